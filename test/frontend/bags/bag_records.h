#ifndef PLUMBLINE_TEST_FRONTEND_BAGS_BAG_RECORDS_H_
#define PLUMBLINE_TEST_FRONTEND_BAGS_BAG_RECORDS_H_

#include <plumbline/apps/simulation/bag_writer.h>
#include <plumbline/core/error.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/builtins.h>
#include <plumbline/frontend/log_reader.h>
#include <unistd.h>

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

namespace plumbline {

constexpr std::int64_t kSecond = 1000000000;
constexpr std::int64_t kBagStart = 1000 * kSecond;

// A folder of this process that is gone in the end.
class Folder {
 public:
  Folder()
      : path_(std::filesystem::temp_directory_path() /
              ("plumbline_bags_" + std::to_string(getpid()) + "_" +
               std::to_string(count_++))) {
    std::filesystem::create_directories(path_);
  }
  ~Folder() { std::filesystem::remove_all(path_); }
  std::string operator/(const std::string& name) const {
    return (path_ / name).string();
  }

 private:
  static inline int count_ = 0;
  std::filesystem::path path_;
};

inline void WriteText(const std::string& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

inline const Registry& Readers() {
  static const Registry* const registry = [] {
    auto* const all = new Registry;
    RegisterBuiltinLogReaders(all);
    return all;
  }();
  return *registry;
}

inline Log ReadPath(const std::string& path, const LaserOptions& options = {}) {
  return ReadLog(path, Readers(), options);
}

// Of bytes, by the reader that recognizes them.
inline Log ReadBytes(const std::string& bytes,
                     const LaserOptions& options = {}) {
  InputStream input("bag", bytes);
  const LogReaderType* reader = RecognizeLog(Readers(), input.Peek(65536));
  if (reader == nullptr) throw Error("bag", 0, "is not recognized", "");
  return reader->read(&input, options);
}

inline std::string WhatOf(const std::string& bytes,
                          const LaserOptions& options = {}) {
  try {
    ReadBytes(bytes, options);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

inline std::int64_t SkippedInBag(const Log& log, const std::string& reason) {
  std::int64_t count = 0;
  for (const SkipReport& report : log.skipped) {
    if (report.reason.find(reason) != std::string::npos) count += report.count;
  }
  return count;
}

inline LaserScanMessage PlainScan(std::int64_t stamp) {
  LaserScanMessage scan;
  scan.header = {stamp, "laser"};
  scan.angle_min = -1.0;
  scan.angle_max = 1.0;
  scan.angle_increment = 0.5;
  scan.range_min = 0.1;
  scan.range_max = 10.0;
  scan.ranges = {1.0f, 2.0f, 3.0f, 4.0f, 5.0f};
  return scan;
}

inline BagRecord Record(const LaserScanMessage& scan, MessageEncoding encoding,
                        const std::string& topic = "/scan") {
  return {topic, "sensor_msgs/LaserScan", scan.header.stamp,
          EncodeLaserScan(scan, encoding)};
}

// Makes one of a record of a LaserScan.
inline void AsMultiEcho(MessageEncoding encoding, BagRecord* record) {
  LaserScanMessage scan;
  std::string why;
  if (!DecodeLaserScan(record->data, encoding, &scan, &why)) std::abort();
  record->type = "sensor_msgs/MultiEchoLaserScan";
  record->data = EncodeMultiEchoLaserScan(scan, encoding);
}

inline BagRecord OdometryRecord(std::int64_t stamp, const Pose2& pose,
                                MessageEncoding encoding,
                                const std::string& topic = "/odom") {
  OdometryMessage odometry;
  odometry.header = {stamp, "odom"};
  odometry.child_frame = "base_link";
  odometry.pose.x = pose[0];
  odometry.pose.y = pose[1];
  odometry.pose.qz = std::sin(0.5 * pose[2]);
  odometry.pose.qw = std::cos(0.5 * pose[2]);
  return {topic, "nav_msgs/Odometry", stamp,
          EncodeOdometry(odometry, encoding)};
}

inline TransformMessage Transform(std::int64_t stamp, const std::string& parent,
                                  const std::string& child, const Pose2& pose) {
  TransformMessage transform;
  transform.header = {stamp, parent};
  transform.child_frame = child;
  transform.transform.x = pose[0];
  transform.transform.y = pose[1];
  transform.transform.qz = std::sin(0.5 * pose[2]);
  transform.transform.qw = std::cos(0.5 * pose[2]);
  return transform;
}

inline BagRecord TfRecord(const TransformMessage& transform,
                          MessageEncoding encoding,
                          const std::string& topic = "/tf") {
  return {topic, "tf2_msgs/TFMessage", transform.header.stamp,
          EncodeTransforms({transform}, encoding)};
}

constexpr MessageEncoding kRos1 = MessageEncoding::kRos1;
constexpr MessageEncoding kCdr = MessageEncoding::kCdr;

// Scans a tenth of a second apart, odometry between them.
inline std::vector<BagRecord> SmallDrive(MessageEncoding encoding,
                                         int scans = 10) {
  std::vector<BagRecord> records;
  records.push_back(
      TfRecord(Transform(kBagStart, "base_link", "laser", Pose2(0.2, 0.0, 0.1)),
               encoding, "/tf_static"));
  for (int i = 0; i <= scans; ++i) {
    const std::int64_t time = kBagStart + i * kSecond / 10;
    records.push_back(OdometryRecord(
        time - kSecond / 20, Pose2(0.1 * i - 0.05, 0.0, 0.0), encoding));
    if (i < scans) records.push_back(Record(PlainScan(time), encoding));
  }
  return records;
}

}  // namespace plumbline

#endif  // PLUMBLINE_TEST_FRONTEND_BAGS_BAG_RECORDS_H_
