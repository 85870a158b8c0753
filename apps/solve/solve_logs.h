#ifndef PLUMBLINE_APPS_SOLVE_SOLVE_LOGS_H_
#define PLUMBLINE_APPS_SOLVE_SOLVE_LOGS_H_

#include <plumbline/apps/solve/log_input.h>
#include <plumbline/apps/solve/run_context.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/key_scan_archive.h>
#include <plumbline/pipeline/log_solver.h>

#include <memory>
#include <optional>
#include <vector>

namespace plumbline {

/// The map of earlier logs.
struct EarlierMap {
  KeyScanArchive key_scans;
  Graph graph;
};

/// What --map names; null without. Throws Error.
std::unique_ptr<EarlierMap> EarlierMapFromFlags(const Registry& registry);

/// Refuses options that do not go with several logs, or with --map. Throws
/// Error.
void CheckOptionsOfLogs(const LogSolverOptions& options);

/// Turns several logs into one map, or continues an earlier one, or finds logs
/// in it, and writes what came out. `starts`: of each log, where it is known
/// (--start_pose). `earlier`: the map that the logs continue or are found in,
/// or null. Returns the process's exit status; throws Error.
int SolveLogs(const std::vector<std::unique_ptr<OpenInput>>& inputs,
              const std::vector<std::optional<Pose2>>& starts,
              const EarlierMap* earlier, const RunContext& run);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_SOLVE_SOLVE_LOGS_H_
