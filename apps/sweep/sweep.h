#ifndef PLUMBLINE_APPS_SWEEP_SWEEP_H_
#define PLUMBLINE_APPS_SWEEP_SWEEP_H_

#include <plumbline/apps/sweep/sweep_grid.h>

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {

/// What a sweep runs. It is kept as sweep.json in the sweep's folder, so that
/// any machine that sees the folder can do any of the runs.
struct SweepDefinition {
  std::vector<SweepAxis> axes;
  /// The settings are not all combinations, but the first values of all axes
  /// and, axis by axis, its other values with the first ones of the rest.
  bool one_at_a_time = false;
  /// Runs of every setting, with the seeds first_seed, first_seed + 1, ...
  int trials = 1;
  std::uint64_t first_seed = 1;
  /// Flag of the command that takes the seed; empty: it has none.
  std::string seed_flag = "seed";
  /// The program, as an absolute path, and its arguments.
  std::vector<std::string> command;
  /// Run after the command when it succeeded, "{}" replaced by the run's
  /// folder; empty: nothing.
  std::vector<std::string> evaluate;
  /// Where the command is run; relative paths of its arguments start here.
  std::string working_directory;
  /// Set for the command: what it needs of the environment on other machines.
  std::vector<std::pair<std::string, std::string>> environment;
  /// Most time of a run, command and evaluation, s; 0: no limit.
  double time_limit = 0.0;
  /// Figure by which the best setting was chosen last, and whether the most of
  /// it is best; empty: nobody asked.
  std::string objective;
  bool maximize = false;
  /// SHA-256 of best.flags as the sweep wrote it last; empty: it wrote none.
  std::string best_digest;
};

/// Writes sweep.json into a folder, whole or not at all.
void WriteDefinition(const SweepDefinition& definition,
                     const std::string& folder);

/// Reads it; none when there is none. Throws Error when it cannot be read or
/// makes no sense (CheckDefinition).
std::optional<SweepDefinition> ReadDefinition(const std::string& folder);

/// Throws Error, naming `path`, unless the definition can be run: a command, a
/// name and at least one value for every axis, no value twice, at least one
/// trial, a time limit that is no less than 0, and a million runs at most.
void CheckDefinition(const SweepDefinition& definition,
                     const std::string& path);

/// Whether the sweep.json of a folder was written there: a folder that was
/// copied, moved or unpacked from an archive holds a command that somebody else
/// may have chosen.
bool WasDefinedHere(const std::string& folder);

/// Throws Error unless runs of `old_one`, which were done in `folder`, can be
/// taken for runs of `definition`: axes, trials and time limits may differ, all
/// else must not.
void CheckSameRuns(const SweepDefinition& old_one,
                   const SweepDefinition& definition,
                   const std::string& folder);

/// A run of a sweep.
struct SweepRun {
  /// A value for every axis, in their order.
  std::vector<std::string> values;
  std::uint64_t seed = 1;
  /// Folder below <folder>/runs, made of flags, values and seed; never the same
  /// for two runs of one sweep, and the same in sweeps with other axes' values.
  std::string name;
};

/// All runs: the first axis varies slowest, the seed fastest; one at a time the
/// first values of all axes come first, then the axes in their order.
std::vector<SweepRun> MakeRuns(const SweepDefinition& definition);

/// The flags of a setting as the command takes them: "--link_radius=5".
std::vector<std::string> SettingFlags(const SweepDefinition& definition,
                                      const std::vector<std::string>& values);

/// The same in one line for a shell.
std::string SettingText(const SweepDefinition& definition,
                        const std::vector<std::string>& values);

/// What the run executes: the command with the run's flags behind it.
std::vector<std::string> RunCommand(const SweepDefinition& definition,
                                    const SweepRun& run,
                                    const std::string& run_folder);

enum class RunStatus { kDone, kFailed, kTimedOut };

/// "done", "failed", "timed_out"
const char* RunStatusName(RunStatus status);

/// A number with its name: "cost.total".
using Figure = std::pair<std::string, double>;

/// What came of a run, kept as run.json in the run's folder and written last: a
/// run without it was not done.
struct RunRecord {
  RunStatus status = RunStatus::kFailed;
  /// Why it is not done: "exit status 3", "signal 11 (Segmentation fault)", and
  /// the last line that it printed.
  std::string reason;
  /// Time that it took, s.
  double seconds = 0.0;
  /// Every number of summary.json, then, as "evaluation.*", of
  /// evaluation.json; empty unless it is done.
  std::vector<Figure> figures;
  /// Names of what is null there: figures that there are, and that are not
  /// known of this run.
  std::vector<std::string> unknown;
};

/// Path of a run's folder in the sweep's folder.
std::string RunFolder(const std::string& folder, const SweepRun& run);

/// The record of a run; none when it was not done or has no readable record.
std::optional<RunRecord> ReadRecord(const std::string& run_folder);

/// Writes the record of a run whose process is gone without one: failed.
void RecordLoss(const std::string& run_folder);

/// Throws Error, naming the flag or value, when a setting has a flag that the
/// command, or the evaluation, refuses: each value of each axis is tried once,
/// with the first ones of the others. Programs whose name begins with
/// "plumbline_" are asked (--check_flags); of others nothing is known.
void CheckFlagsOfRuns(const SweepDefinition& definition);

/// Every number of a JSON document, in its order, by its path: {"a": {"b": [1,
/// true]}} gives a.b.0 = 1 and a.b.1 = 1 (false is 0). With `count_lists` a
/// list gives its size in place of its entries: a.b = 2. Words are passed over;
/// the paths of what is null go to `unknown`. Throws Error, naming `path`, when
/// the text is no JSON object.
std::vector<Figure> Numbers(const std::string& text, bool count_lists,
                            const std::string& path,
                            std::vector<std::string>* unknown = nullptr);

/// Does a run: empties its folder, runs command and evaluation there with what
/// they print in log.txt, reads summary.json and evaluation.json, writes and
/// returns the record. When `stop` returns true it ends what runs and returns
/// none, with no record. Processes that are left over after a time-out or stop
/// get SIGTERM, and SIGKILL five seconds later. Not thread safe: one run a
/// process at a time. Throws Error when the folder cannot be written.
std::optional<RunRecord> ExecuteRun(const SweepDefinition& definition,
                                    const SweepRun& run,
                                    const std::string& folder,
                                    const std::function<bool()>& stop);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_SWEEP_SWEEP_H_
