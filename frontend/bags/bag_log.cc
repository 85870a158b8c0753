#include <plumbline/core/error.h>
#include <plumbline/factors/angle.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/bags/bag_log.h>
#include <plumbline/frontend/bags/bag_messages.h>
#include <plumbline/frontend/bags/bag_sources.h>
#include <plumbline/frontend/scan_sweep.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <utility>

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
// Scans that were recorded out of order are put in order so far, s and scans.
// Who sets a clock back by more means it.
constexpr double kOrderSeconds = 1.0;
constexpr std::size_t kOrderScans = 100;
// Odometry farther from a scan than this, s, is worth a word.
constexpr double kFarOdometry = 1.0;
// Nobody takes longer over a scan, s, nor than from one scan to the next, but
// for what clocks differ by.
constexpr double kLongestScan = 1.0;
constexpr double kLongestSweep = 1.2;
// Poses that a turn of the laser is sampled with.
constexpr int kSweepSamples = 16;
// cos of the angle by which a laser's plane may be out of level.
const double kLevel = std::cos(DegToRad(20.0));

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

// Makes the scans of a log from those of a bag.
class ScanPlacer {
 public:
  ScanPlacer(const LaserOptions& options, BagSources sources,
             BagMessages* messages, Log* log)
      : options_(options),
        sources_(std::move(sources)),
        messages_(messages),
        tree_(messages->tree),
        frames_(messages->frames),
        scans_(messages->scans),
        log_(log) {}

  void Place() {
    SortScans();
    ChooseBase();
    PlaceScans();
    Examine();
  }

  // What was passed over.
  const std::vector<SkipReport>& skipped() const { return skips_.reports(); }

 private:
  // Puts scans that are a little out of order where they belong.
  void SortScans() {
    std::int64_t moved = 0;
    for (std::size_t i = 1; i < scans_.size(); ++i) {
      std::size_t j = i;
      while (j > 0 && i - j < kOrderScans &&
             scans_[j].stamp < scans_[j - 1].stamp &&
             static_cast<double>(scans_[j - 1].stamp - scans_[j].stamp) <=
                 kOrderSeconds * kNanoseconds) {
        std::swap(scans_[j], scans_[j - 1]);
        --j;
      }
      if (j < i) ++moved;
    }
    if (moved > 0) {
      log_->notes.push_back(std::to_string(moved) +
                            " scans were recorded out of order: they are put "
                            "in the order of their time stamps");
    }
  }

  // The laser on the robot; whether it is upside down.
  struct Mount {
    Pose2 pose = Pose2::Zero();
    bool is_upside_down = false;
    bool is_known = false;
    bool is_tilted = false;
    bool is_moving = false;
  };

  Mount MountAt(std::size_t frame, std::int64_t time) const {
    Mount mount;
    Pose3 pose;
    if (sources_.base.empty() || frames_[frame].empty() ||
        !tree_.LookupAnyWay(sources_.base, frames_[frame], time, &pose)) {
      return mount;
    }
    mount.is_known = true;
    const Eigen::Matrix3d rotation = pose.rotation.toRotationMatrix();
    mount.is_upside_down = rotation(2, 2) < 0.0;
    mount.is_tilted = std::abs(rotation(2, 2)) < kLevel;
    const auto round = [](double value) {
      return std::round(value * 1e9) / 1e9 + 0.0;  // no -0
    };
    // Composed of several transforms it is a little off, as a quaternion is.
    mount.pose = Pose2(round(pose.translation.x()), round(pose.translation.y()),
                       round(std::atan2(rotation(1, 0), rotation(0, 0))));
    return mount;
  }

  // The robot's own frame where odometry does not name one that tf knows.
  void ChooseBase() {
    Pose3 pose;
    if (!sources_.base.empty() &&
        tree_.LookupAnyWay(sources_.base, frames_[0], scans_.front().stamp,
                           &pose)) {
      return;
    }
    const std::vector<std::string> chain = tree_.ChainOf(frames_[0]);
    if (chain.size() < 2) return;
    // The last frame of the robot itself: what stands still to the laser.
    std::size_t top = 0;
    while (top + 1 < chain.size() && !tree_.IsMoving(chain[top]) &&
           chain[top + 1].find("odom") == std::string::npos &&
           chain[top + 1] != "map" && chain[top + 1] != "world") {
      ++top;
    }
    if (top == 0) return;
    if (!sources_.base.empty()) {
      log_->notes.push_back("odometry is of the frame '" + sources_.base +
                            "', which tf does not tie to the laser's frame '" +
                            frames_[0] + "': it is taken for '" + chain[top] +
                            "'");
    }
    sources_.base = chain[top];
  }

