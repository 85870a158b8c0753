#ifndef PLUMBLINE_PIPELINE_RUN_CONTROL_H_
#define PLUMBLINE_PIPELINE_RUN_CONTROL_H_

#include <plumbline/core/em.h>
#include <plumbline/core/graph.h>
#include <plumbline/factors/pose2.h>

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

namespace plumbline {

/// The map of a log while it is made; it changes once the callback returns.
struct MapSoFar {
  const Graph& graph;
  /// Phases of EM on the whole map until now.
  const std::vector<EmPhase>& trace;
  /// Makes a pose for every scan so far, map frame. Cost: linear in the scans.
  std::function<std::vector<Pose2>()> trajectory;
};

/// Callbacks while a log or a graph is solved. Each may be null.
struct RunControl {
  /// Told the scans done and the scans in all, after every scan.
  std::function<void(std::size_t done, std::size_t total)> progress;
  /// Asked between steps: true ends the work early, with what there is whole.
  std::function<bool()> stop;
  /// Told, in a few words, of each step after the last scan as it begins.
  std::function<void(const char* name)> step;
  /// Told when a stage of solving a log has ended. `state()` makes the bytes
  /// that LogSolver::Resume goes on from, at the cost of copying the map.
  std::function<void(const std::function<std::string()>& state)> checkpoint;
  /// Shown the map after every scan and between the stages that follow. The
  /// result does not depend on whether it is looked at.
  std::function<void(const MapSoFar& map)> look;
};

}  // namespace plumbline

#endif  // PLUMBLINE_PIPELINE_RUN_CONTROL_H_
