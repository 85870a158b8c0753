#ifndef PLUMBLINE_FRONTEND_MISSED_MOTION_H_
#define PLUMBLINE_FRONTEND_MISSED_MOTION_H_

#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/odometry_refinement.h>

#include <vector>

namespace plumbline {

/// Scans that odometry alone placed or had stand, between two that were
/// matched.
struct BlindRun {
  /// The last scan before them and the first one after.
  int begin = 0;
  int end = 0;
  /// What odometry had missed by `end` (RefinedScan::missed).
  Pose2 missed = Pose2::Zero();
};

/// Those after which something was missing, in the order of the log. `refined`
/// has all scans of the log.
std::vector<BlindRun> FindBlindRuns(const std::vector<RefinedScan>& refined);

/// Spreads what odometry missed over the scans that were placed by it alone:
/// where they could not be matched for a while, the first one that is matched
/// again shows what was missed by then, and all of it would be a leap there.
/// Each gets the share of it that its way has, a turn on the spot counting as
/// way. Changes `pose` and `since_key.mean` of these scans and nothing else.
/// To be done once. Cost: linear.
void SpreadMissedMotion(std::vector<RefinedScan>* refined);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_MISSED_MOTION_H_
