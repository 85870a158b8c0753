#ifndef PLUMBLINE_CORE_EM_H_
#define PLUMBLINE_CORE_EM_H_

#include <plumbline/core/detector.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/session.h>

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace plumbline {

/// Detectors by the level whose features they read: hierarchy[0] reads level 0.
using Hierarchy = std::vector<std::vector<std::unique_ptr<StructureDetector>>>;

/// Parses "a,b/c/d" (levels by '/', detectors of a level by ',') and makes the
/// detectors with their parameters (by detector name; what is missing is the
/// default). An empty description gives no detectors. A level holds what the
/// detectors of the level below make, level 0 holds `raw_feature_types`. Throws
/// Error with the list of detectors when a name is unknown, and with the list
/// of what fits where when a detector reads nothing that its level can hold.
Hierarchy MakeHierarchy(
    const std::string& description, const Registry& registry,
    const std::vector<std::string>& raw_feature_types,
    const std::map<std::string, DetectorParameters>& parameters);

/// What is known of a relation before the building was seen.
struct RelationPrior {
  /// False: proposals of it are left out.
  bool is_expected = true;
  /// Standard deviations that take the place of the detector's, one a row, in
  /// the units of the rows; empty: as the detector has it.
  std::vector<double> sigmas;
};

/// When structure is broken, proposed again, and when the loop ends.
struct EmOptions {
  /// Structure constraints with a smaller delta are broken.
  double delta_threshold = 0.3;
  /// False: wrong structure is kept (for comparison).
  bool break_constraints = true;
  /// Break the worst first: those whose chi^2 is at least this share of the
  /// largest, then solve and look again, so that what a wrong hypothesis bends
  /// is not broken with it. 0: break all at once (the paper).
  double break_share = 0.0;
  /// What the E-step judges structure by. False: the solve under the weights of
  /// the E-step before. A low weight lets the residual grow, and that lowers
  /// the weight again, until what lies some 1.5 standard deviations of its
  /// measurements off is broken, however tight the tolerance: right where a
  /// wrong constraint does more harm than a missing one. True: a solve in which
  /// all live structure has its full weight, so that delta is the p-value of
  /// the hypothesis itself; with a tolerance t and measurements that place the
  /// feature to within m, what is off by more than about t + m^2 / t is broken.
  /// The M-steps in between weigh by delta either way.
  bool full_weight_test = false;
  /// The loop ends at the latest after so many iterations.
  int max_iterations = 50;
  /// Relative change of the cost at which solves of the whole graph within the
  /// loop end; 0: the session's own tolerance. With a larger one the first
  /// solve, of the measurements alone, ends at 0.03 of it, and one to a
  /// thousandth (the session's own where that is more) follows when the loop
  /// has ended. Weights and hypotheses do not wait for the last digits,
  /// and the more parts a graph has the longer some part of it takes to settle.
  /// What a detector finds is settled in place where it is little; the next
  /// iteration solves for the rest of the graph.
  double loop_tolerance = 0.0;
  /// Initial radius of the trust region of those solves (SessionOptions; only
  /// with a loop_tolerance). The radius is one for the whole graph: with steps
  /// that are nearly Gauss-Newton's, one floppy place in which they go wrong
  /// has a step rejected everywhere, and the larger a graph the more often
  /// there is one.
  double loop_trust_region_radius = 1e7;
  /// Converged: at most one in 10,000 of structure came or went (so nothing, in
  /// smaller graphs), and the relative change of the total cost is smaller.
  double cost_tolerance = 1e-4;
  /// A broken hypothesis may be proposed again when its error has fallen by
  /// more than so many of its standard deviations since it was broken and the
  /// map relaxed without it ...
  double reproposal_sigmas = 1.0;
  /// ... but not after it was broken so often: this bounds the loop.
  int max_breaks = 3;
  /// Nor when a raw feature has had so many hypotheses of one relation broken,
  /// whatever their values: a virtual feature that comes back a little to the
  /// side each time would otherwise never be the same hypothesis.
  int max_breaks_per_feature = 10;
  std::uint64_t seed = 1;
  /// By relation; what is missing is as the detectors propose it. As many
  /// sigmas as the relation has rows, or none; others are an Error when the
  /// relation is proposed.
  std::map<std::string, RelationPrior> relation_priors;
};

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
  /// The same by relation name; of structure only.
  std::map<std::string, int> structure_by_relation;
  std::map<std::string, int> broken_by_relation;
  /// Time of this phase.
  double seconds = 0.0;
};

/// What a run of EM came to.
struct EmReport {
  int iterations = 0;
  bool converged = false;
  double detect_seconds = 0.0;
  double solve_seconds = 0.0;
};

/// Finds structure, weighs it, breaks it and finds it again (method.md, section
/// 2).
///
/// Weights: a constraint enters with delta = 1 and so pulls with its full
/// weight in the solve that follows; every E-step after a solve gives it the
/// p-value of its unweighted residual (at least kDeltaFloor), and below the
/// threshold it is broken (EmOptions::full_weight_test).
///
/// Support: a virtual feature is dropped, with its constraints, when it has
/// fewer live structure constraints from features of lower levels than its
/// detector's minimum_support (or not those that it needs, IsSupported), or a
/// single live constraint altogether: it would follow that one and say nothing
/// (unless its detector keeps_followers). Dropping goes on up the levels. Fixed
/// virtual features and those with measurements stay.
///
/// Memory: what was broken is remembered by what it said (relation, expected
/// value, features; virtual ones by their type and value, since they come again
/// under other ids), with its error once the map had relaxed without it. A
/// hypothesis is let in again only as reproposal_sigmas and max_breaks say, and
/// a virtual feature only with the minimum support left. Every hypothesis is
/// thus added at most max_breaks times, and a raw feature has at most
/// max_breaks_per_feature of them broken per relation, so the loop ends.
class EmOrchestrator {
 public:
  /// Pointers are not owned and must outlive the orchestrator.
  EmOrchestrator(Graph* graph, SolverSession* session, const Registry& registry,
                 Hierarchy hierarchy, const EmOptions& options);
  ~EmOrchestrator();

  /// One iteration: optimize, break, optimize, and for each level detect, add,
  /// optimize; solves with nothing new to solve are left out. With `scope` only
  /// the features listed, and the virtual ones on them that have few
  /// constraints, vary and are looked at, at a cost that does not depend on the
  /// size of the graph. Returns true when it added or removed something.
  bool Iterate(const std::vector<FeatureId>* scope = nullptr);

  /// Iterates on the whole graph until it has converged (or max_iterations).
  /// The first solve has the measurements only, unless structure is live
  /// already. `stop` is asked between phases and ends the loop when it returns
  /// true. Returns the sums of this run.
  EmReport Run(const std::function<bool()>& stop = nullptr);

  /// Called after every phase.
  void SetTrace(std::function<void(const EmPhase&)> trace);

  /// Sums over every iteration so far, those with a scope included.
  const EmReport& totals() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_EM_H_
