#ifndef PLUMBLINE_CORE_EM_SCOPE_H_
#define PLUMBLINE_CORE_EM_SCOPE_H_

#include <plumbline/core/graph.h>

#include <vector>

namespace plumbline {

/// The part of the graph that one iteration of EM works on: the whole, or the
/// surroundings of a list of features.
struct EmScope {
  /// The list that the scope was made of, not owned; null for the whole graph.
  const std::vector<FeatureId>* features = nullptr;
  /// With a list: the features that vary, ascending. These are the list and the
  /// virtual features on it that have few constraints. Virtual features with
  /// many are held: they speak for a large part of the map, and solving for
  /// them costs as much.
  std::vector<FeatureId> variables;
  /// With a list: the list and every virtual feature on it, ascending.
  std::vector<FeatureId> attached;

  /// True when there is no list.
  bool is_whole() const { return features == nullptr; }
  /// The argument of the session's functions: the variables, null for all.
  const std::vector<FeatureId>* session_scope() const {
    return is_whole() ? nullptr : &variables;
  }
};

/// True for what EM weighs and breaks.
bool IsLiveStructure(const Constraint& constraint);

/// The scope of a list of features (ids that are not there are passed over), or
/// of the whole graph when null. Its cost depends on the list alone.
EmScope MakeEmScope(const Graph& graph, const std::vector<FeatureId>* features);

/// Live structure constraints on the features of the scope that vary, in the
/// order of ids.
std::vector<Constraint*> LiveStructure(const EmScope& scope, Graph* graph);

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_EM_SCOPE_H_
