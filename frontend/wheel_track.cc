#include <plumbline/frontend/wheel_track.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace plumbline {
namespace {

// Standard deviation of odometry's place over a metre, m, and over a turn by a
// radian, m.
constexpr double kWalk = 0.02;
constexpr double kWalkPerRadian = 0.05;
// Standard deviation of what odometry is early or late by, m.
constexpr double kEarlyOrLate = 0.02;
// Variance that each match leaves at least, m^2.
constexpr double kLeastVariance = 2.5e-7;
// Where the returns say nothing, 1/m^2 and 1/rad^2.
constexpr double kRidge = 1e-6;
// An innovation counts as so many squared sigmas at most; from there on the
// track begins anew.
constexpr double kFarthest = 6.0;
// Share of the last innovation in their mean.
constexpr double kShare = 0.1;

Eigen::Matrix2d Isotropic(double variance) {
  return variance * Eigen::Matrix2d::Identity();
}

}  // namespace

void WheelTrack::Move(const Pose2& motion, double heading) {
  const double c = std::cos(heading);
  const double s = std::sin(heading);
  position_ += Eigen::Vector2d(c * motion[0] - s * motion[1],
                               s * motion[0] + c * motion[1]);
  covariance_ +=
      Isotropic(kWalk * kWalk * motion.head<2>().norm() +
                kWalkPerRadian * kWalkPerRadian * std::abs(motion[2]));
}

Eigen::Matrix2d WheelTrack::Covariance() const {
  return unrest_ * (covariance_ + Isotropic(kEarlyOrLate * kEarlyOrLate));
}

void WheelTrack::Follow(const Eigen::Vector2d& matched,
                        const Eigen::Matrix3d& information) {
  const Eigen::Matrix2d returns =
      (information + kRidge * Eigen::Matrix3d::Identity())
          .inverse()
          .topLeftCorner<2, 2>();
  const Eigen::Vector2d innovation = matched - position_;
  const Eigen::Matrix2d usual =
      covariance_ + Isotropic(kEarlyOrLate * kEarlyOrLate) + returns;
  const double squared = 0.5 * innovation.dot(usual.inverse() * innovation);
  if (exists_) {
    unrest_ = std::max(
        1.0, unrest_ + kShare * (std::min(kFarthest, squared) - unrest_));
  }
  if (!exists_ || !(squared <= kFarthest)) {
    exists_ = true;
    position_ = matched;
    covariance_ = Isotropic(kEarlyOrLate * kEarlyOrLate);
    return;
  }
  const Eigen::Matrix2d gain =
      unrest_ * covariance_ * (Covariance() + returns).inverse();
  position_ += gain * innovation;
  const Eigen::Matrix2d left = covariance_ - gain * covariance_;
  covariance_ = 0.5 * (left + left.transpose()) + Isotropic(kLeastVariance);
}

void WheelTrack::MoveBy(const Pose2& motion) {
  const Eigen::Matrix2d rotation =
      Eigen::Rotation2Dd(motion[2]).toRotationMatrix();
  position_ = rotation * position_ + motion.head<2>();
  const Eigen::Matrix2d moved = rotation * covariance_ * rotation.transpose();
  covariance_ = 0.5 * (moved + moved.transpose());
}

}  // namespace plumbline
