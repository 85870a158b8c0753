#include <gflags/gflags_declare.h>
#include <plumbline/apps/cli/app.h>
#include <plumbline/apps/cli/progress.h>
#include <plumbline/apps/solve/run_outputs.h>
#include <plumbline/apps/solve_flags.h>
#include <plumbline/core/error.h>
#include <plumbline/core/stopwatch.h>
#include <plumbline/core/utf8.h>
#include <plumbline/frontend/output_writer.h>
#include <plumbline/outputs/checkpoint_file.h>
#include <plumbline/outputs/closing_lines.h>
#include <plumbline/pipeline/several_logs.h>

#include <cstdio>
#include <set>
#include <sstream>
#include <system_error>
#include <utility>

// Of apps/cli.
DECLARE_bool(quiet);

namespace plumbline {
namespace {

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

// Why a run does not have files that were asked for by their names. Of those
// that a word such as "default" stands for nobody waits.
void TellOutputsLeftOut(const SolveOutcome& outcome) {
  const Registry& registry = *outcome.registry;
  const std::set<std::string> selected = SelectOutputs(FLAGS_outputs, registry);
  const std::set<std::string> written = OutputsFromFlags(registry);
  std::istringstream words(FLAGS_outputs);
  std::set<std::string> told;
  std::string name;
  while (std::getline(words, name, ',')) {
    if (selected.count(name) == 0 || !told.insert(name).second) continue;
    if (written.count(name) == 0) {
      Remark("%s not written: --localize leaves the map as it is",
             name.c_str());
    } else if (registry.Get<OutputWriterType>(name).of_scans &&
               outcome.trajectory.empty()) {
      Remark("%s not written: %s", name.c_str(),
             outcome.scans == nullptr ? "a graph has no scans"
                                      : "there are no scans");
    }
  }
}

// Removes the maps of logs that an earlier run kept apart, from this one on:
// they are none of the present run's.
void RemoveMapsFrom(std::size_t map, const Registry& registry) {
  namespace fs = std::filesystem;
  std::error_code error;
  std::set<std::string> there;
  for (fs::directory_iterator entry(FLAGS_output_dir, error);
       !error && entry != fs::directory_iterator(); entry.increment(error)) {
    there.insert(entry->path().filename().string());
  }
  for (; map < kMostLogs; ++map) {
    if (there.count(FolderOfMap(map)) == 0) continue;
    const fs::path path = fs::path(FLAGS_output_dir) / FolderOfMap(map);
    if (!fs::is_directory(path, error)) continue;
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

}  // namespace

std::set<std::string> OutputsFromFlags(const Registry& registry) {
  std::set<std::string> names = SelectOutputs(FLAGS_outputs, registry);
  if (!FLAGS_localize) return names;
  std::set<std::string> left;
  for (const char* name : {"map.png", "map.svg", "trajectory.tum"}) {
    if (names.count(name) > 0) left.insert(name);
  }
  return left;
}

std::set<std::string> NamesOfAllOutputs(const Registry& registry) {
  std::set<std::string> names =
      FilesOfOutputs(SelectOutputs("all", registry), registry);
  names.insert(CheckpointFile::kName);
  return names;
}

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

std::string FolderOfMap(std::size_t map) {
  return map == 0 ? "" : "map_" + std::to_string(map + 1);
}

std::string Joined(const std::vector<std::string>& names) {
  std::string list;
  for (const std::string& name : names) {
    list += (list.empty() ? "" : ", ") + name;
  }
  return list;
}

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
    TellOutputsLeftOut(*outcome);
    if (written.is_cut) outcome->summary.partial = true;
    outcome->summary.files = std::move(written.files);
    outcome->summary.digests = written.digests;
    if (const BuildingPlan* plan = outcome->BuildingIfMade()) {
      outcome->summary.plan = {static_cast<std::int64_t>(plan->rooms.size()),
                               static_cast<std::int64_t>(plan->doors.size()),
                               plan->way_outside};
    }
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

void FinishRun(const RunContext& run, std::size_t num_maps,
               SolveOutcome* outcome) {
  WriteOutputs(outcome, run.clock, run.folder);
  if (!outcome->summary.partial) TellWhole();
  RemoveMapsFrom(num_maps, run.registry);
  run.live->Finish(*outcome);
  TellEnd(*outcome, run.clock);
}

}  // namespace plumbline
