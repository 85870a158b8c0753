#ifndef PLUMBLINE_FRONTEND_BAGS_BAG_SOURCE_H_
#define PLUMBLINE_FRONTEND_BAGS_BAG_SOURCE_H_

#include <plumbline/frontend/bags/message_decoder.h>
#include <plumbline/frontend/scan.h>
#include <plumbline/frontend/skip_counter.h>

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace plumbline {

/// A topic of a bag: a stream of messages of one type.
struct BagTopic {
  std::string name;
  /// As ROS 1 writes it, "sensor_msgs/LaserScan" (ROS 2 has
  /// "sensor_msgs/msg/LaserScan"); empty when the bag does not say.
  std::string type;
  MessageEncoding encoding = MessageEncoding::kRos1;
  /// Why its messages cannot be read; empty when they can.
  std::string unreadable;
};

/// A message as a bag has it.
struct BagMessage {
  /// Index into BagSource::topics().
  std::size_t topic = 0;
  /// When it was recorded, ns since the epoch of the recording's clock.
  std::int64_t time = 0;
  /// Packed fields, valid until the next call of Next(); empty for topics that
  /// are not wanted.
  std::string_view data;
};

/// The messages of a bag in the order of the file, one at a time: no more than
/// two chunks for each thread are in memory. What is damaged is passed over and
/// counted.
class BagSource {
 public:
  virtual ~BagSource() = default;

  /// Selects the topics whose data are read, all by default. To be called
  /// before the first Next().
  void SetWanted(std::function<bool(const BagTopic&)> wanted) {
    wanted_ = std::move(wanted);
  }

  /// The next message; false at the end. Throws Error on a read error.
  virtual bool Next(BagMessage* message) = 0;

  /// Topics met so far; grows while messages are read.
  const std::vector<BagTopic>& topics() const { return topics_; }
  /// What was passed over so far.
  const std::vector<SkipReport>& skipped() const { return skips_.reports(); }
  /// What else is to be said of the bag, known at its end.
  const std::vector<std::string>& notes() const { return notes_; }
  /// "ROS 1 bag", "ROS 2 bag (mcap)", ...: for people.
  const std::string& format() const { return format_; }

 protected:
  /// `format`: for people, as format() says it.
  explicit BagSource(std::string format) : format_(std::move(format)) {}

  /// Adds a topic, or finds the one of that name and type; its index.
  std::size_t AddTopic(const BagTopic& topic);
  bool IsWanted(const BagTopic& topic) const {
    return topic.unreadable.empty() && (!wanted_ || wanted_(topic));
  }
  /// Counts a message, or the lack of one, at the present position.
  void Skip(const std::string& reason, std::int64_t count = 1) {
    skips_.Add(reason, position_, count);
  }
  /// Says something of the bag.
  void Note(std::string note) { notes_.push_back(std::move(note)); }
  /// A message was met.
  void CountMessage() { ++position_; }

 private:
  std::string format_;
  std::vector<BagTopic> topics_;
  std::function<bool(const BagTopic&)> wanted_;
  SkipCounter skips_;
  std::vector<std::string> notes_;
  int position_ = 0;
};

/// "sensor_msgs/msg/LaserScan" as "sensor_msgs/LaserScan".
std::string PlainTypeName(const std::string& type);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_BAGS_BAG_SOURCE_H_
