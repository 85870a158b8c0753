#include <plumbline/factors/angle.h>
#include <plumbline/frontend/bags/bag_messages.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace plumbline {
namespace {

constexpr double kNanoseconds = 1e9;  // in a second
constexpr std::size_t kFewestReadings = 2;
constexpr std::size_t kMostFrames = 100;
// Steps by which the last beam may lie beside angle_max.
constexpr double kOtherEnd = 1.5;

// LaserScan has its angles as floats. Of all angles that this float may stand
// for the round one is meant, in parts of 1/1200 degree, where there is one.
double RoundAngle(double angle) {
  constexpr double kParts = 1200.0;
  const double round = DegToRad(std::round(RadToDeg(angle) * kParts) / kParts);
  return static_cast<float>(round) == static_cast<float>(angle) ? round : angle;
}

// Of a laser that tells several echoes of a beam apart.
bool IsMultiEcho(const BagTopic& topic) {
  return topic.type == "sensor_msgs/MultiEchoLaserScan";
}

// Takes in all messages, decoded.
class Collector {
 public:
  Collector(BagSource* source, const LaserOptions& options)
      : source_(source), options_(options) {}

  BagMessages Collect() {
    source_->SetWanted(
        [this](const BagTopic& topic) { return IsWanted(topic); });
    BagMessage message;
    while (source_->Next(&message)) {
      // The bag may say anything.
      message.time = std::clamp(message.time, -kMostTime, kMostTime);
      TakeMessage(message);
    }
    // Topics without messages are known, too.
    if (!source_->topics().empty()) StreamOf(0);
    messages_.topics = source_->topics();
    for (auto& [space, tree] : messages_.trees) tree.Sort();
    messages_.skipped_by_source = source_->skipped();
    messages_.skipped = skips_.reports();
    source_->SetWanted(nullptr);
    return std::move(messages_);
  }

 private:
  bool IsWanted(const BagTopic& topic) const {
    switch (KindOf(topic)) {
      case BagTopicKind::kOther:
        return false;
      case BagTopicKind::kScan:
        return options_.scan_topic.empty() ||
               IsNamed(topic, options_.scan_topic);
      case BagTopicKind::kOdometry:
        return options_.odometry_topic.empty() ||
               IsNamed(topic, options_.odometry_topic);
      default:
        return true;
    }
  }

  void Skip(const std::string& reason, std::int64_t count = 1) {
    skips_.Add(reason, position_, count);
  }

  BagStream& StreamOf(std::size_t topic) {
    while (messages_.streams.size() < source_->topics().size()) {
      const BagTopic& added = source_->topics()[messages_.streams.size()];
      BagStream stream;
      stream.kind =
          added.unreadable.empty() ? KindOf(added) : BagTopicKind::kOther;
      stream.seen.name = added.name;
      stream.seen.type = added.type;
      stream.seen.why_not = added.unreadable;
      messages_.streams.push_back(std::move(stream));
    }
    return messages_.streams[topic];
  }

  void TakeMessage(const BagMessage& message) {
    ++position_;
    BagStream& stream = StreamOf(message.topic);
    Count(message.time, &stream);
    const BagTopic& topic = source_->topics()[message.topic];
    if (!topic.unreadable.empty()) {
      Skip("message of " + topic.name + ": " + topic.unreadable);
      return;
    }
    if (stream.kind == BagTopicKind::kOther || !IsWanted(topic)) return;
    std::string why;
    if (!Take(message, message.topic, &stream, &why)) {
      Skip(topic.type + " on " + topic.name + " that " + why);
    }
  }

  static void Count(std::int64_t time, BagStream* stream) {
    LogTopic& seen = stream->seen;
    if (seen.messages++ == 0) {
      seen.first_time = SecondsOf(time);
    } else {
      const double gap =
          static_cast<double>(time - stream->last_time) / kNanoseconds;
      seen.largest_gap = std::max(seen.largest_gap, gap);
      if (gap < 0.0) ++seen.time_reversals;
    }
    seen.last_time = SecondsOf(time);
    stream->last_time = time;
  }

