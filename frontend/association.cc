#include <plumbline/frontend/association.h>

#include <Eigen/LU>
#include <cmath>

namespace plumbline {

Eigen::Vector2d Innovation(const Pose2& robot,
                           const SegmentObservation& observation,
                           const Pose2& feature) {
  const Eigen::Vector2d middle =
      TransformPoint(robot, observation.pose.head<2>());
  const double dx = middle.x() - feature[0];
  const double dy = middle.y() - feature[1];
  return {-dx * std::sin(feature[2]) + dy * std::cos(feature[2]),
          NormalizeAngle(robot[2] + observation.pose[2] - feature[2])};
}

Eigen::Matrix<double, 2, 3> InnovationJacobian(
    const Pose2& robot, const SegmentObservation& observation,
    const Pose2& feature) {
  const double c = std::cos(robot[2]);
  const double s = std::sin(robot[2]);
  const double px = observation.pose[0];
  const double py = observation.pose[1];
  const double nx = -std::sin(feature[2]);
  const double ny = std::cos(feature[2]);
  Eigen::Matrix<double, 2, 3> jacobian;
  jacobian << nx, ny, nx * (-s * px - c * py) + ny * (c * px - s * py),  //
      0.0, 0.0, 1.0;
  return jacobian;
}

Eigen::Matrix2d InnovationCovariance(const Pose2& robot,
                                     const SegmentObservation& observation,
                                     const AssociationCandidate& candidate,
                                     const AssociationOptions& options) {
  const Eigen::Matrix<double, 2, 3> jacobian =
      InnovationJacobian(robot, observation, candidate.pose);
  Eigen::Matrix2d covariance =
      observation.covariance +
      jacobian * candidate.robot_covariance * jacobian.transpose();
  covariance(0, 0) +=
      options.feature_offset_sigma * options.feature_offset_sigma;
  covariance(1, 1) += options.feature_angle_sigma * options.feature_angle_sigma;
  return covariance;
}

std::vector<Association> Associate(
    const Pose2& robot, const std::vector<SegmentObservation>& observations,
    const std::vector<AssociationCandidate>& candidates,
    const AssociationOptions& options) {
  std::vector<Association> associations;
  for (std::size_t o = 0; o < observations.size(); ++o) {
    const SegmentObservation& observation = observations[o];
    const Eigen::Vector2d middle =
        TransformPoint(robot, observation.pose.head<2>());
    Association best;
    best.squared_distance = options.gate;
    for (std::size_t k = 0; k < candidates.size(); ++k) {
      const AssociationCandidate& candidate = candidates[k];
      const double along =
          (middle.x() - candidate.pose[0]) * std::cos(candidate.pose[2]) +
          (middle.y() - candidate.pose[1]) * std::sin(candidate.pose[2]);
      if (along + 0.5 * observation.length <
              candidate.extent_begin - options.max_gap ||
          along - 0.5 * observation.length >
              candidate.extent_end + options.max_gap) {
        continue;
      }
      const Eigen::Vector2d innovation =
          Innovation(robot, observation, candidate.pose);
      if (std::abs(innovation[0]) > options.max_offset ||
          std::abs(innovation[1]) > options.max_angle) {
        continue;
      }
      const Eigen::Matrix2d covariance =
          InnovationCovariance(robot, observation, candidate, options);
      const double squared = innovation.dot(covariance.inverse() * innovation);
      if (squared < best.squared_distance) {
        best.squared_distance = squared;
        best.observation = static_cast<int>(o);
        best.candidate = static_cast<int>(k);
      }
    }
    if (best.observation >= 0) associations.push_back(best);
  }
  return associations;
}

}  // namespace plumbline
