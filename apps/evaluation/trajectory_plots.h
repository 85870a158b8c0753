#ifndef PLUMBLINE_APPS_EVALUATION_TRAJECTORY_PLOTS_H_
#define PLUMBLINE_APPS_EVALUATION_TRAJECTORY_PLOTS_H_

#include <plumbline/apps/evaluation/trajectory_errors.h>
#include <plumbline/apps/figures/line_plot.h>

#include <ostream>
#include <vector>

namespace plumbline {

/// What is drawn of a comparison of two trajectories.
struct TrajectoryComparison {
  PosePairs pairs;
  AbsoluteErrors absolute;
  RelativeErrors relative;
  RelativeErrorOptions steps;
  /// Of the reference: otherwise its poses have numbers only.
  bool has_times = true;
};

/// Both paths, over the two axes along which the reference reaches farthest;
/// absolute and relative errors over time, from the first pair on.
std::vector<LinePlot> PlotComparison(const TrajectoryComparison& comparison);

/// Writes a line per pair: time,ape_m,ape_deg,rpe_m,rpe_deg. Relative errors
/// stand where their step ends; empty where none does. The text stays the same
/// number when read again.
void WritePoseErrors(const TrajectoryComparison& comparison,
                     std::ostream& output);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_EVALUATION_TRAJECTORY_PLOTS_H_
