#include <plumbline/core/registry.h>
#include <plumbline/core/wall.h>
#include <plumbline/core/wall_pair.h>
#include <plumbline/detectors/merged_walls.h>
#include <plumbline/outputs/map_drawing.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <optional>
#include <utility>

namespace plumbline {

bool WallEnds(const Feature& feature, DrawnWall* wall) {
  const std::optional<Wall> seen = WallOf(feature);
  if (!seen || !(seen->end > seen->begin)) return false;
  const Eigen::Vector2d begin = seen->At(seen->begin);
  const Eigen::Vector2d end = seen->At(seen->end);
  wall->x1 = begin.x();
  wall->y1 = begin.y();
  wall->x2 = end.x();
  wall->y2 = end.y();
  wall->id = feature.id;
  return true;
}

namespace {

bool IsLiveStructure(const Constraint& constraint) {
  return constraint.state == ConstraintState::kLive &&
         constraint.kind == ConstraintClass::kStructure;
}

// The orientation of a rectangle's sides in the direction phi, or kNoId.
FeatureId OrientationOfSide(const Graph& graph, FeatureId rectangle,
                            double phi) {
  for (const ConstraintId id : graph.ConstraintsOf(rectangle)) {
    const Constraint& constraint = graph.GetConstraint(id);
    if (IsLiveStructure(constraint) &&
        constraint.type->Is(RelationRole::kDirection) &&
        std::abs(NormalizeAxial(constraint.expected[0] - phi)) < 0.25 * kPi) {
      return constraint.features[1];
    }
  }
  return kNoId;
}

// The orientation feature that live structure ties a wall to, itself or as a
// side of a rectangle, or kNoId.
FeatureId OrientationOf(const Graph& graph, FeatureId wall) {
  FeatureId by_rectangle = kNoId;
  for (const ConstraintId id : graph.ConstraintsOf(wall)) {
    const Constraint& constraint = graph.GetConstraint(id);
    if (!IsLiveStructure(constraint)) continue;
    for (const FeatureId other : constraint.features) {
      const FeatureType& type = *graph.GetFeature(other).type;
      if (type.Is(FeatureRole::kDirection)) return other;
      if (type.Is(FeatureRole::kRectangle) && by_rectangle == kNoId) {
        by_rectangle = OrientationOfSide(graph, other, constraint.expected[1]);
      }
    }
  }
  return by_rectangle;
}

}  // namespace

MapDrawing DrawingFromGraph(const Graph& graph,
                            const std::vector<Pose2>& path) {
  MapDrawing drawing;
  drawing.path = path;
  // Orientation of each wall, and length of wall of each orientation.
  std::vector<FeatureId> orientations;
  std::map<FeatureId, double> lengths;
  for (const MergedWall& merged : MergeWalls(graph)) {
    DrawnWall wall;
    if (!WallEnds(merged.wall, &wall)) continue;
    wall.members = merged.members;
    FeatureId orientation = kNoId;
    for (const FeatureId member : merged.members) {
      if (orientation == kNoId) orientation = OrientationOf(graph, member);
    }
    if (orientation != kNoId) {
      lengths[orientation] += merged.wall.extent_end - merged.wall.extent_begin;
    }
    orientations.push_back(orientation);
    drawing.walls.push_back(std::move(wall));
  }
  for (const Constraint* constraint : graph.Constraints()) {
    if (constraint->state == ConstraintState::kLive &&
        constraint->type->Is(RelationRole::kSameWall)) {
      drawing.closures.push_back(MiddleOfCommonPart(
          *WallOf(graph.GetFeature(constraint->features[0])),
          *WallOf(graph.GetFeature(constraint->features[1]))));
    }
  }
  for (const Feature* feature : graph.Features()) {
    const FeatureType& type = *feature->type;
    if (type.Is(FeatureRole::kCircle)) {
      drawing.circles.push_back({feature->parameters[0], feature->parameters[1],
                                 feature->parameters[2], feature->id});
    } else if (type.Is(FeatureRole::kRectangle)) {
      const auto& p = feature->parameters;
      drawing.rectangles.push_back({p[0], p[1], p[2], p[3], p[4], feature->id});
    } else if (type.Is(FeatureRole::kPoint)) {
      (feature->is_virtual ? drawing.centers : drawing.points)
          .emplace_back(feature->parameters[0], feature->parameters[1]);
    } else if (type.Is(FeatureRole::kPose) && path.empty()) {
      drawing.path.emplace_back(feature->parameters[0], feature->parameters[1],
                                feature->parameters[2]);
    }
  }
  std::vector<std::pair<FeatureId, double>> order(lengths.begin(),
                                                  lengths.end());
  std::stable_sort(
      order.begin(), order.end(),
      [](const auto& a, const auto& b) { return a.second > b.second; });
  std::map<FeatureId, int> clusters;
  for (std::size_t i = 0; i < order.size(); ++i) {
    clusters[order[i].first] = static_cast<int>(i);
    drawing.cluster_features.push_back(order[i].first);
    drawing.cluster_directions.push_back(
        graph.GetFeature(order[i].first).parameters[0]);
  }
  for (std::size_t i = 0; i < drawing.walls.size(); ++i) {
    if (orientations[i] != kNoId) {
      drawing.walls[i].cluster = clusters.at(orientations[i]);
    }
  }
  return drawing;
}

}  // namespace plumbline
