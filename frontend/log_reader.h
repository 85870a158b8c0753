#ifndef PLUMBLINE_FRONTEND_LOG_READER_H_
#define PLUMBLINE_FRONTEND_LOG_READER_H_

#include <plumbline/core/registry.h>
#include <plumbline/frontend/input_stream.h>
#include <plumbline/frontend/scan.h>

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace plumbline {

/// What a log does not say, or says wrongly, about its laser, and which part of
/// it is to be read.
struct LaserOptions {
  /// Direction of the first beam in the laser's frame, rad. Unset: from the
  /// log, or by its format.
  std::optional<double> laser_start_angle;
  /// Step between beams, rad. Unset: as above.
  std::optional<double> laser_step;
  /// Readings at or above it are no return, m. Unset: as above. How far a laser
  /// is trusted is the front-end's business, not the reader's.
  std::optional<double> laser_max_range;
  /// Topic of the scans in a log that has topics. Empty: the only one there is.
  std::string scan_topic;
  /// Topic of the odometry; "tf": the transform of odom to the robot; "none":
  /// without odometry. Empty: the only one there is, else tf, else without.
  std::string odometry_topic;
  /// Called with what the log holds once it was read, even when it is then
  /// refused. May be empty.
  std::function<void(const std::vector<LogTopic>& topics)> on_topics;
  /// Asked while a folder is read: true ends the input there. Below, told how
  /// much was read, bytes. A single file has those of its InputStream. May be
  /// empty.
  std::function<bool()> stop;
  std::function<void(std::int64_t done, std::int64_t size)> progress;
};

/// A format of robot logs: a kind of plug-in (Registry::Register, Find, Get,
/// All).
struct LogReaderType {
  static constexpr char kKind[] = "log reader";
  static constexpr char kTitle[] = "Log readers (--log_reader)";

  /// "carmen"
  std::string name;
  std::string description;
  /// Whether text with this beginning is such a log. A few kilobytes are
  /// given, or all there is; unpacked where the input is compressed.
  std::function<bool(std::string_view prefix)> recognizes;
  /// Reads a log. Lines that cannot be used are passed over and counted in
  /// Log::skipped; throws Error when there is no scan at all.
  std::function<Log(InputStream* input, const LaserOptions& options)> read;
  /// For logs that are a folder, or more than the stream of a file's bytes:
  /// whether the file or folder at `path` is such a log, asked before
  /// `recognizes`, and what reads it then, in place of `read`. Both or none.
  std::function<bool(const std::string& path)> recognizes_path;
  std::function<Log(const std::string& path, const LaserOptions& options)>
      read_path;
};

/// The first reader, in the order of names, that recognizes text that starts
/// with `prefix`; null when none does.
const LogReaderType* RecognizeLog(const Registry& registry,
                                  std::string_view prefix);

/// The first reader, in the order of names, that recognizes the file or folder
/// `path` as a whole (LogReaderType::recognizes_path); null when none does.
const LogReaderType* RecognizeLogPath(const Registry& registry,
                                      const std::string& path);

/// Throws Error for a folder that no reader recognizes; what else there may be
/// at `path` is let pass.
void RefuseFolder(const std::string& path);

/// Takes readings of the largest range for no return where they stand for that
/// (RepeatedRange), whatever the log says of its laser's range, and reports
/// them in Log::skipped; leaves all as it is where the options say it. Readers
/// of formats need not care.
void TakeOutRepeatedRange(const LaserOptions& options, Log* log);

/// Leaves out scans that have every reading of the one before them although
/// odometry has moved: the laser had stopped, or looks less often than its
/// scans are noted. They would hold the robot where it was. Reports them in
/// Log::skipped. Of a log in which they are more than three fifths, as one of a
/// simulated laser without noise may be, all stay. Readers of formats need not
/// care.
void LeaveOutRepeatedScans(Log* log);

/// Reads the log `path` ("-": standard input), whatever its format and
/// compression, with the reader that recognizes it. Throws Error when the file
/// cannot be read, no reader of the registry (RegisterBuiltinLogReaders)
/// recognizes it, or there is no scan in it.
Log ReadLog(const std::string& path, const Registry& registry,
            const LaserOptions& options = {});

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_LOG_READER_H_
