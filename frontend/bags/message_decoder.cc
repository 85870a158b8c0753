#include <plumbline/frontend/bags/message_decoder.h>

#include <cstring>

namespace plumbline {
namespace {

constexpr std::int64_t kNanosecondsPerSecond = 1000000000;
// No laser has more readings.
constexpr std::size_t kMostReadings = 1000000;
constexpr std::size_t kMostTransforms = 100000;

MessageHeader DecodeHeader(MessageDecoder* decoder) {
  MessageHeader header;
  std::int64_t seconds = 0;
  if (decoder->encoding() == MessageEncoding::kRos1) {
    decoder->UInt32();  // number in the sequence
    seconds = decoder->UInt32();
  } else {
    seconds = decoder->Int32();
  }
  header.stamp = seconds * kNanosecondsPerSecond +
                 static_cast<std::int64_t>(decoder->UInt32());
  header.frame = decoder->String();
  return header;
}

Pose3Message DecodePose(MessageDecoder* decoder) {
  Pose3Message pose;
  pose.x = decoder->Float64();
  pose.y = decoder->Float64();
  pose.z = decoder->Float64();
  pose.qx = decoder->Float64();
  pose.qy = decoder->Float64();
  pose.qz = decoder->Float64();
  pose.qw = decoder->Float64();
  return pose;
}

bool Done(const MessageDecoder& decoder, std::string* why) {
  if (!decoder.ok()) *why = decoder.why();
  return decoder.ok();
}

// What comes before the ranges, of which there is then the right number: a
// float each, or a list of echoes, whose own number is as long.
bool DecodeScanUpToRanges(MessageDecoder* decoder, LaserScanMessage* message,
                          std::string* why) {
  message->header = DecodeHeader(decoder);
  message->angle_min = decoder->Float32();
  message->angle_max = decoder->Float32();
  message->angle_increment = decoder->Float32();
  message->time_increment = decoder->Float32();
  message->scan_time = decoder->Float32();
  message->range_min = decoder->Float32();
  message->range_max = decoder->Float32();
  const std::size_t count = decoder->SequenceSize(sizeof(float));
  if (count > kMostReadings) {
    *why = "has more than a million readings";
    return false;
  }
  message->ranges.resize(count);
  return true;
}

}  // namespace

MessageDecoder::MessageDecoder(std::string_view bytes, MessageEncoding encoding)
    : bytes_(bytes), encoding_(encoding) {
  if (encoding == MessageEncoding::kRos1) return;
  if (bytes.size() < 4) {
    Fail(bytes.empty() ? "has no bytes" : "breaks off in its CDR header");
    return;
  }
  // 0 and 1 are plain CDR, big- and little-endian; what follows in the list of
  // representations lays its fields out in another way.
  if (bytes[0] != 0 || (bytes[1] != 0 && bytes[1] != 1)) {
    Fail("is no plain CDR of version 1");
    return;
  }
  big_endian_ = bytes[1] == 0;
  position_ = origin_ = 4;
}

bool MessageDecoder::Fail(const char* why) {
  if (ok_) why_ = why;
  ok_ = false;
  return false;
}

bool MessageDecoder::Align(std::size_t size) {
  if (!ok_) return false;
  if (encoding_ == MessageEncoding::kCdr) {
    position_ = origin_ + (position_ - origin_ + size - 1) / size * size;
  }
  if (position_ > bytes_.size() || bytes_.size() - position_ < size) {
    return Fail(bytes_.empty() ? "has no bytes" : "breaks off");
  }
  return true;
}

std::uint64_t MessageDecoder::Take(std::size_t size) {
  if (!Align(size)) return 0;
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < size; ++i) {
    const std::size_t place = big_endian_ ? i : size - 1 - i;
    value = value << 8 | static_cast<unsigned char>(bytes_[position_ + place]);
  }
  position_ += size;
  return value;
}

std::uint8_t MessageDecoder::UInt8() {
  return static_cast<std::uint8_t>(Take(1));
}

std::uint32_t MessageDecoder::UInt32() {
  return static_cast<std::uint32_t>(Take(4));
}

