#include <plumbline/detectors/point_graph.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <set>
#include <utility>

namespace plumbline {
namespace {

constexpr int kFewPoints = 64;
constexpr int kNearest = 8;

bool IsPoint(const Feature& feature, int level) {
  return feature.level == level && feature.type->name == "point" &&
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
                       int reach) {
  const auto add = [&](const Feature& feature, bool is_listed) {
    ids_.push_back(feature.id);
    positions_.emplace_back(feature.parameters[0], feature.parameters[1]);
    is_listed_.push_back(is_listed);
  };
  if (scope.level > 0) {
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
  const bool is_connected =
      std::any_of(neighbors_.begin(), neighbors_.end(),
                  [](const auto& neighbors) { return !neighbors.empty(); });
  if (scope.level > 0 && !is_connected) ConnectNearest();
}

int PointGraph::Find(FeatureId id) const {
  const auto found = std::lower_bound(ids_.begin(), ids_.end(), id);
  if (found == ids_.end() || *found != id) return -1;
  return static_cast<int>(found - ids_.begin());
}

void PointGraph::Connect(const Graph& graph) {
  neighbors_.resize(ids_.size());
  for (std::size_t i = 0; i < ids_.size(); ++i) {
    std::vector<int>& neighbors = neighbors_[i];
    ForEachMeasured(graph, ids_[i], [&](FeatureId id) {
      const int j = Find(id);
      if (j >= 0) neighbors.push_back(j);
    });
    std::sort(neighbors.begin(), neighbors.end());
    neighbors.erase(std::unique(neighbors.begin(), neighbors.end()),
                    neighbors.end());
  }
}

void PointGraph::ConnectNearest() {
  const int n = size();
  if (n <= kFewPoints) {
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < n; ++j) {
        if (j != i) neighbors_[static_cast<std::size_t>(i)].push_back(j);
      }
    }
    return;
  }
  // Cells with about two points each; those of a crowded cell are cut off
  // below, so that points on one spot do not make all pairs.
  Eigen::Vector2d low = positions_[0];
  Eigen::Vector2d high = positions_[0];
  for (const Eigen::Vector2d& position : positions_) {
    low = low.cwiseMin(position);
    high = high.cwiseMax(position);
  }
  const double extent = (high - low).maxCoeff();
  const double cell =
      std::max(extent * std::sqrt(2.0 / n), 1e-9 * (1.0 + extent));
  using Cell = std::pair<std::int64_t, std::int64_t>;
  const auto cell_of = [&](const Eigen::Vector2d& position) {
    return Cell(static_cast<std::int64_t>((position.x() - low.x()) / cell),
                static_cast<std::int64_t>((position.y() - low.y()) / cell));
  };
  std::map<Cell, std::vector<int>> cells;
  for (int i = 0; i < n; ++i) cells[cell_of(position(i))].push_back(i);
  std::vector<std::set<int>> connected(static_cast<std::size_t>(n));
  for (int i = 0; i < n; ++i) {
    const Cell center = cell_of(position(i));
    std::vector<std::pair<double, int>> nearest;
    for (std::int64_t x = center.first - 2; x <= center.first + 2; ++x) {
      for (std::int64_t y = center.second - 2; y <= center.second + 2; ++y) {
        const auto found = cells.find({x, y});
        if (found == cells.end()) continue;
        std::size_t taken = 0;
        for (const int j : found->second) {
          if (j == i) continue;
          if (++taken > 4 * kNearest) break;
          nearest.emplace_back((position(j) - position(i)).squaredNorm(), j);
        }
      }
    }
    const std::size_t count =
        std::min(nearest.size(), static_cast<std::size_t>(kNearest));
    std::partial_sort(nearest.begin(),
                      nearest.begin() + static_cast<std::ptrdiff_t>(count),
                      nearest.end());
    for (std::size_t k = 0; k < count; ++k) {
      connected[static_cast<std::size_t>(i)].insert(nearest[k].second);
      connected[static_cast<std::size_t>(nearest[k].second)].insert(i);
    }
  }
  for (std::size_t i = 0; i < connected.size(); ++i) {
    neighbors_[i].assign(connected[i].begin(), connected[i].end());
  }
}

}  // namespace plumbline
