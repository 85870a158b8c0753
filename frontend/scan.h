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
  /// Directions of the beams in the laser's frame, rad, where they are not
  /// angle_step apart: in a scan taken while the robot turned, seen from where
  /// the laser was at `timestamp`. One per beam, or empty.
  std::vector<float> bearings;
  /// Line of the log that it was on, or number of its message, from 1.
  int line = 0;

  /// Direction of a beam in the laser's frame, rad.
  double Bearing(std::size_t beam) const {
    return bearings.empty()
               ? start_angle + static_cast<double>(beam) * angle_step
               : bearings[beam];
  }
};

/// Something in the input that was passed over, and how often.
struct SkipReport {
  /// What was wrong and what was expected: one text for each kind.
  std::string reason;
  std::int64_t count = 0;
  /// The first lines where it happened (at most 5), from 1; in a bag the
  /// numbers of the messages met last.
  std::vector<int> first_lines;
};

/// A stream of messages of one type in a log: a topic of a bag, or all messages
/// of one name.
struct LogTopic {
  std::string name;
  /// "sensor_msgs/LaserScan"; empty when unknown, or the same as the name.
  std::string type;
  std::int64_t messages = 0;
  /// When they were recorded, s; the longest time between two, s.
  double first_time = 0.0;
  double last_time = 0.0;
  double largest_gap = 0.0;
  /// How often a time stamp is earlier than the one before.
  std::int64_t time_reversals = 0;
  /// What it served as ("scans", "odometry", ...); empty when it was not used.
  std::string use;
  /// Why it was not, where that is worth saying.
  std::string why_not;
};

/// What a gyroscope measured.
struct TimedYawRate {
  /// s
  double timestamp = 0.0;
  /// rad/s, counterclockwise; scale and bias are as the sensor has them.
  double rate = 0.0;
};

/// A log as it was read.
struct Log {
  /// In the order of the file, which is right even where time stamps are not.
  std::vector<Scan> scans;
  /// PARAM messages, last value of each name.
  std::map<std::string, std::string> parameters;
  /// Messages by name that were understood.
  std::map<std::string, std::int64_t> messages;
  /// What kind of log it is, for people: "ROS 1 bag"; empty: CARMEN.
  std::string format;
  /// What SkipReport::first_lines counts: "line" or "message".
  std::string position_unit = "line";
  std::vector<LogTopic> topics;
  /// What was taken for granted or chosen, for people: sentences without a full
  /// stop.
  std::vector<std::string> notes;
  /// Where the odometry comes from: "/odom", "tf odom -> base_link", ...; empty
  /// when the format has one source only.
  std::string odometry_source;
  /// Turn rates in the order of time, where there is no odometry.
  std::vector<TimedYawRate> yaw_rates;
  std::string yaw_rate_source;
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
