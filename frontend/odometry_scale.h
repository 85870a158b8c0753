#ifndef PLUMBLINE_FRONTEND_ODOMETRY_SCALE_H_
#define PLUMBLINE_FRONTEND_ODOMETRY_SCALE_H_

#include <plumbline/core/state_archive.h>
#include <plumbline/factors/pose2.h>

#include <Eigen/Core>

namespace plumbline {

/// How many metres odometry's metre has, learnt on the way from matches of
/// scans that tell how far the robot went. Wheels are as large as somebody
/// entered once, so odometry is too long or too short everywhere alike; along a
/// corridor without doors, where the returns say nothing, this adds up.
class OdometryScale {
 public:
  /// What a metre of odometry is presently taken for, m.
  double scale() const { return scale_; }

  /// A motion by odometry with the scale allowed for.
  Pose2 Scaled(const Pose2& motion) const {
    return Pose2(scale_ * motion[0], scale_ * motion[1], motion[2]);
  }

  /// The motion since the last key scan: as odometry has it (not scaled), its
  /// covariance, how the scans were matched, and the information of the returns
  /// alone, all in that key scan's frame. Counts where the returns say how far
  /// it went much better than odometry does, at its end and at its beginning.
  void Compare(const Pose2& motion, const Eigen::Matrix3d& covariance,
               const Pose2& matched, const Eigen::Matrix3d& information);

  /// The motion that is compared next does not begin at a match.
  void Break() { is_anchored_ = false; }

  /// Writes or reads all of it (state_archive.h).
  template <typename Archive>
  friend void Exchange(Archive& archive, OdometryScale& scale) {
    auto& [value, variance, is_anchored] = scale;
    ExchangeAll(archive, value, variance, is_anchored);
  }

 private:
  double scale_ = 1.0;
  double variance_ = kPriorSigma * kPriorSigma;
  // The last key scan's match told how far the robot had gone.
  bool is_anchored_ = false;

  // What wheels are entered wrong by: a few percent, and two or three times
  // that (the metre of the intel log is 0.964 m) is still possible.
  static constexpr double kPriorSigma = 0.05;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_ODOMETRY_SCALE_H_