  // The laser on the robot, by frame.
  std::vector<Mount> FindMounts() {
    std::vector<Mount> mounts;
    bool any_known = false;
    for (std::size_t f = 0; f < frames_.size(); ++f) {
      Mount mount = MountAt(f, scans_.front().stamp);
      for (const std::string& name : tree_.ChainOf(frames_[f])) {
        if (name == sources_.base) break;
        mount.is_moving |= tree_.IsMoving(name);
      }
      mount.is_moving &= mount.is_known;
      any_known |= mount.is_known;
      mounts.push_back(mount);
      NoteMount(mount, frames_[f]);
    }
    if (any_known) messages_->NoteTransformsUsed("place of the laser");
    return mounts;
  }

  void PlaceScans() {
    const std::vector<Mount> mounts = FindMounts();
    period_ = TimeBetweenScans();
    const BagScan* before = nullptr;
    std::vector<float> ranges_before;
    std::int64_t far = 0;
    log_->scans.reserve(scans_.size());
    for (BagScan& raw : scans_) {
      if (before != nullptr && raw.stamp == before->stamp &&
          SameReadings(raw.message.ranges, ranges_before)) {
        skips_.Add("scan that was recorded twice", raw.position);
        continue;
      }
      before = &raw;
      Mount mount = mounts[raw.frame];
      if (mount.is_moving) mount = MountAt(raw.frame, raw.stamp);
      Scan scan = MakeScan(raw, mount);
      if (static_cast<double>(sources_.motion.DistanceTo(raw.stamp)) >
          kFarOdometry * kNanoseconds) {
        ++far;
      }
      log_->scans.push_back(std::move(scan));
      // Frees what was taken over before.
      ranges_before = std::move(raw.message.ranges);
    }
    if (far > 0) {
      log_->notes.push_back(
          std::to_string(far) +
          " scans are more than 1 s from the next odometry: they are placed "
          "by what is nearest");
    }
  }

  // Median, s; 0 where nothing is known.
  double TimeBetweenScans() const {
    std::vector<double> steps;
    for (std::size_t i = 1; i < scans_.size(); ++i) {
      const auto step =
          static_cast<double>(scans_[i].stamp - scans_[i - 1].stamp);
      if (step > 0.0) steps.push_back(step / kNanoseconds);
    }
    if (steps.empty()) return 0.0;
    const auto middle =
        steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
    std::nth_element(steps.begin(), middle, steps.end());
    return *middle;
  }

  void NoteMount(const Mount& mount, const std::string& frame) {
    if (!mount.is_known) {
      log_->notes.push_back(
          "tf does not say where the laser's frame '" + frame + "' is" +
          (sources_.base.empty() ? std::string()
                                 : " in '" + sources_.base + "'") +
          (tree_.empty() ? " (there is no tf)" : "") +
          ": the laser is taken to be at the robot's centre, looking ahead");
    } else if (mount.is_tilted) {
      log_->notes.push_back(
          "the laser '" + frame +
          "' is tilted by more than 20 degrees: its scans are "
          "taken for level");
    }
  }

  // As bytes: what is not a number is no other than itself.
  static bool SameReadings(const std::vector<float>& a,
                           const std::vector<float>& b) {
    return a.size() == b.size() &&
           std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0;
  }

