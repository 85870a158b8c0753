#ifndef PLUMBLINE_FRONTEND_BAGS_BAG_MESSAGES_H_
#define PLUMBLINE_FRONTEND_BAGS_BAG_MESSAGES_H_

#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/bags/bag_source.h>
#include <plumbline/frontend/bags/message_decoder.h>
#include <plumbline/frontend/bags/transform_tree.h>
#include <plumbline/frontend/log_reader.h>
#include <plumbline/frontend/scan.h>

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace plumbline {

/// Use of a topic's messages, by their type.
enum class BagTopicKind {
  kOther,
  kScan,
  kOdometry,
  kTransforms,
  kStaticTransforms,
  kImu,
};

/// The use of a topic's messages.
BagTopicKind KindOf(const BagTopic& topic);

/// Whether a topic has this name, with or without a slash in front.
bool IsNamed(const BagTopic& topic, const std::string& name);

/// "robot1/" of "/robot1/scan"; empty where there is none.
std::string NamespaceOf(const std::string& topic);

/// A scan of a bag. Times here and below are ns since the epoch of the clock
/// that set them.
struct BagScan {
  /// Time that the sender stamped it with.
  std::int64_t stamp = 0;
  /// Time at which it was recorded.
  std::int64_t received = 0;
  /// By how much `stamp` is ahead of what the sender wrote, ns: the clock was
  /// set back by that before, and times are to go on.
  std::int64_t set_back = 0;
  /// Number of the message in the bag, from 1.
  int position = 0;
  /// Index of its frame in BagMessages::frames.
  std::size_t frame = 0;
  /// The message; its angles are checked and rounded.
  LaserScanMessage message;
};

/// A pose of the robot by odometry.
struct BagPose {
  /// Time that the sender stamped it with.
  std::int64_t stamp = 0;
  /// Time at which it was recorded.
  std::int64_t received = 0;
  /// m and rad, in the plane.
  Pose2 pose = Pose2::Zero();
  /// Number of the message in the bag, from 1.
  int position = 0;
};

/// A turn rate.
struct BagTurnRate {
  /// Time that the sender stamped it with.
  std::int64_t stamp = 0;
  /// Time at which it was recorded.
  std::int64_t received = 0;
  /// rad/s.
  double rate = 0.0;
};

/// The scans of a topic.
struct BagScanSet {
  /// In the order of the bag.
  std::vector<BagScan> list;
  /// Names of their frames.
  std::vector<std::string> frames;
  /// Scans whose last direction is not that of their angle_max, and the first
  /// one's two, rad: by angle_increment, which is believed, and by angle_max.
  std::int64_t other_ends = 0;
  double end_by_step = 0.0;
  double stated_end = 0.0;
};

/// A topic of a bag with the content of its messages.
struct BagStream {
  /// kOther as well for a topic whose messages cannot be read.
  BagTopicKind kind = BagTopicKind::kOther;
  /// Figures of the topic for Log::topics.
  LogTopic seen;
  /// When its last message was recorded.
  std::int64_t last_time = 0;
  /// Frames of an odometry topic: that of the poses, and the robot's. Of an
  /// IMU's: its own.
  std::string frame;
  std::string child_frame;
  /// Messages of an odometry topic.
  std::vector<BagPose> poses;
  /// Messages of an IMU's topic.
  std::vector<BagTurnRate> rates;
  /// Messages of a laser's topic, until one is chosen.
  BagScanSet scans;
};

/// The content of all messages of a bag that a log can be made of.
struct BagMessages {
  /// By topic.
  std::vector<BagTopic> topics;
  std::vector<BagStream> streams;
  /// Those of the topic that was chosen (bag_sources.h); empty before.
  BagScanSet scans;
  /// Transforms between frames, in the order of time, by the namespace of their
  /// topics.
  std::map<std::string, TransformTree> trees;
  /// Those that hold for the scans' topic; empty before it is chosen.
  TransformTree tree;
  /// What the source passed over, and messages that could not be used.
  std::vector<SkipReport> skipped_by_source;
  std::vector<SkipReport> skipped;

  /// "3 topics: /scan (sensor_msgs/LaserScan, 789 messages), ...".
  std::string Contents() const;
  /// The topics of a kind that have messages: "/scan (789), /rear (780)".
  std::string ListOf(BagTopicKind kind) const;
  /// What was passed over, at most three reasons, each after a semicolon.
  std::string Losses() const;
  /// The transforms that hold for a topic: those of namespaces that it is in,
  /// inner before outer ones, or all where it is in no namespace that has some.
  TransformTree TreeOf(const std::string& topic) const;
  /// Takes the transforms for the topic of the scans.
  void ChooseTree(const std::string& topic);
  /// Adds a use to those of the topics of transforms that hold.
  void NoteTransformsUsed(const std::string& use);

 private:
  // Namespaces whose transforms hold for a topic, inner before outer ones.
  std::vector<std::string> SpacesOf(const std::string& topic) const;
};

/// Reads all messages of a bag. The options choose topics and set angles of
/// the laser. Messages that cannot be used are counted in `skipped`.
BagMessages CollectBagMessages(BagSource* source, const LaserOptions& options);

/// The pose of a rigid motion in the plane: x, y (m) and heading (rad), rounded
/// to a nanoradian. A quaternion gives a heading back but for the last digits,
/// and a drive is to be the same in all formats.
Pose2 PoseInPlane(const Pose3& pose);

/// The most that a time may be, ns, either way: 146 years, which a stamp with
/// 32 bits of seconds keeps within. Differences of such times fit their type.
constexpr std::int64_t kMostTime = 4600000000000000000;

/// Seconds of a time in ns: the double nearest to it.
double SecondsOf(std::int64_t nanoseconds);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_BAGS_BAG_MESSAGES_H_
