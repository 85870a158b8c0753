#include "equal_radius_detector.h"

#include <plumbline/detectors/parameters.h>

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "equal_radius.h"

namespace mine {
namespace {

// Whether a live relation of the type ties the circle to one before it.
bool IsTied(const plumbline::Graph& graph, const plumbline::Feature& circle,
            const plumbline::RelationType& relation) {
  for (const plumbline::ConstraintId id : graph.ConstraintsOf(circle.id)) {
    const plumbline::Constraint& constraint = graph.GetConstraint(id);
    if (constraint.type == &relation &&
        constraint.state == plumbline::ConstraintState::kLive &&
        constraint.features[1] == circle.id) {
      return true;
    }
  }
  return false;
}

}  // namespace

const std::string& EqualRadiusDetector::name() const {
  static const std::string name = "equal_radius";
  return name;
}

//! [detector]
plumbline::Transaction EqualRadiusDetector::Detect(
    const plumbline::Graph& graph, const plumbline::Registry& registry,
    const plumbline::DetectionScope& scope) const {
  const plumbline::RelationType& relation =
      registry.GetRelation(EqualRadius::kName);
  plumbline::Transaction transaction;
  std::vector<const plumbline::Feature*> before;
  std::int64_t refused = 0;
  for (const plumbline::Feature* circle :
       plumbline::FeaturesInScope(graph, scope)) {
    if (!circle->type->Is(plumbline::FeatureRole::kCircle)) continue;
    const plumbline::Feature* nearest = nullptr;
    double nearest_gap = options_.gate;
    for (const plumbline::Feature* other : before) {
      const double gap = std::abs(circle->parameters[2] - other->parameters[2]);
      if (gap < nearest_gap) {
        nearest_gap = gap;
        nearest = other;
      }
    }
    before.push_back(circle);
    refused += nearest == nullptr;
    if (nearest == nullptr || IsTied(graph, *circle, relation)) continue;
    transaction.AddConstraint(plumbline::MakeStructure(
        relation, {nearest->id, circle->id}, Eigen::VectorXd::Zero(1),
        plumbline::InformationFromSigmas(
            Eigen::VectorXd::Constant(1, options_.sigma)),
        name()));
  }
  scope.Count("circles", static_cast<std::int64_t>(before.size()));
  scope.Count("circles refused: no other of this radius", refused);
  return transaction;
}
//! [detector]

//! [parameters]
plumbline::DetectorType EqualRadiusDetectorType() {
  plumbline::DetectorType type;
  type.name = "equal_radius";
  type.description = "Circles of the same radius: columns cast in one mould";
  type.reads = {"circle"};
  plumbline::SetParameters<EqualRadiusOptions>(
      [](plumbline::ParameterBinder* parameters, EqualRadiusOptions* options) {
        parameters->Length("gate", &options->gate, 0.0, 10.0,
                           "radii nearer to each other are the same");
        parameters->Length("sigma", &options->sigma, 1e-6, 1.0,
                           "tolerance of the casting");
      },
      [](const EqualRadiusOptions& options) {
        return std::make_unique<EqualRadiusDetector>(options);
      },
      &type);
  return type;
}
//! [parameters]

}  // namespace mine
