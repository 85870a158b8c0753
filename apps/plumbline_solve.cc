// Turns a robot's log, or a graph, into a true map.

#include <gflags/gflags.h>
#include <plumbline/apps/cli/app.h>
#include <plumbline/apps/cli/progress.h>
#include <plumbline/apps/solve_flags.h>
#include <plumbline/core/error.h>
#include <plumbline/core/graph_g2o.h>
#include <plumbline/core/graph_json.h>
#include <plumbline/core/initial_guess.h>
#include <plumbline/core/parallel_for.h>
#include <plumbline/core/plugin.h>
#include <plumbline/core/sha256.h>
#include <plumbline/core/stopwatch.h>
#include <plumbline/core/utf8.h>
#include <plumbline/core/version.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/frontend/builtins.h>
#include <plumbline/frontend/carmen_reader.h>
#include <plumbline/frontend/input_stream.h>
#include <plumbline/frontend/key_scan_archive.h>
#include <plumbline/frontend/log_reader.h>
#include <plumbline/frontend/scan_odometry.h>
#include <plumbline/outputs/building_frame.h>
#include <plumbline/outputs/checkpoint_file.h>
#include <plumbline/outputs/closing_lines.h>
#include <plumbline/outputs/live_report.h>
#include <plumbline/outputs/marginals_output.h>
#include <plumbline/outputs/output_folder.h>
#include <plumbline/outputs/report.h>
#include <plumbline/outputs/solve_outputs.h>
#include <plumbline/outputs/summary.h>
#include <plumbline/pipeline/graph_solver.h>
#include <plumbline/pipeline/log_solver.h>
#include <plumbline/pipeline/several_logs.h>
#include <plumbline/pipeline/without_structure.h>
#include <sys/stat.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

// Of apps/cli.
DECLARE_bool(quiet);

namespace plumbline {
namespace {

void LoadPlugins(Registry* registry) {
  std::istringstream list(FLAGS_plugins);
  std::string path;
  while (std::getline(list, path, ',')) {
    if (!path.empty()) LoadPlugin(path, registry);
  }
}

// Parameters of a detector, a line each: "min_side=1 m", "angle_0, angle_1, ...
// deg".
void ListParameters(const DetectorType& detector) {
  for (const DetectorParameter& parameter : detector.parameters) {
    std::ostringstream text;
    if (parameter.is_list) {
      text << parameter.name << "0, " << parameter.name << "1, ...";
    } else {
      text << parameter.name << '=' << parameter.default_value;
    }
    if (!parameter.unit.empty()) text << ' ' << parameter.unit;
    std::printf("    %-32s %s\n", text.str().c_str(),
                parameter.description.c_str());
  }
}

void ListPlugins(const Registry& registry) {
  for (const PluginList* list : registry.lists()) {
    std::printf("%s\n", list->title().c_str());
    for (const PluginList::Entry& entry : list->entries()) {
      std::printf("  %-34s %s\n", entry.name.c_str(),
                  entry.description.c_str());
      if (list->title() != DetectorType::kTitle) continue;
      ListParameters(registry.GetDetector(entry.name));
    }
  }
}

std::string Joined(const std::vector<std::string>& names) {
  std::string list;
  for (const std::string& name : names) {
    list += (list.empty() ? "" : ", ") + name;
  }
  return list;
}

// What became of files that an earlier run or somebody else left in the folder.
void TellChanges(const OutputFolder::Changes& changes, const Summary& summary) {
  const char* folder = FLAGS_output_dir.c_str();
  if (!changes.removed.empty()) {
    Remark("%s: removed of an earlier run: %s", folder,
           Joined(changes.removed).c_str());
  }
  if (!changes.kept.empty()) {
    Remark("%s: kept of an earlier run: %s", folder,
           Joined(changes.kept).c_str());
  }
  if (!changes.replaced_foreign.empty()) {
    Remark("%s: replaced, though no run had written them: %s", folder,
           Joined(changes.replaced_foreign).c_str());
  }
  if (!summary.partial) return;
  const std::string scans =
      summary.scans_in_log > 0
          ? " (" + std::to_string(summary.scans) + " of " +
                std::to_string(summary.scans_in_log) + " scans)"
          : "";
  Remark("%s: holds a part of the run%s%s", folder, scans.c_str(),
         changes.replaced_whole_run ? " in place of a whole one" : "");
}

// Times of a whole run and of its steps, and the bar over them: each step ends
// where the next begins.
class RunClock {
 public:
  // A step; one of the same name goes on.
  void Begin(const std::string& step) {
    bar_.Begin(step);
    const double now = watch_.Seconds();
    Add(now - step_begin_, &steps_);
    step_ = step;
    step_begin_ = now;
  }

  // The bar over all steps.
  WorkProgress& bar() { return bar_; }

  // The step that is under way.
  const std::string& step() const { return step_; }

  // The total and the steps until now.
  void Read(Summary* summary) const {
    summary->total_seconds = watch_.Seconds();
    summary->step_seconds = steps_;
    Add(summary->total_seconds - step_begin_, &summary->step_seconds);
  }

 private:
  using Steps = std::vector<std::pair<std::string, double>>;

  // Takes in the step that is under way.
  void Add(double seconds, Steps* steps) const {
    const auto same =
        std::find_if(steps->begin(), steps->end(),
                     [this](const auto& step) { return step.first == step_; });
    if (same == steps->end()) {
      steps->emplace_back(step_, seconds);
    } else {
      same->second += seconds;
    }
  }

