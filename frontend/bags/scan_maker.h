#ifndef PLUMBLINE_FRONTEND_BAGS_SCAN_MAKER_H_
#define PLUMBLINE_FRONTEND_BAGS_SCAN_MAKER_H_

#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/bags/bag_messages.h>
#include <plumbline/frontend/bags/bag_sources.h>
#include <plumbline/frontend/log_reader.h>
#include <plumbline/frontend/scan.h>
#include <plumbline/frontend/skip_counter.h>

#include <cstdint>
#include <vector>

namespace plumbline {

/// The laser on the robot, by tf.
struct LaserPlacement {
  /// In the robot's frame.
  Pose2 pose = Pose2::Zero();
  bool is_upside_down = false;
  bool is_known = false;
  bool is_tilted = false;
  /// It moves: it has to be looked up for each scan.
  bool is_moving = false;
};

/// Makes scans from messages: beams run counterclockwise, what is no return is
/// 0, and what the robot moved during a sweep is undone by odometry.
class ScanMaker {
 public:
  /// `motion` must outlive the object. `scans`: all of the bag, which tell how
  /// long a sweep can take at most.
  ScanMaker(const LaserOptions& options, const BagMotion* motion,
            const std::vector<BagScan>& scans);

  /// The scan of a message. Counts what of it was not used in `skips`.
  Scan Make(const BagScan& raw, const LaserPlacement& mount,
            SkipCounter* skips);

  /// Scans whose time_increment cannot be: a sweep would take longer than from
  /// one scan to the next, or a whole turn hardly any of that time.
  std::int64_t impossible_sweeps() const { return impossible_sweeps_; }
  std::int64_t hasty_sweeps() const { return hasty_sweeps_; }
  /// Readings of all scans, those that are returns, and those beyond the
  /// maximum range.
  std::int64_t readings() const { return readings_; }
  std::int64_t returns() const { return returns_; }
  std::int64_t beyond() const { return beyond_; }
  /// Scans in which motion was undone.
  std::int64_t undone() const { return undone_; }

  /// Whether a scan says how long the laser takes to it, and that can be.
  bool IsSweepBelieved(const LaserScanMessage& message) const {
    return SweepOf(message) == Sweep::kBelieved;
  }

 private:
  enum class Sweep { kUnsaid, kImpossible, kHasty, kBelieved };
  Sweep SweepOf(const LaserScanMessage& message) const;
  void UndoMotion(const BagScan& raw, const LaserPlacement& mount,
                  std::size_t stride, Scan* scan);

  const LaserOptions& options_;
  const BagMotion* motion_;
  // Median time between scans, s; 0 where nothing is known.
  double period_ = 0.0;
  std::int64_t readings_ = 0;
  std::int64_t returns_ = 0;
  std::int64_t beyond_ = 0;
  std::int64_t impossible_sweeps_ = 0;
  std::int64_t hasty_sweeps_ = 0;
  std::int64_t undone_ = 0;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_BAGS_SCAN_MAKER_H_
