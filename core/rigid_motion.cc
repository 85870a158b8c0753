#include <plumbline/core/error.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/rigid_motion.h>

#include <string>
#include <utility>
#include <vector>

namespace plumbline {

Feature Moved(const Pose2& by, Feature feature) {
  const FeatureType& type = *feature.type;
  const auto turn = [&](int i) {
    double& angle = feature.parameters[static_cast<std::size_t>(i)];
    angle = NormalizeAngle(angle + by[2]);
  };
  const auto move = [&](double* x) {
    const Eigen::Vector2d point = TransformPoint(by, {x[0], x[1]});
    x[0] = point[0];
    x[1] = point[1];
  };
  if (type.anchor_size == 2) move(feature.anchor.data());
  if (type.HasPosition()) {
    move(feature.data());
    if (type.traits.leading == Leading::kFrame) turn(2);
    return feature;
  }
  // A place or a line takes more than one number: one alone is a measure, which
  // no motion changes.
  const bool is_measure = type.size == 1;
  for (int i = 0; i < type.size; ++i) {
    if (type.parameters[static_cast<std::size_t>(i)].is_angle) {
      turn(i);
    } else if (type.anchor_size != 2 && !is_measure) {
      throw Error("feature " + std::to_string(feature.id), 0,
                  "a " + type.name +
                      " cannot be moved: what its parameters refer to is not "
                      "known",
                  "types that begin with a position, refer to an anchor, are "
                  "angles, or a single measure");
    }
  }
  return feature;
}

std::unique_ptr<Graph> Moved(const Pose2& by, const Graph& graph) {
  std::vector<Feature> features;
  features.reserve(graph.num_features());
  for (const Feature* feature : graph.Features()) {
    features.push_back(Moved(by, *feature));
  }
  std::vector<Constraint> constraints;
  constraints.reserve(graph.num_constraints());
  for (const Constraint* constraint : graph.Constraints()) {
    if (constraint->features.size() == 1 &&
        constraint->state == ConstraintState::kLive) {
      throw Error("constraint " + std::to_string(constraint->id), 0,
                  "a " + constraint->type->name +
                      " ties a feature to the map frame, which cannot move",
                  "relations between features only");
    }
    constraints.push_back(*constraint);
  }
  auto moved = std::make_unique<Graph>();
  moved->Restore(std::move(features), std::move(constraints),
                 graph.feature_id_end(), graph.constraint_id_end());
  return moved;
}

}  // namespace plumbline
