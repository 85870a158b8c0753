#ifndef PLUMBLINE_APPS_SOLVE_LIVE_MAP_H_
#define PLUMBLINE_APPS_SOLVE_LIVE_MAP_H_

#include <plumbline/apps/solve/run_clock.h>
#include <plumbline/outputs/live_report.h>
#include <plumbline/outputs/report.h>
#include <plumbline/outputs/solve_outputs.h>
#include <plumbline/pipeline/run_control.h>

#include <functional>
#include <optional>
#include <string>

namespace plumbline {

/// The report of --live_dir, which shows the map while the run goes on; does
/// nothing without that flag. A run that cannot write it goes on without.
class LiveMap {
 public:
  /// `clock` has to outlive this. Throws Error where --live_dir cannot be used.
  explicit LiveMap(const RunClock& clock);

  /// Throws Error where --live_dir cannot be used whatever is in the folder: as
  /// the constructor does, without writing anything.
  static void CheckFlags();

  bool is_on() const { return report_.has_value(); }

  /// Shows the map as it stands, if it is time to; `stage` says where the run
  /// is.
  void Show(const MapSoFar& map, const std::function<std::string()>& stage);

  /// Shows the end of the run: its report.html if it wrote one.
  void Finish(const SolveOutcome& outcome);

 private:
  Report MakeReport(const MapSoFar& map) const;
  void Try(const std::function<void()>& write);

  const RunClock& clock_;
  std::optional<LiveReport> report_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_SOLVE_LIVE_MAP_H_
