#include <plumbline/core/constraint.h>

#include <utility>

namespace plumbline {
namespace {

Constraint MakeConstraint(const RelationType& type,
                          std::vector<FeatureId> features,
                          Eigen::VectorXd expected, Eigen::MatrixXd information,
                          ConstraintClass kind, std::string source) {
  Constraint constraint;
  constraint.type = &type;
  constraint.features = std::move(features);
  constraint.expected = std::move(expected);
  constraint.information = std::move(information);
  constraint.kind = kind;
  constraint.source = std::move(source);
  return constraint;
}

}  // namespace

Constraint MakeMeasurement(const RelationType& type,
                           std::vector<FeatureId> features,
                           Eigen::VectorXd expected,
                           Eigen::MatrixXd information, std::string source) {
  return MakeConstraint(type, std::move(features), std::move(expected),
                        std::move(information), ConstraintClass::kMeasurement,
                        std::move(source));
}

Constraint MakeStructure(const RelationType& type,
                         std::vector<FeatureId> features,
                         Eigen::VectorXd expected, Eigen::MatrixXd information,
                         std::string source) {
  return MakeConstraint(type, std::move(features), std::move(expected),
                        std::move(information), ConstraintClass::kStructure,
                        std::move(source));
}

Eigen::MatrixXd InformationFromSigmas(const Eigen::VectorXd& sigmas) {
  return sigmas.cwiseAbs2().cwiseInverse().asDiagonal();
}

}  // namespace plumbline
