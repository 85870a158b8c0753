#include <plumbline/core/error.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/carmen_messages.h>
#include <plumbline/frontend/carmen_reader.h>
#include <plumbline/frontend/foreign_format.h>
#include <plumbline/frontend/laser_profile.h>
#include <plumbline/frontend/slow_odometry.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

constexpr double kDefaultMaximumRange = 80.0;
// A reading is no return from this far below the nominal maximum range on, m:
// logs round to centimetres and lasers report a little less than they claim.
constexpr double kMaximumRangeMargin = 0.05;
// A stated maximum range above it is in another unit, m.
constexpr double kAbsurdMaximumRange = 200.0;
// Of more than these every second, third, ... is used: 360 degrees in steps of
// 0.036 degrees, 3 mm apart at 5 m.
constexpr int kMostBeamsUsed = 10000;

class CarmenReader {
 public:
  CarmenReader(InputStream* input, const LaserOptions& options)
      : input_(input),
        options_(options),
        messages_(options.laser_step.has_value()) {
    const auto refuse = [](const char* name, double value, const char* range) {
      throw PLUMBLINE_ERROR(std::string(name) + " is " + std::to_string(value),
                            range);
    };
    if (options.laser_start_angle &&
        !(std::abs(*options.laser_start_angle) <= 2.0 * kPi))
      refuse("laser_start_angle", *options.laser_start_angle,
             "radians within a turn");
    if (options.laser_step &&
        !(*options.laser_step != 0.0 && std::abs(*options.laser_step) <= kPi))
      refuse("laser_step", *options.laser_step,
             "radians, not zero and within half a turn");
    if (options.laser_max_range && !(*options.laser_max_range > 0.0))
      refuse("laser_max_range", *options.laser_max_range, "metres above 0");
  }

  Log Read() {
    if (LooksLikeG2o(input_->Peek(std::size_t{1} << 16))) {
      throw Error(input_->name(), 0, "is a g2o graph", "a CARMEN log");
    }
    const std::string foreign =
        ForeignFormat(input_->Peek(std::size_t{1} << 16));
    if (!foreign.empty()) {
      throw Error(input_->name(), 0, "is " + foreign,
                  "a robot's log (CARMEN, CSV, or a ROS 1 or ROS 2 bag) or a "
                  "graph (g2o)");
    }
    is_recognized_ = LooksLikeCarmenLog(input_->Peek(std::size_t{1} << 16));
    std::string_view line;
    while (input_->ReadLine(&line)) {
      if (line.find('\0') != std::string_view::npos) {
        messages_.skips().Add("line with zero bytes: expected text",
                              input_->line_number());
        continue;
      }
      messages_.Read(line, input_->line_number());
    }
    if (!input_->damage().empty()) {
      messages_.skips().Add(
          input_->damage() +
              ": what was unpacked before it is used, the rest is lost",
          input_->line_number());
    }
    log_.parameters = messages_.parameters();
    log_.messages = messages_.counts();
    log_.skipped = messages_.skips().reports();
    ChooseScans();
    PlaceRawScans();
    PlaceLaser();
    if (kind_ != CarmenMessages::kRawLaser) SpreadSlowOdometry(&log_);
    FindReturns();
    ThinScans();
    Examine();
    return std::move(log_);
  }

 private:
  using Kind = CarmenMessages::Kind;

  void ThinScans() {
    SkipReport report;
    report.reason = "beams of a scan of more than " +
                    std::to_string(kMostBeamsUsed) +
                    ": every second, third, ... is used";
    for (Scan& scan : log_.scans) {
      if (ThinScan(kMostBeamsUsed, &scan) == 1) continue;
      ++report.count;
      if (report.first_lines.size() < 5)
        report.first_lines.push_back(scan.line);
    }
    if (report.count > 0) log_.skipped.push_back(std::move(report));
  }

