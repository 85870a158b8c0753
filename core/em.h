#ifndef PLUMBLINE_CORE_EM_H_
#define PLUMBLINE_CORE_EM_H_

#include <plumbline/core/em_options.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/hierarchy.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/session.h>
#include <plumbline/core/structure_judge.h>

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace plumbline {

/// One row of em_trace.csv: the state after a phase and the solve that belongs
/// to it.
struct EmPhase {
  int iteration = 0;
  /// "measurements", "optimize", "break", "detect_0", "detect_1", ..., and with
  /// a loop_tolerance "final".
  std::string phase;
  /// Of the whole graph, or in an iteration with a scope of the constraints on
  /// the features that varied.
  CostReport cost;
  /// Live features by type name.
  std::map<std::string, int> features;
  /// Live ones, and broken ones that are on record (they go with a feature that
  /// is dropped).
  int structure_constraints = 0;
  int broken_constraints = 0;
  /// Both by relation name; structure only.
  std::map<std::string, int> structure_by_relation;
  std::map<std::string, int> broken_by_relation;
  /// By the name of the detector, in a phase that detects: what it searched and
  /// refused, and what of its proposal was let in (ProposalFilter).
  std::map<std::string, DetectionCounts> detections;
  /// Time of this phase.
  double seconds = 0.0;
};

/// Why a run of EM ended, as ceres::TerminationType says it of a solve.
enum class EmTermination {
  /// Next to nothing came or went, the cost stood still, and the last solve of
  /// the whole graph reached its tolerance or EmOptions::cost_tolerance.
  kConvergence,
  /// After EmOptions::max_iterations, with something still coming or going, or
  /// with a last solve that ended on its way.
  kNoConvergence,
  /// The last solve failed: its state proves nothing.
  kFailure,
  /// Whoever was asked whether to stop said so.
  kUserStop,
};

/// Its name in summary.json: "convergence", "no_convergence", "failure" or
/// "user_stop".
const char* ToString(EmTermination termination);

/// Result of a run of EM.
struct EmReport {
  /// Of the last run; kNoConvergence before the first.
  EmTermination termination = EmTermination::kNoConvergence;
  int iterations = 0;
  double detect_seconds = 0.0;
  double solve_seconds = 0.0;

  /// Whether the last run ended because nothing changed any more.
  bool converged() const { return termination == EmTermination::kConvergence; }
};

/// Finds structure, weighs it, breaks it and finds it again (method.md, section
/// 2): the paper's Algorithm 1, put together from
///
///   SolveSchedule     the M-step: when, for what and how far to solve
///   StructureJudge    the E-step: weights, and what is to be broken
///   SupportPolicy     which virtual features stay
///   Hierarchy         the detectors that propose structure
///   ProposalFilter    what of a proposal enters the graph
///   HypothesisMemory  what was broken and may not simply come again
///
/// A constraint enters with delta = 1 and so pulls with its full weight in the
/// solve that follows; every E-step after a solve weighs it anew. Virtual
/// features that have lost their support go with their constraints.
///
/// The loop ends, whatever detectors propose that is not there already: every
/// hypothesis that comes either stays or is broken, and what is broken is let
/// in again only as HypothesisMemory says, which bounds how often a relation
/// may be broken on the raw features that a hypothesis is about, directly or
/// by way of virtual ones.
class EmOrchestrator {
 public:
  /// Pointers are not owned and must outlive the orchestrator. Without a judge
  /// it is a ResidualJudge.
  EmOrchestrator(Graph* graph, SolverSession* session, const Registry& registry,
                 Hierarchy hierarchy, const EmOptions& options,
                 std::unique_ptr<StructureJudge> judge = nullptr);
  ~EmOrchestrator();

  /// One iteration: optimize, break, optimize, and for each level detect, add,
  /// optimize; solves with nothing new to solve are left out. With `scope` only
  /// the features listed, and the virtual ones on them that have few
  /// constraints, vary and are looked at, at a cost that does not depend on the
  /// size of the graph. Returns true when it added or removed something.
  bool Iterate(const std::vector<FeatureId>* scope = nullptr);

  /// Iterates on the whole graph until it has converged (or max_iterations).
  /// After an iteration in which nothing came or went the detectors look again
  /// once something breaks, and in any case before it ends.
  /// The first solve has the measurements only, unless structure is live
  /// already. `stop` is asked after every phase, every step of a solve, and by
  /// detectors that take long; once it has returned true the loop ends within
  /// that step, and what a detector was about to propose is not added. Returns
  /// the sums of this run.
  EmReport Run(const std::function<bool()>& stop = nullptr);

  /// Called after every phase.
  void SetTrace(std::function<void(const EmPhase&)> trace);

  /// Sums over every iteration so far, those with a scope included.
  const EmReport& totals() const;

 private:
  struct Impl;
  class StopScope;
  std::unique_ptr<Impl> impl_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_EM_H_