  Scan MakeScan(const BagScan& raw, const Mount& mount) {
    const LaserScanMessage& message = raw.message;
    Scan scan;
    scan.timestamp = SecondsOf(raw.stamp);
    scan.timestamp_text = SecondsText(raw.stamp);
    scan.line = raw.position;
    scan.odometry = sources_.motion.At(raw.stamp);
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
      skips_.Add(
          "beams of a scan of more than 10000: every second, "
          "third, ... is used",
          raw.position);
    }
    for (std::size_t i = 0; i < n; i += stride) {
      const float range = message.ranges[i];
      // Infinite where nothing was near enough, and not a number, compare so.
      const bool is_return = range > 0.0f &&
                             range >= static_cast<float>(least) &&
                             range < scan.maximum_range - kMaximumRangeMargin;
      scan.ranges.push_back(is_return ? range : 0.0f);
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

  // A laser that turns with the robot sees each beam from another place: puts
  // the returns where they are seen from the place of the time stamp, which is
  // that of the first beam.
  void UndoMotion(const BagScan& raw, const Mount& mount, std::size_t stride,
                  Scan* scan) {
    const double step =
        raw.message.time_increment * static_cast<double>(stride);
    const std::size_t n = scan->ranges.size();
    const double duration = step * static_cast<double>(n - 1);
    if (!sources_.motion.is_known() || !(std::abs(duration) > 0.0)) return;
    if (!(std::abs(duration) <= kLongestScan) ||
        (period_ > 0.0 && std::abs(duration) > kLongestSweep * period_)) {
      ++impossible_sweeps_;
      return;
    }
    // Of the laser, seen from where it was at first, evenly in time.
    std::vector<Pose2> places;
    // Upside down, the laser sees the robot's motion mirrored.
    const double side = mount.is_upside_down ? -1.0 : 1.0;
    for (int k = 0; k <= kSweepSamples; ++k) {
      const auto time =
          raw.stamp + static_cast<std::int64_t>(std::llround(
                          duration * kNanoseconds * k / kSweepSamples));
      Pose2 place =
          Compose(Inverse(mount.pose),
                  Compose(Between(scan->odometry, sources_.motion.At(time)),
                          mount.pose));
      place[1] *= side;
      place[2] *= side;
      places.push_back(place);
    }
    if (UndoSweep(places, scan)) ++undone_;
  }

  void Examine() {
    for (std::size_t i = 1; i < log_->scans.size(); ++i) {
      const Scan& before = log_->scans[i - 1];
      const Scan& scan = log_->scans[i];
      if (scan.odometry != log_->scans[0].odometry) log_->has_odometry = true;
      if (scan.ranges.size() != before.ranges.size())
        ++log_->beam_count_changes;
      const double back = before.timestamp - scan.timestamp;
      if (back > 0.0) {
        ++log_->time_reversals;
        log_->largest_time_reversal =
            std::max(log_->largest_time_reversal, back);
      }
    }
    if (!log_->has_odometry && sources_.motion.is_known()) {
      log_->notes.push_back(log_->odometry_source +
                            " never changes: it is taken for none");
      log_->odometry_source.clear();
    }
    if (impossible_sweeps_ > 0) {
      log_->notes.push_back(
          "time_increment of " + std::to_string(impossible_sweeps_) + " of " +
          std::to_string(log_->scans.size()) +
          " scans says that a sweep takes longer than from one scan to the "
          "next: it is not believed");
    }
    if (undone_ > 0) {
      log_->notes.push_back("motion during the scan was undone in " +
                            std::to_string(undone_) + " of " +
                            std::to_string(log_->scans.size()) + " scans");
    }
  }

  const LaserOptions& options_;
  BagSources sources_;
  BagMessages* messages_;
  const TransformTree& tree_;
  const std::vector<std::string>& frames_;
  std::vector<BagScan>& scans_;
  Log* log_;
  SkipCounter skips_;
  std::int64_t undone_ = 0;
  std::int64_t impossible_sweeps_ = 0;
  double period_ = 0.0;
};

void AppendReports(const std::vector<SkipReport>& reports, Log* log) {
  log->skipped.insert(log->skipped.end(), reports.begin(), reports.end());
}

void NoteEnds(const BagMessages& messages, Log* log) {
  if (messages.other_ends == 0) return;
  char text[200];
  std::snprintf(text, sizeof text,
                "%lld scans end at another angle than they say, the first at "
                "%.2f degrees by angle_increment and at %.2f by angle_max: "
                "angle_increment is believed (--laser_step says another)",
                static_cast<long long>(messages.other_ends),
                RadToDeg(messages.end_by_step), RadToDeg(messages.stated_end));
  log->notes.push_back(text);
}

void TellTopics(const BagMessages& messages, const LaserOptions& options,
                Log* log) {
  for (const BagStream& stream : messages.streams) {
    log->topics.push_back(stream.seen);
    if (stream.seen.messages == 0) continue;
    log->messages[stream.seen.name] += stream.seen.messages;
  }
  if (options.on_topics) options.on_topics(log->topics);
}

}  // namespace

Log ReadBag(BagSource* source, const std::string& name,
            const LaserOptions& options) {
  Log log;
  log.format = source->format();
  log.position_unit = "message";
  BagMessages messages = CollectBagMessages(source, options);
  AppendReports(messages.skipped_by_source, &log);
  AppendReports(messages.skipped, &log);
  log.notes = source->notes();
  NoteEnds(messages, &log);
  try {
    ScanPlacer placer(options, ChooseBagSources(name, options, &messages, &log),
                      &messages, &log);
    placer.Place();
    AppendReports(placer.skipped(), &log);
  } catch (const Error&) {
    TellTopics(messages, options, &log);
    throw;
  }
  TellTopics(messages, options, &log);
  return log;
}

}  // namespace plumbline
