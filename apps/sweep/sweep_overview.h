#ifndef PLUMBLINE_APPS_SWEEP_SWEEP_OVERVIEW_H_
#define PLUMBLINE_APPS_SWEEP_SWEEP_OVERVIEW_H_

#include <plumbline/apps/sweep/sweep_table.h>

#include <optional>
#include <string>
#include <vector>

namespace plumbline {

/// What an overview of a sweep shows.
struct OverviewOptions {
  /// Figures to draw, by name.
  std::vector<std::string> figures;
  /// By which the best setting is chosen; empty: by none.
  std::string objective;
  bool minimize = true;
};

/// Figures worth a plot when nobody says which: the objective (if any), the
/// means of the evaluation, then the others in their order; only such as differ
/// between runs, no measured times, at most `count`.
std::vector<std::string> ChooseFigures(const SweepResult& result,
                                       const std::string& objective,
                                       std::size_t count);

/// The plots as one SVG document. All combinations of two flags: a heat map of
/// the mean of each figure. Otherwise for each flag the mean of each figure
/// over its values, with a band of its 95 % confidence interval where there are
/// several trials; the other flags have the values of the best setting, or
/// their first ones where there is no objective or one flag was varied at a
/// time. A flag with numbers has an axis to scale, logarithmic where they span
/// a factor of more than 20. Throws Error for figures that no run has.
std::string OverviewSvg(const SweepResult& result,
                        const OverviewOptions& options);

/// A page that needs no other file: what was run, the best setting, the plots,
/// heat maps of all pairs of flags for the first figure, a table of all
/// settings, and the runs that failed.
std::string OverviewHtml(const SweepResult& result,
                         const OverviewOptions& options);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_SWEEP_SWEEP_OVERVIEW_H_
