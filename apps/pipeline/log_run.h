#ifndef PLUMBLINE_PIPELINE_LOG_RUN_H_
#define PLUMBLINE_PIPELINE_LOG_RUN_H_

#include <plumbline/core/graph.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/scan.h>
#include <plumbline/pipeline/log_solver.h>
#include <plumbline/pipeline/run_control.h>

#include <vector>

namespace plumbline {

/// What the stages of solving a log share once all scans are in.
struct LogRun {
  /// All scans of the log; not copied.
  const std::vector<Scan>& scans;
  /// Callbacks of whoever runs it; not copied.
  const RunControl& control;
  /// What is known of the result so far.
  LogSolverResult result;
  /// Poses of the key scans as they were found again last, map frame.
  std::vector<Pose2> keys;
  /// Features of the places of the second map, or of those that were recovered,
  /// in the order of the log.
  std::vector<FeatureId> places;
  /// Not once the adjusted poses were looked through for them in vain.
  bool may_have_open_ways = true;

  /// Of these scans; what is referred to must outlive it.
  LogRun(const std::vector<Scan>& all_scans, const RunControl& run_control)
      : scans(all_scans), control(run_control) {}

  /// Tells that a step begins.
  void Begin(const char* step) const;
  /// Whether it is time to stop. Once it was time to stop, it stays so.
  bool IsStopped();
  /// The trajectory of the result from the places as they stand in the graph.
  void TakeTrajectory(const Graph& graph, int place_stride);
};

}  // namespace plumbline

#endif  // PLUMBLINE_PIPELINE_LOG_RUN_H_
