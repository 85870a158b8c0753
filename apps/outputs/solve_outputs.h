#ifndef PLUMBLINE_OUTPUTS_SOLVE_OUTPUTS_H_
#define PLUMBLINE_OUTPUTS_SOLVE_OUTPUTS_H_

#include <plumbline/core/break_log.h>
#include <plumbline/core/graph_json.h>
#include <plumbline/core/registry.h>
#include <plumbline/frontend/key_scan_archive.h>
#include <plumbline/frontend/map_without_structure.h>
#include <plumbline/frontend/output_writer.h>
#include <plumbline/outputs/map_drawing.h>
#include <plumbline/outputs/occupancy_grid.h>
#include <plumbline/outputs/summary.h>
#include <plumbline/plan/building_plan.h>

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

namespace plumbline {

class SharedParts;

/// One of several logs that a map is made of.
struct LogPart {
  /// Its place among the inputs, from 1.
  std::size_t number = 1;
  /// Its poses in the trajectory: [begin, end).
  std::size_t begin = 0;
  std::size_t end = 0;
};

/// All that the files of plumbline_solve are made of.
struct SolveOutcome : SolvedRun {
  OccupancyOptions occupancy;
  double delta_threshold = 0.0;
  /// The scans that `scans` points to when what was seen in mirrors was cut out
  /// of them for the outputs.
  std::shared_ptr<const std::vector<Scan>> cut_scans;
  /// The graph that `graph` points to when it was moved for the outputs.
  std::shared_ptr<const Graph> moved_graph;
  /// Of a run on several logs: those in this map, each of which gets a
  /// trajectory_<number>.tum; empty otherwise.
  std::vector<LogPart> logs;
  /// All of them, for the report.
  std::vector<FlagValue> flags;
  /// For map.json, and of how many standard deviations ellipses are drawn (0:
  /// none).
  FeatureCovariances covariances;
  double ellipse_sigmas = 0.0;
  /// Makes the map without structure, for the report; may be null.
  std::function<MapWithoutStructure()> without_structure;
  /// Those of a first map that another one stands for.
  std::vector<PlacedClosure> closures;
  /// How constraints were broken, as far as it is known: for the report.
  BreakRecords breaks;
  /// Makes the key scans that map.json keeps; null for a graph.
  std::function<KeyScanArchive()> key_scans;
  /// Complete but for the times and memory of writing.
  Summary summary;
  /// Parts that several files show, made by the first writer that needs them.
  std::shared_ptr<SharedParts> parts;

  SolveOutcome();

  /// Rooms and doors; null when none of the files that were written needed
  /// them, or they could not be looked for.
  const BuildingPlan* BuildingIfMade() const;
};

/// Most logs that can be solved together.
inline constexpr std::size_t kMostLogs = 50;

/// Registers the output writers of this folder. They take a SolveOutcome and no
/// other SolvedRun. Writers that are registered already stay.
void RegisterBuiltinOutputWriters(Registry* registry);

/// Names that a list selects: "default", "all", "none", names, and names with a
/// minus in front, which are taken out again; from left to right, separated by
/// commas. A list that begins with a minus begins from the default. Throws
/// Error that lists the names for one that is unknown.
std::set<std::string> SelectOutputs(const std::string& list,
                                    const Registry& registry);

/// Result of WriteSolveOutputs.
struct WrittenOutputs {
  /// Names of the files, in order.
  std::vector<std::string> files;
  /// SHA-256 of each by name, in hexadecimal digits.
  std::map<std::string, std::string> digests;
  /// A line for each that made no sense, with why.
  std::vector<std::string> reasons;
  /// An interrupt came while they were written, and something is missing in
  /// one of them.
  bool is_cut = false;
};

/// Names of all files that these writers write, further ones included.
std::set<std::string> FilesOfOutputs(const std::set<std::string>& names,
                                     const Registry& registry);

/// Writes the files selected on this many threads; throws Error that names all
/// files that cannot be written. `progress` (may be null) is told how many are
/// done and how many there are, by one thread at a time.
WrittenOutputs WriteSolveOutputs(
    const SolveOutcome& outcome, const std::set<std::string>& names,
    const std::filesystem::path& folder, int threads,
    const std::function<void(int, int)>& progress = nullptr);

}  // namespace plumbline

#endif  // PLUMBLINE_OUTPUTS_SOLVE_OUTPUTS_H_
