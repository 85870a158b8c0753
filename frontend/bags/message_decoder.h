#ifndef PLUMBLINE_FRONTEND_BAGS_MESSAGE_DECODER_H_
#define PLUMBLINE_FRONTEND_BAGS_MESSAGE_DECODER_H_

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace plumbline {

/// How the fields of a message are packed.
enum class MessageEncoding {
  /// ROS 1: little-endian, without padding.
  kRos1,
  /// ROS 2: Common Data Representation (OMG DDS-XTypes), version 1, either
  /// byte order: a header of 4 bytes, then fields aligned to their size.
  kCdr,
};

/// Reads the fields of a message one after another. A read beyond the end of
/// the message gives zeros and makes ok() false for good; nothing is thrown.
class MessageDecoder {
 public:
  /// `bytes` must stay valid. For kCdr the first 4 bytes say the byte order;
  /// an unknown representation makes ok() false.
  MessageDecoder(std::string_view bytes, MessageEncoding encoding);

  /// The next field, of that type.
  std::uint8_t UInt8();
  /// The next field, of that type.
  std::int32_t Int32();
  /// The next field, of that type.
  std::uint32_t UInt32();
  /// The next field, of that type.
  float Float32();
  /// The next field, of that type.
  double Float64();
  /// The next field, of that type, without a terminating zero.
  std::string String();
  /// Number of elements of a sequence whose elements take at least
  /// `element_size` bytes; 0, and ok() false, when the message is too short.
  std::size_t SequenceSize(std::size_t element_size);
  /// Passes over `count` numbers of 8 bytes.
  void SkipFloat64(std::size_t count);

  /// False once something was missing.
  bool ok() const { return ok_; }
  /// Why it is not; empty when all is well.
  const std::string& why() const { return why_; }
  MessageEncoding encoding() const { return encoding_; }

 private:
  // The next `size` bytes, in the order of this machine.
  std::uint64_t Take(std::size_t size);
  bool Align(std::size_t size);
  bool Fail(const char* why);

  std::string_view bytes_;
  MessageEncoding encoding_;
  std::size_t position_ = 0;
  // Alignment counts from here.
  std::size_t origin_ = 0;
  bool big_endian_ = false;
  bool ok_ = true;
  std::string why_;
};

/// std_msgs/Header.
struct MessageHeader {
  /// Nanoseconds since the epoch of the recording's clock.
  std::int64_t stamp = 0;
  std::string frame;
};

/// sensor_msgs/LaserScan: rad, s, m, as the message has them. Of a
/// sensor_msgs/MultiEchoLaserScan the first echo of each beam; 0, which is no
/// return, where there was none.
struct LaserScanMessage {
  MessageHeader header;
  double angle_min = 0.0;
  double angle_max = 0.0;
  double angle_increment = 0.0;
  double time_increment = 0.0;
  double scan_time = 0.0;
  double range_min = 0.0;
  double range_max = 0.0;
  std::vector<float> ranges;
};

/// A position (m) and an orientation (unit quaternion) in space.
struct Pose3Message {
  double x = 0.0;
  double y = 0.0;
  double z = 0.0;
  double qx = 0.0;
  double qy = 0.0;
  double qz = 0.0;
  double qw = 1.0;
};

/// nav_msgs/Odometry without covariances and twist, and the messages that are a
/// pose with a header (geometry_msgs/PoseStamped, PoseWithCovarianceStamped),
/// which have no child_frame.
struct OdometryMessage {
  MessageHeader header;
  std::string child_frame;
  Pose3Message pose;
};

/// geometry_msgs/TransformStamped: the pose of `child_frame` in header.frame.
struct TransformMessage {
  MessageHeader header;
  std::string child_frame;
  Pose3Message transform;
};

/// sensor_msgs/Imu: the turn rate about the sensor's z axis, rad/s.
struct ImuMessage {
  MessageHeader header;
  double yaw_rate = 0.0;
};

/// Each fills `message` and returns true; or says in `why` what is wrong with
/// the bytes and returns false.
bool DecodeLaserScan(std::string_view bytes, MessageEncoding encoding,
                     LaserScanMessage* message, std::string* why);
bool DecodeMultiEchoLaserScan(std::string_view bytes, MessageEncoding encoding,
                              LaserScanMessage* message, std::string* why);
bool DecodeOdometry(std::string_view bytes, MessageEncoding encoding,
                    OdometryMessage* message, std::string* why);
bool DecodePoseStamped(std::string_view bytes, MessageEncoding encoding,
                       OdometryMessage* message, std::string* why);
bool DecodeTransforms(std::string_view bytes, MessageEncoding encoding,
                      std::vector<TransformMessage>* messages,
                      std::string* why);
bool DecodeImu(std::string_view bytes, MessageEncoding encoding,
               ImuMessage* message, std::string* why);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_BAGS_MESSAGE_DECODER_H_
