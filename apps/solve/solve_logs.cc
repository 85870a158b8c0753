#include <plumbline/apps/cli/app.h>
#include <plumbline/apps/cli/progress.h>
#include <plumbline/apps/solve/flag_remarks.h>
#include <plumbline/apps/solve/log_map.h>
#include <plumbline/apps/solve/run_outputs.h>
#include <plumbline/apps/solve/run_summary.h>
#include <plumbline/apps/solve/solve_log.h>
#include <plumbline/apps/solve/solve_logs.h>
#include <plumbline/apps/solve/solving_progress.h>
#include <plumbline/apps/solve_flags.h>
#include <plumbline/core/error.h>
#include <plumbline/core/graph_json.h>
#include <plumbline/core/utf8.h>
#include <plumbline/factors/angle.h>
#include <plumbline/pipeline/several_logs.h>

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <sstream>
#include <string>
#include <system_error>
#include <utility>

namespace plumbline {
namespace {

// What a summary says of several logs: their notes and what was passed over.
void AddNotes(const std::string& title, const Summary& log, Summary* summary) {
  for (SkipReport skip : log.skipped) {
    skip.reason = title + ": " + skip.reason;
    summary->skipped.push_back(std::move(skip));
  }
  for (const std::string& note : log.notes) {
    summary->notes.push_back(title + ": " + note);
  }
  summary->log_format = log.log_format;
  summary->scan_source = log.scan_source;
  summary->odometry_source = log.odometry_source;
}

// The flag that puts a log where it may lie.
std::string StartThatPlaces(std::size_t log, const Pose2& start) {
  char text[120];
  std::snprintf(text, sizeof text,
                "--start_pose=%zu:%.2f,%.2f,%.1f puts it there", log + 1,
                start[0], start[1], RadToDeg(start[2]));
  return text;
}

// What became of each log.
std::vector<Summary::LogInput> DescribeLogs(
    const std::vector<std::unique_ptr<OpenInput>>& inputs,
    const SeveralLogsResult& solved, const Registry& registry) {
  const bool has_trajectories =
      OutputsFromFlags(registry).count("trajectory.tum") > 0;
  std::vector<Summary::LogInput> logs;
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    const LogInMap& in_map = solved.logs[i];
    const TrackPlacement& placement = in_map.placement;
    Summary::LogInput log;
    log.input = inputs[i]->log.name;
    if (has_trajectories) {
      // Of one log that was only localized nothing else is in that file.
      log.trajectory = FLAGS_localize && inputs.size() == 1
                           ? "trajectory.tum"
                           : "trajectory_" + std::to_string(i + 1) + ".tum";
    }
    log.scans = static_cast<std::int64_t>(in_map.end - in_map.begin);
    log.map = FolderOfMap(in_map.map);
    log.parts = placement.windows;
    log.agreeing = placement.agreeing;
    log.contradicting = placement.contradicting;
    log.changed_places =
        placement.walls_through_map + placement.walls_through_track;
    if (!placement.found && in_map.map > 0) {
      log.why_apart = placement.why_not;
      log.candidate = in_map.candidate;
    }
    if (placement.found) {
      Remark(
          "%s: placed in the map: %d of %d parts of it agree with it, to "
          "%.2f m; %d contradict it",
          log.input.c_str(), log.agreeing, log.parts, placement.misfit,
          log.contradicting);
      log.uncertain = placement.doubt;
      if (!log.uncertain.empty()) {
        Remark("%s: may not be its place: %s", log.input.c_str(),
               log.uncertain.c_str());
      } else if (log.changed_places > 0) {
        Remark(
            "%s: at %d place%s one has wall where the other looks through: "
            "doors were opened or shut, or it is another building",
            log.input.c_str(), log.changed_places,
            log.changed_places > 1 ? "s" : "");
      }
    } else if (!log.why_apart.empty()) {
      Remark("%s: kept apart, in %s: %s", log.input.c_str(),
             (std::filesystem::path(FLAGS_output_dir) / log.map).c_str(),
             log.why_apart.c_str());
      if (log.candidate) {
        Remark("%s: may lie in the map of %s all the same: %s",
               log.input.c_str(), inputs.front()->log.name.c_str(),
               StartThatPlaces(i, *log.candidate).c_str());
      }
    }
    logs.push_back(std::move(log));
  }
  return logs;
}

// Parts of one recording, given one by one, lack what only the first of them
// has, as the place of the laser: a log that begins within this, s, of another
// one's end, by the same topics, looks like one.
constexpr double kGapOfParts = 2.0;
// What places in a bag are counted in (Log::position_unit).
constexpr char kBagPositions[] = "message";

// A word where a bag seems to go on with another one.
void TellParts(const std::vector<std::unique_ptr<OpenInput>>& inputs,
               const std::vector<Log>& logs, Summary* summary) {
  for (std::size_t i = 0; i < logs.size(); ++i) {
    for (std::size_t j = 0; j < logs.size(); ++j) {
      if (i == j || logs[i].position_unit != kBagPositions ||
          logs[i].scan_message != logs[j].scan_message ||
          logs[i].odometry_source != logs[j].odometry_source) {
        continue;
      }
      const double gap =
          logs[j].scans.front().timestamp - logs[i].scans.back().timestamp;
      if (!(gap >= 0.0 && gap <= kGapOfParts)) continue;
      const std::string note =
          "begins where " + inputs[i]->log.name +
          " ends: parts of one recording are better given together, as the "
          "folder that holds them";
      Remark("%s: %s", inputs[j]->log.name.c_str(), note.c_str());
      summary->notes.push_back(TitleOf(inputs[j]->log.name) + ": " + note);
    }
  }
}

// Reads all logs; each has odometry in the end.
std::vector<Log> ReadLogs(const std::vector<std::unique_ptr<OpenInput>>& inputs,
                          const LogSolverOptions& options, RunClock* clock,
                          Summary* summary) {
  clock->bar().Plan(
      StagesOfLogs(std::vector<double>(inputs.size(), 1.0), options));
  std::vector<Log> logs;
  for (const std::unique_ptr<OpenInput>& input : inputs) {
    const std::string& name = input->log.name;
    Summary of_log;
    Log log = ReadLog(input->log, clock, &of_log);
    summary->reading.Add(of_log.reading);
    if (log.scans.empty()) throw Error(name, 0, "no scans", "a log with scans");
    CompleteLog(name, options, clock, &log, &of_log);
    AddNotes(TitleOf(name), of_log, summary);
    logs.push_back(std::move(log));
  }
  TellParts(inputs, logs, summary);
  return logs;
}

SeveralLogsResult RunSeveralLogs(std::vector<Log> logs,
                                 const SeveralLogsOptions& options,
                                 const RunContext& run) {
  std::vector<std::size_t> num_scans;
  std::size_t scans = 0;
  for (const Log& log : logs) {
    num_scans.push_back(log.scans.size());
    scans += log.scans.size();
  }
  // Now the sizes of the logs are known.
  std::vector<double> sizes;
  for (const std::size_t number : num_scans) {
    sizes.push_back(static_cast<double>(number * logs.size()) /
                    static_cast<double>(scans));
  }
  run.clock->bar().Plan(StagesOfLogs(sizes, options.solver));
  SolvingProgress progress(run.clock, run.live);
  SeveralLogsControl control;
  control.begin_log = [&](std::size_t i) {
    progress.BeginLog("scans of log " + std::to_string(i + 1) + " of " +
                      std::to_string(num_scans.size()));
  };
  control.run = progress.Control();
  return SolveSeveralLogs(run.registry, std::move(logs), options, control);
}

// Says which logs fit nowhere in the earlier map.
void TellElsewhere(const std::vector<std::unique_ptr<OpenInput>>& inputs,
                   const SeveralLogsResult& solved) {
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    const TrackPlacement& placement = solved.logs[i].placement;
    if (placement.found) continue;
    std::fprintf(stderr, "%s fits nowhere in %s: %s\n",
                 PrintableUtf8(inputs[i]->log.name).c_str(),
                 PrintableUtf8(FLAGS_map).c_str(), placement.why_not.c_str());
    if (solved.logs[i].candidate) {
      std::fprintf(stderr, "it may lie there all the same: %s\n",
                   StartThatPlaces(i, *solved.logs[i].candidate).c_str());
    }
  }
  std::fprintf(stderr, "nothing is written\n");
}

