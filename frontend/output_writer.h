#ifndef PLUMBLINE_FRONTEND_OUTPUT_WRITER_H_
#define PLUMBLINE_FRONTEND_OUTPUT_WRITER_H_

#include <plumbline/core/em.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/graph_g2o.h>
#include <plumbline/core/registry.h>
#include <plumbline/frontend/scan.h>
#include <plumbline/frontend/timed_pose.h>

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace plumbline {

/// Result of a run, as an output writer sees it. A program may hand over a
/// class derived from it to the writers that it brings itself.
struct SolvedRun {
  virtual ~SolvedRun() = default;

  /// Never null while files are written.
  const Graph* graph = nullptr;
  const Registry* registry = nullptr;
  /// One pose per scan that was solved (map frame); empty for a graph.
  std::vector<TimedPose> trajectory;
  /// The log's scans, at least one per pose; null for a graph.
  const std::vector<Scan>* scans = nullptr;
  std::vector<EmPhase> trace;
  /// Comments and unknown tags of a graph's file; null for a log.
  const G2oFile* g2o = nullptr;
  /// "office.clf.gz, with structure"
  std::string title;
};

/// A file that a run can write: a kind of plug-in (Registry::Register, Find,
/// Get, All).
struct OutputWriterType {
  static constexpr char kKind[] = "output writer";
  static constexpr char kTitle[] = "Output writers (--outputs)";

  /// The file's name: "map.svg".
  std::string name;
  /// Names of further files that it writes with it: "occupancy.yaml".
  std::vector<std::string> further_files;
  /// Names of files that it writes with it in some runs only.
  std::vector<std::string> optional_files;
  /// One line.
  std::string description;
  /// Written unless somebody says otherwise.
  bool by_default = true;
  /// Needs scans and their poses: left out for a graph.
  bool of_scans = false;
  /// Writes the file into a folder, whole or not at all (core/atomic_file.h);
  /// may run at the same time as other writers. Returns why it makes no sense
  /// to write it, or nothing; throws Error when it cannot be written.
  std::function<std::string(const SolvedRun&, const std::filesystem::path&)>
      write;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_OUTPUT_WRITER_H_
