#ifndef PLUMBLINE_APPS_EVALUATION_TRAJECTORY_FILE_H_
#define PLUMBLINE_APPS_EVALUATION_TRAJECTORY_FILE_H_

#include <plumbline/frontend/bags/transform_tree.h>
#include <plumbline/frontend/timed_pose.h>

#include <string>
#include <vector>

namespace plumbline {

/// A pose of a trajectory in space.
struct TimedPose3 {
  /// s; the number of the pose, from 0, where the file has no times.
  double timestamp = 0.0;
  /// Pose of the body in the trajectory's frame.
  Pose3 pose;
};

/// A trajectory as a file has it, in the order of the file.
struct TrajectoryFile {
  /// The path, for messages.
  std::string name;
  /// "TUM", "KITTI", "ROS 1 bag", ...: for people.
  std::string format;
  /// The topic or transform of a bag; empty otherwise.
  std::string source;
  /// False for KITTI: its poses have numbers only.
  bool has_times = true;
  std::vector<TimedPose3> poses;
  /// What was passed over or is odd about it, a line each.
  std::vector<std::string> notes;
};

/// Reads a trajectory, plain or compressed; its kind is told by its contents:
///
/// * TUM: `timestamp x y z qx qy qz qw` a line, quaternions of unit length;
/// * KITTI: the 12 numbers of a 3x4 matrix [R t] a line, row by row, R a
///   rotation (to 1e-3);
/// * a ROS 1 or ROS 2 bag (frontend/bags.md): a topic of type
/// nav_msgs/Odometry,
///   geometry_msgs/PoseStamped or geometry_msgs/PoseWithCovarianceStamped, or,
///   for a `topic` of "tf:PARENT.CHILD", the transform between these frames
///   whenever tf gives one on the way. An empty `topic` stands for the only one
///   there is. Poses have the time stamps of their headers.
///
/// Empty lines and comments (#) are passed over. Throws Error, with file and
/// line, for anything else: numbers that are missing, too many or not finite,
/// no rotation, damaged compression, no pose at all; and for a bag without such
/// a topic, or with several where `topic` names none, listing them.
TrajectoryFile ReadTrajectory(const std::string& path,
                              const std::string& topic = "");

/// The poses in the plane: z, roll and pitch are dropped.
std::vector<TimedPose> InPlane(const TrajectoryFile& trajectory);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_EVALUATION_TRAJECTORY_FILE_H_
