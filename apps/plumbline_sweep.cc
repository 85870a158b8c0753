// Runs a program with every combination of values of its flags, and tables and
// draws what comes out.

#include <fcntl.h>
#include <gflags/gflags.h>
#include <plumbline/apps/cli/app.h>
#include <plumbline/apps/cli/nearest_word.h>
#include <plumbline/apps/cli/progress.h>
#include <plumbline/apps/sweep/sweep.h>
#include <plumbline/apps/sweep/sweep_grid.h>
#include <plumbline/apps/sweep/sweep_launcher.h>
#include <plumbline/apps/sweep/sweep_overview.h>
#include <plumbline/apps/sweep/sweep_table.h>
#include <plumbline/core/atomic_file.h>
#include <plumbline/core/error.h>
#include <plumbline/core/sha256.h>
#include <plumbline/core/stopwatch.h>
#include <plumbline/core/utf8.h>
#include <plumbline/outputs/summary.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

DEFINE_string(
    grid, "",
    "Flags of the command and their values: "
    "flag=values;flag=values;... Values are separated by commas; "
    "a:step:b is a range, log(a,b,n) are n values from a to b at "
    "equal ratios, \"...\" is a value that holds commas. flag:key=values "
    "is for flags that take lists of key=value");
DEFINE_bool(one_at_a_time, false,
            "Not all combinations: the first values of all flags, and the "
            "other values of each flag with the first ones of the others");
DEFINE_int32(trials, 1, "Runs of every setting, each with its own seed");
PLUMBLINE_FLAG_RANGE(trials, 1, 1000000);
DEFINE_uint64(seed, 1, "Seed of the first trial; the next have the next ones");
DEFINE_string(seed_flag, "seed",
              "Flag of the command that takes the seed; empty: it has none");
DEFINE_string(evaluate, "",
              "Command that is run after each run; the numbers of the "
              "evaluation.json that it writes become columns. {} stands for "
              "the run's folder; without it, --trajectory, --output and, "
              "beside --truth, --map are added as plumbline_evaluate takes "
              "them");
DEFINE_double(time_limit, 0.0, "Most time of a run, s; 0: no limit");
PLUMBLINE_FLAG_RANGE(time_limit, 0, 1e9);
DEFINE_bool(retry_failed, false,
            "Do runs that failed or took too long again, too");

DEFINE_string(launcher, "local",
              "What does the runs: local (processes on this machine), "
              "parallel (GNU parallel, over ssh with --hosts), slurm (job "
              "arrays of a cluster)");
PLUMBLINE_FLAG_CHOICES(launcher, "local", "parallel", "slurm");
DEFINE_int32(jobs, 0,
             "Runs at a time: on this machine (local), on each host "
             "(parallel), on the cluster (slurm); 0: one run per core, on the "
             "cluster no limit");
PLUMBLINE_FLAG_RANGE(jobs, 0, 100000);
DEFINE_string(hosts, "",
              "Hosts for GNU parallel, separated by commas, as its --sshlogin "
              "takes them; they need the folders under the same paths");
DEFINE_string(launcher_options, "",
              "Further options of parallel or sbatch, as in "
              "'--partition=long --mem=4G'");

DEFINE_string(output_dir, "", "Folder for the results; made if missing");
DEFINE_string(minimize, "",
              "Figure by which the best setting is chosen: a column of "
              "sweep.csv, as in evaluation.relations.translation_m.mean. A "
              "folder that is gone on with without a command keeps its "
              "figure; empty: none");
DEFINE_string(maximize, "", "The same, the most of it being best");
DEFINE_string(figures, "",
              "Figures to draw, separated by commas: columns of sweep.csv, in "
              "double quotes where a name holds commas; empty: the one to "
              "minimize or maximize and some others that differ between runs");
DEFINE_bool(times, true,
            "Columns of measured time and memory; without them the same sweep "
            "gives the same bytes of sweep.csv");
DEFINE_string(run, "",
              "Does only the run of this name of the sweep in --output_dir: "
              "what launchers start on other machines");
DEFINE_bool(trust, false,
            "Runs the command of a sweep.json that was not written in this "
            "folder without asking");

