#include <plumbline/frontend/bags/bag_log.h>
#include <plumbline/frontend/bags/mcap.h>
#include <plumbline/frontend/bags/rosbag1.h>
#include <plumbline/frontend/bags/rosbag2.h>
#include <plumbline/frontend/builtins.h>
#include <plumbline/frontend/carmen_reader.h>
#include <plumbline/frontend/csv_reader.h>
#include <plumbline/frontend/log_reader.h>

#include <memory>
#include <string>
#include <utility>

namespace plumbline {
namespace {

LogReaderType BagReaderType(const char* name, const char* description,
                            bool (*recognizes)(std::string_view),
                            std::unique_ptr<BagSource> (*open)(InputStream*)) {
  LogReaderType type;
  type.name = name;
  type.description = description;
  type.recognizes = recognizes;
  type.read = [open](InputStream* input, const LaserOptions& options) {
    return ReadBag(open(input).get(), input->name(), options);
  };
  return type;
}

}  // namespace

void RegisterBuiltinLogReaders(Registry* registry) {
  if (registry->Find<LogReaderType>("carmen") == nullptr) {
    LogReaderType carmen;
    carmen.name = "carmen";
    carmen.description =
        "CARMEN: FLASER, RLASER, ROBOTLASER1, RAWLASER1, ODOM, PARAM";
    carmen.recognizes = LooksLikeCarmenLog;
    carmen.read = [](InputStream* input, const LaserOptions& options) {
      return ReadCarmenLog(input, options);
    };
    registry->Register(std::move(carmen));
  }
  const auto add = [registry](LogReaderType type) {
    if (registry->Find<LogReaderType>(type.name) == nullptr) {
      registry->Register(std::move(type));
    }
  };
  LogReaderType csv;
  csv.name = "csv";
  csv.description =
      "CSV of scans: time, start_angle, angle_step, r0, r1, ...; x, y, theta";
  csv.recognizes = LooksLikeCsvLog;
  csv.read = ReadCsvLog;
  add(std::move(csv));
  add(BagReaderType("mcap",
                    "MCAP: messages of ROS 2 or ROS 1, chunks plain, "
                    "lz4 or zstd",
                    LooksLikeMcap, OpenMcap));
  add(BagReaderType("ros1_bag", "ROS 1 bag (2.0): chunks plain, bz2 or lz4",
                    LooksLikeRosbag1, OpenRosbag1));
  LogReaderType ros2 = BagReaderType(
      "ros2_bag",
      "ROS 2 bag: folder with metadata.yaml and .db3 or .mcap, or a .db3",
      LooksLikeSqlite, OpenRosbag2Sqlite);
  ros2.recognizes_path = LooksLikeRosbag2Folder;
  ros2.read_path = [](const std::string& path, const LaserOptions& options) {
    return ReadBag(
        OpenRosbag2Folder(path, options.stop, options.progress).get(), path,
        options);
  };
  add(std::move(ros2));
}

}  // namespace plumbline
