#ifndef PLUMBLINE_FRONTEND_SCAN_H_
#define PLUMBLINE_FRONTEND_SCAN_H_

#include <plumbline/factors/pose2.h>

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace plumbline {

/// One laser scan of a log.
struct Scan {
  /// Seconds, as in the log (the message's own logger or IPC time stamp that
  /// the relations name).
  double timestamp = 0.0;
  /// The time stamp as the log wrote it, so that it can be written back.
  std::string timestamp_text;
  /// Raw odometry: pose of the robot (not of the laser) in the odometry frame.
  Pose2 odometry = Pose2::Zero();
  /// Pose of the laser in the robot's frame.
  Pose2 laser_offset = Pose2::Zero();
  /// Direction of the first beam in the laser's frame and step between beams,
  /// rad.
  double start_angle = 0.0;
  double angle_step = 0.0;
  /// Range of the laser, m: readings at or above it (within the reader's
  /// margin) are "no return".
  double maximum_range = 0.0;
  /// m, one per beam. A reading that is not a return (NaN, negative, zero, at
  /// or above maximum_range) is stored as 0.
  std::vector<float> ranges;
  /// Line of the log that it stood on, from 1.
  int line = 0;
};

/// Something in the input that was passed over, and how often.
struct SkipReport {
  /// What was wrong and what was expected: one text a kind.
  std::string reason;
  std::int64_t count = 0;
  /// The first lines where it happened (at most 5), from 1.
  std::vector<int> first_lines;
};

/// A log as it was read.
struct Log {
  /// In the order of the file, which is right even where time stamps are not.
  std::vector<Scan> scans;
  /// PARAM messages, last value of each name.
  std::map<std::string, std::string> parameters;
  /// Messages by name that were understood.
  std::map<std::string, std::int64_t> messages;
  std::vector<SkipReport> skipped;
  /// Name of the message that gave the scans.
  std::string scan_message;
  /// False when no scan had odometry that ever changed: the front-end has to
  /// do without.
  bool has_odometry = false;
  /// Scans whose number of beams differs from the scan before.
  std::int64_t beam_count_changes = 0;
  /// Time stamps that jump back against the scan before, and by how much at
  /// most, s.
  std::int64_t time_reversals = 0;
  double largest_time_reversal = 0.0;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_SCAN_H_
