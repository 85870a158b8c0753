#ifndef PLUMBLINE_PIPELINE_GRAPH_SOLVER_H_
#define PLUMBLINE_PIPELINE_GRAPH_SOLVER_H_

#include <plumbline/core/em.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/hierarchy.h>
#include <plumbline/core/hierarchy_spec.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/session.h>

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace plumbline {

/// Options of solving a graph.
struct GraphSolverOptions {
  /// Find structure. False: measurements only; what the graph has of structure
  /// is taken out of it (LeaveOutStructure).
  bool structure = true;
  /// Detectors by level; empty: DefaultHierarchy of the raw features.
  HierarchySpec hierarchy;
  std::map<std::string, DetectorParameters> detector_parameters;
  SessionOptions session;
  /// Its full_weight_test is passed over; a loop_tolerance of 0 stands for that
  /// of the raw features' profile (RawFeatureProfile).
  EmOptions em;
  /// EmOptions::full_weight_test; unset: that of the raw features' profile.
  std::optional<bool> full_weight_test;
};

/// How much of a graph was taken out of it.
struct LeftOutStructure {
  /// Structure constraints, live and broken.
  std::int64_t constraints = 0;
  /// Virtual features.
  std::int64_t features = 0;
};

/// Takes structure out of a graph, as one that was solved with it has it: its
/// structure constraints, and the virtual features that no measurement names.
LeftOutStructure LeaveOutStructure(Graph* graph);

/// The detectors that a graph is solved with; none without structure. Throws
/// Error when the hierarchy asked for does not fit the graph's raw features.
Hierarchy MakeGraphHierarchy(const GraphSolverOptions& options,
                             const Graph& graph, const Registry& registry);

/// Result of solving a graph; the map itself is in the graph.
struct GraphSolverResult {
  EmReport em;
  CostReport initial_cost;
  CostReport final_cost;
  /// All solves together, and how many they were.
  SolveReport solves;
  int num_solves = 0;
  /// Rows of em_trace.csv.
  std::vector<EmPhase> trace;
};

/// Finds the structure of a graph of features and measurements and solves it
/// with that structure, from where its features stand (MakeInitialGuess places
/// them).
class GraphSolver {
 public:
  /// The registry and graph must outlive the solver. Without
  /// GraphSolverOptions::structure the graph loses its structure. Throws Error
  /// when options do not fit the graph, which stays as it is then.
  GraphSolver(const Registry& registry, const GraphSolverOptions& options,
              Graph* graph);

  /// Before anything is optimized.
  const CostReport& initial_cost() const { return initial_cost_; }

  /// Runs EM until it has converged. `stop` (may be null) is asked between
  /// steps and ends the work early when it returns true; `phase` (may be null)
  /// is told of each phase as it has ended.
  GraphSolverResult Run(
      const std::function<bool()>& stop = nullptr,
      const std::function<void(const EmPhase&)>& phase = nullptr);

  /// The session of all solves.
  const SolverSession& session() const { return session_; }

 private:
  // The hierarchy first: what does not fit is refused before the work.
  GraphSolver(const Registry& registry, const GraphSolverOptions& options,
              Hierarchy hierarchy, Graph* graph);

  SolverSession session_;
  CostReport initial_cost_;
  EmOrchestrator em_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_PIPELINE_GRAPH_SOLVER_H_
