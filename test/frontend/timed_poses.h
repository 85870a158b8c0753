#ifndef PLUMBLINE_TEST_FRONTEND_TIMED_POSES_H_
#define PLUMBLINE_TEST_FRONTEND_TIMED_POSES_H_

#include <plumbline/frontend/timed_pose.h>

namespace plumbline {

inline TimedPose At(double timestamp, double x, double y, double theta) {
  TimedPose timed;
  timed.timestamp = timestamp;
  timed.pose = Pose2(x, y, theta);
  return timed;
}

}  // namespace plumbline

#endif  // PLUMBLINE_TEST_FRONTEND_TIMED_POSES_H_
