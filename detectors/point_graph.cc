#include <plumbline/core/registry.h>
#include <plumbline/detectors/point_graph.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <map>
#include <nanoflann.hpp>
#include <set>
#include <utility>

namespace plumbline {
namespace {

constexpr std::size_t kNearest = 8;

// The positions as nanoflann asks for them.
struct Positions {
  const std::vector<Eigen::Vector2d>& points;

  std::size_t kdtree_get_point_count() const { return points.size(); }
  double kdtree_get_pt(int i, std::size_t dimension) const {
    return points[static_cast<std::size_t>(i)][static_cast<int>(dimension)];
  }
  template <typename Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

using Tree = nanoflann::KDTreeSingleIndexAdaptor<
    nanoflann::L2_Simple_Adaptor<double, Positions, double, int>, Positions, 2,
    int>;

bool IsPoint(const Feature& feature, int level) {
  return feature.level == level && feature.type->Is(FeatureRole::kPoint) &&
         std::isfinite(feature.parameters[0]) &&
         std::isfinite(feature.parameters[1]);
}

// Calls visit(other) for the features that live measurements tie to `id`.
template <typename Visit>
void ForEachMeasured(const Graph& graph, FeatureId id, const Visit& visit) {
  for (const ConstraintId constraint_id : graph.ConstraintsOf(id)) {
    const Constraint& constraint = *graph.FindConstraint(constraint_id);
    if (constraint.state != ConstraintState::kLive ||
        constraint.kind != ConstraintClass::kMeasurement) {
      continue;
    }
    for (const FeatureId other : constraint.features) {
      if (other != id) visit(other);
    }
  }
}

}  // namespace

PointGraph::PointGraph(const Graph& graph, const DetectionScope& scope,
                       int reach)
    : are_virtual_(scope.level > 0) {
  const auto add = [&](const Feature& feature, bool is_listed) {
    ids_.push_back(feature.id);
    positions_.emplace_back(feature.parameters[0], feature.parameters[1]);
    is_listed_.push_back(is_listed);
  };
  if (are_virtual_) {
    const std::set<FeatureId> listed =
        scope.features == nullptr ? std::set<FeatureId>()
                                  : std::set<FeatureId>(scope.features->begin(),
                                                        scope.features->end());
    for (const FeatureId id : graph.VirtualFeatures(scope.level)) {
      const Feature& feature = graph.GetFeature(id);
      if (!IsPoint(feature, scope.level)) continue;
      add(feature, scope.features == nullptr || listed.count(id) > 0);
    }
  } else if (scope.features == nullptr) {
    for (const Feature* feature : graph.Features()) {
      if (IsPoint(*feature, scope.level)) add(*feature, true);
    }
  } else {
    // Breadth first from the list; the value is the number of steps.
    std::map<FeatureId, int> steps;
    std::vector<FeatureId> queue;
    for (const FeatureId id : *scope.features) {
      const Feature* feature = graph.FindFeature(id);
      if (feature == nullptr || !IsPoint(*feature, scope.level)) continue;
      if (steps.emplace(id, 0).second) queue.push_back(id);
    }
    for (std::size_t i = 0; i < queue.size(); ++i) {
      const int next = steps.at(queue[i]) + 1;
      if (next > reach) break;
      ForEachMeasured(graph, queue[i], [&](FeatureId id) {
        if (!IsPoint(graph.GetFeature(id), scope.level)) return;
        if (steps.emplace(id, next).second) queue.push_back(id);
      });
    }
    for (const auto& [id, step] : steps) add(graph.GetFeature(id), step == 0);
  }
  Connect(graph);
  if (scope.level > 0 && neighbors_.empty()) ConnectNearest();
}

int PointGraph::Find(FeatureId id) const {
  const auto found = std::lower_bound(ids_.begin(), ids_.end(), id);
  if (found == ids_.end() || *found != id) return -1;
  return static_cast<int>(found - ids_.begin());
}

void PointGraph::Connect(const Graph& graph) {
  neighbors_begin_.assign(1, 0);
  std::vector<int> own;
  for (const FeatureId from : ids_) {
    own.clear();
    ForEachMeasured(graph, from, [&](FeatureId id) {
      const int j = Find(id);
      if (j >= 0) own.push_back(j);
    });
    std::sort(own.begin(), own.end());
    own.erase(std::unique(own.begin(), own.end()), own.end());
    neighbors_.insert(neighbors_.end(), own.begin(), own.end());
    neighbors_begin_.push_back(neighbors_.size());
  }
}

void PointGraph::ConnectNearest() {
  const Positions positions{positions_};
  const Tree tree(2, positions, nanoflann::KDTreeSingleIndexAdaptorParams());
  std::vector<std::set<int>> connected(positions_.size());
  // A point is the nearest to itself, or one that lies on it is.
  std::array<int, kNearest + 1> nearest{};
  std::array<double, kNearest + 1> squared_distances{};
  for (int i = 0; i < size(); ++i) {
    const std::size_t count =
        tree.knnSearch(position(i).data(), nearest.size(), nearest.data(),
                       squared_distances.data());
    for (std::size_t k = 0; k < count; ++k) {
      const int j = nearest[k];
      if (j == i) continue;
      connected[static_cast<std::size_t>(i)].insert(j);
      connected[static_cast<std::size_t>(j)].insert(i);
    }
  }
  for (std::size_t i = 0; i < connected.size(); ++i) {
    neighbors_.insert(neighbors_.end(), connected[i].begin(),
                      connected[i].end());
    neighbors_begin_[i + 1] = neighbors_.size();
  }
}

}  // namespace plumbline