  bool Take(const BagMessage& message, std::size_t topic, BagStream* stream,
            std::string* why) {
    const MessageEncoding encoding = source_->topics()[topic].encoding;
    switch (stream->kind) {
      case BagTopicKind::kScan:
        return TakeScan(message, topic, encoding, &stream->scans, why);
      case BagTopicKind::kOdometry: {
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
        stream->poses.push_back({odometry.header.stamp, message.time,
                                 PoseInPlane(pose), position_});
        return true;
      }
      case BagTopicKind::kTransforms:
      case BagTopicKind::kStaticTransforms: {
        std::vector<TransformMessage> transforms;
        if (!DecodeTransforms(message.data, encoding, &transforms, why)) {
          return false;
        }
        TransformTree& tree = messages_.trees[NamespaceOf(stream->seen.name)];
        for (const TransformMessage& transform : transforms) {
          if (!tree.Add(transform, message.time, position_,
                        stream->kind == BagTopicKind::kStaticTransforms)) {
            Skip("transform of '" + transform.child_frame.substr(0, 60) +
                 "' that has another parent, or no pose: expected one parent, "
                 "finite numbers and a quaternion of unit length");
          }
        }
        return true;
      }
      case BagTopicKind::kImu: {
        ImuMessage imu;
        if (!DecodeImu(message.data, encoding, &imu, why)) return false;
        if (!std::isfinite(imu.yaw_rate)) {
          *why = "has a turn rate that is not finite";
          return false;
        }
        if (stream->rates.empty()) {
          stream->frame = PlainFrameName(imu.header.frame);
        }
        stream->rates.push_back({imu.header.stamp, message.time, imu.yaw_rate});
        return true;
      }
      case BagTopicKind::kOther:
        break;
    }
    return true;
  }

  bool TakeScan(const BagMessage& message, std::size_t topic,
                MessageEncoding encoding, BagScanSet* set, std::string* why) {
    LaserScanMessage scan;
    const auto decode = IsMultiEcho(source_->topics()[topic])
                            ? DecodeMultiEchoLaserScan
                            : DecodeLaserScan;
    if (!decode(message.data, encoding, &scan, why)) return false;
    if (!CheckAngles(&scan, why)) return false;
    CompareEnds(scan, set);
    const std::string frame = PlainFrameName(scan.header.frame);
    const auto known = std::find(set->frames.begin(), set->frames.end(), frame);
    BagScan raw;
    raw.stamp = scan.header.stamp;
    raw.received = message.time;
    raw.position = position_;
    raw.frame = static_cast<std::size_t>(known - set->frames.begin());
    if (known == set->frames.end()) {
      if (set->frames.size() >= kMostFrames) {
        *why = "has one frame too many";
        return false;
      }
      set->frames.push_back(frame);
    }
    scan.header.frame.clear();
    raw.message = std::move(scan);
    set->list.push_back(std::move(raw));
    return true;
  }

