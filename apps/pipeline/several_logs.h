#ifndef PLUMBLINE_PIPELINE_SEVERAL_LOGS_H_
#define PLUMBLINE_PIPELINE_SEVERAL_LOGS_H_

#include <plumbline/core/registry.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/key_scan_archive.h>
#include <plumbline/frontend/scan.h>
#include <plumbline/frontend/track_placement.h>
#include <plumbline/pipeline/log_solver.h>
#include <plumbline/pipeline/run_control.h>

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

namespace plumbline {

/// Options of solving several logs.
struct SeveralLogsOptions {
  /// Segments and full refinement only.
  LogSolverOptions solver;
  TrackPlacementOptions placement;
  /// By log: where its first scan is in the frame of the first log's map, if
  /// roughly known (TrackPlacementOptions::start_distance). May be shorter than
  /// the list of logs.
  std::vector<std::optional<Pose2>> starts;
  /// The map of earlier logs (map.json), in whose frame all is then, starts
  /// included, and which every log has to be placed in. Null: none. Not owned.
  const KeyScanArchive* earlier = nullptr;
  /// Length of the walls of that map, m.
  double earlier_wall_length = 0.0;
  /// Find the logs in the earlier map, which stays as it is.
  bool localize_only = false;
};

/// Result for one log.
struct LogInMap {
  /// Index of its map, and its scans among that map's: [begin, end).
  std::size_t map = 0;
  std::size_t begin = 0;
  std::size_t end = 0;
  /// How it was placed among the logs before it; not found for the first log
  /// of a map.
  TrackPlacement placement;
  /// Where its first scan may lie though it was kept apart
  /// (TrackPlacement::is_candidate, needs_start): what
  /// SeveralLogsOptions::starts needs to put it there. None but in the first
  /// log's map, or the earlier one.
  std::optional<Pose2> candidate;
};

/// A map of one log or more.
struct MapOfLogs {
  /// Indices of the logs, in the order of their scans. Key scans of an earlier
  /// map come before them.
  std::vector<std::size_t> logs;
  std::vector<Scan> scans;
  /// Of all scans; the frame is that of the first log alone.
  LogSolverResult result;
  /// Has the graph; null where logs are only localized.
  std::unique_ptr<LogSolver> solver;
};

/// Result of SolveSeveralLogs.
struct SeveralLogsResult {
  /// By log.
  std::vector<LogInMap> logs;
  /// The map of the first log comes first. One alone when all logs are of one
  /// building.
  std::vector<MapOfLogs> maps;
  /// Ended early because `stop` said so: there are no maps, or the last of them
  /// is not whole.
  bool interrupted = false;
  /// A log fits nowhere in the earlier map: there are no maps, and
  /// LogInMap::placement says why.
  bool is_elsewhere = false;
};

/// What SolveSeveralLogs is doing.
struct SeveralLogsControl {
  /// Told of every log before its scans are taken.
  std::function<void(std::size_t log)> begin_log;
  /// Of all solvers; checkpoints are not made.
  RunControl run;
};

/// Solves several logs, each with odometry of its own, together. Each log gets
/// its first map; then the logs are placed in each other's buildings by what
/// they saw (PlaceTrack), whatever the order in which they are given, and only
/// where that is certain; those
/// that were placed become one track, in which the robot was lost and found
/// again between the logs, and go on as such: poses, walls and structure are
/// adjusted together in one second map. A log that fits nowhere begins a map of
/// its own. The scans are taken out of the logs. Throws Error when options do
/// not fit or there is no log.
///
/// With an earlier map the logs are placed in what its key scans saw, and those
/// go into the second map with the others'; nothing is made of it when a log
/// fits nowhere. Where logs are only localized, the poses of the earlier key
/// scans are held, and the result has nothing but the trajectory.
SeveralLogsResult SolveSeveralLogs(const Registry& registry,
                                   std::vector<Log> logs,
                                   const SeveralLogsOptions& options,
                                   const SeveralLogsControl& control = {});

}  // namespace plumbline

#endif  // PLUMBLINE_PIPELINE_SEVERAL_LOGS_H_
