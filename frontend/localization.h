#ifndef PLUMBLINE_FRONTEND_LOCALIZATION_H_
#define PLUMBLINE_FRONTEND_LOCALIZATION_H_

#include <plumbline/frontend/association.h>

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <vector>

namespace plumbline {

/// A robot pose corrected against clamped features.
struct Localization {
  Pose2 pose = Pose2::Zero();
  /// Information of the observations alone (axes of the map frame); rank
  /// deficient along a corridor.
  Eigen::Matrix3d observation_information = Eigen::Matrix3d::Zero();
};

/// A recognized feature, linearized at a pose of the robot: observation minus
/// expectation, its derivative with respect to the pose (map frame), and its
/// weight (inverse covariance of the error).
struct LinearizedObservation {
  Eigen::Vector2d error = Eigen::Vector2d::Zero();
  Eigen::Matrix<double, 2, 3> jacobian = Eigen::Matrix<double, 2, 3>::Zero();
  Eigen::Matrix2d weight = Eigen::Matrix2d::Zero();
};

/// The robot-only solve: moves the robot so that `count` observations agree
/// with features that stay where they are, robustly (Cauchy), with
/// `prior_information` (axes of the map frame) about `predicted`.
/// `linearize(pose, i)` gives the i-th observation at a pose.
Localization LocalizeRobot(
    const Pose2& predicted, const Eigen::Matrix3d& prior_information,
    std::size_t count,
    const std::function<LinearizedObservation(const Pose2&, std::size_t)>&
        linearize);

/// The robot-only solve (Eq. 20 in the clamped form of Eq. 21): moves the robot
/// so that recognized segments lie on their features, robustly (Cauchy), with
/// `prior_information` (axes of the map frame) about `predicted`. The features
/// stay where they are.
Localization LocalizeRobot(const Pose2& predicted,
                           const Eigen::Matrix3d& prior_information,
                           const std::vector<SegmentObservation>& observations,
                           const std::vector<AssociationCandidate>& candidates,
                           const std::vector<Association>& associations,
                           const AssociationOptions& options);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_LOCALIZATION_H_
