#include <plumbline/core/error.h>
#include <plumbline/factors/angle.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/bags/bag_log.h>
#include <plumbline/frontend/bags/bag_messages.h>
#include <plumbline/frontend/bags/bag_sources.h>
#include <plumbline/frontend/bags/odometry_clock.h>
#include <plumbline/frontend/bags/scan_maker.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <utility>

namespace plumbline {
namespace {

constexpr double kNanoseconds = 1e9;  // in a second
// Scans that were recorded out of order are put in order so far, s and scans.
// Who sets a clock back by more means it.
constexpr double kOrderSeconds = 1.0;
constexpr std::size_t kOrderScans = 100;
// Odometry is left out where the time stamps of more than this share of the
// scans came twice.
constexpr double kMostTwice = 0.1;
// Odometry farther from a scan than this, s, is worth a word.
constexpr double kFarOdometry = 1.0;
// Odometry is left out where the robot goes faster, m/s, by the median of steps
// longer than this, m, if there are so many.
constexpr double kMostSpeed = 20.0;
constexpr double kLeastWay = 0.02;
constexpr std::size_t kFewestSpeeds = 20;
// A smaller share of readings that are returns is worth a word.
constexpr double kFewestReturns = 0.02;
// cos of the angle by which a laser's plane may be out of level.
const double kLevel = std::cos(DegToRad(20.0));

// Makes the scans of a log from those of a bag.
class ScanPlacer {
 public:
  ScanPlacer(const LaserOptions& options, BagSources sources,
             BagMessages* messages, Log* log)
      : options_(options),
        sources_(std::move(sources)),
        messages_(messages),
        tree_(messages->tree),
        frames_(messages->scans.frames),
        scans_(messages->scans.list),
        log_(log) {}

