#ifndef PLUMBLINE_FRONTEND_STEADY_MOTION_H_
#define PLUMBLINE_FRONTEND_STEADY_MOTION_H_

#include <plumbline/core/state_archive.h>
#include <plumbline/factors/pose2.h>

#include <array>

namespace plumbline {

/// The motion from one scan to the next that goes on as it was, learnt from the
/// last scans that were matched: what a robot most likely does where odometry
/// says nothing of it, because it stands still while the robot goes, or leaps
/// farther than a robot can. Motions are per scan, not per second: time stamps
/// of many logs are those of the transport, in bursts.
class SteadyMotion {
 public:
  /// The motion of a scan that was matched, since the one before, which was,
  /// too (m, m, rad, in the frame of the one before).
  void Add(const Pose2& step);

  /// The next scan's motion does not follow on the last one's.
  void Break() { count_ = 0; }

  /// The robot went on like this, as is known afterwards.
  void GoOn(const Pose2& step) {
    steps_.fill(step);
    count_ = kSteps;
  }

  /// Whether enough scans were matched in a row, and the robot moved.
  bool IsMoving() const;

  /// The next motion: the mean of the last ones, as uncertain as robots change
  /// theirs from scan to scan.
  UncertainPose2 Step() const;

  /// Whether a motion (m, m, rad) is about this one: the robot had not begun to
  /// stop, or to turn.
  bool Explains(const Pose2& motion) const;

  /// Writes or reads all of it (state_archive.h).
  template <typename Archive>
  friend void Exchange(Archive& archive, SteadyMotion& motion) {
    auto& [steps, count] = motion;
    ExchangeAll(archive, steps, count);
  }

 private:
  // The last ones, and how many were added in a row.
  static constexpr int kSteps = 4;
  std::array<Pose2, kSteps> steps_{Pose2::Zero(), Pose2::Zero(), Pose2::Zero(),
                                   Pose2::Zero()};
  int count_ = 0;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_STEADY_MOTION_H_
