#ifndef PLUMBLINE_CORE_CONSTRAINT_H_
#define PLUMBLINE_CORE_CONSTRAINT_H_

#include <plumbline/core/feature.h>

#include <Eigen/Core>
#include <string>
#include <vector>

namespace plumbline {

struct RelationType;  // core/registry.h

/// Measurements bind the graph to the sensors, structure is a hypothesis about
/// the building (method.md, section 1). Only structure is weighted by delta.
enum class ConstraintClass { kMeasurement, kStructure };

/// A broken constraint has no residual in any solve; it stays on record so
/// that reports can say what was tried and the same hypothesis is not proposed
/// again.
enum class ConstraintState { kLive, kBroken };

/// An edge of the graph: residual r = L (f(x) (-) expected), with
/// L' L = information; chi^2 = |r|^2.
struct Constraint {
  ConstraintId id = kNoId;
  /// Owned by the registry; never null in a graph.
  const RelationType* type = nullptr;
  /// In the order that the relation's functor takes them.
  std::vector<FeatureId> features;
  /// Expected value u, in the units of the relation's rows.
  Eigen::VectorXd expected;
  /// Inverse covariance, residual_size x residual_size, symmetric positive
  /// semidefinite (a wall says nothing about the way along it).
  Eigen::MatrixXd information;
  ConstraintClass kind = ConstraintClass::kMeasurement;
  ConstraintState state = ConstraintState::kLive;
  /// Chi-square p-value of the residual at the last E-step, in [0, 1]; 1 for
  /// measurements. The frozen loss reads it from here, so its address is
  /// stable.
  double delta = 1.0;
  /// Structure is broken when its p-value falls below this or below
  /// EmOptions::delta_threshold, whichever is less. For detectors whose
  /// tolerances contain every error of what they join: of right hypotheses a
  /// threshold of 0.3 would break three in ten.
  double break_below = 1.0;
  /// Label in files and reports: who proposed it. Nothing is decided by it.
  std::string source;
};

/// A live measurement: what the sensors say of these features.
Constraint MakeMeasurement(const RelationType& type,
                           std::vector<FeatureId> features,
                           Eigen::VectorXd expected,
                           Eigen::MatrixXd information, std::string source);

/// A live hypothesis about the structure of these features.
Constraint MakeStructure(const RelationType& type,
                         std::vector<FeatureId> features,
                         Eigen::VectorXd expected, Eigen::MatrixXd information,
                         std::string source);

/// The information of rows that are independent of each other: `sigmas` are
/// their standard deviations (tolerances), in the units of the rows, above 0.
Eigen::MatrixXd InformationFromSigmas(const Eigen::VectorXd& sigmas);

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_CONSTRAINT_H_
