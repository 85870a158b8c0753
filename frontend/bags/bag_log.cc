#include <plumbline/core/error.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/bags/bag_log.h>
#include <plumbline/frontend/bags/message_decoder.h>
#include <plumbline/frontend/bags/transform_tree.h>
#include <plumbline/frontend/scan_sweep.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

namespace plumbline {
namespace {

constexpr double kSecond = 1e9;  // ns

// A reading is no return from this far below the maximum range on, m.
constexpr double kMaximumRangeMargin = 0.001;
// Stated maximum ranges beyond it are taken for none, m.
constexpr double kAbsurdMaximumRange = 1000.0;
constexpr double kDefaultMaximumRange = 80.0;
// Of more readings every second, third, ... is used.
constexpr std::size_t kMostBeamsUsed = 10000;
constexpr std::size_t kFewestReadings = 2;
// Scans that were recorded out of order are put in order so far, s and scans.
// Who sets a clock back by more means it.
constexpr double kOrderSeconds = 1.0;
constexpr std::size_t kOrderScans = 100;
// Between the time stamps of two sources and the times at which their messages
// were recorded the delays differ by less, s, or their clocks do.
constexpr double kClockDifference = 0.5;
// Odometry farther from a scan than this, s, is worth a word.
constexpr double kFarOdometry = 1.0;
// Nobody takes longer over a scan, s.
constexpr double kLongestScan = 1.0;
// Poses that a turn of the laser is sampled with.
constexpr int kSweepSamples = 16;
// cos of the angle by which a laser's plane may be out of level.
const double kLevel = std::cos(DegToRad(20.0));

enum class Kind { kOther, kScan, kOdometry, kTransforms, kStatic, kImu };

Kind KindOf(const BagTopic& topic) {
  if (topic.type == "sensor_msgs/LaserScan") return Kind::kScan;
  if (topic.type == "nav_msgs/Odometry") return Kind::kOdometry;
  if (topic.type == "sensor_msgs/Imu") return Kind::kImu;
  if (topic.type == "tf2_msgs/TFMessage" || topic.type == "tf/tfMessage") {
    return topic.name.find("tf_static") != std::string::npos
               ? Kind::kStatic
               : Kind::kTransforms;
  }
  return Kind::kOther;
}

// "scan" and "/scan" are one.
bool IsNamed(const BagTopic& topic, const std::string& name) {
  const auto plain = [](const std::string& text) {
    return !text.empty() && text.front() == '/' ? text.substr(1) : text;
  };
  return plain(topic.name) == plain(name);
}

struct RawScan {
  std::int64_t stamp;
  std::int64_t received;
  int position;
  std::size_t frame;
  LaserScanMessage message;
};

struct RawPose {
  std::int64_t stamp;
  std::int64_t received;
  Pose2 pose;
};

struct RawRate {
  std::int64_t stamp;
  std::int64_t received;
  double rate;
};

// What is known of a topic, and what it gave.
struct Stream {
  Kind kind = Kind::kOther;
  LogTopic seen;
  bool any = false;
  std::int64_t last_time = 0;
  std::string frame;
  std::string child_frame;
  std::vector<RawPose> poses;
  std::vector<RawRate> rates;
};

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

// The nearest number, as of the same time written in digits.
double Seconds(std::int64_t nanoseconds) {
  return static_cast<double>(static_cast<long double>(nanoseconds) / 1e9L);
}

// A quaternion gives a heading back but for the last digits. Rounded to a
// nanoradian it is what was written, so that a drive is the same in all
// formats.
Pose2 InPlane(const Pose3& pose) {
  const Eigen::Quaterniond& q = pose.rotation;
  const double heading =
      std::atan2(2.0 * (q.w() * q.z() + q.x() * q.y()),
                 1.0 - 2.0 * (q.y() * q.y() + q.z() * q.z()));
  return Pose2(pose.translation.x(), pose.translation.y(),
               std::round(heading * 1e9) / 1e9);
}

// LaserScan has its angles as floats. Of all angles that this float may stand
// for the round one is meant, in parts of 1/1200 degree, where there is one.
double RoundAngle(double angle) {
  constexpr double kParts = 1200.0;
  const double round = DegToRad(std::round(RadToDeg(angle) * kParts) / kParts);
  return static_cast<float>(round) == static_cast<float>(angle) ? round : angle;
}

// And of all ranges the one with few digits.
double RoundRange(double range) {
  const double round = std::round(range * 1e4) / 1e4;
  return static_cast<float>(round) == static_cast<float>(range) ? round : range;
}

template <typename T>
T MedianOf(std::vector<T> values) {
  const auto middle =
      values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// By how much messages are recorded later than they are stamped, ns. Times for
// which nobody sets a stamp say nothing: they are all the same.
template <typename Raw>
bool DelayOf(const std::vector<Raw>& messages, std::int64_t* delay) {
  std::vector<std::int64_t> delays;
  std::size_t standing = 0;
  for (std::size_t i = 0; i < messages.size(); ++i) {
    delays.push_back(messages[i].received - messages[i].stamp);
    if (i > 0 && messages[i].stamp == messages[i - 1].stamp) ++standing;
  }
  if (delays.empty() || 2 * standing > messages.size() ||
      (messages.size() == 1 && messages[0].stamp == 0)) {
    return false;
  }
  *delay = MedianOf(std::move(delays));
  return true;
}

// Poses over time.
class Motion {
 public:
  void Set(std::vector<RawPose> poses) {
    poses_ = std::move(poses);
    std::stable_sort(
        poses_.begin(), poses_.end(),
        [](const RawPose& a, const RawPose& b) { return a.stamp < b.stamp; });
  }
  bool empty() const { return poses_.empty(); }
  std::int64_t first() const { return poses_.front().stamp; }
  std::int64_t last() const { return poses_.back().stamp; }

  // Interpolated; the ends hold before and after.
  Pose2 At(std::int64_t time) const {
    const auto after = std::upper_bound(
        poses_.begin(), poses_.end(), time,
        [](std::int64_t t, const RawPose& pose) { return t < pose.stamp; });
    if (after == poses_.begin()) return poses_.front().pose;
    const RawPose& before = *(after - 1);
    if (after == poses_.end() || before.stamp == time) return before.pose;
    const double share = static_cast<double>(time - before.stamp) /
                         static_cast<double>(after->stamp - before.stamp);
    Pose2 difference = after->pose - before.pose;
    difference[2] = NormalizeAngle(difference[2]);
    Pose2 pose = before.pose + share * difference;
    pose[2] = NormalizeAngle(pose[2]);
    return pose;
  }

  // Time to the nearest pose, ns.
  std::int64_t Distance(std::int64_t time) const {
    const auto after = std::lower_bound(
        poses_.begin(), poses_.end(), time,
        [](const RawPose& pose, std::int64_t t) { return pose.stamp < t; });
    std::int64_t distance = -1;
    if (after != poses_.end()) distance = after->stamp - time;
    if (after != poses_.begin()) {
      const std::int64_t back = time - (after - 1)->stamp;
      if (distance < 0 || back < distance) distance = back;
    }
    return distance;
  }

  bool changes() const {
    return std::any_of(poses_.begin(), poses_.end(), [&](const RawPose& pose) {
      return pose.pose != poses_.front().pose;
    });
  }

 private:
  std::vector<RawPose> poses_;
};

class BagReader {
 public:
  BagReader(BagSource* source, const std::string& name,
            const LaserOptions& options)
      : source_(source), name_(name), options_(options) {}

  Log Read() {
    log_.format = source_->format();
    log_.position_unit = "message";
    source_->SetWanted(
        [this](const BagTopic& topic) { return IsWanted(topic); });
    Collect();
    tree_.Sort();
    Finish();
    return std::move(log_);
  }

 private:
  bool IsWanted(const BagTopic& topic) const {
    switch (KindOf(topic)) {
      case Kind::kOther:
        return false;
      case Kind::kScan:
        return !is_ambiguous_ && (options_.scan_topic.empty() ||
                                  IsNamed(topic, options_.scan_topic));
      case Kind::kOdometry:
        return options_.odometry_topic.empty() ||
               IsNamed(topic, options_.odometry_topic);
      default:
        return true;
    }
  }

  void Skip(const std::string& reason, std::int64_t count = 1) {
    skips_.Add(reason, position_, count);
  }

  Stream& StreamOf(std::size_t topic) {
    while (streams_.size() < source_->topics().size()) {
      const BagTopic& added = source_->topics()[streams_.size()];
      Stream stream;
      stream.kind = added.unreadable.empty() ? KindOf(added) : Kind::kOther;
      stream.seen.name = added.name;
      stream.seen.type = added.type;
      stream.seen.why_not = added.unreadable;
      streams_.push_back(std::move(stream));
    }
    return streams_[topic];
  }

  // Takes in all messages, decoded.
  void Collect() {
    BagMessage message;
    while (source_->Next(&message)) {
      ++position_;
      const std::size_t topic = message.topic;
      Stream& stream = StreamOf(topic);
      Count(message.time, &stream);
      const BagTopic& of = source_->topics()[topic];
      if (!of.unreadable.empty()) {
        Skip("message of " + of.name + ": " + of.unreadable);
        continue;
      }
      if (stream.kind == Kind::kOther || !IsWanted(of)) continue;
      std::string why;
      if (!Take(message, topic, &stream, &why)) {
        Skip(of.type + " on " + of.name + " that " + why);
      }
    }
    // Topics without messages are known, too.
    if (!source_->topics().empty()) StreamOf(0);
  }

  static void Count(std::int64_t time, Stream* stream) {
    LogTopic& seen = stream->seen;
    if (seen.messages++ == 0) {
      seen.first_time = Seconds(time);
    } else {
      const double gap =
          static_cast<double>(time - stream->last_time) / kSecond;
      seen.largest_gap = std::max(seen.largest_gap, gap);
      if (gap < 0.0) ++seen.time_reversals;
    }
    seen.last_time = Seconds(time);
    stream->last_time = time;
  }

  bool Take(const BagMessage& message, std::size_t topic, Stream* stream,
            std::string* why) {
    const MessageEncoding encoding = source_->topics()[topic].encoding;
    switch (stream->kind) {
      case Kind::kScan:
        return TakeScan(message, topic, encoding, why);
      case Kind::kOdometry: {
        OdometryMessage odometry;
        if (!DecodeOdometry(message.data, encoding, &odometry, why)) {
          return false;
        }
        Pose3 pose;
        if (!ToPose3(odometry.pose, &pose)) {
          *why =
              "has no pose: expected finite numbers and a quaternion of "
              "unit length";
          return false;
        }
        if (stream->poses.empty()) {
          stream->frame = PlainFrameName(odometry.header.frame);
          stream->child_frame = PlainFrameName(odometry.child_frame);
        }
        stream->poses.push_back(
            {odometry.header.stamp, message.time, InPlane(pose)});
        return true;
      }
      case Kind::kTransforms:
      case Kind::kStatic: {
        std::vector<TransformMessage> transforms;
        if (!DecodeTransforms(message.data, encoding, &transforms, why)) {
          return false;
        }
        for (const TransformMessage& transform : transforms) {
          if (!tree_.Add(transform, transform.header.stamp,
                         stream->kind == Kind::kStatic)) {
            Skip("transform of '" + transform.child_frame.substr(0, 60) +
                 "' that has another parent, or no pose: expected one parent, "
                 "finite numbers and a quaternion of unit length");
          }
        }
        return true;
      }
      case Kind::kImu: {
        ImuMessage imu;
        if (!DecodeImu(message.data, encoding, &imu, why)) return false;
        if (!std::isfinite(imu.yaw_rate)) {
          *why = "has a turn rate that is not finite";
          return false;
        }
        stream->rates.push_back({imu.header.stamp, message.time, imu.yaw_rate});
        return true;
      }
      case Kind::kOther:
        break;
    }
    return true;
  }

  bool TakeScan(const BagMessage& message, std::size_t topic,
                MessageEncoding encoding, std::string* why) {
    LaserScanMessage scan;
    if (!DecodeLaserScan(message.data, encoding, &scan, why)) return false;
    if (!CheckAngles(&scan, why)) return false;
    if (scans_.empty()) scan_topic_ = topic;
    if (scan_topic_ != topic) {
      // Two topics could be meant: nothing is to be kept but the counts.
      is_ambiguous_ = true;
      scans_ = {};
      return true;
    }
    const std::string frame = PlainFrameName(scan.header.frame);
    const auto known = std::find(frames_.begin(), frames_.end(), frame);
    RawScan raw;
    raw.stamp = scan.header.stamp;
    raw.received = message.time;
    raw.position = position_;
    raw.frame = static_cast<std::size_t>(known - frames_.begin());
    if (known == frames_.end()) {
      if (frames_.size() >= 100) {
        *why = "has one frame too many";
        return false;
      }
      frames_.push_back(frame);
    }
    scan.header.frame.clear();
    raw.message = std::move(scan);
    scans_.push_back(std::move(raw));
    return true;
  }

  bool CheckAngles(LaserScanMessage* scan, std::string* why) const {
    const std::size_t n = scan->ranges.size();
    scan->angle_min = RoundAngle(scan->angle_min);
    scan->angle_increment = RoundAngle(scan->angle_increment);
    if (n < kFewestReadings) {
      *why = n == 0 ? "has no readings" : "has a single reading";
      return false;
    }
    if (options_.laser_start_angle) {
      scan->angle_min = *options_.laser_start_angle;
    }
    if (options_.laser_step) {
      scan->angle_increment = *options_.laser_step;
    } else if (scan->angle_increment == 0.0) {
      scan->angle_increment =
          (scan->angle_max - scan->angle_min) / static_cast<double>(n - 1);
    }
    const double turn = scan->angle_increment * static_cast<double>(n - 1);
    if (!std::isfinite(scan->angle_min) || std::abs(scan->angle_min) > 7.0 ||
        !(std::abs(turn) <= 2.1 * kPi) || turn == 0.0) {
      *why = "has absurd angles: expected radians within a turn";
      return false;
    }
    return true;
  }

  // "3 topics: /scan (sensor_msgs/LaserScan, 789 messages), ..."
  std::string Contents() const {
    if (streams_.empty()) return "no topics";
    std::string text = std::to_string(streams_.size()) +
                       (streams_.size() == 1 ? " topic: " : " topics: ");
    std::size_t count = 0;
    for (const Stream& stream : streams_) {
      if (++count > 40) {
        text += ", ...";
        break;
      }
      text += (count > 1 ? ", " : "") + stream.seen.name + " (" +
              (stream.seen.type.empty() ? "type unknown" : stream.seen.type) +
              ", " + std::to_string(stream.seen.messages) + ")";
    }
    return text;
  }

  // Why there are no scans, as far as skips tell.
  std::string Losses() const {
    std::string text;
    int count = 0;
    for (const auto* reports : {&skips_.reports(), &source_->skipped()}) {
      for (const SkipReport& report : *reports) {
        if (++count > 3) return text;
        text += "; " + std::to_string(report.count) + " x " + report.reason;
      }
    }
    return text;
  }

  [[noreturn]] void Refuse(const std::string& what,
                           const std::string& expected) const {
    throw Error(name_, 0, what, expected);
  }

  void Finish() {
    for (const SkipReport& report : source_->skipped()) {
      log_.skipped.push_back(report);
    }
    for (const SkipReport& report : skips_.reports()) {
      log_.skipped.push_back(report);
    }
    try {
      ChooseScans();
      ChooseOdometry();
      UseClock();
      PlaceScans();
    } catch (const Error&) {
      TellTopics();
      throw;
    }
    TellTopics();
    for (const SkipReport& report : late_skips_.reports()) {
      log_.skipped.push_back(report);
    }
  }

  void TellTopics() {
    for (const Stream& stream : streams_) {
      log_.topics.push_back(stream.seen);
      if (stream.seen.messages == 0) continue;
      log_.messages[stream.seen.name] += stream.seen.messages;
    }
    if (options_.on_topics) options_.on_topics(log_.topics);
  }

  void ChooseScans() {
    std::string candidates;
    for (std::size_t i = 0; i < streams_.size(); ++i) {
      Stream& stream = streams_[i];
      if (stream.kind != Kind::kScan || stream.seen.messages == 0) continue;
      candidates += (candidates.empty() ? "" : ", ") + stream.seen.name + " (" +
                    std::to_string(stream.seen.messages) + ")";
    }
    if (is_ambiguous_) {
      for (Stream& stream : streams_) {
        if (stream.kind == Kind::kScan) {
          stream.seen.why_not = "several topics have scans";
        }
      }
      Refuse("has laser scans on several topics: " + candidates,
             "--scan_topic with one of them");
    }
    if (!options_.scan_topic.empty()) {
      const auto named = std::find_if(
          source_->topics().begin(), source_->topics().end(),
          [&](const BagTopic& t) { return IsNamed(t, options_.scan_topic); });
      if (named == source_->topics().end() || KindOf(*named) != Kind::kScan) {
        Refuse((named == source_->topics().end()
                    ? "has no topic " + options_.scan_topic
                    : "has messages of type " + named->type + " on " +
                          options_.scan_topic) +
                   "; it has " + Contents(),
               candidates.empty() ? "a bag with sensor_msgs/LaserScan"
                                  : "--scan_topic with one of " + candidates);
      }
    }
    if (scans_.empty()) {
      Refuse(
          "has no laser scan that can be used; it has " + Contents() + Losses(),
          "messages of type sensor_msgs/LaserScan");
    }
    Stream& stream = streams_[scan_topic_];
    stream.seen.use = "scans";
    log_.scan_message = stream.seen.name;
    for (Stream& other : streams_) {
      if (other.kind == Kind::kScan && &other != &stream &&
          other.seen.messages > 0) {
        other.seen.why_not = "another topic was chosen";
      }
    }
  }

  // The frames from the laser to the root, and where odometry ties in.
  void ChooseOdometry() {
    const std::string& wanted = options_.odometry_topic;
    std::vector<std::size_t> candidates;
    std::string list;
    for (std::size_t i = 0; i < streams_.size(); ++i) {
      const Stream& stream = streams_[i];
      if (stream.kind != Kind::kOdometry || stream.seen.messages == 0) continue;
      list += (list.empty() ? "" : ", ") + stream.seen.name + " (" +
              std::to_string(stream.seen.messages) + ")";
      if (!stream.poses.empty()) candidates.push_back(i);
    }
    if (wanted == "none") return;
    if (!wanted.empty() && wanted != "tf") {
      const auto named =
          std::find_if(source_->topics().begin(), source_->topics().end(),
                       [&](const BagTopic& t) { return IsNamed(t, wanted); });
      if (named == source_->topics().end() ||
          KindOf(*named) != Kind::kOdometry || candidates.empty()) {
        Refuse((named == source_->topics().end() ? "has no topic " + wanted
                : KindOf(*named) != Kind::kOdometry
                    ? "has messages of type " + named->type + " on " + wanted
                    : "has no odometry that can be used on " + wanted) +
                   "; it has " + Contents() + Losses(),
               "--odometry_topic with " +
                   (list.empty() ? std::string("tf or none")
                                 : "one of " + list + ", tf or none"));
      }
    }
    if (wanted != "tf" && candidates.size() > 1) {
      for (const std::size_t i : candidates) {
        streams_[i].seen.why_not = "several topics have odometry";
      }
      Refuse("has odometry on several topics: " + list,
             "--odometry_topic with one of them, tf or none");
    }
    if (wanted != "tf" && candidates.size() == 1) {
      odometry_ = static_cast<int>(candidates[0]);
      Stream& stream = streams_[candidates[0]];
      stream.seen.use = "odometry";
      log_.odometry_source = stream.seen.name;
      base_ = stream.child_frame;
      return;
    }
    // odom -> base -> ... -> laser
    const std::vector<std::string> chain = tree_.ChainOf(frames_[0]);
    for (std::size_t i = 1; i < chain.size(); ++i) {
      std::string low = chain[i];
      std::transform(low.begin(), low.end(), low.begin(),
                     [](unsigned char c) { return std::tolower(c); });
      if (low.find("odom") == std::string::npos ||
          !tree_.IsMoving(chain[i - 1])) {
        continue;
      }
      odom_frame_ = chain[i];
      base_ = chain[i - 1];
      log_.odometry_source = "tf " + odom_frame_ + " -> " + base_;
      UseTransforms("odometry");
      return;
    }
    if (wanted == "tf") {
      Refuse(
          "has no transform of a moving robot in a frame called odom above "
          "the laser's frame '" +
              frames_[0] + "'; tf has " +
              (tree_.empty() ? "nothing" : tree_.Describe()),
          "such a transform, or --odometry_topic=none");
    }
  }

  void UseTransforms(const char* use) {
    for (Stream& stream : streams_) {
      if (stream.kind != Kind::kTransforms && stream.kind != Kind::kStatic) {
        continue;
      }
      std::string& uses = stream.seen.use;
      if (uses.find(use) == std::string::npos) {
        uses += (uses.empty() ? "" : ", ") + std::string(use);
      }
    }
  }

  // Which clock counts, and how the other sources' differ.
  void UseClock() {
    std::int64_t delay = 0;
    const bool is_stamped = DelayOf(scans_, &delay);
    if (!is_stamped) {
      log_.notes.push_back(
          "scans have no time stamps of their own: the times "
          "at which they were recorded are used");
      for (RawScan& scan : scans_) scan.stamp = scan.received;
    }
    const auto align = [&](const std::string& topic, auto* messages) {
      std::int64_t own = 0;
      if (!DelayOf(*messages, &own)) {
        for (auto& message : *messages) message.stamp = message.received;
        own = 0;
        log_.notes.push_back(topic +
                             " has no time stamps of its own: the times at "
                             "which it was recorded are used");
        if (!is_stamped) return;
      }
      // From its clock to the scans'.
      const std::int64_t difference = own - (is_stamped ? delay : 0);
      if (std::abs(static_cast<double>(difference)) <
          kClockDifference * kSecond) {
        return;
      }
      for (auto& message : *messages) message.stamp += difference;
      char text[160];
      std::snprintf(text, sizeof text,
                    "is stamped by another clock than the scans: %.3f s are "
                    "added",
                    static_cast<double>(difference) / kSecond);
      log_.notes.push_back(topic + " " + text);
    };
    if (odometry_ >= 0) {
      Stream& stream = streams_[static_cast<std::size_t>(odometry_)];
      align(stream.seen.name, &stream.poses);
      motion_.Set(std::move(stream.poses));
    } else if (!odom_frame_.empty()) {
      // At the time of each scan, and of what lies between its beams.
      tf_motion_ = true;
    } else {
      TakeYawRates(align);
    }
    for (Stream& stream : streams_) stream.poses = {};
  }

  template <typename Align>
  void TakeYawRates(const Align& align) {
    Stream* chosen = nullptr;
    for (Stream& stream : streams_) {
      if (stream.kind != Kind::kImu || stream.rates.empty()) continue;
      if (chosen == nullptr || stream.rates.size() > chosen->rates.size()) {
        if (chosen != nullptr)
          chosen->seen.why_not = "another has more messages";
        chosen = &stream;
      } else {
        stream.seen.why_not = "another has more messages";
      }
    }
    if (chosen == nullptr) return;
    align(chosen->seen.name, &chosen->rates);
    std::stable_sort(
        chosen->rates.begin(), chosen->rates.end(),
        [](const RawRate& a, const RawRate& b) { return a.stamp < b.stamp; });
    for (const RawRate& rate : chosen->rates) {
      log_.yaw_rates.push_back({Seconds(rate.stamp), rate.rate});
    }
    chosen->seen.use = "turn rates";
    log_.yaw_rate_source = chosen->seen.name;
  }

  // Pose of the robot by odometry.
  Pose2 OdometryAt(std::int64_t time) const {
    if (!tf_motion_) return motion_.empty() ? Pose2::Zero() : motion_.At(time);
    Pose3 pose;
    tree_.Lookup(odom_frame_, base_, time, &pose);
    return InPlane(pose);
  }

  bool HasMotion() const { return tf_motion_ || !motion_.empty(); }

  // Puts scans that are a little out of order where they belong.
  void SortScans() {
    std::int64_t moved = 0;
    for (std::size_t i = 1; i < scans_.size(); ++i) {
      std::size_t j = i;
      while (j > 0 && i - j < kOrderScans &&
             scans_[j].stamp < scans_[j - 1].stamp &&
             static_cast<double>(scans_[j - 1].stamp - scans_[j].stamp) <=
                 kOrderSeconds * kSecond) {
        std::swap(scans_[j], scans_[j - 1]);
        --j;
      }
      if (j < i) ++moved;
    }
    if (moved > 0) {
      log_.notes.push_back(std::to_string(moved) +
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
    if (base_.empty() || frames_[frame].empty() ||
        !tree_.LookupAnyWay(base_, frames_[frame], time, &pose)) {
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
    if (!base_.empty() &&
        tree_.LookupAnyWay(base_, frames_[0], scans_.front().stamp, &pose)) {
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
    if (!base_.empty()) {
      log_.notes.push_back("odometry is of the frame '" + base_ +
                           "', which tf does not tie to the laser's frame '" +
                           frames_[0] + "': it is taken for '" + chain[top] +
                           "'");
    }
    base_ = chain[top];
  }

  void PlaceScans() {
    SortScans();
    ChooseBase();
    std::vector<Mount> mounts;
    bool any_known = false;
    for (std::size_t f = 0; f < frames_.size(); ++f) {
      Mount mount = MountAt(f, scans_.front().stamp);
      for (const std::string& name : tree_.ChainOf(frames_[f])) {
        if (name == base_) break;
        mount.is_moving |= tree_.IsMoving(name);
      }
      mount.is_moving &= mount.is_known;
      any_known |= mount.is_known;
      mounts.push_back(mount);
      NoteMount(mount, frames_[f]);
    }
    if (any_known) UseTransforms("place of the laser");
    const RawScan* before = nullptr;
    std::int64_t far = 0;
    log_.scans.reserve(scans_.size());
    for (RawScan& raw : scans_) {
      position_ = raw.position;
      if (before != nullptr && raw.stamp == before->stamp &&
          !log_.scans.empty() && SameReadings(raw, log_.scans.back())) {
        late_skips_.Add("scan that was recorded twice", raw.position);
        continue;
      }
      before = &raw;
      Mount mount = mounts[raw.frame];
      if (mount.is_moving) mount = MountAt(raw.frame, raw.stamp);
      Scan scan = MakeScan(raw, mount);
      if (!motion_.empty() && static_cast<double>(motion_.Distance(raw.stamp)) >
                                  kFarOdometry * kSecond) {
        ++far;
      }
      log_.scans.push_back(std::move(scan));
      // Free what was taken over.
      raw.message.ranges = {};
    }
    if (far > 0) {
      log_.notes.push_back(
          std::to_string(far) +
          " scans are more than 1 s from the next odometry: they are placed "
          "by what is nearest");
    }
    Examine();
  }

  void NoteMount(const Mount& mount, const std::string& frame) {
    if (!mount.is_known) {
      log_.notes.push_back(
          "tf does not say where the laser's frame '" + frame + "' is" +
          (base_.empty() ? std::string() : " in '" + base_ + "'") +
          (tree_.empty() ? " (there is no tf)" : "") +
          ": the laser is taken to be at the robot's centre, looking ahead");
    } else if (mount.is_tilted) {
      log_.notes.push_back("the laser '" + frame +
                           "' is tilted by more than 20 degrees: its scans are "
                           "taken for level");
    }
  }

  static bool SameReadings(const RawScan& raw, const Scan& scan) {
    // What is no return was made zero.
    return raw.message.ranges.size() == scan.ranges.size() &&
           std::equal(raw.message.ranges.begin(), raw.message.ranges.end(),
                      scan.ranges.begin(),
                      [](float a, float b) { return a == b || b == 0.0f; });
  }

  Scan MakeScan(const RawScan& raw, const Mount& mount) {
    const LaserScanMessage& message = raw.message;
    Scan scan;
    scan.timestamp = Seconds(raw.stamp);
    scan.timestamp_text = SecondsText(raw.stamp);
    scan.line = raw.position;
    scan.odometry = OdometryAt(raw.stamp);
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
      late_skips_.Add(
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
  void UndoMotion(const RawScan& raw, const Mount& mount, std::size_t stride,
                  Scan* scan) {
    const double step =
        raw.message.time_increment * static_cast<double>(stride);
    const std::size_t n = scan->ranges.size();
    const double duration = step * static_cast<double>(n - 1);
    if (!HasMotion() || !(std::abs(duration) > 0.0) ||
        !(std::abs(duration) <= kLongestScan)) {
      return;
    }
    // Of the laser, seen from where it was at first, evenly in time.
    std::vector<Pose2> places;
    // Upside down, the laser sees the robot's motion mirrored.
    const double side = mount.is_upside_down ? -1.0 : 1.0;
    for (int k = 0; k <= kSweepSamples; ++k) {
      const auto time =
          raw.stamp + static_cast<std::int64_t>(
                          std::llround(duration * kSecond * k / kSweepSamples));
      Pose2 place = Compose(
          Inverse(mount.pose),
          Compose(Between(scan->odometry, OdometryAt(time)), mount.pose));
      place[1] *= side;
      place[2] *= side;
      places.push_back(place);
    }
    if (UndoSweep(places, scan)) ++undone_;
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
    if (!log_.has_odometry && HasMotion()) {
      log_.notes.push_back(log_.odometry_source +
                           " never changes: it is taken for none");
      log_.odometry_source.clear();
    }
    if (undone_ > 0) {
      log_.notes.push_back("motion during the scan was undone in " +
                           std::to_string(undone_) + " of " +
                           std::to_string(log_.scans.size()) + " scans");
    }
  }

  BagSource* source_;
  std::string name_;
  const LaserOptions& options_;
  Log log_;
  SkipCounter skips_;
  // Found while scans are placed.
  SkipCounter late_skips_;
  int position_ = 0;
  std::vector<Stream> streams_;
  TransformTree tree_;
  std::vector<RawScan> scans_;
  std::vector<std::string> frames_;
  std::size_t scan_topic_ = 0;
  bool is_ambiguous_ = false;
  int odometry_ = -1;
  std::string odom_frame_;
  std::string base_;
  Motion motion_;
  bool tf_motion_ = false;
  std::int64_t undone_ = 0;
};

}  // namespace

Log ReadBag(BagSource* source, const std::string& name,
            const LaserOptions& options) {
  return BagReader(source, name, options).Read();
}

}  // namespace plumbline
