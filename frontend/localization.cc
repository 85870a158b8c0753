#include <plumbline/frontend/localization.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>

namespace plumbline {

Localization LocalizeRobot(const Pose2& predicted,
                           const Eigen::Matrix3d& prior_information,
                           const std::vector<SegmentObservation>& observations,
                           const std::vector<AssociationCandidate>& candidates,
                           const std::vector<Association>& associations,
                           const AssociationOptions& options) {
  Localization result;
  result.pose = predicted;
  constexpr int kMaxIterations = 10;
  constexpr double kConvergence = 1e-8;
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    Eigen::Vector3d difference = result.pose - predicted;
    difference[2] = NormalizeAngle(difference[2]);
    Eigen::Vector3d gradient = prior_information * difference;
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
    for (const Association& association : associations) {
      const SegmentObservation& observation =
          observations[association.observation];
      const AssociationCandidate& candidate = candidates[association.candidate];
      const Eigen::Vector2d error =
          Innovation(result.pose, observation, candidate.pose);
      const Eigen::Matrix<double, 2, 3> jacobian =
          InnovationJacobian(result.pose, observation, candidate.pose);
      // The features are clamped, but not exact.
      Eigen::Matrix2d covariance = observation.covariance;
      covariance(0, 0) +=
          options.feature_offset_sigma * options.feature_offset_sigma;
      covariance(1, 1) +=
          options.feature_angle_sigma * options.feature_angle_sigma;
      const Eigen::Matrix2d weight = covariance.inverse();
      const double squared = error.dot(weight * error);
      const double robust = 1.0 / (1.0 + squared / 4.0);
      information.noalias() +=
          robust * jacobian.transpose() * weight * jacobian;
      gradient.noalias() += robust * jacobian.transpose() * (weight * error);
    }
    result.observation_information = information;
    Eigen::Matrix3d hessian = information + prior_information;
    hessian.diagonal().array() += 1e-9;
    const Eigen::Vector3d step = hessian.ldlt().solve(-gradient);
    if (!step.allFinite()) break;
    result.pose += step;
    result.pose[2] = NormalizeAngle(result.pose[2]);
    if (step.squaredNorm() < kConvergence * kConvergence) break;
  }
  return result;
}

}  // namespace plumbline
