#include <plumbline/core/disjoint_sets.h>
#include <plumbline/core/registry.h>
#include <plumbline/detectors/wall_faces.h>

#include <algorithm>
#include <cmath>
#include <optional>

namespace plumbline {
namespace {

// Of a face: offset and direction.
constexpr Eigen::Index kFaceSize = 2;

// What a pose sees of a wall. Relative poses are what a front-end makes of it.
bool IsSighting(const Constraint& constraint) {
  return constraint.state == ConstraintState::kLive &&
         constraint.kind == ConstraintClass::kMeasurement &&
         !constraint.type->Is(RelationRole::kPose);
}

// Whether a feature is somewhere, unlike a direction or a size.
bool HasPlace(const Feature& feature) {
  return feature.type->HasPosition() || feature.type->anchor_size > 0 ||
         feature.type->Is(FeatureRole::kWall);
}

// Whether a pose of the graph has seen a wall.
bool WasSeen(const Graph& graph, FeatureId wall) {
  const std::vector<ConstraintId>& constraints = graph.ConstraintsOf(wall);
  return std::any_of(
      constraints.begin(), constraints.end(), [&](ConstraintId id) {
        const Constraint& constraint = graph.GetConstraint(id);
        return IsSighting(constraint) &&
               std::any_of(constraint.features.begin(),
                           constraint.features.end(), [&](FeatureId other) {
                             return graph.GetFeature(other).type->Is(
                                 FeatureRole::kPose);
                           });
      });
}

}  // namespace

std::vector<WallFace> CollectWallFaces(const Graph& graph,
                                       const DetectionScope& scope,
                                       double min_length) {
  std::vector<WallFace> faces;
  for (const Feature* feature : FeaturesInScope(graph, scope)) {
    if (!feature->type->traits.is_one_sided) continue;
    const std::optional<Wall> wall = WallOf(*feature);
    if (!wall || !(wall->length() >= min_length) ||
        !std::isfinite(wall->length()) || !wall->Middle().allFinite() ||
        !std::isfinite(wall->angle) || !WasSeen(graph, feature->id)) {
      continue;
    }
    WallFace face;
    face.feature = feature;
    face.wall = *wall;
    face.middle = wall->Middle();
    face.length = wall->length();
    faces.push_back(face);
  }
  if (faces.empty()) return faces;
  DisjointSets parts(static_cast<std::size_t>(graph.feature_id_end()));
  for (const Constraint* constraint : graph.Constraints()) {
    if (constraint->state != ConstraintState::kLive) continue;
    FeatureId first = kNoId;
    for (const FeatureId id : constraint->features) {
      if (!HasPlace(graph.GetFeature(id))) continue;
      if (first == kNoId) first = id;
      parts.Join(static_cast<std::size_t>(first), static_cast<std::size_t>(id));
    }
  }
  for (WallFace& face : faces) {
    face.part = parts.Find(static_cast<std::size_t>(face.feature->id));
  }
  return faces;
}

Eigen::MatrixXd FaceCovariance(const std::vector<const Feature*>& others,
                               const std::vector<const WallFace*>& faces,
                               const Eigen::Vector2d& across,
                               Marginals* marginals) {
  std::vector<FeatureId> ids;
  Eigen::Index columns = 0;
  for (const Feature* other : others) {
    ids.push_back(other->id);
    columns += other->type->size;
  }
  const Eigen::Index kept = columns;
  for (const WallFace* face : faces) {
    ids.push_back(face->feature->id);
    columns += face->feature->type->size;
  }
  Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(
      kept + kFaceSize * static_cast<Eigen::Index>(faces.size()), columns);
  jacobian.topLeftCorner(kept, kept).setIdentity();
  Eigen::Index row = kept;
  Eigen::Index column = kept;
  for (const WallFace* face : faces) {
    const Wall& wall = face->wall;
    const double cosine = across.dot(wall.normal());
    const double side = cosine < 0.0 ? -1.0 : 1.0;
    jacobian.block<1, 2>(row, column) = side * across.transpose();
    jacobian(row, column + 2) = 0.5 * (wall.begin + wall.end) * side * cosine;
    jacobian(row + 1, column + 2) = 1.0;
    row += kFaceSize;
    column += face->feature->type->size;
  }
  return jacobian * marginals->JointCovariance(ids) * jacobian.transpose();
}

}  // namespace plumbline