  void Place() {
    SortScans();
    ChooseBase();
    FindMounts();
    LeaveAmbiguousOdometry();
    LeaveAbsurdOdometry();
    AgreeOnClock();
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

  LaserPlacement MountAt(std::size_t frame, std::int64_t time) const {
    LaserPlacement mount;
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

  void FindMounts() {
    bool any_known = false;
    for (std::size_t f = 0; f < frames_.size(); ++f) {
      LaserPlacement mount = MountAt(f, scans_.front().stamp);
      for (const std::string& name : tree_.ChainOf(frames_[f])) {
        if (name == sources_.base) break;
        mount.is_moving |= tree_.IsMoving(name);
      }
      mount.is_moving &= mount.is_known;
      any_known |= mount.is_known;
      mounts_.push_back(mount);
      NoteMount(mount, frames_[f]);
    }
    if (any_known) messages_->NoteTransformsUsed("place of the laser");
  }

  // A clock that is set back in the middle of the log goes through the same
  // times twice, and which odometry belongs to which scan is lost.
  void LeaveAmbiguousOdometry() {
    if (!sources_.motion.is_known() && log_->yaw_rates.empty()) return;
    const std::size_t twice = ScansOfTimesThatCameTwice();
    if (twice == 0) return;
    std::string note = "the clock was set back: the time stamps of " +
                       std::to_string(twice) + " of " +
                       std::to_string(scans_.size()) + " scans came twice";
    if (static_cast<double>(twice) <=
        kMostTwice * static_cast<double>(scans_.size())) {
      log_->notes.push_back(note + ", and their odometry may be another's");
      return;
    }
    log_->notes.push_back(note +
                          ": odometry is not used, since it may be another's");
    LeaveOdometry();
  }

  // Odometry in millimetres or centimetres sends the map miles away. A jump is
  // no matter: what counts is how fast the robot goes as a rule.
  void LeaveAbsurdOdometry() {
    std::vector<double> speeds;
    for (std::size_t i = 1; i < scans_.size(); ++i) {
      const double step =
          static_cast<double>(scans_[i].stamp - scans_[i - 1].stamp) /
          kNanoseconds;
      const double way = (sources_.motion.At(scans_[i].stamp) -
                          sources_.motion.At(scans_[i - 1].stamp))
                             .head<2>()
                             .norm();
      if (step > 0.0 && way > kLeastWay) speeds.push_back(way / step);
    }
    if (speeds.size() < kFewestSpeeds) return;
    const auto middle =
        speeds.begin() + static_cast<std::ptrdiff_t>(speeds.size() / 2);
    std::nth_element(speeds.begin(), middle, speeds.end());
    if (*middle <= kMostSpeed) return;
    char text[200];
    std::snprintf(text, sizeof text,
                  " has the robot go at %.0f m/s, as of another unit than "
                  "metres: it is not used",
                  *middle);
    log_->notes.push_back(log_->odometry_source + text);
    LeaveOdometry();
  }

  void LeaveOdometry() {
    sources_.motion = BagMotion();
    sources_.clock_difference = sources_.recording_delay = 0;
    log_->yaw_rates.clear();
    log_->yaw_rate_source.clear();
    log_->odometry_source.clear();
  }

  std::size_t ScansOfTimesThatCameTwice() const {
    // From one setting back to the next, ns.
    std::vector<std::pair<std::int64_t, std::int64_t>> spans;
    for (std::size_t i = 0; i < scans_.size(); ++i) {
      const std::int64_t stamp = scans_[i].stamp;
      if (i == 0 || static_cast<double>(scans_[i - 1].stamp - stamp) >
                        kOrderSeconds * kNanoseconds) {
        spans.emplace_back(stamp, stamp);
      }
      spans.back().first = std::min(spans.back().first, stamp);
      spans.back().second = std::max(spans.back().second, stamp);
    }
    if (spans.size() == 1) return 0;
    return static_cast<std::size_t>(
        std::count_if(scans_.begin(), scans_.end(), [&](const BagScan& scan) {
          return std::count_if(spans.begin(), spans.end(), [&](const auto& s) {
                   return s.first <= scan.stamp && scan.stamp <= s.second;
                 }) > 1;
        }));
  }

  // Odometry, or the turn rates, by the clock of the scans.
  void AgreeOnClock() {
    const bool is_delay = sources_.clock_difference == 0;
    const std::int64_t difference =
        is_delay ? sources_.recording_delay : sources_.clock_difference;
    const auto mount_of = [this](const BagScan& scan) { return MountOf(scan); };
    if (difference == 0) {
      if (!sources_.motion.is_known()) return;
      const ClockChoice choice =
          FindSmallClockDifference(options_, scans_, mount_of, sources_.motion);
      if (!choice.is_told || choice.difference == 0) return;
      char text[120];
      std::snprintf(text, sizeof text,
                    ": %.3f s are added to its time stamps, by which it lays "
                    "the scans on each other best",
                    static_cast<double>(choice.difference) / kNanoseconds);
      log_->notes.push_back(log_->odometry_source + text);
      sources_.motion.MoveBy(choice.difference);
      return;
    }
    const bool is_motion = sources_.motion.is_known();
    const ClockChoice choice = ChooseClock(
        options_, scans_, mount_of,
        is_motion ? sources_.motion : MotionOfTurnRates(), difference);
    if ((choice.is_told || is_delay) && choice.difference == 0) return;
    // What was not stamped is not late unless scans say so.
    if (!choice.is_told && is_delay) return;
    const auto seconds = [](std::int64_t nanoseconds) {
      return static_cast<double>(nanoseconds) / kNanoseconds;
    };
    char text[200];
    if (choice.difference == 0) {
      std::snprintf(text, sizeof text,
                    " was recorded %.3f s %s after its time stamps than the "
                    "scans after theirs; they do not tell whether clocks "
                    "differ, and the time stamps are believed",
                    std::abs(seconds(difference)),
                    difference < 0 ? "sooner" : "later");
    } else {
      std::snprintf(text, sizeof text,
                    is_delay ? ": %.3f s are added, since the scans were "
                               "recorded that much after they were taken"
                             : " is stamped by another clock than the scans: "
                               "%.3f s are added",
                    seconds(choice.difference));
    }
    log_->notes.push_back(
        (is_motion ? log_->odometry_source : log_->yaw_rate_source) + text);
    sources_.motion.MoveBy(choice.difference);
    for (TimedYawRate& rate : log_->yaw_rates) {
      rate.timestamp += seconds(choice.difference);
    }
  }

  BagMotion MotionOfTurnRates() const {
    std::vector<BagPose> poses;
    double before = 0.0;
    double heading = 0.0;
    for (const TimedYawRate& rate : log_->yaw_rates) {
      const double turn = rate.rate * (rate.timestamp - before);
      if (!poses.empty() && std::isfinite(turn)) {
        heading = NormalizeAngle(heading + turn);
      }
      before = rate.timestamp;
      BagPose pose;
      pose.stamp = pose.received = static_cast<std::int64_t>(
          std::llround(rate.timestamp * kNanoseconds));
      pose.pose = Pose2(0.0, 0.0, heading);
      poses.push_back(pose);
    }
    BagMotion motion;
    motion.SetPoses(std::move(poses));
    return motion;
  }

  LaserPlacement MountOf(const BagScan& scan) const {
    const LaserPlacement& mount = mounts_[scan.frame];
    return mount.is_moving ? MountAt(scan.frame, scan.stamp - scan.set_back)
                           : mount;
  }

  void PlaceScans() {
    ScanMaker maker(options_, &sources_.motion, scans_);
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
      Scan scan = maker.Make(raw, MountOf(raw), &skips_);
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
    NoteReturns(maker);
    impossible_sweeps_ = maker.impossible_sweeps();
    hasty_sweeps_ = maker.hasty_sweeps();
    undone_ = maker.undone();
  }

  // A map of hardly any returns is none, and does not say why.
  void NoteReturns(const ScanMaker& maker) {
    const auto readings = static_cast<double>(maker.readings());
    if (static_cast<double>(maker.returns()) >= kFewestReturns * readings) {
      return;
    }
    char text[200];
    std::snprintf(
        text, sizeof text, "%.2g %% of the readings are returns%s",
        100.0 * static_cast<double>(maker.returns()) / readings,
        2.0 * static_cast<double>(maker.beyond()) > readings
            ? ": most lie beyond the maximum range, as if they were of "
              "another unit than metres"
            : "");
    log_->notes.push_back(text);
  }

  void NoteMount(const LaserPlacement& mount, const std::string& frame) {
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
    if (hasty_sweeps_ > 0) {
      log_->notes.push_back(
          "time_increment of " + std::to_string(hasty_sweeps_) + " of " +
          std::to_string(log_->scans.size()) +
          " scans says that a whole turn takes less than a tenth of the time "
          "to the next: it is not believed");
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
  std::int64_t hasty_sweeps_ = 0;
  // By frame.
  std::vector<LaserPlacement> mounts_;
};

void AppendReports(const std::vector<SkipReport>& reports, Log* log) {
  log->skipped.insert(log->skipped.end(), reports.begin(), reports.end());
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