  WorkProgress bar_;
  Stopwatch watch_;
  Steps steps_;
  std::string step_ = "start";
  // s on the watch.
  double step_begin_ = 0.0;
};

// Below 0 when the whole is not known.
double ShareOf(std::int64_t done, std::int64_t total) {
  return total > 0 ? static_cast<double>(done) / static_cast<double>(total)
                   : -1.0;
}

// Which files --outputs asks for. Where a log is only localized the map is as
// it was, and so are the files that are made of it alone.
std::set<std::string> OutputsFromFlags(const Registry& registry) {
  std::set<std::string> names = SelectOutputs(FLAGS_outputs, registry);
  if (!FLAGS_localize) return names;
  std::set<std::string> left;
  for (const char* name : {"map.png", "map.svg", "trajectory.tum"}) {
    if (names.count(name) > 0) left.insert(name);
  }
  return left;
}

// Writes all files and puts them in place together, the summary last: it knows
// what the others took.
void WriteOutputs(SolveOutcome* outcome, RunClock* clock,
                  OutputFolder* folder) {
  clock->Begin("writing");
  const Stopwatch watch;
  outcome->summary.partial = InterruptRequested();
  CountGraph(*outcome->graph, &outcome->summary);
  for (const PlacedClosure& closure : outcome->closures) {
    Summary::Closures& counts = outcome->summary.closures;
    ++counts.proposed;
    ++(closure.holds ? counts.live : counts.broken);
  }
  // What the report says; the summary, written last, has the whole.
  clock->Read(&outcome->summary);
  outcome->summary.peak_memory_bytes = PeakMemoryBytes();
  outcome->flags = OwnFlags();
  outcome->delta_threshold = FLAGS_delta_threshold;
  try {
    WrittenOutputs written = WriteSolveOutputs(
        *outcome, OutputsFromFlags(*outcome->registry), folder->staging(),
        NumThreadsFromFlags(), [clock](int done, int total) {
          clock->bar().Update(ShareOf(done, total));
        });
    for (const std::string& reason : written.reasons) {
      Remark("%s", reason.c_str());
    }
    outcome->summary.files = std::move(written.files);
    outcome->summary.digests = written.digests;
    outcome->summary.write_seconds = watch.Seconds();
    clock->Read(&outcome->summary);
    outcome->summary.peak_memory_bytes = PeakMemoryBytes();
    WriteSummary(outcome->summary,
                 (folder->staging() / OutputFolder::kSummary).string());
    TellChanges(folder->Commit(written.digests), outcome->summary);
  } catch (const Error& error) {
    throw folder->InPlace(error);
  }
  for (const auto& [step, seconds] : outcome->summary.step_seconds) {
    Detail("%8.3f s  %s", seconds, step.c_str());
  }
  Detail("written to %s in %.1f s", FLAGS_output_dir.c_str(), watch.Seconds());
}

// The last words of a run.
void TellEnd(const SolveOutcome& outcome, RunClock* clock) {
  clock->bar().Finish();
  if (FLAGS_quiet) return;
  for (const std::string& line :
       FLAGS_localize ? ClosingLinesInMap(outcome, FLAGS_output_dir, FLAGS_map)
                      : ClosingLines(outcome, FLAGS_output_dir)) {
    std::printf("%s\n", PrintableLines(line).c_str());
  }
}

// All files that the run reads, as far as flags name them.
std::vector<std::filesystem::path> InputFiles() {
  std::vector<std::filesystem::path> files = {FLAGS_structure_prior, FLAGS_map,
                                              FLAGS_plan, FLAGS_constraints};
  for (const std::string& input : InputsFromFlags()) {
    files.emplace_back(input == "-" ? "/dev/stdin" : input);
  }
  std::istringstream plugins(FLAGS_plugins);
  std::string plugin;
  while (std::getline(plugins, plugin, ',')) files.push_back(plugin);
  return files;
}

// Every name that a run may write.
std::set<std::string> NamesOfAllOutputs(const Registry& registry) {
  std::set<std::string> names =
      FilesOfOutputs(SelectOutputs("all", registry), registry);
  names.insert(CheckpointFile::kName);
  return names;
}

// Where the files of a map go: those of the first log's map into the output
// folder itself.
std::string FolderOfMap(std::size_t map) {
  return map == 0 ? "" : "map_" + std::to_string(map + 1);
}

// Removes the maps of logs that an earlier run kept apart, from this one on:
// they are none of the present run's.
void RemoveMapsFrom(std::size_t map, const Registry& registry) {
  for (; map < kMostLogs; ++map) {
    const std::filesystem::path path =
        std::filesystem::path(FLAGS_output_dir) / FolderOfMap(map);
    std::error_code error;
    if (!std::filesystem::is_directory(path, error)) continue;
    OutputFolder::Changes changes;
    try {
      changes =
          OutputFolder(path, NamesOfAllOutputs(registry), InputFiles()).Clear();
    } catch (const Error& failure) {
      // The run's own files are in place.
      Remark("%s", failure.what());
      continue;
    }
    if (!changes.removed.empty()) {
      Remark("%s: removed of an earlier run: %s", path.c_str(),
             Joined(changes.removed).c_str());
    }
    if (!changes.kept.empty()) {
      Remark("%s: kept of an earlier run: %s", path.c_str(),
             Joined(changes.kept).c_str());
    }
  }
}

// Of `flags` those that were given, "--a, --b"; how many.
int GivenOf(const std::vector<std::string>& flags, std::string* given) {
  int count = 0;
  for (const FlagValue& flag : ChangedFlags()) {
    if (std::count(flags.begin(), flags.end(), flag.name) == 0) continue;
    *given += (count++ > 0 ? ", --" : "--") + flag.name;
  }
  return count;
}

// Says which flags that were given do nothing for this kind of input.
void RemarkOnFlags(const std::string& name, const char* kind,
                   const char* other_kind,
                   const std::vector<std::string>& of_the_other) {
  std::string flags;
  const int count = GivenOf(of_the_other, &flags);
  if (count == 0) return;
  Remark("%s is a %s: %s %s for %s and %s no effect", name.c_str(), kind,
         flags.c_str(), count > 1 ? "are" : "is", other_kind,
         count > 1 ? "have" : "has");
}

// The same of flags that say more of structure where none is looked for. That
// is no mistake in a sweep, or in a file of flags that is used with and without
// structure.
void RemarkOnStructureFlags() {
  if (FLAGS_structure) return;
  std::string flags;
  const int count = GivenOf(StructureFlags(), &flags);
  if (count == 0) return;
  Remark("--structure=false: %s %s of structure and %s no effect",
         flags.c_str(), count > 1 ? "say more" : "says more",
         count > 1 ? "have" : "has");
}

// Covariances and ellipses that were asked for.
void TakeMarginals(const SolverSession* session, SolveOutcome* outcome) {
  const Stopwatch watch;
  outcome->covariances = ComputeMarginals(
      *outcome->graph, session,
      ParseMarginalsSelection(FLAGS_marginals, *outcome->registry),
      FLAGS_marginals_hold_gauge);
  outcome->ellipse_sigmas = FLAGS_ellipse_sigmas;
  if (!outcome->covariances.empty()) {
    Detail("covariances of %zu features in %.1f s", outcome->covariances.size(),
           watch.Seconds());
  }
}

// What the summary says of costs and EM.
void Summarize(const CostReport& initial, const CostReport& last,
               const EmReport& em, Summary* summary) {
  summary->initial_cost = initial.total();
  summary->measurement_cost = last.measurement;
  summary->structure_cost = last.structure;
  summary->em_iterations = em.iterations;
  summary->em_termination = em.termination;
  summary->detect_seconds = em.detect_seconds;
  summary->solve_seconds = em.solve_seconds;
}

// A line on a phase of EM.
void TellPhase(const EmPhase& phase) {
  Detail("EM %d %s: cost %.6g + %.6g, %d structure constraints, %d broken",
         phase.iteration, phase.phase.c_str(), phase.cost.measurement,
         phase.cost.structure, phase.structure_constraints,
         phase.broken_constraints);
  for (const auto& [detector, counts] : phase.detections) {
    std::string list;
    for (const auto& [name, number] : counts) {
      if (number == 0) continue;
      list += (list.empty() ? "" : ", ") + name + " " + std::to_string(number);
    }
    if (!list.empty()) Detail("  %s: %s", detector.c_str(), list.c_str());
  }
}

// Tells the bar how much of an input is read.
class ReadingProgress {
 public:
  ReadingProgress(InputStream* input, RunClock* clock) : input_(input) {
    input_->SetProgress([clock](std::int64_t done, std::int64_t size) {
      clock->bar().Update(ShareOf(done, size));
    });
  }
  ~ReadingProgress() { input_->SetProgress(nullptr); }
  ReadingProgress(const ReadingProgress&) = delete;
  ReadingProgress& operator=(const ReadingProgress&) = delete;

