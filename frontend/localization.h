#ifndef PLUMBLINE_FRONTEND_LOCALIZATION_H_
#define PLUMBLINE_FRONTEND_LOCALIZATION_H_

#include <plumbline/frontend/association.h>

#include <Eigen/Core>
#include <vector>

namespace plumbline {

/// A robot pose corrected against clamped features.
struct Localization {
  Pose2 pose = Pose2::Zero();
  /// Information of the observations alone (axes of the map frame); rank
  /// deficient along a corridor.
  Eigen::Matrix3d observation_information = Eigen::Matrix3d::Zero();
};

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
