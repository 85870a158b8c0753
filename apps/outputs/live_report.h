#ifndef PLUMBLINE_OUTPUTS_LIVE_REPORT_H_
#define PLUMBLINE_OUTPUTS_LIVE_REPORT_H_

#include <plumbline/core/stopwatch.h>
#include <plumbline/outputs/report.h>

#include <filesystem>
#include <functional>
#include <string>

namespace plumbline {

/// report.html in a folder of its own, written again and again while a run is
/// under way: the page loads itself anew. Each page is put in place whole. Not
/// thread safe.
class LiveReport {
 public:
  /// Share of the time between two pages that making one may take.
  static constexpr double kShare = 0.05;

  /// Makes the folder. A page is due every `seconds`, and less often where
  /// making it would take more than kShare of the time. Throws Error when the
  /// folder cannot be made, or has a report.html that is no report.
  LiveReport(const std::filesystem::path& folder, double seconds);

  /// Whether it is time for the next page. Costs a look at the clock.
  bool IsDue() const { return watch_.Seconds() >= due_; }

  /// Writes a page if it is time to; only then is `make` called. `stage`: what
  /// the run is at, for people. Throws Error when the page cannot be written.
  void Offer(const std::string& stage, const std::function<Report()>& make);

  /// Writes the last page, which no longer loads itself anew: a copy of
  /// `report`, or, where there is no such file, what `make` makes. Throws Error
  /// when it cannot be written.
  void Finish(const std::filesystem::path& report,
              const std::function<Report()>& make);

 private:
  std::filesystem::path path_;
  double seconds_;
  Stopwatch watch_;
  // s on the watch, from which on the next one is due.
  double due_ = 0.0;
};

}  // namespace plumbline

#endif  // PLUMBLINE_OUTPUTS_LIVE_REPORT_H_