// Writes where the robot was in the earlier map.
void WriteLocalized(const EarlierMap& earlier, const std::string& title,
                    const SeveralLogsResult& solved, Summary summary,
                    const RunContext& run) {
  const MapOfLogs& map = solved.maps.front();
  SolveOutcome outcome;
  outcome.summary = std::move(summary);
  // No structure is looked for: there is nothing that could yet converge.
  outcome.summary.em_termination = EmTermination::kConvergence;
  TellOfTrack(title, map.scans, map.result, &outcome.summary);
  const auto begin =
      static_cast<std::ptrdiff_t>(earlier.key_scans.scans.size());
  const std::vector<Scan> scans(map.scans.begin() + begin, map.scans.end());
  const std::vector<Pose2> poses(map.result.trajectory.begin() + begin,
                                 map.result.trajectory.end());
  outcome.summary.scans = outcome.summary.scans_in_log =
      static_cast<std::int64_t>(poses.size());
  outcome.trajectory = TimedTrajectory(scans, poses);
  if (map.logs.size() > 1) {
    const auto before = static_cast<std::size_t>(begin);
    for (const std::size_t i : map.logs) {
      const LogInMap& log = solved.logs[i];
      outcome.logs.push_back({i + 1, log.begin - before, log.end - before});
    }
  }
  outcome.graph = &earlier.graph;
  outcome.registry = &run.registry;
  outcome.scans = &scans;
  outcome.title = title + ", in " + TitleOf(FLAGS_map);
  FinishRun(run, 1, &outcome);
}

}  // namespace

