#include "equal_radius_detector.h"

#include <plumbline/detectors/parameters.h>

#include <Eigen/Core>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

namespace mine {
namespace {

// Whether a live equal_radius ties the circle to one that stood before it.
bool IsTied(const plumbline::Graph& graph, const plumbline::Feature& circle) {
  for (const plumbline::ConstraintId id : graph.ConstraintsOf(circle.id)) {
    const plumbline::Constraint& constraint = graph.GetConstraint(id);
    if (constraint.type->name == "equal_radius" &&
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
  plumbline::Transaction transaction;
  std::vector<const plumbline::Feature*> before;
  for (const plumbline::Feature* circle : graph.Features()) {
    if (circle->type->name != "circle" || circle->level != scope.level) {
      continue;
    }
    const plumbline::Feature* nearest = nullptr;
    double nearest_gap = gate_;
    for (const plumbline::Feature* other : before) {
      const double gap = std::abs(circle->parameters[2] - other->parameters[2]);
      if (gap < nearest_gap) {
        nearest_gap = gap;
        nearest = other;
      }
    }
    before.push_back(circle);
    if (nearest == nullptr || IsTied(graph, *circle)) continue;

    plumbline::Constraint constraint;
    constraint.type = &registry.GetRelation("equal_radius");
    constraint.features = {nearest->id, circle->id};
    constraint.expected = Eigen::VectorXd::Zero(1);
    constraint.information =
        Eigen::MatrixXd::Constant(1, 1, 1.0 / (sigma_ * sigma_));
    constraint.kind = plumbline::ConstraintClass::kStructure;
    constraint.source = name();
    transaction.AddConstraint(std::move(constraint));
  }
  return transaction;
}
//! [detector]

plumbline::DetectorType EqualRadiusDetectorType() {
  plumbline::DetectorType type;
  type.name = "equal_radius";
  type.description = "Circles of the same radius: columns cast in one mould";
  type.reads = {"circle"};
  type.defaults = {{"gate", 0.1}, {"sigma", 0.002}};
  type.make = [defaults =
                   type.defaults](const plumbline::DetectorParameters& given) {
    const plumbline::ParameterReader reader("equal_radius", defaults, given);
    return std::make_unique<EqualRadiusDetector>(reader.Get("gate", 0.0, 10.0),
                                                 reader.Get("sigma", 1e-6));
  };
  return type;
}

}  // namespace mine
