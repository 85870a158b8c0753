#include <plumbline/frontend/odometry_scale.h>

#include <Eigen/LU>
#include <cmath>

namespace plumbline {
namespace {

// Shorter motions are noise, m.
constexpr double kLeastWay = 0.1;
// The returns' variance along the way is no larger than this share of
// odometry's.
constexpr double kClearShare = 0.25;
// Where the returns say nothing, 1/m^2 and 1/rad^2.
constexpr double kRidge = 1e-6;
// Standard deviation of the ratio of a motion by match to that by odometry. One
// that is more than kFarthest of these off is a slip.
constexpr double kRatioSigma = 0.1;
constexpr double kFarthest = 3.0;
// By how much the scale may change over a metre: a hundredth over 100 m.
constexpr double kDriftVariance = 1e-6;

}  // namespace

void OdometryScale::Compare(const Pose2& motion,
                            const Eigen::Matrix3d& covariance,
                            const Pose2& matched,
                            const Eigen::Matrix3d& information) {
  const double way = motion.head<2>().norm();
  variance_ += kDriftVariance * way;
  if (way < kLeastWay) return;
  const Eigen::Vector3d along(motion[0] / way, motion[1] / way, 0.0);
  const Eigen::Matrix3d returns =
      (information + kRidge * Eigen::Matrix3d::Identity()).inverse();
  const bool is_clear =
      along.dot(returns * along) <= kClearShare * along.dot(covariance * along);
  const double ratio = along.dot(matched) / way;
  if (is_clear && is_anchored_ &&
      std::abs(ratio - scale_) <= kFarthest * kRatioSigma) {
    const double gain = variance_ / (variance_ + kRatioSigma * kRatioSigma);
    scale_ += gain * (ratio - scale_);
    variance_ *= 1.0 - gain;
  }
  is_anchored_ = is_clear;
}

}  // namespace plumbline
