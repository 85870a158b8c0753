#ifndef PLUMBLINE_APPS_SOLVE_OUTPUTS_H_
#define PLUMBLINE_APPS_SOLVE_OUTPUTS_H_

#include <plumbline/apps/occupancy_grid.h>
#include <plumbline/apps/relations.h>
#include <plumbline/apps/summary.h>
#include <plumbline/apps/without_structure.h>
#include <plumbline/core/em.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/graph_g2o.h>
#include <plumbline/core/registry.h>
#include <plumbline/frontend/scan.h>

#include <filesystem>
#include <functional>
#include <set>
#include <string>
#include <vector>

namespace plumbline {

/// What a run came to: all that the files are made of.
struct SolveOutcome {
  /// Never null while files are written.
  const Graph* graph = nullptr;
  const Registry* registry = nullptr;
  /// One pose a scan that was solved (map frame); empty for a graph.
  std::vector<TimedPose> trajectory;
  /// The log's scans, at least one a pose; null for a graph.
  const std::vector<Scan>* scans = nullptr;
  std::vector<EmPhase> trace;
  /// Comments and unknown tags of a graph's file; null for a log.
  const G2oFile* g2o = nullptr;
  /// "office.clf.gz, with structure"
  std::string title;
  OccupancyOptions occupancy;
  double delta_threshold = 0.0;
  /// All of them, for the report.
  std::vector<FlagValue> flags;
  /// Makes the map without structure, for the report; may be null.
  std::function<MapWithoutStructure()> without_structure;
  /// Complete but for the times and memory of writing.
  Summary summary;
};

/// A file that a run can write.
struct SolveOutput {
  /// The file's name, by which --outputs knows it.
  std::string name;
  /// One line.
  std::string description;
  /// Written unless --outputs says otherwise.
  bool by_default = true;
  /// Needs scans and their poses: left out for a graph.
  bool of_scans = false;
  /// Writes the file into a folder, whole or not at all. Returns why it makes
  /// no sense to write it, or nothing; throws Error when it cannot be written.
  std::function<std::string(const SolveOutcome&, const std::filesystem::path&)>
      write;
};

/// All of them, in the order in which they are listed to people.
const std::vector<SolveOutput>& SolveOutputs();

/// Names that a list selects: "default", "all", "none", names, and names with a
/// minus in front, which are taken out again; from left to right, separated by
/// commas. A list that begins with a minus begins from the default. Throws
/// Error that lists the names for one that is unknown.
std::set<std::string> SelectOutputs(const std::string& list);

/// Writes the files selected on so many threads. Returns a line for each that
/// made no sense, with why; throws Error when a file cannot be written.
std::vector<std::string> WriteSolveOutputs(const SolveOutcome& outcome,
                                           const std::set<std::string>& names,
                                           const std::filesystem::path& folder,
                                           int threads);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_SOLVE_OUTPUTS_H_
