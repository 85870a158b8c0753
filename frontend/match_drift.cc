#include <plumbline/frontend/match_drift.h>

#include <cmath>
#include <cstddef>

namespace plumbline {

Eigen::Matrix3d DriftCovariance(const Pose2& motion, const MatchDrift& drift) {
  const double way = motion.head<2>().norm();
  const double turned = std::abs(motion[2]);
  const double translation =
      drift.translation_per_root_metre * drift.translation_per_root_metre * way;
  const double heading =
      drift.rotation_per_root_metre * drift.rotation_per_root_metre * way +
      drift.rotation_per_root_radian * drift.rotation_per_root_radian * turned;
  return Eigen::Vector3d(translation, translation, heading).asDiagonal();
}

UncertainPose2 DriftAlong(const std::vector<Pose2>& poses,
                          const MatchDrift& drift) {
  UncertainPose2 sum;
  sum.covariance.setZero();
  for (std::size_t k = 1; k < poses.size(); ++k) {
    const Pose2 step = Between(poses[k - 1], poses[k]);
    sum = Compose(sum, {step, DriftCovariance(step, drift)});
  }
  return sum;
}

}  // namespace plumbline