  void ChooseScans() {
    int chosen = 0;
    while (chosen < CarmenMessages::kNumKinds &&
           messages_.scans(static_cast<Kind>(chosen)).scans.empty()) {
      ++chosen;
    }
    if (chosen == CarmenMessages::kNumKinds) {
      // What no reader recognizes comes here, too: its name may say better
      // what it was meant to be.
      throw Error(input_->name(), 0, Found(),
                  is_recognized_
                      ? "a CARMEN log with FLASER, ROBOTLASER1, RAWLASER1 or "
                        "RLASER messages"
                      : ExpectedInFileOf(input_->name()));
    }
    kind_ = static_cast<Kind>(chosen);
    log_.scan_message = CarmenMessages::kNames[kind_];
    for (int other = chosen + 1; other < CarmenMessages::kNumKinds; ++other) {
      const std::vector<Scan>& scans =
          messages_.scans(static_cast<Kind>(other)).scans;
      if (scans.empty()) continue;
      SkipReport report;
      report.reason = std::string(CarmenMessages::kNames[other]) +
                      " passed over: the scans are taken from " +
                      log_.scan_message;
      report.count = static_cast<std::int64_t>(scans.size());
      for (std::size_t i = 0; i < scans.size() && i < 5; ++i) {
        report.first_lines.push_back(scans[i].line);
      }
      log_.skipped.push_back(report);
    }
    CarmenMessages::Scans taken = messages_.TakeScans(kind_);
    log_.scans = std::move(taken.scans);
    lasers_ = std::move(taken.lasers);
  }

  // What the input holds in place of scans, for the refusal.
  std::string Found() const {
    if (input_->line_number() == 0 && input_->damage().empty())
      return "is empty";
    if (input_->line_number() == 0)
      return "nothing of it can be unpacked: " + input_->damage();
    std::string found =
        "no laser scan found: " + std::to_string(input_->line_number()) +
        " lines";
    for (const auto& [name, count] : log_.messages)
      found += ", " + std::to_string(count) + " " + name;
    int listed = 0;
    for (const SkipReport& report : log_.skipped) {
      if (++listed > 3) break;
      found += "; " + std::to_string(report.count) + " x " + report.reason;
      if (!report.first_lines.empty() && report.first_lines.front() > 0)
        found += " (first in line " +
                 std::to_string(report.first_lines.front()) + ")";
    }
    return found;
  }

  // Interpolates the poses of ODOM messages.
  void PlaceRawScans() {
    const std::vector<CarmenMessages::TimedPose>& odometry =
        messages_.odometry();
    if (kind_ != CarmenMessages::kRawLaser || odometry.empty()) return;
    for (std::size_t i = 0; i < log_.scans.size(); ++i) {
      Scan& scan = log_.scans[i];
      const int before = messages_.odometry_before()[i];
      const CarmenMessages::TimedPose& last = odometry[std::max(before, 0)];
      scan.odometry = last.pose;
      const std::size_t after = static_cast<std::size_t>(before + 1);
      if (before < 0 || after >= odometry.size()) continue;
      const CarmenMessages::TimedPose& next = odometry[after];
      const double span = next.timestamp - last.timestamp;
      const double part = (scan.timestamp - last.timestamp) / span;
      if (!(span > 0.0 && part >= 0.0 && part <= 1.0)) continue;
      Pose2 difference = next.pose - last.pose;
      difference[2] = NormalizeAngle(difference[2]);
      scan.odometry = last.pose + part * difference;
      scan.odometry[2] = NormalizeAngle(scan.odometry[2]);
    }
  }

  void PlaceLaser() {
    const bool rear = kind_ == CarmenMessages::kRlaser;
    Pose2 offset(
        messages_.Parameter(
            rear ? "robot_rearlaser_offset" : "robot_frontlaser_offset", 0.0),
        0.0, rear ? kPi : 0.0);
    if (kind_ != CarmenMessages::kRawLaser) {
      const LaserMount mount = FindLaserMount(log_.scans, lasers_);
      if (mount.is_fixed && mount.is_on_robot) {
        offset = mount.pose;
      } else {
        SkipReport report;
        report.reason =
            mount.is_fixed
                ? "laser pose, not its scan: 5 m or more from the robot, whose "
                  "pose alone is used"
                : "laser pose, not its scan: at no fixed place on the robot (a "
                  "corrected log?), whose pose alone is used";
        report.count = static_cast<std::int64_t>(log_.scans.size());
        // Too far away are all of them, also where none is apart.
        const std::size_t places =
            mount.is_fixed ? log_.scans.size() : mount.apart.size();
        for (std::size_t i = 0; i < places && i < 5; ++i) {
          const std::size_t scan =
              mount.is_fixed ? i : static_cast<std::size_t>(mount.apart[i]);
          report.first_lines.push_back(log_.scans[scan].line);
        }
        log_.skipped.push_back(report);
      }
    }
    for (Scan& scan : log_.scans)
      scan.laser_offset = offset + Pose2::Zero();  // no -0
  }

