#include <plumbline/frontend/localization.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>

namespace plumbline {

Localization LocalizeRobot(
    const Pose2& predicted, const Eigen::Matrix3d& prior_information,
    std::size_t count,
    const std::function<LinearizedObservation(const Pose2&, std::size_t)>&
        linearize) {
  Localization result;
  result.pose = predicted;
  constexpr int kMaxIterations = 10;
  constexpr double kConvergence = 1e-8;
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    Eigen::Vector3d difference = result.pose - predicted;
    difference[2] = NormalizeAngle(difference[2]);
    Eigen::Vector3d gradient = prior_information * difference;
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
    for (std::size_t i = 0; i < count; ++i) {
      const LinearizedObservation observation = linearize(result.pose, i);
      const Eigen::Matrix<double, 2, 3>& jacobian = observation.jacobian;
      const Eigen::Matrix2d& weight = observation.weight;
      const double squared = observation.error.dot(weight * observation.error);
      const double robust = 1.0 / (1.0 + squared / 4.0);
      information.noalias() +=
          robust * jacobian.transpose() * weight * jacobian;
      gradient.noalias() +=
          robust * jacobian.transpose() * (weight * observation.error);
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

Localization LocalizeRobot(const Pose2& predicted,
                           const Eigen::Matrix3d& prior_information,
                           const std::vector<SegmentObservation>& observations,
                           const std::vector<AssociationCandidate>& candidates,
                           const std::vector<Association>& associations,
                           const AssociationOptions& options) {
  return LocalizeRobot(
      predicted, prior_information, associations.size(),
      [&](const Pose2& pose, std::size_t i) {
        const SegmentObservation& observation =
            observations[associations[i].observation];
        const Pose2& feature = candidates[associations[i].candidate].pose;
        LinearizedObservation linearized;
        linearized.error = Innovation(pose, observation, feature);
        linearized.jacobian = InnovationJacobian(pose, observation, feature);
        // The features are clamped, but not exact.
        Eigen::Matrix2d covariance = observation.covariance;
        covariance(0, 0) +=
            options.feature_offset_sigma * options.feature_offset_sigma;
        covariance(1, 1) +=
            options.feature_angle_sigma * options.feature_angle_sigma;
        linearized.weight = covariance.inverse();
        return linearized;
      });
}

}  // namespace plumbline