std::int32_t MessageDecoder::Int32() {
  return static_cast<std::int32_t>(UInt32());
}

float MessageDecoder::Float32() {
  const std::uint32_t bits = UInt32();
  float value = 0.0f;
  std::memcpy(&value, &bits, sizeof value);
  return value;
}

double MessageDecoder::Float64() {
  const std::uint64_t bits = Take(8);
  double value = 0.0;
  std::memcpy(&value, &bits, sizeof value);
  return value;
}

std::string MessageDecoder::String() {
  const std::size_t size = SequenceSize(1);
  if (!ok_) return {};
  std::string text(bytes_.substr(position_, size));
  position_ += size;
  // CDR counts the zero at the end.
  if (!text.empty() && text.back() == '\0') text.pop_back();
  return text;
}

std::size_t MessageDecoder::SequenceSize(std::size_t element_size) {
  const std::uint32_t count = UInt32();
  if (!ok_) return 0;
  if (count > (bytes_.size() - position_) / element_size) {
    Fail("says that more follows than does");
    return 0;
  }
  return count;
}

void MessageDecoder::SkipFloat64(std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) Take(8);
}

bool DecodeLaserScan(std::string_view bytes, MessageEncoding encoding,
                     LaserScanMessage* message, std::string* why) {
  MessageDecoder decoder(bytes, encoding);
  if (!DecodeScanUpToRanges(&decoder, message, why)) return false;
  for (float& range : message->ranges) range = decoder.Float32();
  return Done(decoder, why);
}

bool DecodeMultiEchoLaserScan(std::string_view bytes, MessageEncoding encoding,
                              LaserScanMessage* message, std::string* why) {
  MessageDecoder decoder(bytes, encoding);
  if (!DecodeScanUpToRanges(&decoder, message, why)) return false;
  for (float& range : message->ranges) {
    const std::size_t echoes = decoder.SequenceSize(sizeof(float));
    if (!decoder.ok()) break;
    range = echoes > 0 ? decoder.Float32() : 0.0f;
    for (std::size_t i = 1; i < echoes; ++i) decoder.Float32();
  }
  return Done(decoder, why);
}

bool DecodeOdometry(std::string_view bytes, MessageEncoding encoding,
                    OdometryMessage* message, std::string* why) {
  MessageDecoder decoder(bytes, encoding);
  message->header = DecodeHeader(&decoder);
  message->child_frame = decoder.String();
  message->pose = DecodePose(&decoder);
  return Done(decoder, why);
}

bool DecodePoseStamped(std::string_view bytes, MessageEncoding encoding,
                       OdometryMessage* message, std::string* why) {
  MessageDecoder decoder(bytes, encoding);
  message->header = DecodeHeader(&decoder);
  message->pose = DecodePose(&decoder);
  return Done(decoder, why);
}

bool DecodeTransforms(std::string_view bytes, MessageEncoding encoding,
                      std::vector<TransformMessage>* messages,
                      std::string* why) {
  messages->clear();
  MessageDecoder decoder(bytes, encoding);
  // Seven numbers are the least that a transform has.
  const std::size_t count = decoder.SequenceSize(7 * sizeof(double));
  if (count > kMostTransforms) {
    *why = "has more than 100000 transforms";
    return false;
  }
  for (std::size_t i = 0; i < count && decoder.ok(); ++i) {
    TransformMessage message;
    message.header = DecodeHeader(&decoder);
    message.child_frame = decoder.String();
    message.transform = DecodePose(&decoder);
    messages->push_back(std::move(message));
  }
  return Done(decoder, why);
}

bool DecodeImu(std::string_view bytes, MessageEncoding encoding,
               ImuMessage* message, std::string* why) {
  MessageDecoder decoder(bytes, encoding);
  message->header = DecodeHeader(&decoder);
  // Orientation and its covariance, then the turn rates about x and y.
  decoder.SkipFloat64(4 + 9 + 2);
  message->yaw_rate = decoder.Float64();
  return Done(decoder, why);
}

}  // namespace plumbline