namespace plumbline {
namespace {

namespace fs = std::filesystem;

std::string OwnPath() {
  std::error_code error;
  const fs::path path = fs::read_symlink("/proc/self/exe", error);
  return error ? "plumbline_sweep" : path.string();
}

// The working folder may have been removed.
[[noreturn]] void FailWithoutWorkingFolder(const std::string& place,
                                           const std::error_code& error) {
  throw Error(place, 0,
              "the working folder is not there (" + error.message() + ")",
              "a working folder");
}

fs::path Absolute(const std::string& place, const std::string& path) {
  std::error_code error;
  fs::path absolute = fs::absolute(path, error);
  if (error) FailWithoutWorkingFolder(place, error);
  return absolute;
}

bool IsProgram(const fs::path& path) {
  std::error_code ignored;
  return fs::is_regular_file(path, ignored) && access(path.c_str(), X_OK) == 0;
}

// Absolute path of a program: with a slash from here, otherwise beside this
// one or in PATH.
std::string FindProgram(const std::string& name) {
  std::vector<fs::path> places;
  if (name.find('/') != std::string::npos) {
    places.push_back(Absolute(name, name));
  } else {
    places.push_back(fs::path(OwnPath()).parent_path() / name);
    const char* const path = std::getenv("PATH");
    std::istringstream folders(path == nullptr ? "" : path);
    std::string folder;
    while (std::getline(folders, folder, ':')) {
      std::error_code error;
      const fs::path place =
          fs::absolute(folder.empty() ? "." : folder, error) / name;
      if (!error) places.push_back(place);
    }
  }
  for (const fs::path& place : places) {
    if (IsProgram(place)) return place.lexically_normal().string();
  }
  throw Error(name, 0, "there is no such program", "a program behind --");
}

std::vector<std::string> EvaluateCommand() {
  std::vector<std::string> command = SplitWords(FLAGS_evaluate);
  if (command.empty()) return command;
  command[0] = FindProgram(command[0]);
  bool names_folder = false;
  bool has_truth = false;
  for (const std::string& word : command) {
    names_folder = names_folder || word.find("{}") != std::string::npos;
    has_truth = has_truth || word.find("-truth") != std::string::npos;
  }
  if (!names_folder) {
    command.push_back("--trajectory={}/trajectory.tum");
    if (has_truth) command.push_back("--map={}/map.json");
    command.push_back("--output={}/evaluation.json");
  }
  return command;
}

SweepDefinition DefinitionFromFlags(const std::vector<std::string>& command) {
  SweepDefinition definition;
  definition.axes = ParseGrid(FLAGS_grid);
  for (const SweepAxis& axis : definition.axes) {
    if (axis.flag == "output_dir" ||
        (!FLAGS_seed_flag.empty() && axis.flag == FLAGS_seed_flag)) {
      throw Error("--grid", 0, "'" + axis.flag + "' is the sweep's to set",
                  "other flags (--trials and --seed say which seeds)");
    }
  }
  definition.one_at_a_time = FLAGS_one_at_a_time;
  definition.trials = FLAGS_trials;
  definition.first_seed = FLAGS_seed;
  definition.seed_flag = FLAGS_seed_flag;
  if (definition.seed_flag.empty() && definition.trials > 1) {
    throw Error("--trials", 0, "trials without a seed are all the same",
                "--trials=1, or the flag that takes a seed in --seed_flag");
  }
  definition.command = command;
  definition.command[0] = FindProgram(command[0]);
  definition.evaluate = EvaluateCommand();
  std::error_code error;
  definition.working_directory = fs::current_path(error).string();
  if (error) FailWithoutWorkingFolder("plumbline_sweep", error);
  if (const char* datasets = std::getenv("PLUMBLINE_DATASETS")) {
    definition.environment.emplace_back("PLUMBLINE_DATASETS", datasets);
  }
  definition.time_limit = FLAGS_time_limit;
  CheckDefinition(definition, "--grid");
  return definition;
}

// Keeps a second sweep out of the folder. Children inherit it, so that what a
// killed sweep has left running keeps it, too.
class FolderLock {
 public:
  explicit FolderLock(const std::string& folder) {
    const std::string path = folder + "/lock";
    descriptor_ = open(path.c_str(), O_RDWR | O_CREAT, 0666);
    if (descriptor_ < 0) {
      throw Error(path, 0,
                  std::string("cannot be written: ") + std::strerror(errno),
                  "a writable folder");
    }
    const Stopwatch watch;
    bool is_told = false;
    while (flock(descriptor_, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK &&
           !InterruptRequested()) {
      if (!is_told && watch.Seconds() > 2.0) {
        Remark(
            "%s: another sweep, or what is left of one, is at work here; "
            "waiting until it ends",
            folder.c_str());
        is_told = true;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
  }
  ~FolderLock() { close(descriptor_); }
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  int descriptor_;
};

// The figure to choose the best setting by; empty without one.
const std::string& Objective() {
  return FLAGS_minimize.empty() ? FLAGS_maximize : FLAGS_minimize;
}

// Throws unless a run that is done has the figure to choose by; true when there
// was one to ask. One that knows of the figure and does not know it (null, as
// errors of walls of which it found none) says nothing.
bool CheckObjective(const std::vector<SweepRun>& runs,
                    const std::string& folder) {
  for (const SweepRun& run : runs) {
    const std::optional<RunRecord> record = ReadRecord(RunFolder(folder, run));
    if (!record || record->status != RunStatus::kDone ||
        std::count(record->unknown.begin(), record->unknown.end(),
                   Objective()) > 0) {
      continue;
    }
    std::vector<std::string> names;
    for (const Figure& figure : record->figures) {
      if (figure.first == Objective()) return true;
      names.push_back(figure.first);
    }
    const std::string nearest = NearestWord(Objective(), names);
    std::string known;
    for (const std::string& name : names) {
      known += (known.empty() ? "" : ", ") + name;
    }
    throw Error(FLAGS_minimize.empty() ? "--maximize" : "--minimize", 0,
                "no run has a figure '" + Objective() + "'" +
                    (nearest.empty() ? "" : " (" + nearest + "?)"),
                "one of " + known);
  }
  return false;
}

// What the columns of runs of plumbline_solve begin with.
std::vector<std::string> PartsOfSummaries() {
  Summary summary;
  summary.scans = 1;
  summary.partial = true;
  summary.solver.emplace();
  std::ostringstream text;
  WriteSummary(summary, text);
  std::vector<std::string> parts = {"evaluation"};
  const nlohmann::json json = nlohmann::json::parse(text.str());
  for (const auto& [part, value] : json.items()) parts.push_back(part);
  return parts;
}

// What can be known of the figure before there is a run.
void CheckObjectiveBeforehand(const SweepDefinition& definition) {
  const std::string& name = Objective();
  if (name.empty()) return;
  const char* const flag = FLAGS_minimize.empty() ? "--maximize" : "--minimize";
  if (name.compare(0, 11, "evaluation.") == 0 && definition.evaluate.empty()) {
    throw Error(flag, 0,
                "'" + name + "' comes of an evaluation, and there is none",
                "--evaluate, or another figure");
  }
  if (fs::path(definition.command[0]).filename() != "plumbline_solve") return;
  const std::vector<std::string> parts = PartsOfSummaries();
  const std::string part = name.substr(0, name.find('.'));
  if (std::count(parts.begin(), parts.end(), part) > 0) return;
  std::string known;
  for (const std::string& one : parts) {
    known += (known.empty() ? "" : ", ") + one;
  }
  const std::string nearest = NearestWord(part, parts);
  throw Error(
      flag, 0,
      "no run will have a figure '" + name + "'" +
          (nearest.empty() ? "" : " (" + nearest + "?)"),
      "a number of summary.json, by its path: it begins with one of " + known);
}

// Does what is not done yet.
void DoRuns(const SweepDefinition& definition, const std::string& folder) {
  std::vector<SweepRun> pending;
  const std::vector<SweepRun> runs = MakeRuns(definition);
  for (const SweepRun& run : runs) {
    const std::optional<RunRecord> record = ReadRecord(RunFolder(folder, run));
    if (record && (record->status == RunStatus::kDone || !FLAGS_retry_failed)) {
      continue;
    }
    // Launchers count records.
    fs::remove(RunFolder(folder, run) + "/run.json");
    pending.push_back(run);
  }
  Detail("%zu runs, %zu of them done already", runs.size(),
         runs.size() - pending.size());
  if (pending.empty()) return;

  // A figure that no run has is found out at the first run, not at the last.
  bool is_checked = Objective().empty() || CheckObjective(runs, folder);
  std::optional<Error> missing;
  Progress progress("sweep", "runs", static_cast<std::int64_t>(pending.size()));
  LaunchOptions options;
  options.jobs = FLAGS_jobs;
  options.program = OwnPath();
  options.hosts = FLAGS_hosts;
  options.options = SplitWords(FLAGS_launcher_options);
  options.progress = [&](int done) {
    progress.Update(done);
    if (is_checked || done == 0) return;
    try {
      is_checked = CheckObjective(pending, folder);
    } catch (const Error& error) {
      is_checked = true;
      missing = error;
    }
  };
  options.stop = [&] { return InterruptRequested() || missing; };
  if (FLAGS_launcher == "local") {
    LaunchLocally(definition, pending, folder, options);
  } else if (FLAGS_launcher == "parallel") {
    LaunchWithParallel(pending, folder, options);
  } else {
    LaunchWithSlurm(pending, folder, options);
  }
  if (missing) throw *missing;
  if (InterruptRequested()) return;
  for (const SweepRun& run : pending) {
    if (!ReadRecord(RunFolder(folder, run))) RecordLoss(RunFolder(folder, run));
  }
}

void TellRuns(const SweepResult& result) {
  int counts[3] = {0, 0, 0};
  int missing = 0;
  for (const std::optional<RunRecord>& record : result.records) {
    if (record) {
      ++counts[static_cast<int>(record->status)];
    } else {
      ++missing;
    }
  }
  std::printf("runs: %zu; %d done, %d failed, %d timed out", result.runs.size(),
              counts[0], counts[1], counts[2]);
  if (missing > 0) std::printf(", %d not done yet", missing);
  std::printf("\n");
}

// Says on stderr why runs are not done; true when there are any.
bool TellFailures(const SweepResult& result) {
  constexpr int kMost = 10;
  int failures = 0;
  for (std::size_t i = 0; i < result.runs.size(); ++i) {
    const std::optional<RunRecord>& record = result.records[i];
    if (!record || record->status == RunStatus::kDone) continue;
    if (++failures > kMost) continue;
    std::fprintf(
        stderr, "%s: %s: %s\n", result.runs[i].name.c_str(),
        record->status == RunStatus::kTimedOut ? "timed out" : "failed",
        record->reason.c_str());
  }
  if (failures > kMost) {
    std::fprintf(stderr, "and %d more, in sweep.csv\n", failures - kMost);
  }
  return failures > 0;
}

std::string EstimateText(const Estimate& estimate, std::size_t trials) {
  char text[96];
  std::snprintf(text, sizeof(text), trials > 1 ? "%.6g [%.6g, %.6g]" : "%.6g",
                estimate.value, estimate.low, estimate.high);
  return text;
}

bool IsGiven(const char* flag) {
  return !gflags::GetCommandLineFlagInfoOrDie(flag).is_default;
}

// Keeps the question with the runs. Who only has the pages made anew asks the
// one that was asked last.
void TakeObjective(bool has_command, SweepDefinition* definition) {
  if (has_command || IsGiven("minimize") || IsGiven("maximize")) {
    definition->objective = Objective();
    definition->maximize = !FLAGS_maximize.empty();
  } else {
    (definition->maximize ? FLAGS_maximize : FLAGS_minimize) =
        definition->objective;
  }
}

// Removes the best.flags of an earlier question, which would be taken for the
// answer to this one; false when somebody else's is in its place, which stays.
bool RemoveBest(SweepDefinition* definition, const std::string& folder) {
  const std::string path = folder + "/best.flags";
  std::error_code error;
  if (!fs::exists(fs::symlink_status(path, error))) return true;
  if (definition->best_digest.empty() ||
      Sha256OfFile(path) != definition->best_digest) {
    return false;
  }
  fs::remove(path);
  return true;
}

// Prints the best setting, and writes it as a flag file.
void TellBest(const SweepResult& result, bool may_write,
              SweepDefinition* definition, const std::string& folder) {
  const bool minimize = !FLAGS_minimize.empty();
  const std::string figure = minimize ? FLAGS_minimize : FLAGS_maximize;
  const std::optional<BestSetting> best = FindBest(result, figure, minimize);
  if (!best) {
    std::printf("best: no setting has all its runs done with a figure '%s'\n",
                figure.c_str());
    return;
  }
  const std::vector<SweepSetting> settings = Settings(result);
  const SweepSetting& setting = settings[best->setting];
  std::printf("best: %s: %s = %s\n",
              SettingText(result.definition, setting.values).c_str(),
              figure.c_str(),
              EstimateText(best->mean, setting.runs.size()).c_str());
  for (const std::size_t i : best->equals) {
    std::printf("as good as far as one can tell: %s\n",
                SettingText(result.definition, settings[i].values).c_str());
  }
  const std::string path = folder + "/best.flags";
  if (!may_write) {
    throw Error(path, 0, "is not what this sweep wrote, and stays",
                "the file in another place");
  }
  std::string text;
  for (const std::string& flag :
       SettingFlags(result.definition, setting.values)) {
    text += flag + '\n';
  }
  Sha256 digest;
  digest.Update(text);
  definition->best_digest = digest.HexDigest();
  WriteDefinition(*definition, folder);
  WriteFileAtomically(path, [&](std::ostream& output) { output << text; });
}

// sweep.svg and sweep.html.
void WriteOverview(const SweepResult& result, const std::string& folder) {
  constexpr std::size_t kFigures = 8;
  OverviewOptions options;
  options.minimize = FLAGS_maximize.empty();
  options.objective = options.minimize ? FLAGS_minimize : FLAGS_maximize;
  options.figures = SplitNames(FLAGS_figures);
  if (options.figures.empty()) {
    options.figures = ChooseFigures(result, options.objective, kFigures);
  }
  WriteFileAtomically(folder + "/sweep.html", [&](std::ostream& output) {
    output << OverviewHtml(result, options);
  });
  WriteFileAtomically(folder + "/sweep.svg", [&](std::ostream& output) {
    output << OverviewSvg(result, options);
  });
}

int UsageError(const std::string& message) {
  std::fprintf(stderr, "%s\nplumbline_sweep: --help lists the flags\n",
               message.c_str());
  return kExitUsage;
}

// A command that came with a folder is run only when somebody says so.
void AskForTrust(const SweepDefinition& definition, const std::string& folder) {
  if (FLAGS_trust || WasDefinedHere(folder)) return;
  std::string command;
  for (const std::vector<std::string>& words :
       {definition.command, definition.evaluate}) {
    if (words.empty()) continue;
    command += "\n ";
    for (const std::string& word : words) {
      command += " " + PrintableUtf8(QuoteForShell(word));
    }
  }
  if (isatty(STDIN_FILENO) && isatty(STDERR_FILENO)) {
    std::fprintf(stderr,
                 "%s/sweep.json was not written in this folder. It runs:%s\n"
                 "Go on? [y/N] ",
                 folder.c_str(), command.c_str());
    std::string answer;
    std::getline(std::cin, answer);
    if (answer == "y" || answer == "Y" || answer == "yes") return;
  }
  throw Error(
      folder + "/sweep.json", 0,
      "was not written in this folder, and its command is not trusted:" +
          command + "\n",
      "the command behind --, or --trust");
}

// Nothing of somebody else is replaced by the first run in a folder.
void CheckNewFolder(const std::string& folder) {
  for (const char* name :
       {"sweep.csv", "sweep.svg", "sweep.html", "best.flags", "runs"}) {
    std::error_code error;
    if (fs::exists(fs::symlink_status(folder + "/" + name, error))) {
      throw Error(folder + "/" + name, 0,
                  "is there, and no sweep.json that tells of it",
                  "another --output_dir");
    }
  }
}

int RunOne(const std::string& folder) {
  const std::optional<SweepDefinition> definition = ReadDefinition(folder);
  if (!definition) throw Error(folder, 0, "holds no sweep", "sweep.json");
  AskForTrust(*definition, folder);
  for (const SweepRun& run : MakeRuns(*definition)) {
    if (run.name != FLAGS_run) continue;
    if (!ReadRecord(RunFolder(folder, run))) {
      ExecuteRun(*definition, run, folder, [] { return InterruptRequested(); });
    }
    return kExitSuccess;
  }
  throw Error("--run", 0, "there is no run '" + FLAGS_run + "' in " + folder,
              "a name that sweep.csv lists");
}

int Run(const std::vector<std::string>& command) {
  if (FLAGS_output_dir.empty()) {
    return UsageError("--output_dir is missing: expected a folder");
  }
  if (!FLAGS_minimize.empty() && !FLAGS_maximize.empty()) {
    return UsageError("--minimize and --maximize: expected one of them");
  }
  const std::string folder =
      Absolute("--output_dir", FLAGS_output_dir).lexically_normal().string();
  if (!FLAGS_run.empty()) return RunOne(folder);
  if (!FLAGS_grid.empty() && command.empty()) {
    return UsageError("--grid without a command: expected it behind --");
  }

  std::optional<SweepDefinition> old_one = ReadDefinition(folder);
  SweepDefinition definition;
  if (!command.empty()) {
    definition = DefinitionFromFlags(command);
    if (old_one) {
      CheckSameRuns(*old_one, definition, folder);
      definition.best_digest = old_one->best_digest;
    }
  } else if (old_one) {
    definition = *old_one;
    AskForTrust(definition, folder);
    if (FLAGS_time_limit > 0.0) definition.time_limit = FLAGS_time_limit;
  } else {
    return UsageError(
        "there is no command: expected -- and a program with its flags, or a "
        "folder with a sweep to go on with");
  }
  std::error_code error;
  fs::create_directories(folder, error);
  if (!fs::is_directory(folder)) {
    throw Error("--output_dir", 0, "cannot make '" + folder + "'",
                "a folder that can be written to");
  }
  if (!old_one) CheckNewFolder(folder);
  TakeObjective(!command.empty(), &definition);
  CheckObjectiveBeforehand(definition);
  CheckFlagsOfRuns(definition);
  const FolderLock lock(folder);
  WriteDefinition(definition, folder);
  DoRuns(definition, folder);

  const SweepResult result = CollectSweep(definition, folder);
  WriteFileAtomically(folder + "/sweep.csv", [&](std::ostream& output) {
    WriteSweepTable(result, FLAGS_times, output);
  });
  TellRuns(result);
  WriteOverview(result, folder);
  const std::string best = folder + "/best.flags";
  const bool had_best = fs::exists(best, error);
  const bool may_write = RemoveBest(&definition, folder);
  if (!Objective().empty()) {
    TellBest(result, may_write, &definition, folder);
  } else if (!may_write) {
    Remark("%s is not what this sweep wrote, and stays", best.c_str());
  } else if (had_best) {
    Remark("%s: removed: there is no --minimize or --maximize now",
           best.c_str());
  }
  return TellFailures(result) && !InterruptRequested() ? kExitInput
                                                       : kExitSuccess;
}

}  // namespace
}  // namespace plumbline

int main(int argc, char** argv) {
  plumbline::AppInfo info;
  info.name = "plumbline_sweep";
  info.summary =
      "Runs a program, such as plumbline_solve or plumbline_experiments, with "
      "every combination of values of its flags, and makes a table of every "
      "number in the summary.json that each run writes. A run that is done is "
      "not done again when the same sweep is started anew.";
  info.usage = {"--grid=GRID --output_dir=DIR [flags] -- COMMAND [its flags]",
                "--output_dir=DIR [flags]"};
  info.example =
      "plumbline_sweep --grid='delta_threshold=0.05,0.1,0.3;"
      "link_radius=5,10,20' --trials=20 --jobs=2 --output_dir=out/sweep -- "
      "plumbline_solve --input=datasets/office.clf.gz --outputs=none";
  info.statuses = {{plumbline::kExitInput, "also where a run failed"}};
  info.groups = {
      {"Runs",
       {"grid", "one_at_a_time", "trials", "seed", "seed_flag", "evaluate",
        "time_limit", "retry_failed"}},
      {"Where they run", {"launcher", "jobs", "hosts", "launcher_options"}},
      {"Results",
       {"output_dir", "minimize", "maximize", "figures", "times", "quiet",
        "verbose"}},
      {"Inner workings", {"run", "trust"}}};
  info.takes_arguments = true;
  const std::vector<std::string> command =
      plumbline::ParseFlags(info, argc, argv);
  return plumbline::RunMain([&] { return plumbline::Run(command); });
}
