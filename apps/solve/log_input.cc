#include <plumbline/apps/cli/app.h>
#include <plumbline/apps/cli/progress.h>
#include <plumbline/apps/solve/log_input.h>
#include <plumbline/apps/solve/reading_meter.h>
#include <plumbline/apps/solve_flags.h>
#include <plumbline/core/graph_g2o.h>
#include <plumbline/core/stopwatch.h>
#include <plumbline/core/utf8.h>
#include <plumbline/factors/angle.h>
#include <plumbline/frontend/carmen_reader.h>
#include <plumbline/frontend/companions.h>
#include <plumbline/frontend/range_offset.h>
#include <plumbline/frontend/scan_odometry.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <string_view>

namespace plumbline {
namespace {

Log ReadInput(const LogInput& input, RunClock* clock) {
  LaserOptions options = LaserOptionsFromFlags();
  if (input.stream != nullptr) {
    const ReadingProgress progress(input.stream, clock);
    Log log = input.reader->read(input.stream, options);
    TakeOutRepeatedRange(options, &log);
    LeaveOutRepeatedScans(&log);
    return log;
  }
  options.stop = [] { return InterruptRequested(); };
  options.progress = [clock](std::int64_t done, std::int64_t size) {
    clock->bar().Update(ShareOf(done, size));
  };
  Log log = input.reader->read_path(input.name, options);
  TakeOutRepeatedRange(options, &log);
  LeaveOutRepeatedScans(&log);
  return log;
}

// What was passed over and taken for granted.
void TellOfLog(const std::string& name, const Log& log, Summary* summary) {
  for (const SkipReport& skip : log.skipped) {
    std::string places;
    for (int place : skip.first_lines) places += " " + std::to_string(place);
    // Some reports are of no place.
    if (!places.empty()) places = "; first at " + log.position_unit + places;
    Remark("%s: %lld skipped: %s%s", name.c_str(),
           static_cast<long long>(skip.count),
           PrintableUtf8(skip.reason).c_str(), places.c_str());
  }
  if (!log.skipped.empty() && !log.scans.empty()) {
    Remark("%s: used are %zu scans, from %.1f s to %.1f s", name.c_str(),
           log.scans.size(), log.scans.front().timestamp,
           log.scans.back().timestamp);
  }
  for (const std::string& note : log.notes) {
    Remark("%s: %s", name.c_str(), PrintableUtf8(note).c_str());
  }
  summary->skipped = log.skipped;
  summary->log_format = log.format;
  summary->scan_source = log.scan_message;
  summary->odometry_source = log.odometry_source;
  summary->notes = log.notes;
}

ScanOdometryOptions MatchingOptions(const LogSolverOptions& solver_options) {
  ScanOdometryOptions options;
  options.points = solver_options.odometry.points;
  options.matcher = solver_options.odometry.matcher;
  options.stop = [] { return InterruptRequested(); };
  return options;
}

void TellSweeps(const std::string& name, Summary* summary) {
  summary->notes.push_back(
      "scans fit each other better as sweeps of a turning laser: the motion "
      "during them is undone");
  Remark("%s: %s", name.c_str(), summary->notes.back().c_str());
}

// Names what MatchScansAlone takes the time of.
constexpr char kMatchingStep[] = "scan matching for want of odometry";

// The share of the way that scans may leave open without a word.
constexpr double kToldOpenShare = 0.05;

// Scan matching alone carries a log without odometry.
void MatchScansAlone(const std::string& name,
                     const LogSolverOptions& solver_options, RunClock* clock,
                     Log* log, Summary* summary) {
  clock->Begin(kMatchingStep);
  ScanOdometryOptions options = MatchingOptions(solver_options);
  options.progress = [clock](std::size_t done, std::size_t total) {
    clock->bar().Update(ShareOf(static_cast<std::int64_t>(done),
                                static_cast<std::int64_t>(total)));
  };
  const Stopwatch watch;
  const ScanOdometryReport report = AddScanOdometry(options, log);
  char text[256];
  summary->odometry_source = "scan matching";
  if (report.used_yaw_rates) {
    std::snprintf(text, sizeof text,
                  " with turn rates of %s (scale %.4g, bias %.3g degrees/s)",
                  log->yaw_rate_source.c_str(), report.yaw_scale,
                  RadToDeg(report.yaw_bias));
    summary->odometry_source += text;
  } else if (!log->yaw_rates.empty()) {
    std::snprintf(text, sizeof text,
                  "turn rates of %s are not used: they explain %.0f %% of how "
                  "the scans turn",
                  log->yaw_rate_source.c_str(),
                  100.0 * std::max(0.0, report.explained));
    Remark("%s: %s", name.c_str(), text);
    summary->notes.push_back(text);
  }
  Remark("%s: there is no odometry: %s carries it", name.c_str(),
         summary->odometry_source.c_str());
  if (report.sweep != 0) TellSweeps(name, summary);
  if (report.unmatched > 0) {
    std::snprintf(text, sizeof text,
                  "%zu of %zu scans could not be matched: there the robot is "
                  "taken to go on as before",
                  report.unmatched, log->scans.size());
    Remark("%s: %s", name.c_str(), text);
    summary->notes.push_back(text);
  }
  if (report.open_way > kToldOpenShare * report.way) {
    std::snprintf(text, sizeof text,
                  "on %.0f of %.0f m of the way the scans do not tell how far "
                  "the robot went: lengths there may be off",
                  report.open_way, report.way);
    Remark("%s: %s", name.c_str(), text);
    summary->notes.push_back(text);
    summary->open_way = report.open_way;
  }
  Detail("matched scans for want of odometry in %.1f s", watch.Seconds());
}

// What a turning laser saw while the robot moved, where the log does not say
// how long its sweeps take.
void UndoSweeps(const std::string& name, const LogSolverOptions& solver_options,
                RunClock* clock, Log* log, Summary* summary) {
  if (!solver_options.odometry.match_scans) return;
  clock->Begin("sweeps of the laser");
  if (UndoSweepsByOdometry(MatchingOptions(solver_options), log) != 0) {
    TellSweeps(name, summary);
  }
}

// What the laser reads too long or too short everywhere.
void UndoRangeOffset(const std::string& name, RunClock* clock, Log* log,
                     Summary* summary) {
  clock->Begin("offset of the laser's ranges");
  const RangeOffset found = FindRangeOffset(log->scans);
  Detail("%s: %d pairs of scans: ranges off by %.1f mm (+- %.1f) at first",
         name.c_str(), found.pairs, 1e3 * found.first, 1e3 * found.sigma);
  if (found.offset == 0.0) return;
  for (Scan& scan : log->scans) TakeOutRangeOffset(found.offset, &scan);
  summary->range_offset = found.offset;
  char text[160];
  std::snprintf(text, sizeof text,
                "the laser's ranges are %.0f mm too %s: that is taken out",
                1e3 * std::abs(found.offset),
                found.offset > 0.0 ? "long" : "short");
  summary->notes.push_back(text);
  Remark("%s: %s", name.c_str(), text);
}

// What goes along with the robot stands nowhere in the map.
void LeaveOutCompanions(const std::string& name,
                        const LogSolverOptions& solver_options, RunClock* clock,
                        Log* log, Summary* summary) {
  if (!solver_options.odometry.match_scans) return;
  clock->Begin("what goes along with the robot");
  CompanionOptions options;
  options.points = solver_options.odometry.points;
  const std::vector<Companion> companions =
      TakeOutCompanions(options, &log->scans);
  if (companions.empty()) return;
  double way = 0.0;
  std::int64_t returns = 0;
  for (const Companion& companion : companions) {
    const auto time_of = [&](int scan) {
      return log->scans[static_cast<std::size_t>(scan)].timestamp;
    };
    Detail("%s: something went along with the robot from %.1f s to %.1f s",
           name.c_str(), time_of(companion.begin), time_of(companion.end));
    way += companion.way;
    returns += companion.returns;
  }
  const int begin = companions.front().begin;
  char text[200];
  std::snprintf(
      text, sizeof text,
      "something went along with the robot for %.1f m in %zu stretch%s, the "
      "first from %.1f s on: its %lld returns are left out",
      way, companions.size(), companions.size() == 1 ? "" : "es",
      log->scans[static_cast<std::size_t>(begin)].timestamp,
      static_cast<long long>(returns));
  summary->notes.push_back(text);
  Remark("%s: %s", name.c_str(), text);
}

}  // namespace

ReadingProgress::ReadingProgress(InputStream* input, RunClock* clock)
    : input_(input) {
  input_->SetProgress([clock](std::int64_t done, std::int64_t size) {
    clock->bar().Update(ShareOf(done, size));
  });
}

std::unique_ptr<OpenInput> Open(const std::string& name,
                                const Registry& registry,
                                const LogReaderType* reader) {
  const ReadingMeter meter;
  auto input = std::make_unique<OpenInput>();
  input->log.name = name;
  if (name != "-") {
    const bool takes_path = reader != nullptr && reader->read_path != nullptr &&
                            reader->recognizes_path != nullptr &&
                            reader->recognizes_path(name);
    input->log.reader = takes_path          ? reader
                        : reader == nullptr ? RecognizeLogPath(registry, name)
                                            : nullptr;
  }
  if (input->log.reader != nullptr) return input;
  if (name != "-") RefuseFolder(name);
  input->stream.emplace(name, [] { return InterruptRequested(); });
  const std::string_view prefix = input->stream->Peek(1 << 16);
  if (prefix.empty() && InterruptRequested()) return nullptr;
  if (reader == nullptr) reader = RecognizeLog(registry, prefix);
  input->is_graph = reader == nullptr && LooksLikeG2o(prefix);
  // What nobody recognizes is for the reader of the commonest format to
  // refuse: it says what it found.
  if (reader == nullptr) reader = &registry.Get<LogReaderType>("carmen");
  input->log.reader = reader;
  input->log.stream = &*input->stream;
  input->log.name = input->stream->name();
  input->log.opening = meter.Read();
  return input;
}

Log ReadLog(const LogInput& input, RunClock* clock, Summary* summary) {
  clock->Begin("reading");
  const ReadingMeter meter;
  Log log = ReadInput(input, clock);
  summary->reading = input.opening;
  summary->reading.Add(meter.Read());
  TellOfLog(input.name, log, summary);
  Detail(
      "read %zu scans in %.2f s, %.2f s of them idle; all threads computed for "
      "%.2f s",
      log.scans.size(), summary->reading.seconds, summary->reading.idle_seconds,
      summary->reading.cpu_seconds);
  return log;
}

void CompleteLog(const std::string& name, const LogSolverOptions& options,
                 RunClock* clock, Log* log, Summary* summary) {
  if (!log->has_odometry) {
    MatchScansAlone(name, options, clock, log, summary);
  } else {
    UndoSweeps(name, options, clock, log, summary);
    LeaveOutCompanions(name, options, clock, log, summary);
  }
  if (options.range_offset) UndoRangeOffset(name, clock, log, summary);
}

// The scans of a log are counted on the way; what comes after the last one is
// taken to be as much work for every scan as it is in the middle of logs with
// 800 to 17,000 of them.
std::vector<WorkStage> StagesOfLogs(const std::vector<double>& sizes,
                                    const LogSolverOptions& options) {
  double all = 0.0;
  std::vector<WorkStage> stages;
  for (const double size : sizes) {
    all += size;
    stages.push_back({"reading", 0.1 * size});
  }
  for (const double size : sizes) {
    stages.push_back({"scans", size});
    if (!options.structure) continue;
    stages.push_back({"structure of the whole map", 0.02 * size});
    stages.push_back({"closing of loops", 0.15 * size});
  }
  if (sizes.size() > 1) stages.push_back({"placing of logs", 0.5 * all});
  if (RecoversPoses(options))
    stages.push_back({"recovery of poses", 0.2 * all});
  if (options.refine == Refinement::kFull) {
    stages.push_back({"adjustment of poses", 0.5 * all});
    stages.push_back({"walls from adjusted poses", 0.1 * all});
    stages.push_back({"joint adjustment of poses and walls", 0.2 * all});
    stages.push_back({"structure of the map from adjusted poses", 0.2 * all});
  }
  if (options.check_map) stages.push_back({"check of the map", 0.1 * all});
  stages.push_back({"writing", 0.4 * all});
  return stages;
}

std::vector<WorkStage> StagesWithMatching(const std::vector<double>& sizes,
                                          const LogSolverOptions& options) {
  std::vector<WorkStage> stages = StagesOfLogs(sizes, options);
  stages.insert(stages.begin(), {kMatchingStep, 1.0});
  return stages;
}

}  // namespace plumbline
