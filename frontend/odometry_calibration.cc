#include <plumbline/frontend/odometry_calibration.h>

#include <Eigen/LU>
#include <cmath>

namespace plumbline {
namespace {

// Shorter motions are noise, m.
constexpr double kLeastWay = 0.1;
// The returns' variance along the way is no larger than this share of
// odometry's for the scale, and across it for the course.
constexpr double kClearShare = 1.0;
constexpr double kClearShareOfCourse = 0.25;
// Where the returns say nothing, 1/m^2 and 1/rad^2.
constexpr double kRidge = 1e-6;
// A ratio of a motion by match to that by odometry that is more than so much
// off is a slip.
constexpr double kSlip = 0.3;
// So many motions in a row whose ratios lie within this share of their mean are
// none, up to a scale of so much.
constexpr int kManyMotions = 8;
constexpr double kSameRatio = 0.2;
constexpr double kLargestScale = 3.0;
// Standard deviation of such a ratio, and of a match's ends along the way, m.
constexpr double kRatioSigma = 0.03;
constexpr double kWaySigma = 0.01;
// Odometry is a scan early or late: by so many of its last steps that what it
// went between two scans changes a motion.
constexpr double kLagSteps = 2.0;
// Where the robot turns by more, rad, wheels do not roll as they do on a way
// ahead.
constexpr double kMostTurnOfScale = 0.1;
// Standard deviation of the direction of a match over such a motion, rad. One
// that is more than kFarthest of these off is a slip to the side.
constexpr double kCourseSigma = DegToRad(3.0);
constexpr double kFarthest = 3.0;
// By how much the scale may change over a metre: a hundredth over 1 km, as
// wheels get warm.
constexpr double kDriftVariance = 1e-7;
// By how much the course may change over a metre, rad^2: two tenths of a degree
// over 1 km.
constexpr double kCourseDriftVariance = 1e-8;
// Where the robot turns by more, rad, where the laser sits tells on the course.
constexpr double kMostTurn = 0.05;
// Shorter than this share of odometry's motion a match has no direction.
constexpr double kLeastRatio = 0.5;

}  // namespace

void OdometryCalibration::NoteLonger(double ratio) {
  if (ratio - scale_ <= kSlip) {
    num_longer_ = 0;
    return;
  }
  if (num_longer_ > 0 && std::abs(ratio - longer_) > kSameRatio * longer_) {
    num_longer_ = 0;
  }
  ++num_longer_;
  longer_ =
      num_longer_ == 1 ? ratio : longer_ + (ratio - longer_) / num_longer_;
  if (num_longer_ < kManyMotions || longer_ > kLargestScale) return;
  scale_ = longer_;
  variance_ = kPriorSigma * kPriorSigma;
  num_longer_ = 0;
}

Pose2 OdometryCalibration::Corrected(const Pose2& motion) const {
  const double along = scale_ * std::cos(course_);
  const double across = scale_ * std::sin(course_);
  return Pose2(along * motion[0] - across * motion[1],
               across * motion[0] + along * motion[1], motion[2]);
}

double OdometryCalibration::AddedVariance(double way) {
  return kDriftVariance * way;
}

void OdometryCalibration::Compare(const Pose2& motion,
                                  const Eigen::Matrix3d& covariance,
                                  const Pose2& matched,
                                  const Eigen::Matrix3d& information,
                                  double last_step) {
  const double way = motion.head<2>().norm();
  const double change = last_step - last_step_;
  last_step_ = last_step;
  variance_ += AddedVariance(way);
  course_variance_ += kCourseDriftVariance * way;
  if (way < kLeastWay) return;
  const Eigen::Vector3d along(motion[0] / way, motion[1] / way, 0.0);
  const Eigen::Matrix3d returns =
      (information + kRidge * Eigen::Matrix3d::Identity()).inverse();
  const double of_returns = along.dot(returns * along);
  const bool is_clear =
      of_returns <= kClearShare * along.dot(covariance * along);
  const double ratio = along.dot(matched) / way;
  const bool tells =
      is_clear && is_anchored_ && std::abs(motion[2]) <= kMostTurnOfScale;
  if (tells) NoteLonger(ratio);
  if (tells && std::abs(ratio - scale_) <= kSlip) {
    const double of_ratio =
        kRatioSigma * kRatioSigma + (of_returns + kWaySigma * kWaySigma +
                                     kLagSteps * kLagSteps * change * change) /
                                        (way * way);
    const double gain = variance_ / (variance_ + of_ratio);
    scale_ += gain * (ratio - scale_);
    variance_ *= 1.0 - gain;
  }
  is_anchored_ = is_clear;

  const Eigen::Vector3d across(-along[1], along[0], 0.0);
  if (across.dot(returns * across) >
          kClearShareOfCourse * across.dot(covariance * across) ||
      ratio < kLeastRatio || std::abs(matched[2]) > kMostTurn) {
    return;
  }
  // Where odometry turns more than the scans do, half of that is in the
  // direction of its chord.
  const double apart = NormalizeAngle(
      std::atan2(matched[1], matched[0]) - std::atan2(motion[1], motion[0]) -
      0.5 * NormalizeAngle(matched[2] - motion[2]));
  if (std::abs(apart - course_) > kFarthest * kCourseSigma) return;
  const double gain =
      course_variance_ / (course_variance_ + kCourseSigma * kCourseSigma);
  course_ += gain * (apart - course_);
  course_variance_ *= 1.0 - gain;
}

}  // namespace plumbline