  // Steps that are rounded, or of another laser, bend a scan into a spiral.
  // Many drivers count a beam too many or too few: that is no matter.
  void CompareEnds(const LaserScanMessage& scan, BagScanSet* set) {
    if (options_.laser_start_angle || options_.laser_step) return;
    const double end =
        scan.angle_min +
        scan.angle_increment * static_cast<double>(scan.ranges.size() - 1);
    if (!(std::abs(end - scan.angle_max) >
          kOtherEnd * std::abs(scan.angle_increment))) {
      return;
    }
    if (set->other_ends++ > 0) return;
    set->end_by_step = end;
    set->stated_end = scan.angle_max;
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

  BagSource* source_;
  const LaserOptions& options_;
  BagMessages messages_;
  SkipCounter skips_;
  int position_ = 0;
};

}  // namespace

BagTopicKind KindOf(const BagTopic& topic) {
  if (topic.type == "sensor_msgs/LaserScan" || IsMultiEcho(topic)) {
    return BagTopicKind::kScan;
  }
  if (topic.type == "nav_msgs/Odometry") return BagTopicKind::kOdometry;
  if (topic.type == "sensor_msgs/Imu") return BagTopicKind::kImu;
  if (topic.type == "tf2_msgs/TFMessage" || topic.type == "tf/tfMessage") {
    return topic.name.find("tf_static") != std::string::npos
               ? BagTopicKind::kStaticTransforms
               : BagTopicKind::kTransforms;
  }
  return BagTopicKind::kOther;
}

bool IsNamed(const BagTopic& topic, const std::string& name) {
  const auto plain = [](const std::string& text) {
    return !text.empty() && text.front() == '/' ? text.substr(1) : text;
  };
  return plain(topic.name) == plain(name);
}

std::string NamespaceOf(const std::string& topic) {
  const std::string plain = PlainFrameName(topic);
  return plain.substr(0, plain.rfind('/') + 1);
}

std::string BagMessages::Contents() const {
  if (streams.empty()) return "no topics";
  std::string text = std::to_string(streams.size()) +
                     (streams.size() == 1 ? " topic: " : " topics: ");
  std::size_t count = 0;
  for (const BagStream& stream : streams) {
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

std::string BagMessages::ListOf(BagTopicKind kind) const {
  std::string list;
  for (const BagStream& stream : streams) {
    if (stream.kind != kind || stream.seen.messages == 0) continue;
    list += (list.empty() ? "" : ", ") + stream.seen.name + " (" +
            std::to_string(stream.seen.messages) + ")";
  }
  return list;
}

std::string BagMessages::Losses() const {
  std::string text;
  int count = 0;
  for (const auto* reports : {&skipped, &skipped_by_source}) {
    for (const SkipReport& report : *reports) {
      if (++count > 3) return text;
      text += "; " + std::to_string(report.count) + " x " + report.reason;
    }
  }
  return text;
}

std::vector<std::string> BagMessages::SpacesOf(const std::string& topic) const {
  const std::string space = NamespaceOf(topic);
  std::vector<std::string> inner;
  std::vector<std::string> all;
  bool is_in_one = false;
  // From the end: what begins with a namespace comes after that.
  for (auto tree = trees.rbegin(); tree != trees.rend(); ++tree) {
    all.push_back(tree->first);
    if (space.compare(0, tree->first.size(), tree->first) != 0) continue;
    inner.push_back(tree->first);
    is_in_one |= !tree->first.empty();
  }
  return is_in_one ? inner : all;
}

TransformTree BagMessages::TreeOf(const std::string& topic) const {
  TransformTree tree;
  for (const std::string& space : SpacesOf(topic)) {
    tree.AddFrames(trees.at(space));
  }
  return tree;
}

void BagMessages::ChooseTree(const std::string& topic) {
  const std::vector<std::string> spaces = SpacesOf(topic);
  tree = TreeOf(topic);
  trees.clear();
  for (BagStream& stream : streams) {
    if ((stream.kind == BagTopicKind::kTransforms ||
         stream.kind == BagTopicKind::kStaticTransforms) &&
        stream.seen.messages > 0 &&
        std::count(spaces.begin(), spaces.end(),
                   NamespaceOf(stream.seen.name)) == 0) {
      stream.seen.why_not = "it is of another namespace than the scans";
    }
  }
}

void BagMessages::NoteTransformsUsed(const std::string& use) {
  for (BagStream& stream : streams) {
    if (stream.kind != BagTopicKind::kTransforms &&
        stream.kind != BagTopicKind::kStaticTransforms) {
      continue;
    }
    if (!stream.seen.why_not.empty()) continue;
    std::string& uses = stream.seen.use;
    if (uses.find(use) == std::string::npos) {
      uses += (uses.empty() ? "" : ", ") + use;
    }
  }
}

BagMessages CollectBagMessages(BagSource* source, const LaserOptions& options) {
  return Collector(source, options).Collect();
}

Pose2 PoseInPlane(const Pose3& pose) {
  const Eigen::Quaterniond& q = pose.rotation;
  const double heading =
      std::atan2(2.0 * (q.w() * q.z() + q.x() * q.y()),
                 1.0 - 2.0 * (q.y() * q.y() + q.z() * q.z()));
  return Pose2(pose.translation.x(), pose.translation.y(),
               std::round(heading * 1e9) / 1e9);
}

double SecondsOf(std::int64_t nanoseconds) {
  return static_cast<double>(static_cast<long double>(nanoseconds) / 1e9L);
}

}  // namespace plumbline
