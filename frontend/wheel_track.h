#ifndef PLUMBLINE_FRONTEND_WHEEL_TRACK_H_
#define PLUMBLINE_FRONTEND_WHEEL_TRACK_H_

#include <plumbline/core/state_archive.h>
#include <plumbline/factors/pose2.h>

#include <Eigen/Core>

namespace plumbline {

/// Where odometry has the robot when it is held by what matches clearly tell.
/// Along a corridor a match tells a little, and errs by as much in each scan,
/// as the same things are seen from the same side: what is taken from scan to
/// scan adds up over metres, while odometry is a little early or late, which
/// does not. So this goes on by odometry's motions and follows matches only as
/// fast as odometry drifts (a Kalman filter of the position, whose measurements
/// have the returns' noise and that of odometry's time).
class WheelTrack {
 public:
  /// Whether it goes on from a match.
  bool exists() const { return exists_; }

  /// Nothing is known.
  void Reset() { exists_ = false; }

  /// The robot goes on from a pose that is turned by `heading` (rad, map frame)
  /// by a motion (m, m, rad, in the frame of that pose).
  void Move(const Pose2& motion, double heading);

  /// Where odometry has the robot, m, map frame, and the covariance of the
  /// robot's place about it, m^2.
  const Eigen::Vector2d& position() const { return position_; }
  Eigen::Matrix2d Covariance() const;

  /// Where a match has the robot, m, map frame, and the information of the
  /// returns alone (m, m, rad, map frame). What is far off begins anew there.
  void Follow(const Eigen::Vector2d& matched,
              const Eigen::Matrix3d& information);

  /// The map's frame is moved: what lay at p lies at `motion` p (m, m, rad).
  void MoveBy(const Pose2& motion);

  /// Writes or reads all of it (state_archive.h).
  template <typename Archive>
  friend void Exchange(Archive& archive, WheelTrack& track) {
    auto& [exists, position, covariance, unrest] = track;
    ExchangeAll(archive, exists, position, covariance, unrest);
  }

 private:
  bool exists_ = false;
  Eigen::Vector2d position_ = Eigen::Vector2d::Zero();
  // Of odometry's place about where it would have to be, without what is early
  // or late, m^2.
  Eigen::Matrix2d covariance_ = Eigen::Matrix2d::Zero();
  // Mean of the last squared innovations over what they should be, at least 1:
  // by how much the variances of this odometry are larger.
  double unrest_ = 1.0;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_WHEEL_TRACK_H_
