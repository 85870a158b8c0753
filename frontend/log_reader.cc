#include <plumbline/core/error.h>
#include <plumbline/factors/angle.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/carmen_reader.h>
#include <plumbline/frontend/laser_profile.h>
#include <plumbline/frontend/log_reader.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <string>
#include <system_error>
#include <utility>

namespace plumbline {
namespace {

// So much of a log is shown to the readers.
constexpr std::size_t kRecognizedBytes = std::size_t{1} << 16;
// Lines of a report that are shown.
constexpr std::size_t kShownLines = 5;
// Readings that are the same, m.
constexpr double kSameReading = 0.0005;
// A robot that has moved by more, m and rad, sees something else. Fewer returns
// than this tell nothing; where more scans of a log than this share repeat the
// one before, its laser may be one without noise.
constexpr double kMovedWay = 0.02;
constexpr double kMovedTurn = DegToRad(1.0);
constexpr std::int64_t kFewestReturns = 10;
constexpr double kMostRepeated = 0.6;

// Whether a scan is one that was noted before, at another place.
bool IsRepeated(const Scan& scan, const Scan& before) {
  if (scan.ranges != before.ranges || scan.bearings != before.bearings ||
      scan.start_angle != before.start_angle ||
      scan.angle_step != before.angle_step) {
    return false;
  }
  const Pose2 motion = Between(before.odometry, scan.odometry);
  return (motion.head<2>().norm() > kMovedWay ||
          std::abs(motion[2]) > kMovedTurn) &&
         std::count_if(scan.ranges.begin(), scan.ranges.end(), [](float range) {
           return range > 0.0f;
         }) >= kFewestReturns;
}

}  // namespace

const LogReaderType* RecognizeLog(const Registry& registry,
                                  std::string_view prefix) {
  for (const LogReaderType* reader : registry.All<LogReaderType>()) {
    if (reader->recognizes != nullptr && reader->recognizes(prefix)) {
      return reader;
    }
  }
  return nullptr;
}

const LogReaderType* RecognizeLogPath(const Registry& registry,
                                      const std::string& path) {
  for (const LogReaderType* reader : registry.All<LogReaderType>()) {
    if (reader->recognizes_path != nullptr && reader->read_path != nullptr &&
        reader->recognizes_path(path)) {
      return reader;
    }
  }
  return nullptr;
}

void RefuseFolder(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::is_directory(path, error)) return;
  throw Error(path, 0, "is a directory",
              "a file, or the folder of a ROS 2 bag with metadata.yaml, or of "
              "the parts of a ROS 1 bag");
}

void TakeOutRepeatedRange(const LaserOptions& options, Log* log) {
  if (options.laser_max_range) return;
  const double repeated = RepeatedRange(log->scans);
  if (repeated == 0.0) return;
  char reason[160];
  std::snprintf(reason, sizeof reason,
                "readings of %.3f m, the largest of all and always the same: "
                "taken for no return, whatever the largest range is said to be",
                repeated);
  SkipReport skip;
  skip.reason = reason;
  for (Scan& scan : log->scans) {
    bool has_it = false;
    for (float& range : scan.ranges) {
      if (range < static_cast<float>(repeated - kSameReading)) continue;
      range = 0.0f;
      has_it = true;
      ++skip.count;
    }
    scan.maximum_range = std::min(scan.maximum_range, repeated);
    if (has_it && skip.first_lines.size() < kShownLines) {
      skip.first_lines.push_back(scan.line);
    }
  }
  log->skipped.push_back(std::move(skip));
}

void LeaveOutRepeatedScans(Log* log) {
  std::vector<bool> is_repeated(log->scans.size(), false);
  std::size_t last = 0;
  SkipReport skip;
  for (std::size_t i = 1; i < log->scans.size(); ++i) {
    is_repeated[i] = IsRepeated(log->scans[i], log->scans[last]);
    if (!is_repeated[i]) {
      last = i;
      continue;
    }
    ++skip.count;
    if (skip.first_lines.size() < kShownLines) {
      skip.first_lines.push_back(log->scans[i].line);
    }
  }
  if (skip.count == 0 ||
      static_cast<double>(skip.count) >
          kMostRepeated * static_cast<double>(log->scans.size())) {
    return;
  }
  skip.reason =
      "scan with every reading of the one before it although odometry has "
      "moved: the laser had not looked again";
  std::size_t kept = 0;
  for (std::size_t i = 0; i < log->scans.size(); ++i) {
    if (is_repeated[i]) continue;
    if (kept != i) log->scans[kept] = std::move(log->scans[i]);
    ++kept;
  }
  log->scans.resize(kept);
  log->skipped.push_back(std::move(skip));
}

Log ReadLog(const std::string& path, const Registry& registry,
            const LaserOptions& options) {
  if (path != "-") {
    const LogReaderType* reader = RecognizeLogPath(registry, path);
    if (reader != nullptr) {
      Log log = reader->read_path(path, options);
      TakeOutRepeatedRange(options, &log);
      LeaveOutRepeatedScans(&log);
      return log;
    }
    RefuseFolder(path);
  }
  InputStream input(path, options.stop);
  const LogReaderType* reader =
      RecognizeLog(registry, input.Peek(kRecognizedBytes));
  if (reader == nullptr && LooksLikeG2o(input.Peek(kRecognizedBytes))) {
    throw Error(input.name(), 0, "is a graph (g2o), not a log", "a log");
  }
  if (reader == nullptr) {
    std::string names;
    for (const LogReaderType* known : registry.All<LogReaderType>()) {
      names += (names.empty() ? "" : ", ") + known->name;
    }
    // What breaks off may be one, if there were more of it.
    throw Error(input.name(), 0,
                "is no log of a known format" +
                    (input.damage().empty() ? "" : ", and " + input.damage()),
                names.empty() ? "log readers in the registry"
                              : "a log for one of the readers " + names);
  }
  Log log = reader->read(&input, options);
  TakeOutRepeatedRange(options, &log);
  LeaveOutRepeatedScans(&log);
  return log;
}

}  // namespace plumbline