  void FindReturns() {
    const bool rear = kind_ == CarmenMessages::kRlaser;
    const bool old_format = kind_ == CarmenMessages::kFlaser || rear;
    double nominal = messages_.Parameter(
        rear ? "robot_rear_laser_max" : "robot_front_laser_max", 0.0);
    if (!(nominal > 0.0 && nominal <= kAbsurdMaximumRange))
      nominal = kDefaultMaximumRange;
    const double resolution = DegToRad(messages_.Parameter(
        rear ? "laser_rear_laser_resolution" : "laser_front_laser_resolution",
        0.0));
    double largest = 0.0;
    for (Scan& scan : log_.scans) {
      if (old_format) {
        const BeamFan fan =
            FanOfBeams(static_cast<int>(scan.ranges.size()), resolution);
        scan.start_angle = fan.start_angle;
        scan.angle_step = fan.angle_step;
      }
      if (options_.laser_start_angle)
        scan.start_angle = *options_.laser_start_angle;
      if (options_.laser_step) scan.angle_step = *options_.laser_step;
      if (!(scan.maximum_range > 0.0)) scan.maximum_range = nominal;
      if (options_.laser_max_range)
        scan.maximum_range = *options_.laser_max_range;
      largest = std::max(largest, scan.maximum_range);
    }
    const double saturated =
        options_.laser_max_range
            ? 0.0
            : SaturatedRange(log_.scans, largest - kMaximumRangeMargin);
    for (Scan& scan : log_.scans) {
      double no_return = scan.maximum_range - kMaximumRangeMargin;
      if (saturated > 0.0 && saturated < no_return) {
        scan.maximum_range = saturated;
        no_return = saturated;
      }
      for (float& range : scan.ranges) {
        if (range >= no_return) range = 0.0f;
      }
    }
  }

  void Examine() {
    for (std::size_t i = 1; i < log_.scans.size(); ++i) {
      const Scan& before = log_.scans[i - 1];
      const Scan& scan = log_.scans[i];
      if (scan.odometry != log_.scans[0].odometry) log_.has_odometry = true;
      if (scan.ranges.size() != before.ranges.size()) ++log_.beam_count_changes;
      const double back = before.timestamp - scan.timestamp;
      if (back > 0.0) {
        ++log_.time_reversals;
        log_.largest_time_reversal = std::max(log_.largest_time_reversal, back);
      }
    }
  }

  InputStream* input_;
  LaserOptions options_;
  // Whether its beginning is that of a CARMEN log.
  bool is_recognized_ = false;
  CarmenMessages messages_;
  Log log_;
  Kind kind_ = CarmenMessages::kFlaser;
  // Of log_.scans.
  std::vector<Pose2> lasers_;
};

enum class TextFormat { kUnknown, kCarmen, kG2o };

TextFormat RecognizeFormat(std::string_view prefix) {
  constexpr std::array<std::string_view, 12> kCarmenNames = {
      "FLASER",    "RLASER",    "ODOM",        "PARAM",
      "SYNC",      "TRUEPOS",   "ROBOTLASER1", "ROBOTLASER2",
      "RAWLASER1", "RAWLASER2", "COMMENT",     "NMEA-GGA"};
  while (!prefix.empty()) {
    const std::size_t end = prefix.find('\n');
    const std::string_view tag = CarmenTokens(prefix.substr(0, end)).Next();
    // VERTEX_SE2, and TORO's VERTEX2.
    if (tag.substr(0, 6) == "VERTEX" || tag.substr(0, 4) == "EDGE" ||
        tag.substr(0, 7) == "PARAMS_" || tag.substr(0, 10) == "PLUMBLINE_" ||
        tag == "FIX")
      return TextFormat::kG2o;
    if (std::find(kCarmenNames.begin(), kCarmenNames.end(), tag) !=
        kCarmenNames.end())
      return TextFormat::kCarmen;
    if (end == std::string_view::npos) break;
    prefix.remove_prefix(end + 1);
  }
  return TextFormat::kUnknown;
}

}  // namespace

Log ReadCarmenLog(const std::string& path, const LaserOptions& options) {
  InputStream input(path);
  return ReadCarmenLog(&input, options);
}

Log ReadCarmenLog(InputStream* input, const LaserOptions& options) {
  return CarmenReader(input, options).Read();
}

bool LooksLikeCarmenLog(std::string_view prefix) {
  return RecognizeFormat(prefix) == TextFormat::kCarmen;
}

bool LooksLikeG2o(std::string_view prefix) {
  return RecognizeFormat(prefix) == TextFormat::kG2o;
}

}  // namespace plumbline
