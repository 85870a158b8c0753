#include <plumbline/detectors/default_hierarchy.h>
#include <plumbline/pipeline/graph_solver.h>
#include <plumbline/pipeline/raw_features.h>

#include <algorithm>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

// In the order in which they come up.
std::vector<const FeatureType*> RawTypes(const Graph& graph) {
  std::vector<const FeatureType*> types;
  for (const Feature* feature : graph.Features()) {
    if (feature->level == 0 &&
        std::find(types.begin(), types.end(), feature->type) == types.end()) {
      types.push_back(feature->type);
    }
  }
  return types;
}

SessionOptions SessionOf(const GraphSolverOptions& options) {
  SessionOptions session = options.session;
  // Only structure is ever broken.
  session.fast_removal = options.structure;
  return session;
}

EmOptions EmOf(const GraphSolverOptions& options, const Graph& graph) {
  EmOptions em = options.em;
  if (!options.structure) return em;
  const RawFeatureProfile& profile = ProfileOf(RawTypes(graph));
  em.full_weight_test =
      options.full_weight_test.value_or(profile.full_weight_test);
  if (em.loop_tolerance == 0.0) {
    em.loop_tolerance = profile.graph_loop_tolerance;
  }
  return em;
}

// The graph with what it is solved with.
Graph* WithoutUnwanted(const GraphSolverOptions& options, Graph* graph) {
  if (!options.structure) LeaveOutStructure(graph);
  return graph;
}

}  // namespace

LeftOutStructure LeaveOutStructure(Graph* graph) {
  const Graph& from = *graph;
  Transaction transaction;
  LeftOutStructure left_out;
  const std::vector<int> virtual_levels = from.VirtualLevels();
  std::set<FeatureId> measured;
  for (const Constraint* constraint : from.Constraints()) {
    if (constraint->kind == ConstraintClass::kStructure) {
      transaction.RemoveConstraint(constraint->id);
      ++left_out.constraints;
    } else if (!virtual_levels.empty()) {
      measured.insert(constraint->features.begin(), constraint->features.end());
    }
  }
  for (const int level : virtual_levels) {
    for (const FeatureId id : from.VirtualFeatures(level)) {
      if (measured.count(id) > 0) continue;
      transaction.RemoveFeature(id);
      ++left_out.features;
    }
  }
  if (!transaction.empty()) graph->Apply(std::move(transaction));
  return left_out;
}

Hierarchy MakeGraphHierarchy(const GraphSolverOptions& options,
                             const Graph& graph, const Registry& registry) {
  if (!options.structure) return {};
  const std::vector<const FeatureType*> raw = RawTypes(graph);
  std::vector<std::string> names;
  for (const FeatureType* type : raw) names.push_back(type->name);
  return MakeHierarchy(options.hierarchy.empty()
                           ? DefaultHierarchy(raw, registry)
                           : options.hierarchy,
                       registry, names, options.detector_parameters);
}

GraphSolver::GraphSolver(const Registry& registry,
                         const GraphSolverOptions& options, Graph* graph)
    : GraphSolver(registry, options,
                  MakeGraphHierarchy(options, *graph, registry), graph) {}

GraphSolver::GraphSolver(const Registry& registry,
                         const GraphSolverOptions& options, Hierarchy hierarchy,
                         Graph* graph)
    : session_(WithoutUnwanted(options, graph), registry, SessionOf(options)),
      initial_cost_(session_.Cost()),
      em_(graph, &session_, registry, std::move(hierarchy),
          EmOf(options, *graph)) {}

GraphSolverResult GraphSolver::Run(
    const std::function<bool()>& stop,
    const std::function<void(const EmPhase&)>& phase) {
  GraphSolverResult result;
  em_.SetTrace([&](const EmPhase& ended) {
    result.trace.push_back(ended);
    if (phase) phase(ended);
  });
  result.em = em_.Run(stop);
  em_.SetTrace(nullptr);
  result.initial_cost = initial_cost_;
  result.final_cost = session_.Cost();
  result.solves = session_.totals();
  result.num_solves = session_.num_solves();
  return result;
}

}  // namespace plumbline
