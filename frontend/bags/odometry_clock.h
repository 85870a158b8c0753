#ifndef PLUMBLINE_FRONTEND_BAGS_ODOMETRY_CLOCK_H_
#define PLUMBLINE_FRONTEND_BAGS_ODOMETRY_CLOCK_H_

#include <plumbline/frontend/bags/bag_messages.h>
#include <plumbline/frontend/bags/bag_sources.h>
#include <plumbline/frontend/bags/scan_maker.h>
#include <plumbline/frontend/log_reader.h>

#include <cstdint>
#include <functional>
#include <vector>

namespace plumbline {

/// By how much odometry's clock differs from that of the scans.
struct ClockChoice {
  /// ns, to be added to the times of odometry.
  std::int64_t difference = 0;
  /// Whether the scans told it; else it was guessed.
  bool is_told = false;
};

/// Finds out whether time stamps of odometry are to be moved. `difference`, ns:
/// what makes odometry as late at the recorder as the scans. Either the clocks
/// differ by about that (by up to 2.5 s more or less, since messages take
/// different times to be recorded), or messages of one kind are only recorded
/// later, as those of a slow laser are, and the stamps are right. Odometry has
/// to lay scans that were taken one after another on each other, which tells
/// the two apart wherever the robot turned or moved unevenly. Where it did not,
/// stamps that overlap with those of half the scans are believed.
///
/// Scans are in the order of the bag; `mount_of` says where the laser is on the
/// robot.
ClockChoice ChooseClock(
    const LaserOptions& options, const std::vector<BagScan>& scans,
    const std::function<LaserPlacement(const BagScan&)>& mount_of,
    const BagMotion& motion, std::int64_t difference);

/// The same where nothing else says that clocks differ: looks up to half a
/// second about the time stamps. So little smears scans in which motion is
/// undone. No difference unless scans tell it clearly, nor for lasers that
/// see much and do not say how long they take to it.
ClockChoice FindSmallClockDifference(
    const LaserOptions& options, const std::vector<BagScan>& scans,
    const std::function<LaserPlacement(const BagScan&)>& mount_of,
    const BagMotion& motion);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_BAGS_ODOMETRY_CLOCK_H_
