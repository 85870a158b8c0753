#ifndef PLUMBLINE_FRONTEND_TIMED_POSE_H_
#define PLUMBLINE_FRONTEND_TIMED_POSE_H_

#include <plumbline/factors/pose2.h>

#include <string>

namespace plumbline {

/// A pose of a trajectory.
struct TimedPose {
  /// s
  double timestamp = 0.0;
  /// The time stamp as the input wrote it; empty when there is no such text.
  std::string timestamp_text;
  /// Pose of the robot in the map frame, m and rad.
  Pose2 pose = Pose2::Zero();
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_TIMED_POSE_H_