std::unique_ptr<EarlierMap> EarlierMapFromFlags(const Registry& registry) {
  constexpr std::size_t kLargestMap = std::size_t{1} << 31;
  if (FLAGS_map.empty()) {
    if (!FLAGS_localize) return nullptr;
    throw Error("--localize", 0, "nothing to localize in", "--map=map.json");
  }
  if (FLAGS_localize && FLAGS_align == "building") {
    throw Error("--align", 0, "--localize gives poses in the frame of --map",
                "one of them");
  }
  if (FLAGS_localize && !(FLAGS_plan.empty() && FLAGS_constraints.empty())) {
    throw Error(FLAGS_plan.empty() ? "--constraints" : "--plan", 0,
                "has no effect with --localize, which leaves the map as it is",
                "one of them");
  }
  const std::string text = ReadTextInput(FLAGS_map, kLargestMap);
  auto map = std::make_unique<EarlierMap>();
  map->key_scans = ReadKeyScans(text, FLAGS_map);
  std::istringstream input(text);
  ReadGraphJson(input, FLAGS_map, registry, &map->graph);
  std::error_code error;
  if (std::filesystem::equivalent(
          std::filesystem::absolute(FLAGS_map, error).parent_path(),
          FLAGS_output_dir, error)) {
    throw Error("--output_dir", 0, "is the folder of --map", "another folder");
  }
  return map;
}

void CheckOptionsOfLogs(const LogSolverOptions& options) {
  if (options.features == RawFeatures::kSegments &&
      options.refine == Refinement::kFull) {
    return;
  }
  throw Error("--input", 0,
              "several logs, or --map, do not go with --features=points, "
              "--refine=map or --refine=none",
              "segments and full refinement");
}

int SolveLogs(const std::vector<std::unique_ptr<OpenInput>>& inputs,
              const std::vector<std::optional<Pose2>>& starts,
              const EarlierMap* earlier, const RunContext& run) {
  SeveralLogsOptions options;
  options.solver = LogSolverOptionsFromFlags(run.registry);
  options.starts = starts;
  if (earlier != nullptr) {
    options.earlier = &earlier->key_scans;
    options.earlier_wall_length = LengthOfWalls(earlier->graph);
    options.localize_only = FLAGS_localize;
  }
  CheckHierarchy(options.solver, run.registry);
  RemarkOnFlags("--input", "list of logs", "graphs", GraphFlags());
  std::vector<const LogReaderType*> readers;
  for (const auto& input : inputs) readers.push_back(input->log.reader);
  RemarkOnBagFlags("--input", readers);
  CheckOptionsOfLogs(options.solver);
  Summary common = BeginSummary();
  std::vector<Log> logs = ReadLogs(inputs, options.solver, run.clock, &common);

  const SeveralLogsResult solved =
      RunSeveralLogs(std::move(logs), options, run);
  if (solved.interrupted) {
    run.clock->bar().Finish();
    std::fprintf(stderr,
                 "interrupted: the logs are not put together, nothing is "
                 "written\n");
    return kExitInterrupted;
  }
  if (solved.is_elsewhere) {
    run.clock->bar().Finish();
    TellElsewhere(inputs, solved);
    return kExitElsewhere;
  }
  common.logs = DescribeLogs(inputs, solved, run.registry);
  if (FLAGS_localize) {
    WriteLocalized(*earlier, TitleOf(inputs.front()->log.name), solved,
                   std::move(common), run);
    return kExitSuccess;
  }

  // The output folder's own map comes last: its summary is the run's.
  for (std::size_t m = solved.maps.size(); m-- > 0;) {
    const MapOfLogs& map = solved.maps[m];
    SolveOutcome outcome;
    outcome.summary = common;
    std::string title;
    for (const std::size_t i : map.logs) {
      title += (title.empty() ? "" : ", ") + TitleOf(inputs[i]->log.name);
      outcome.logs.push_back({i + 1, solved.logs[i].begin, solved.logs[i].end});
    }
    run.clock->Begin("figures");
    TakeMap(title, map.scans, *map.solver, run.registry, options.solver,
            map.result, &outcome);
    if (m == 0) {
      FinishRun(run, solved.maps.size(), &outcome);
      continue;
    }
    OutputFolder apart(std::filesystem::path(FLAGS_output_dir) / FolderOfMap(m),
                       NamesOfAllOutputs(run.registry), InputFiles());
    WriteOutputs(&outcome, run.clock, &apart);
  }
  return kExitSuccess;
}

}  // namespace plumbline
