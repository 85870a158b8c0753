#ifndef PLUMBLINE_FRONTEND_ODOMETRY_CALIBRATION_H_
#define PLUMBLINE_FRONTEND_ODOMETRY_CALIBRATION_H_

#include <plumbline/core/state_archive.h>
#include <plumbline/factors/pose2.h>

#include <Eigen/Core>

namespace plumbline {

/// How odometry's motions lie to those of the scans, learnt on the way from
/// matches. Two constants, since both hold everywhere and add up where the
/// returns say nothing or little:
/// - how many metres odometry's metre has: wheels are as large as somebody
///   entered once;
/// - the course, by which the robot drives to the left of where its laser looks
///   according to the log: a laser that is mounted a degree askew makes every
///   way look like a slip to the side, and a match that believes odometry in
///   part turns the map a little with every metre.
class OdometryCalibration {
 public:
  /// What a metre of odometry is presently taken for, m.
  double scale() const { return scale_; }
  /// Direction of a motion in the scans, seen from that by odometry, rad.
  double course() const { return course_; }

  /// A motion by odometry with scale and course allowed for.
  Pose2 Corrected(const Pose2& motion) const;

  /// The motion since the last key scan: as odometry has it (not corrected),
  /// its covariance, how the scans were matched, and the information of the
  /// returns alone, all in that key scan's frame; what odometry went between
  /// the last two scans, m. The scale counts where the returns say how far it
  /// went better than odometry does, at its end and at its beginning, for less
  /// where the robot sped up or slowed down, as odometry is a little early or
  /// late; the course where they say much better at its end what is across.
  void Compare(const Pose2& motion, const Eigen::Matrix3d& covariance,
               const Pose2& matched, const Eigen::Matrix3d& information,
               double last_step);

  /// The motion that is compared next does not begin at a match.
  void Break() { is_anchored_ = false; }

  /// Writes or reads all of it (state_archive.h).
  template <typename Archive>
  friend void Exchange(Archive& archive, OdometryCalibration& calibration) {
    auto& [value, variance, is_anchored, last_step, course, course_variance] =
        calibration;
    ExchangeAll(archive, value, variance, is_anchored, last_step, course,
                course_variance);
  }

 private:
  double scale_ = 1.0;
  double variance_ = kPriorSigma * kPriorSigma;
  // The last key scan's match told how far the robot had gone.
  bool is_anchored_ = false;
  // What odometry went between the last two scans before, m.
  double last_step_ = 0.0;
  double course_ = 0.0;
  double course_variance_ = kPriorCourse * kPriorCourse;

  // What wheels are entered wrong by: a few percent, and two or three times
  // that (the metre of the intel log is 0.964 m) is still possible.
  static constexpr double kPriorSigma = 0.05;
  // What lasers are mounted askew by, rad.
  static constexpr double kPriorCourse = DegToRad(2.0);
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_ODOMETRY_CALIBRATION_H_
