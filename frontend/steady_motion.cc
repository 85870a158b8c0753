#include <plumbline/frontend/steady_motion.h>

#include <cmath>

namespace plumbline {
namespace {

// A robot that moves by less from scan to scan stands, m and rad.
constexpr double kLeastWay = 0.02;
constexpr double kLeastTurn = DegToRad(1.0);
// Standard deviations of a change from scan to scan, m and rad, and their share
// of the motion: over a stretch the changes add up like a random walk.
constexpr double kWaySigma = 0.02;
constexpr double kTurnSigma = DegToRad(3.0);
constexpr double kShare = 0.5;

}  // namespace

void SteadyMotion::Add(const Pose2& step) {
  steps_[count_ % kSteps] = step;
  // Only whether there are enough, and the place of the next one, count.
  count_ = count_ + 1 < 2 * kSteps ? count_ + 1 : kSteps;
}

bool SteadyMotion::IsMoving() const {
  if (count_ < kSteps) return false;
  const Pose2 step = Step().mean;
  return step.head<2>().norm() >= kLeastWay || std::abs(step[2]) >= kLeastTurn;
}

UncertainPose2 SteadyMotion::Step() const {
  UncertainPose2 step;
  for (const Pose2& one : steps_) step.mean += one / kSteps;
  const double way = kWaySigma + kShare * step.mean.head<2>().norm();
  const double turn = kTurnSigma + kShare * std::abs(step.mean[2]);
  step.covariance =
      Eigen::Vector3d(way * way, way * way, turn * turn).asDiagonal();
  return step;
}

bool SteadyMotion::Explains(const Pose2& motion) const {
  const Pose2 mean = Step().mean;
  const Pose2 left = motion - mean;
  return left.head<2>().norm() <=
             kShare * mean.head<2>().norm() + kLeastWay / 2 &&
         std::abs(left[2]) <= kShare * std::abs(mean[2]) + kTurnSigma;
}

}  // namespace plumbline
