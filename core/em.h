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
/// default). Throws Error with the list of detectors when a name is unknown,
/// and with the list of what fits where when a detector reads nothing that its
/// level can hold.
Hierarchy MakeHierarchy(
    const std::string& description, const Registry& registry,
    const std::vector<std::string>& raw_feature_types,
    const std::map<std::string, DetectorParameters>& parameters);

struct EmOptions {
  /// Structure constraints with a smaller delta are broken.
  double delta_threshold = 0.3;
  /// False: wrong structure is kept (for comparison).
  bool break_constraints = true;
  /// The loop ends at the latest after so many iterations.
  int max_iterations = 50;
  /// Converged: nothing added, nothing removed, and the relative change of the
  /// total cost is smaller.
  double cost_tolerance = 1e-4;
  /// A broken hypothesis may be proposed again when its error has changed by
  /// more than so many of its standard deviations since it was broken ...
  double reproposal_sigmas = 1.0;
  /// ... but not after it was broken so often: this bounds the loop.
  int max_breaks = 3;
  std::uint64_t seed = 1;
};

/// One row of em_trace.csv.
struct EmPhase {
  int iteration = 0;
  /// "measurements", "optimize", "break", "detect_0", "detect_1", ...
  std::string phase;
  CostReport cost;
  /// Live features by type name.
  std::map<std::string, int> features;
  int structure_constraints = 0;
  int broken_constraints = 0;
  /// Time of this phase.
  double seconds = 0.0;
};

struct EmReport {
  int iterations = 0;
  bool converged = false;
  double detect_seconds = 0.0;
  double solve_seconds = 0.0;
};

/// Finds structure, weighs it, breaks it and finds it again (method.md, section
/// 2).
class EmOrchestrator {
 public:
  /// Pointers are not owned and must outlive the orchestrator.
  EmOrchestrator(Graph* graph, SolverSession* session, const Registry& registry,
                 Hierarchy hierarchy, const EmOptions& options);
  ~EmOrchestrator();

  /// One iteration: optimize, break, optimize, and for each level detect, add,
  /// optimize. With `scope` only the features listed vary and are looked at,
  /// at a cost that does not depend on the size of the graph. Returns true
  /// when it added or removed something.
  bool Iterate(const std::vector<FeatureId>* scope = nullptr);

  /// Iterates on the whole graph until it has converged (or max_iterations).
  /// `stop` is asked between phases and ends the loop when it returns true.
  EmReport Run(const std::function<bool()>& stop = nullptr);

  /// Called after every phase.
  void SetTrace(std::function<void(const EmPhase&)> trace);

  const EmReport& totals() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_EM_H_
