#ifndef PLUMBLINE_APPS_SOLVE_SOLVING_PROGRESS_H_
#define PLUMBLINE_APPS_SOLVE_SOLVING_PROGRESS_H_

#include <plumbline/apps/solve/live_map.h>
#include <plumbline/apps/solve/run_clock.h>
#include <plumbline/core/stopwatch.h>
#include <plumbline/pipeline/run_control.h>

#include <cstddef>
#include <string>

namespace plumbline {

/// The bar and lines on the way through one log or several, and the live map.
class SolvingProgress {
 public:
  /// `clock` is told of the steps; both have to outlive this.
  SolvingProgress(RunClock* clock, LiveMap* live)
      : clock_(*clock), live_(*live) {}

  /// A log begins.
  void BeginLog(const std::string& title);

  /// For a solver; this has to stay while it runs.
  RunControl Control();

 private:
  std::string Stage() const;
  void TakeScan(std::size_t done, std::size_t total);

  RunClock& clock_;
  LiveMap& live_;
  Stopwatch watch_;
  // Of the log, and its scans.
  std::string title_;
  std::size_t done_ = 0;
  std::size_t total_ = 0;
  // All scans are in: how many steps are left is not known.
  bool is_finishing_ = false;
};

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_SOLVE_SOLVING_PROGRESS_H_
