#include <plumbline/core/em_scope.h>

#include <set>

namespace plumbline {
namespace {

// Virtual features with more constraints are held in a scope.
constexpr std::size_t kMaxLocalConstraints = 50;

}  // namespace

bool IsLiveStructure(const Constraint& constraint) {
  return constraint.state == ConstraintState::kLive &&
         constraint.kind == ConstraintClass::kStructure;
}

EmScope MakeEmScope(const Graph& graph,
                    const std::vector<FeatureId>* features) {
  EmScope scope;
  scope.features = features;
  if (features == nullptr) return scope;
  std::set<FeatureId> seen;
  std::set<FeatureId> variables;
  std::vector<FeatureId> queue;
  for (const FeatureId id : *features) {
    if (graph.FindFeature(id) == nullptr || !seen.insert(id).second) continue;
    variables.insert(id);
    queue.push_back(id);
  }
  for (std::size_t i = 0; i < queue.size(); ++i) {
    const int level = graph.FindFeature(queue[i])->level;
    for (const ConstraintId constraint_id : graph.ConstraintsOf(queue[i])) {
      const Constraint& constraint = *graph.FindConstraint(constraint_id);
      if (!IsLiveStructure(constraint)) continue;
      for (const FeatureId id : constraint.features) {
        const Feature& other = *graph.FindFeature(id);
        if (!other.is_virtual || other.level <= level ||
            !seen.insert(id).second) {
          continue;
        }
        if (graph.ConstraintsOf(id).size() <= kMaxLocalConstraints) {
          variables.insert(id);
          queue.push_back(id);
        }
      }
    }
  }
  scope.variables.assign(variables.begin(), variables.end());
  scope.attached.assign(seen.begin(), seen.end());
  return scope;
}

std::vector<Constraint*> LiveStructure(const EmScope& scope, Graph* graph) {
  std::vector<Constraint*> structure;
  if (scope.is_whole()) {
    for (Constraint* constraint : graph->MutableConstraints()) {
      if (IsLiveStructure(*constraint)) structure.push_back(constraint);
    }
    return structure;
  }
  std::set<ConstraintId> ids;
  for (const FeatureId id : scope.variables) {
    const auto& constraints = graph->ConstraintsOf(id);
    ids.insert(constraints.begin(), constraints.end());
  }
  for (const ConstraintId id : ids) {
    Constraint* constraint = graph->FindConstraint(id);
    if (IsLiveStructure(*constraint)) structure.push_back(constraint);
  }
  return structure;
}

}  // namespace plumbline
