#ifndef PLUMBLINE_PIPELINE_RUN_CONTROL_H_
#define PLUMBLINE_PIPELINE_RUN_CONTROL_H_

#include <cstddef>
#include <functional>
#include <string>

namespace plumbline {

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
};

}  // namespace plumbline

#endif  // PLUMBLINE_PIPELINE_RUN_CONTROL_H_