 private:
  InputStream* input_;
};

// A file's name, for people: a name may have any bytes.
std::string TitleOf(const std::string& name) {
  std::filesystem::path path(name);
  // Of a folder that ends in a slash, too.
  if (path.filename().empty()) path = path.parent_path();
  return PrintableUtf8(path.filename().string());
}

// A log and what reads it: by the stream of a file's bytes, or, where that is
// null, by its path.
struct LogInput {
  std::string name;
  const LogReaderType* reader = nullptr;
  InputStream* stream = nullptr;
};

Log ReadInput(const LogInput& input, RunClock* clock) {
  LaserOptions options = LaserOptionsFromFlags();
  if (input.stream != nullptr) {
    const ReadingProgress progress(input.stream, clock);
    return input.reader->read(input.stream, options);
  }
  options.stop = [] { return InterruptRequested(); };
  options.progress = [clock](std::int64_t done, std::int64_t size) {
    clock->bar().Update(ShareOf(done, size));
  };
  return input.reader->read_path(input.name, options);
}

// What was passed over and taken for granted.
void TellOfLog(const std::string& name, const Log& log, Summary* summary) {
  for (const SkipReport& skip : log.skipped) {
    std::string places;
    for (int place : skip.first_lines) places += " " + std::to_string(place);
    Remark("%s: %lld skipped: %s; first at %s%s", name.c_str(),
           static_cast<long long>(skip.count),
           PrintableUtf8(skip.reason).c_str(), log.position_unit.c_str(),
           places.c_str());
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

// A summary that says what the run is asked to do.
Summary BeginSummary() {
  Summary summary;
  summary.input = FLAGS_input;
  summary.seed = FLAGS_seed;
  summary.flags = ChangedFlags();
  return summary;
}

// Stages of a run on logs, by the names of its steps. `sizes`: of each log, its
// scans as a share of those of a middling one of them. The scans of a log are
// counted on the way; what comes after the last one is taken to be as much work
// for every scan as it is in the middle of logs with 800 to 17,000 of them.
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

// The same for what is left once a log turned out to have no odometry.
void PlanMatching(const std::vector<double>& sizes,
                  const LogSolverOptions& options, RunClock* clock) {
  std::vector<WorkStage> stages = StagesOfLogs(sizes, options);
  stages.insert(stages.begin(), {kMatchingStep, 1.0});
  clock->bar().Plan(std::move(stages));
}

// A hierarchy that does not fit what logs are made of is refused before the log
// is read.
void CheckHierarchy(const LogSolverOptions& options, const Registry& registry) {
  if (!options.structure || options.hierarchy.empty()) return;
  ForFlag("hierarchy", [&] {
    MakeHierarchy(options.hierarchy, registry,
                  {ProfileOf(options.features).feature_type},
                  options.detector_parameters);
  });
}

// Everything that a log is solved from, as one number.
std::string DigestOf(const Log& log) {
  Sha256 sha;
  const auto take = [&sha](const void* data, std::size_t size) {
    sha.Update(std::string_view(static_cast<const char*>(data), size));
  };
  for (const Scan& scan : log.scans) {
    const double numbers[] = {
        scan.timestamp,       scan.odometry[0],        scan.odometry[1],
        scan.odometry[2],     scan.laser_offset[0],    scan.laser_offset[1],
        scan.laser_offset[2], scan.start_angle,        scan.angle_step,
        scan.maximum_range,   1.0 * scan.ranges.size()};
    take(numbers, sizeof numbers);
    take(scan.ranges.data(), scan.ranges.size() * sizeof(float));
    take(scan.bearings.data(), scan.bearings.size() * sizeof(float));
    sha.Update(scan.timestamp_text);
  }
  return sha.HexDigest();
}

// What the state between the stages of a run depends on: not on what is made of
// the map in the end, nor on the number of threads.
CheckpointFile::Identity IdentityOfRun(const Log& log) {
  CheckpointFile::Identity identity;
  // A state is memory of this program, which nobody else is to write: whoever
  // sends a folder with one does not know what the folder will be here.
  struct stat folder = {};
  stat(FLAGS_output_dir.c_str(), &folder);
  identity["the folder's inode"] = std::to_string(folder.st_ino);
  identity["the version"] = kVersion;
  identity["the program's digest"] = Sha256OfFile("/proc/self/exe");
  identity["the input's digest"] = DigestOf(log);
  std::istringstream plugins(FLAGS_plugins);
  std::string plugin;
  while (std::getline(plugins, plugin, ',')) {
    identity["the digest of " + plugin] = Sha256OfFile(plugin);
  }
  for (const auto& [what, file] :
       {std::make_pair("the structure prior's digest", &FLAGS_structure_prior),
        std::make_pair("the plan's digest", &FLAGS_plan),
        std::make_pair("the digest of the constraints", &FLAGS_constraints)}) {
    if (!file->empty()) identity[what] = Sha256OfFile(*file);
  }
  const std::set<std::string> without_effect = {"input",
                                                "output_dir",
                                                "outputs",
                                                "marginals",
                                                "verbose",
                                                "quiet",
                                                "live_dir",
                                                "live_every",
                                                "checkpoint_every",
                                                "num_threads",
                                                "marginals_hold_gauge",
                                                "help_format",
                                                "ellipse_sigmas",
                                                "grid_resolution"};
  for (const FlagValue& flag : OwnFlags()) {
    if (without_effect.count(flag.name) == 0) {
      identity["--" + flag.name] = flag.value;
    }
  }
  return identity;
}

// The report of --live_dir; does nothing without.
class LiveMap {
 public:
  // `clock` has to outlive this.
  explicit LiveMap(const RunClock& clock) : clock_(clock) {
    if (FLAGS_live_dir.empty()) return;
    namespace fs = std::filesystem;
    std::error_code error;
    if (fs::weakly_canonical(FLAGS_live_dir, error) ==
        fs::weakly_canonical(FLAGS_output_dir, error)) {
      throw Error("--live_dir", 0, "is the folder of --output_dir",
                  "another one");
    }
    ForFlag("live_dir",
            [this] { report_.emplace(FLAGS_live_dir, FLAGS_live_every); });
  }

  bool is_on() const { return report_.has_value(); }

  // The map as it stands, if it is time to; `stage` says where the run is.
  void Show(const MapSoFar& map, const std::function<std::string()>& stage) {
    if (!is_on() || !report_->IsDue()) return;
    Try([&] { report_->Offer(stage(), [&] { return MakeReport(map); }); });
  }

  // The end of the run: its report.html if it wrote one.
  void Finish(const SolveOutcome& outcome) {
    if (!is_on()) return;
    const std::vector<std::string>& files = outcome.summary.files;
    std::filesystem::path written;
    if (std::count(files.begin(), files.end(), kPage) > 0) {
      written = std::filesystem::path(FLAGS_output_dir) / kPage;
    }
    Try([&] {
      report_->Finish(written, [&] {
        Report report =
            MakeReport({*outcome.graph, outcome.trace, [&] {
                          std::vector<Pose2> poses;
                          for (const TimedPose& timed : outcome.trajectory) {
                            poses.push_back(timed.pose);
                          }
                          return poses;
                        }});
        report.summary = outcome.summary;
        report.title = outcome.title;
        return report;
      });
    });
  }

 private:
  static constexpr char kPage[] = "report.html";

  Report MakeReport(const MapSoFar& map) const {
    Report report;
    report.graph = &map.graph;
    report.path = map.trajectory();
    for (const EmPhase& phase : map.trace) report.trace.push_back({phase, {}});
    report.summary = BeginSummary();
    report.summary.scans = static_cast<std::int64_t>(report.path.size());
    CountGraph(map.graph, &report.summary);
    clock_.Read(&report.summary);
    report.summary.peak_memory_bytes = PeakMemoryBytes();
    report.flags = OwnFlags();
    report.delta_threshold = FLAGS_delta_threshold;
    report.title = TitleOf(FLAGS_input);
    return report;
  }

  // The run can do without.
  template <typename Write>
  void Try(const Write& write) {
    try {
      write();
    } catch (const Error& error) {
      report_.reset();
      Remark("goes on without --live_dir: %s", error.what());
    }
  }

  const RunClock& clock_;
  std::optional<LiveReport> report_;
};

// The bar and lines on the way through one log or several, and the live map.
class SolvingProgress {
 public:
  // `clock` is told of the steps; both have to outlive this.
  SolvingProgress(RunClock* clock, LiveMap* live)
      : clock_(*clock), live_(*live) {}

  // A log begins.
  void BeginLog(const std::string& title) {
    clock_.Begin("scans");
    clock_.bar().SetTitle(title);
    title_ = title;
    is_finishing_ = false;
  }

  // For a solver; this has to stay while it runs.
  RunControl Control() {
    RunControl control;
    control.progress = [this](std::size_t done, std::size_t total) {
      TakeScan(done, total);
    };
    control.stop = [this] {
      if (is_finishing_) clock_.bar().Update();
      return InterruptRequested();
    };
    control.step = [this](const char* step) {
      clock_.Begin(step);
      Detail("%s, after %.1f s", step, watch_.Seconds());
    };
    if (live_.is_on()) {
      control.look = [this](const MapSoFar& map) {
        live_.Show(map, [this] { return Stage(); });
      };
    }
    return control;
  }

 private:
  std::string Stage() const {
    if (is_finishing_) return clock_.step();
    return title_ + ", " + std::to_string(done_) + " of " +
           std::to_string(total_);
  }

  void TakeScan(std::size_t done, std::size_t total) {
    done_ = done;
    total_ = total;
    clock_.bar().Update(ShareOf(static_cast<std::int64_t>(done),
                                static_cast<std::int64_t>(total)));
    if (done % 500 == 0 || done == total) {
      Detail("%zu of %zu scans in %.1f s", done, total, watch_.Seconds());
    }
    is_finishing_ = done == total;
  }

  RunClock& clock_;
  LiveMap& live_;
  Stopwatch watch_;
  // Of the log, and its scans.
  std::string title_;
  std::size_t done_ = 0;
  std::size_t total_ = 0;
  // All scans are in: how many steps are left is not known.
  bool is_finishing_ = false;
};

// Solves a log, from where a run that did not end had got to if there is one,
// and leaves checkpoints on the way.
LogSolverResult RunWithCheckpoints(const Log& log, RunClock* clock,
                                   LiveMap* live, CheckpointFile* checkpoint,
                                   LogSolver* solver) {
  // An interrupt that cuts the reading off leaves another log than that of the
  // state, which stays for the next run.
  bool may_write = FLAGS_checkpoint_every > 0.0 && !InterruptRequested();
  std::optional<std::string> state;
  if (may_write) state = checkpoint->Read();
  if (state) {
    Remark("%s: goes on where a run that did not end had got to",
           FLAGS_output_dir.c_str());
  }
  SolvingProgress progress(clock, live);
  progress.BeginLog("scans");
  RunControl control = progress.Control();
  if (may_write) {
    control.checkpoint = [&](const std::function<std::string()>& make_state) {
      if (!may_write) return;
      try {
        checkpoint->Offer(make_state);
      } catch (const Error& error) {
        // The run can do without.
        may_write = false;
        Remark("goes on without checkpoints: %s", error.what());
      }
    };
  }
  return state ? solver->Resume(log, *state, control)
               : solver->Run(log, control);
}

// How the track hangs together, and which of the two maps stands.
void TellOfTrack(const std::string& name, const std::vector<Scan>& scans,
                 const LogSolverResult& result, Summary* summary) {
  for (const LooseTrack& part : result.loose) {
    const Scan& begin = scans[static_cast<std::size_t>(part.begin)];
    const Scan& end = scans[static_cast<std::size_t>(part.end)];
    summary->tracking.loose.push_back(
        {begin.timestamp, end.timestamp, part.why});
    if (!part.found) ++summary->tracking.pieces;
    Remark("%s: the map hangs by a thread, %.3f s to %.3f s: %s", name.c_str(),
           begin.timestamp, end.timestamp, part.why.c_str());
  }
  for (const std::string& note : result.notes) {
    summary->notes.push_back(note);
    Remark("%s: %s", name.c_str(), PrintableUtf8(note).c_str());
  }
  if (result.second_map_refused) {
    summary->notes.push_back(
        "the map from adjusted poses has hardly any walls: the map of the "
        "front-end stands");
    Remark("%s: %s", name.c_str(), summary->notes.back().c_str());
  }
}

// What the summary says of the solve of a log's map.
void SummarizeLog(const std::vector<Scan>& scans, const LogSolverResult& result,
                  Summary* summary) {
  summary->scans = static_cast<std::int64_t>(result.trajectory.size());
  summary->scans_in_log = static_cast<std::int64_t>(scans.size());
  summary->frontend_seconds =
      result.frontend_seconds + result.relocalization_seconds;
  summary->scan_seconds.assign(result.scan_seconds.begin(),
                               result.scan_seconds.end());
  summary->range_noise = result.range_sigma;
  EmReport em = result.em;
  em.detect_seconds = result.detect_seconds;
  em.solve_seconds = result.solve_seconds;
  Summarize(result.initial_cost, result.final_cost, em, summary);
}

// The pose of every scan that was solved, with its time.
std::vector<TimedPose> TimedTrajectory(const std::vector<Scan>& scans,
                                       const std::vector<Pose2>& poses) {
  std::vector<TimedPose> trajectory(poses.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    trajectory[i].timestamp = scans[i].timestamp;
    trajectory[i].timestamp_text = scans[i].timestamp_text;
    trajectory[i].pose = poses[i];
  }
  return trajectory;
}

// Moves the trajectory and the graph as --align says; returns by what.
Pose2 AlignOutputs(const std::vector<Pose2>& path, SolveOutcome* outcome) {
  if (FLAGS_align != "building") return Pose2::Zero();
  const Pose2 by = BuildingFrame(*outcome->graph, path);
  outcome->moved_graph =
      ForFlag("align", [&] { return Moved(by, *outcome->graph); });
  outcome->graph = outcome->moved_graph.get();
  for (TimedPose& timed : outcome->trajectory) {
    timed.pose = Compose(by, timed.pose);
  }
  outcome->summary.alignment = by;
  return by;
}

// What there is to say and to write of a log's map. All but `name` have to stay
// until the outputs are written.
void TakeMap(const std::string& name, const std::vector<Scan>& scans,
             const LogSolver& solver, const Registry& registry,
             const LogSolverOptions& options, const LogSolverResult& result,
             SolveOutcome* outcome) {
  for (const EmPhase& phase : solver.trace()) TellPhase(phase);
  TellOfTrack(name, scans, result, &outcome->summary);
  SummarizeLog(scans, result, &outcome->summary);
  outcome->trajectory = TimedTrajectory(scans, result.trajectory);
  outcome->graph = &solver.graph();
  outcome->registry = &registry;
  const Pose2 moved_by = AlignOutputs(result.trajectory, outcome);
  if (!InterruptRequested()) TakeMarginals(nullptr, outcome);
  outcome->scans = &scans;
  outcome->key_scans = [&scans, &result, moved_by] {
    std::vector<Pose2> moved;
    for (const Pose2& pose : result.trajectory) {
      moved.push_back(Compose(moved_by, pose));
    }
    return MakeKeyScanArchive(scans, result.refined, result.records, moved);
  };
  outcome->without_structure = [&scans, &registry, &options, &result,
                                moved_by] {
    return Moved(moved_by,
                 ReplayWithoutStructure(scans, registry, options, result,
                                        [] { return InterruptRequested(); }));
  };
  outcome->breaks = result.breaks;
  for (const LoopClosure& closure : result.closures) {
    const auto scan = static_cast<std::size_t>(closure.scan);
    outcome->closures.push_back(
        {Compose(outcome->trajectory[scan].pose, closure.place), closure.holds,
         closure.delta});
  }
  outcome->trace = solver.trace();
  outcome->occupancy = OccupancyOptionsFromFlags();
  outcome->title = TitleOf(name) + (FLAGS_structure ? ", with structure"
                                                    : ", without structure");
}

int SolveLog(const LogInput& input, const Registry& registry, RunClock* clock,
             LiveMap* live, OutputFolder* folder) {
  SolveOutcome outcome;
  Summary& summary = outcome.summary;
  summary = BeginSummary();
  const LogSolverOptions options = LogSolverOptionsFromFlags(registry);
  CheckHierarchy(options, registry);
  RemarkOnFlags(input.name, "log", "graphs", GraphFlags());

  clock->bar().Plan(StagesOfLogs({1.0}, options));
  clock->Begin("reading");
  const Stopwatch reading;
  Log log = ReadInput(input, clock);
  summary.parse_seconds = reading.Seconds();
  TellOfLog(input.name, log, &summary);
  Detail("read %zu scans in %.1f s", log.scans.size(), summary.parse_seconds);
  if (!log.has_odometry) {
    PlanMatching({1.0}, options, clock);
    MatchScansAlone(input.name, options, clock, &log, &summary);
  } else {
    UndoSweeps(input.name, options, clock, &log, &summary);
  }

  CheckpointFile checkpoint(
      std::filesystem::path(FLAGS_output_dir) / CheckpointFile::kName,
      [&log] { return IdentityOfRun(log); }, FLAGS_checkpoint_every);
  LogSolver solver(registry, options);
  const LogSolverResult result =
      RunWithCheckpoints(log, clock, live, &checkpoint, &solver);
  clock->Begin("figures");
  TakeMap(input.name, log.scans, solver, registry, options, result, &outcome);
  WriteOutputs(&outcome, clock, folder);
  RemoveMapsFrom(1, registry);
  live->Finish(outcome);
  TellEnd(outcome, clock);
  if (!summary.partial) checkpoint.Remove();
  return kExitSuccess;
}

// An input, and its stream where it is not read by its path.
struct OpenInput {
  LogInput log;
  std::optional<InputStream> stream;
  bool is_graph = false;
};

// Null when that was interrupted. `reader`: that of --log_reader, or null.
std::unique_ptr<OpenInput> Open(const std::string& name,
                                const Registry& registry,
                                const LogReaderType* reader) {
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
  return input;
}

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

// What became of each log.
std::vector<Summary::LogInput> DescribeLogs(
    const std::vector<std::unique_ptr<OpenInput>>& inputs,
    const SeveralLogsResult& solved) {
  std::vector<Summary::LogInput> logs;
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    const LogInMap& in_map = solved.logs[i];
    const TrackPlacement& placement = in_map.placement;
    Summary::LogInput log;
    log.input = inputs[i]->log.name;
    log.trajectory = "trajectory_" + std::to_string(i + 1) + ".tum";
    log.scans = static_cast<std::int64_t>(in_map.end - in_map.begin);
    log.map = FolderOfMap(in_map.map);
    log.parts = placement.windows;
    log.agreeing = placement.agreeing;
    log.contradicting = placement.contradicting;
    log.changed_places =
        placement.walls_through_map + placement.walls_through_track;
    if (!placement.found && in_map.map > 0) log.why_apart = placement.why_not;
    if (placement.found) {
      Remark(
          "%s: placed in the map: %d of %d parts of it agree with it, to "
          "%.2f m; %d contradict it",
          log.input.c_str(), log.agreeing, log.parts, placement.misfit,
          log.contradicting);
      if (log.changed_places > 0) {
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
    }
    logs.push_back(std::move(log));
  }
  return logs;
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
    clock->Begin("reading");
    const Stopwatch reading;
    Log log = ReadInput(input->log, clock);
    summary->parse_seconds += reading.Seconds();
    Summary of_log;
    TellOfLog(name, log, &of_log);
    if (log.scans.empty()) throw Error(name, 0, "no scans", "a log with scans");
    if (!log.has_odometry) {
      MatchScansAlone(name, options, clock, &log, &of_log);
    } else {
      UndoSweeps(name, options, clock, &log, &of_log);
    }
    AddNotes(TitleOf(name), of_log, summary);
    logs.push_back(std::move(log));
  }
  return logs;
}

SeveralLogsResult RunSeveralLogs(const Registry& registry,
                                 std::vector<Log> logs,
                                 const SeveralLogsOptions& options,
                                 RunClock* clock, LiveMap* live) {
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
  clock->bar().Plan(StagesOfLogs(sizes, options.solver));
  SolvingProgress progress(clock, live);
  SeveralLogsControl control;
  control.begin_log = [&](std::size_t i) {
    progress.BeginLog("scans of log " + std::to_string(i + 1) + " of " +
                      std::to_string(num_scans.size()));
  };
  control.run = progress.Control();
  return SolveSeveralLogs(registry, std::move(logs), options, control);
}

// The map of earlier logs.
struct EarlierMap {
  KeyScanArchive key_scans;
  Graph graph;
};

// What --map names; null without.
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
  const std::string text = ReadTextInput(FLAGS_map, kLargestMap);
  auto map = std::make_unique<EarlierMap>();
  map->key_scans = ReadKeyScans(text, FLAGS_map);
  std::istringstream input(text);
  ReadGraphJson(input, FLAGS_map, registry, &map->graph);
  std::error_code error;
  if (std::filesystem::equivalent(
          std::filesystem::absolute(FLAGS_map).parent_path(), FLAGS_output_dir,
          error)) {
    throw Error("--output_dir", 0, "is the folder of --map", "another folder");
  }
  return map;
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
  }
  std::fprintf(stderr, "nothing is written\n");
}

// Writes where the robot was in the earlier map.
void WriteLocalized(const EarlierMap& earlier, const Registry& registry,
                    const std::string& title, const MapOfLogs& map,
                    Summary summary, RunClock* clock, LiveMap* live,
                    OutputFolder* folder) {
  SolveOutcome outcome;
  outcome.summary = std::move(summary);
  TellOfTrack(title, map.scans, map.result, &outcome.summary);
  const auto begin =
      static_cast<std::ptrdiff_t>(earlier.key_scans.scans.size());
  const std::vector<Scan> scans(map.scans.begin() + begin, map.scans.end());
  const std::vector<Pose2> poses(map.result.trajectory.begin() + begin,
                                 map.result.trajectory.end());
  outcome.summary.scans = outcome.summary.scans_in_log =
      static_cast<std::int64_t>(poses.size());
  outcome.trajectory = TimedTrajectory(scans, poses);
  outcome.graph = &earlier.graph;
  outcome.registry = &registry;
  outcome.scans = &scans;
  outcome.title = title + ", in " + TitleOf(FLAGS_map);
  WriteOutputs(&outcome, clock, folder);
  RemoveMapsFrom(1, registry);
  live->Finish(outcome);
  TellEnd(outcome, clock);
}

// `earlier`: the map that the logs continue or are found in, or null.
int SolveLogs(const std::vector<std::unique_ptr<OpenInput>>& inputs,
              const std::vector<std::optional<Pose2>>& starts,
              const EarlierMap* earlier, const Registry& registry,
              RunClock* clock, LiveMap* live, OutputFolder* folder) {
  SeveralLogsOptions options;
  options.solver = LogSolverOptionsFromFlags(registry);
  options.starts = starts;
  if (earlier != nullptr) {
    options.earlier = &earlier->key_scans;
    options.earlier_wall_length = LengthOfWalls(earlier->graph);
    options.localize_only = FLAGS_localize;
  }
  CheckHierarchy(options.solver, registry);
  RemarkOnFlags("--input", "list of logs", "graphs", GraphFlags());
  if (options.solver.features != RawFeatures::kSegments ||
      options.solver.refine != Refinement::kFull) {
    throw Error("--input", 0,
                "several logs, or --map, do not go with --features=points, "
                "--refine=map or --refine=none",
                "segments and full refinement");
  }
  Summary common = BeginSummary();
  std::vector<Log> logs = ReadLogs(inputs, options.solver, clock, &common);

  const SeveralLogsResult solved =
      RunSeveralLogs(registry, std::move(logs), options, clock, live);
  if (solved.interrupted) {
    clock->bar().Finish();
    std::fprintf(stderr,
                 "interrupted: the logs are not put together, nothing is "
                 "written\n");
    return kExitInterrupted;
  }
  if (solved.is_elsewhere) {
    clock->bar().Finish();
    TellElsewhere(inputs, solved);
    return kExitElsewhere;
  }
  common.logs = DescribeLogs(inputs, solved);
  if (FLAGS_localize) {
    WriteLocalized(*earlier, registry, TitleOf(inputs.front()->log.name),
                   solved.maps.front(), std::move(common), clock, live, folder);
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
    clock->Begin("figures");
    TakeMap(title, map.scans, *map.solver, registry, options.solver, map.result,
            &outcome);
    if (m == 0) {
      WriteOutputs(&outcome, clock, folder);
      RemoveMapsFrom(solved.maps.size(), registry);
      live->Finish(outcome);
      TellEnd(outcome, clock);
      continue;
    }
    OutputFolder apart(std::filesystem::path(FLAGS_output_dir) / FolderOfMap(m),
                       NamesOfAllOutputs(registry), InputFiles());
    WriteOutputs(&outcome, clock, &apart);
  }
  return kExitSuccess;
}

// Reads a graph; nothing when that was interrupted.
std::optional<G2oFile> ReadGraph(InputStream* input, const Registry& registry,
                                 RunClock* clock, Graph* graph) {
  const ReadingProgress progress(input, clock);
  std::istringstream text(input->ReadRest());
  if (InterruptRequested()) {
    clock->bar().Finish();
    std::fprintf(stderr, "interrupted: the graph is not read whole\n");
    return std::nullopt;
  }
  if (!input->damage().empty()) {
    throw Error(input->name(), 0, input->damage(), "a whole graph");
  }
  return ReadG2o(text, input->name(), registry, graph, G2oOptionsFromFlags());
}

// Places the features where --initial_guess says.
void PlaceStart(const InputStream& input, const G2oFile& g2o, Graph* graph,
                Summary::Solver* figures) {
  InitialGuessOptions start = InitialGuessOptionsFromFlags();
  if (!g2o.named_by_edges.empty() &&
      start.method == InitialGuessMethod::kFile) {
    if (!gflags::GetCommandLineFlagInfoOrDie("initial_guess").is_default) {
      throw Error("--initial_guess", 0,
                  "'file', but " + input.name() + " lists edges only",
                  "odometry, spanning_tree or chordal");
    }
    start.method = InitialGuessMethod::kChordal;
    Remark("%s: lists edges only: poses start by --initial_guess=chordal",
           input.name().c_str());
  }
  if (start.method == InitialGuessMethod::kFile) return;
  const Stopwatch watch;
  const InitialGuessReport made = MakeInitialGuess(start, graph);
  figures->start_poses = made.poses;
  figures->start_landmarks = made.landmarks;
  figures->start_kept = made.kept;
  figures->start_seconds = watch.Seconds();
  Detail("start: %lld poses in %d parts and %lld landmarks placed, %lld kept",
         static_cast<long long>(made.poses), made.parts,
         static_cast<long long>(made.landmarks),
         static_cast<long long>(made.kept));
}

// What the summary says of the solves of a graph.
void SummarizeSolves(const GraphSolverResult& result,
                     Summary::Solver* figures) {
  figures->solves = result.num_solves;
  figures->converged = result.solves.converged;
  figures->iterations = result.solves.iterations;
  figures->evaluation_seconds = result.solves.evaluation_seconds;
  figures->linear_solver_seconds = result.solves.linear_solver_seconds;
  figures->setup_seconds = result.solves.setup_seconds;
}

int SolveGraph(InputStream* input, const Registry& registry, RunClock* clock,
               LiveMap* live, OutputFolder* folder) {
  SolveOutcome outcome;
  Summary& summary = outcome.summary;
  summary = BeginSummary();
  const GraphSolverOptions options = GraphSolverOptionsFromFlags(registry);
  RemarkOnFlags(input->name(), "graph", "logs", LogFlags());

  clock->bar().Plan({{"reading", 0.5},
                     {"first guess", 0.1},
                     {"solving", 1.0},
                     {"writing", 0.3}});
  clock->Begin("reading");
  const Stopwatch reading;
  Graph graph;
  const std::optional<G2oFile> g2o = ReadGraph(input, registry, clock, &graph);
  if (!g2o) return kExitInterrupted;
  summary.parse_seconds = reading.Seconds();
  for (const auto& tag : g2o->unknown_tags) {
    Remark("%s: %d lines with the unknown tag %s kept as they are",
           input->name().c_str(), tag.second, PrintableUtf8(tag.first).c_str());
  }

  if (!FLAGS_marginals_hold_gauge) {
    CheckGauge(graph, ParseMarginalsSelection(FLAGS_marginals, registry));
  }
  Summary::Solver figures;
  clock->Begin("first guess");
  PlaceStart(*input, *g2o, &graph, &figures);

  ForFlag("hierarchy", [&] { MakeGraphHierarchy(options, graph, registry); });
  GraphSolver solver(registry, options, &graph);
  if (!std::isfinite(solver.initial_cost().total())) {
    throw Error(input->name(), 0,
                "the sum of squared residuals at the start is no finite number",
                "smaller values, or less information");
  }
  GraphSolverResult result;
  {
    clock->Begin("solving");
    std::vector<EmPhase> trace;
    result = solver.Run(
        [clock] {
          clock->bar().Update();
          return InterruptRequested();
        },
        [&](const EmPhase& phase) {
          TellPhase(phase);
          if (!live->is_on()) return;
          trace.push_back(phase);
          live->Show({graph, trace, [] { return std::vector<Pose2>(); }}, [&] {
            return "solving, iteration " + std::to_string(phase.iteration) +
                   ": " + phase.phase;
          });
        });
  }
  clock->Begin("figures");
  Summarize(result.initial_cost, result.final_cost, result.em, &summary);
  SummarizeSolves(result, &figures);
  summary.solver = figures;
  if (!figures.converged) {
    const std::string& why = result.solves.message;
    Remark(
        "%s: the solver did not converge%s; --max_solver_iterations and "
        "--initial_guess may help",
        input->name().c_str(), why.empty() ? "" : (" (" + why + ")").c_str());
  }
  outcome.graph = &graph;
  outcome.registry = &registry;
  outcome.trace = std::move(result.trace);
  if (!InterruptRequested()) TakeMarginals(&solver.session(), &outcome);
  outcome.g2o = &*g2o;
  outcome.without_structure = [&] {
    if (InterruptRequested()) return MapWithoutStructure();
    return MapWithoutStructure{SolveWithoutStructure(graph, registry), {}};
  };
  outcome.title = TitleOf(input->name());
  WriteOutputs(&outcome, clock, folder);
  RemoveMapsFrom(1, registry);
  live->Finish(outcome);
  TellEnd(outcome, clock);
  return kExitSuccess;
}

int Run() {
  RunClock clock;
  Registry& registry = Registry::Global();
  RegisterBuiltins(&registry);
  RegisterBuiltinLogReaders(&registry);
  RegisterBuiltinOutputWriters(&registry);
  LoadPlugins(&registry);
  if (FLAGS_list_plugins) {
    ListPlugins(registry);
    return kExitSuccess;
  }
  if (FLAGS_input.empty() || FLAGS_output_dir.empty()) {
    std::fprintf(stderr,
                 "plumbline_solve: --input and --output_dir are needed; see "
                 "--help\n");
    return kExitUsage;
  }
  RefuseFlagsWithoutEffect();
  RemarkOnStructureFlags();
  // Wrong lists are refused before the work.
  ForFlag("outputs", [&] { SelectOutputs(FLAGS_outputs, registry); });
  if (ParseMarginalsSelection(FLAGS_marginals, registry).empty() &&
      FLAGS_ellipse_sigmas > 0.0) {
    throw Error("--ellipse_sigmas", 0, "ellipses of nothing",
                "features named by --marginals");
  }
  const LogReaderType* reader =
      FLAGS_log_reader.empty()
          ? nullptr
          : &ForFlag(
                "log_reader", [&]() -> const auto& {
                  return registry.Get<LogReaderType>(FLAGS_log_reader);
                });
  const std::vector<std::string> names = InputsFromFlags();
  if (names.empty() || names.size() > kMostLogs) {
    throw Error("--input", 0, std::to_string(names.size()) + " names",
                "1 to " + std::to_string(kMostLogs) + " separated by commas");
  }
  const auto starts =
      ForFlag("start_pose", [&] { return StartPosesFromFlags(names.size()); });
  const std::unique_ptr<EarlierMap> earlier = EarlierMapFromFlags(registry);
  std::vector<std::unique_ptr<OpenInput>> inputs;
  for (const std::string& name : names) {
    inputs.push_back(Open(name, registry, reader));
    if (inputs.back() == nullptr) {
      std::fprintf(stderr, "interrupted: nothing was read yet\n");
      return kExitInterrupted;
    }
    if ((names.size() > 1 || earlier != nullptr) && inputs.back()->is_graph) {
      throw Error("--input", 0, name + " is a graph",
                  "one graph alone, or logs");
    }
  }
  // What is wrong with the folder is said before the work, not after it.
  OutputFolder folder(FLAGS_output_dir, NamesOfAllOutputs(registry),
                      InputFiles());
  folder.CheckTargets(FilesOfOutputs(OutputsFromFlags(registry), registry));
  if (!folder.cleaned().empty()) {
    Remark("%s: removed what a run that was killed had left: %s",
           FLAGS_output_dir.c_str(), Joined(folder.cleaned()).c_str());
  }
  LiveMap live(clock);
  const ThreadsScope threads(NumThreadsFromFlags());
  if (inputs.size() > 1 || earlier != nullptr) {
    return SolveLogs(inputs, starts, earlier.get(), registry, &clock, &live,
                     &folder);
  }
  const OpenInput& input = *inputs.front();
  return input.is_graph ? SolveGraph(&*inputs.front()->stream, registry, &clock,
                                     &live, &folder)
                        : SolveLog(input.log, registry, &clock, &live, &folder);
}

}  // namespace
}  // namespace plumbline

int main(int argc, char** argv) {
  plumbline::AppInfo info;
  info.name = "plumbline_solve";
  info.summary =
      "Turns a robot's log or a graph into a true map: finds the walls, the "
      "directions that they share and the right angles between them, and uses "
      "them.";
  info.usage = {"--input=LOG_OR_GRAPH --output_dir=DIR [flags]",
                "--list_plugins [--plugins=libmine.so]"};
  info.example =
      "plumbline_solve --input=datasets/office.clf.gz --output_dir=out/office";
  info.groups = plumbline::SolveFlagGroups();
  plumbline::ParseFlags(info, argc, argv);
  return plumbline::RunMain(plumbline::Run);
}
