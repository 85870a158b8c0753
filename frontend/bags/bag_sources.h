#ifndef PLUMBLINE_FRONTEND_BAGS_BAG_SOURCES_H_
#define PLUMBLINE_FRONTEND_BAGS_BAG_SOURCES_H_

#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/bags/bag_messages.h>
#include <plumbline/frontend/log_reader.h>
#include <plumbline/frontend/scan.h>

#include <cstdint>
#include <string>
#include <vector>

namespace plumbline {

/// The robot's poses over time by the odometry of a bag. Times are ns on the
/// scans' clock.
class BagMotion {
 public:
  /// Poses of a topic or a transform, in any order.
  void SetPoses(std::vector<BagPose> poses);

  /// Adds a time, ns, to those of all poses. What has no such time is taken as
  /// it was recorded.
  void MoveBy(std::int64_t difference);

  /// Whether there is any odometry.
  bool is_known() const { return !poses_.empty(); }

  /// The pose at a time, interpolated; the first and last hold before and after
  /// them. Zero without odometry.
  Pose2 At(std::int64_t time) const;

  /// Time to the nearest pose, ns; 0 without odometry, and while the robot
  /// stands still between two.
  std::int64_t DistanceTo(std::int64_t time) const;

 private:
  // Ascending.
  std::vector<BagPose> poses_;
};

/// What the log of a bag is made from.
struct BagSources {
  /// Name of the robot's own frame, as odometry has it; may be empty.
  std::string base;
  BagMotion motion;
  /// By how much longer odometry, or the turn rates, took from the time stamp
  /// to being recorded than the scans did, ns, where that is more than half a
  /// second: the clocks may differ by that, or the scans were only late.
  std::int64_t clock_difference = 0;
  /// Where scans have the times at which they were recorded: by how much later
  /// than measured that may be, ns, which is how long a scan takes. Else 0.
  std::int64_t recording_delay = 0;
};

/// Chooses the topics or transforms that scans, odometry and turn rates come
/// from (frontend/bags.md), with times of recording where there is no time
/// stamp. Notes the choice in the figures of the topics and in the log; moves
/// poses and turn rates out of `messages`, which must outlive the result.
/// Throws Error, with a list of what is there, when there is no scan, or more
/// than one topic that could be meant and no option says which.
BagSources ChooseBagSources(const std::string& name,
                            const LaserOptions& options, BagMessages* messages,
                            Log* log);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_BAGS_BAG_SOURCES_H_
