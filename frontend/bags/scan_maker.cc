#include <plumbline/factors/angle.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/bags/scan_maker.h>
#include <plumbline/frontend/scan_sweep.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

namespace plumbline {
namespace {

constexpr double kNanoseconds = 1e9;  // in a second
// A reading is no return from this far below the maximum range on, m.
constexpr double kMaximumRangeMargin = 0.001;
// Stated maximum ranges beyond it are taken for none, m.
constexpr double kAbsurdMaximumRange = 1000.0;
constexpr double kDefaultMaximumRange = 80.0;
// Of more readings every second, third, ... is used.
constexpr std::size_t kMostBeamsUsed = 10000;
// Nobody takes longer over a scan, s, nor than from one scan to the next, but
// for what clocks differ by.
constexpr double kLongestScan = 1.0;
constexpr double kLongestSweep = 1.2;
// A laser that sees so much, rad, turns all the time: unless most of its scans
// are missing, a sweep takes no less than this share of the time between two.
const double kWholeTurn = DegToRad(350.0);
constexpr double kShortestSweep = 0.1;
// Poses that a turn of the laser is sampled with.
constexpr int kSweepSamples = 16;

std::string SecondsText(std::int64_t nanoseconds) {
  char text[40];
  const bool is_negative = nanoseconds < 0;
  const auto size = is_negative ? 0 - static_cast<std::uint64_t>(nanoseconds)
                                : static_cast<std::uint64_t>(nanoseconds);
  std::snprintf(text, sizeof text, "%s%llu.%09llu", is_negative ? "-" : "",
                static_cast<unsigned long long>(size / 1000000000),
                static_cast<unsigned long long>(size % 1000000000));
  return text;
}

// LaserScan has its ranges as floats. Of all that this float may stand for the
// one with few digits is meant.
double RoundRange(double range) {
  const double round = std::round(range * 1e4) / 1e4;
  return static_cast<float>(round) == static_cast<float>(range) ? round : range;
}

// Median, s; 0 where nothing is known.
double TimeBetweenScans(const std::vector<BagScan>& scans) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < scans.size(); ++i) {
    const auto step = static_cast<double>(scans[i].stamp - scans[i - 1].stamp);
    if (step > 0.0) steps.push_back(step / kNanoseconds);
  }
  if (steps.empty()) return 0.0;
  const auto middle =
      steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle;
}

}  // namespace

ScanMaker::ScanMaker(const LaserOptions& options, const BagMotion* motion,
                     const std::vector<BagScan>& scans)
    : options_(options), motion_(motion), period_(TimeBetweenScans(scans)) {}

Scan ScanMaker::Make(const BagScan& raw, const LaserPlacement& mount,
                     SkipCounter* skips) {
  const LaserScanMessage& message = raw.message;
  Scan scan;
  scan.timestamp = SecondsOf(raw.stamp - raw.set_back);
  scan.timestamp_text = SecondsText(raw.stamp - raw.set_back);
  scan.line = raw.position;
  scan.odometry = motion_->At(raw.stamp);
  scan.laser_offset = mount.pose;
  scan.maximum_range =
      options_.laser_max_range ? *options_.laser_max_range
      : message.range_max > 0.0 && message.range_max <= kAbsurdMaximumRange
          ? RoundRange(message.range_max)
          : kDefaultMaximumRange;
  const double least =
      message.range_min > 0.0 && message.range_min < scan.maximum_range
          ? message.range_min
          : 0.0;
  const std::size_t n = message.ranges.size();
  const std::size_t stride = (n + kMostBeamsUsed - 1) / kMostBeamsUsed;
  if (stride > 1) {
    skips->Add(
        "beams of a scan of more than 10000: every second, "
        "third, ... is used",
        raw.position);
  }
  for (std::size_t i = 0; i < n; i += stride) {
    const float range = message.ranges[i];
    // Infinite where nothing was near enough, and not a number, compare so.
    const bool is_return = range > 0.0f && range >= static_cast<float>(least) &&
                           range < scan.maximum_range - kMaximumRangeMargin;
    scan.ranges.push_back(is_return ? range : 0.0f);
    ++readings_;
    if (is_return) ++returns_;
    if (std::isfinite(range) && range > scan.maximum_range) ++beyond_;
  }
  scan.start_angle = message.angle_min;
  scan.angle_step = message.angle_increment * static_cast<double>(stride);
  UndoMotion(raw, mount, stride, &scan);
  // Beams run counterclockwise from here on.
  if (mount.is_upside_down) {
    scan.start_angle = -scan.start_angle;
    scan.angle_step = -scan.angle_step;
    for (float& bearing : scan.bearings) bearing = -bearing;
  }
  if (scan.angle_step < 0.0) {
    std::reverse(scan.ranges.begin(), scan.ranges.end());
    std::reverse(scan.bearings.begin(), scan.bearings.end());
    scan.start_angle +=
        scan.angle_step * static_cast<double>(scan.ranges.size() - 1);
    scan.angle_step = -scan.angle_step;
  }
  return scan;
}

ScanMaker::Sweep ScanMaker::SweepOf(const LaserScanMessage& message) const {
  const auto n = static_cast<double>(message.ranges.size());
  const double duration = std::abs(message.time_increment) * (n - 1.0);
  if (!(duration > 0.0)) return Sweep::kUnsaid;
  if (!(duration <= kLongestScan) ||
      (period_ > 0.0 && duration > kLongestSweep * period_)) {
    return Sweep::kImpossible;
  }
  return std::abs(message.angle_increment) * n >= kWholeTurn &&
                 duration < kShortestSweep * period_
             ? Sweep::kHasty
             : Sweep::kBelieved;
}

// A laser that turns with the robot sees each beam from another place: puts
// the returns where they are seen from the place of the time stamp, which is
// that of the first beam.
void ScanMaker::UndoMotion(const BagScan& raw, const LaserPlacement& mount,
                           std::size_t stride, Scan* scan) {
  const double step = raw.message.time_increment * static_cast<double>(stride);
  const std::size_t n = scan->ranges.size();
  const double duration = step * static_cast<double>(n - 1);
  if (!motion_->is_known() || !(std::abs(duration) > 0.0)) return;
  switch (SweepOf(raw.message)) {
    case Sweep::kUnsaid:
      return;
    case Sweep::kImpossible:
      ++impossible_sweeps_;
      return;
    case Sweep::kHasty:
      ++hasty_sweeps_;
      return;
    case Sweep::kBelieved:
      break;
  }
  // Of the laser, seen from where it was at first, evenly in time.
  std::vector<Pose2> places;
  // Upside down, the laser sees the robot's motion mirrored.
  const double side = mount.is_upside_down ? -1.0 : 1.0;
  for (int k = 0; k <= kSweepSamples; ++k) {
    const auto time =
        raw.stamp + static_cast<std::int64_t>(std::llround(
                        duration * kNanoseconds * k / kSweepSamples));
    Pose2 place = Compose(
        Inverse(mount.pose),
        Compose(Between(scan->odometry, motion_->At(time)), mount.pose));
    place[1] *= side;
    place[2] *= side;
    places.push_back(place);
  }
  if (UndoSweep(places, scan)) ++undone_;
}

}  // namespace plumbline
