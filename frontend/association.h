#ifndef PLUMBLINE_FRONTEND_ASSOCIATION_H_
#define PLUMBLINE_FRONTEND_ASSOCIATION_H_

#include <plumbline/core/feature.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/segment_extraction.h>

#include <Eigen/Core>
#include <vector>

namespace plumbline {

/// Gates of the association of observed segments with the walls of the map.
struct AssociationOptions {
  /// Mahalanobis gate on offset and direction together (chi^2, 2 degrees of
  /// freedom).
  double gate = 9.21;
  /// Whatever the uncertainty: farthest offset (m) and direction (rad).
  double max_offset = 0.5;
  double max_angle = DegToRad(12.0);
  /// Uncertainty of a feature's own place in its neighbourhood: offset (m)
  /// and direction (rad).
  double feature_offset_sigma = 0.03;
  double feature_angle_sigma = DegToRad(0.7);
  /// An observation that ends this far before the feature begins may still be
  /// the same wall, m. 0: what begins where a wall ended is no sighting of it;
  /// it may be another wall at a small angle.
  double max_gap = 0.4;
};

/// A feature that may have been observed.
struct AssociationCandidate {
  FeatureId feature = kNoId;
  /// Map frame.
  Pose2 pose = Pose2::Zero();
  double extent_begin = 0.0;
  double extent_end = 0.0;
  /// Covariance of the robot relative to the feature, axes of the map frame.
  Eigen::Matrix3d robot_covariance = Eigen::Matrix3d::Zero();
};

/// An observation recognized as a candidate.
struct Association {
  int observation = -1;
  int candidate = -1;
  double squared_distance = 0.0;
};

/// Offset across (m) and direction (rad) of an observation against a
/// candidate's line, with the robot at `robot`: zero for a perfect match. The
/// offset is taken at the middle of the observation.
Eigen::Vector2d Innovation(const Pose2& robot,
                           const SegmentObservation& observation,
                           const Pose2& feature);

/// Jacobian (2x3) of the innovation with respect to the robot's pose.
Eigen::Matrix<double, 2, 3> InnovationJacobian(
    const Pose2& robot, const SegmentObservation& observation,
    const Pose2& feature);

/// Covariance of the innovation: observation, robot and the feature's own.
Eigen::Matrix2d InnovationCovariance(const Pose2& robot,
                                     const SegmentObservation& observation,
                                     const AssociationCandidate& candidate,
                                     const AssociationOptions& options);

/// Nearest neighbour association: each observation with the candidate of the
/// smallest Mahalanobis distance within the gates on direction, offset and
/// overlap. A candidate may take several observations (a wall behind
/// columns). In the order of observations.
std::vector<Association> Associate(
    const Pose2& robot, const std::vector<SegmentObservation>& observations,
    const std::vector<AssociationCandidate>& candidates,
    const AssociationOptions& options);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_ASSOCIATION_H_
