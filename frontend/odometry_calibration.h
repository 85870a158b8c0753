#ifndef PLUMBLINE_FRONTEND_ODOMETRY_CALIBRATION_H_
#define PLUMBLINE_FRONTEND_ODOMETRY_CALIBRATION_H_

#include <plumbline/core/state_archive.h>
#include <plumbline/factors/pose2.h>

#include <Eigen/Core>

namespace plumbline {

/// What a motion between two key scans made of odometry's metre.
struct MetreUse {
  /// The key scan that it leads to.
  int scan = 0;
  /// Way by odometry, m.
  double way = 0.0;
  /// What a metre was taken for on it, m; and after it, when it had been
  /// compared with the match, with its variance and what was added to that for
  /// the way.
  double used = 1.0;
  double learnt = 1.0;
  double variance = 0.0;
  double added_variance = 0.0;
  /// By how much the motion changes with the metre: odometry's motion, as far
  /// as it was followed, in the frame of the key scan before, m and rad per m.
  Eigen::Vector3d change = Eigen::Vector3d::Zero();

  /// Writes or reads all of it (state_archive.h).
  template <typename Archive>
  friend void Exchange(Archive& archive, MetreUse& use) {
    auto& [scan, way, used, learnt, variance, added_variance, change] = use;
    ExchangeAll(archive, scan, way, used, learnt, variance, added_variance,
                change);
  }
};

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
  /// Its variance, and by how much that grows over a way of this length, m.
  double scale_variance() const { return variance_; }
  static double AddedVariance(double way);
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
  /// Wheels that are entered wrong by half of their size are no slip: where
  /// many motions in a row are longer than odometry's by the same factor, it is
  /// the scale. None that are shorter: what goes along with the robot looks so.
  void Compare(const Pose2& motion, const Eigen::Matrix3d& covariance,
               const Pose2& matched, const Eigen::Matrix3d& information,
               double last_step);

  /// The motion that is compared next does not begin at a match.
  void Break() { is_anchored_ = false; }

  /// Writes or reads all of it (state_archive.h).
  template <typename Archive>
  friend void Exchange(Archive& archive, OdometryCalibration& calibration) {
    auto& [value, variance, is_anchored, last_step, course, course_variance,
           num_longer, longer] = calibration;
    ExchangeAll(archive, value, variance, is_anchored, last_step, course,
                course_variance, num_longer, longer);
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
  // Motions in a row that were longer in the matches than a slip explains, and
  // the mean of their ratios.
  int num_longer_ = 0;
  double longer_ = 0.0;

  void NoteLonger(double ratio);

  // What wheels are entered wrong by: a few percent, and two or three times
  // that (the metre of the intel log is 0.964 m) is still possible.
  static constexpr double kPriorSigma = 0.05;
  // What lasers are mounted askew by, rad.
  static constexpr double kPriorCourse = DegToRad(2.0);
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_ODOMETRY_CALIBRATION_H_
