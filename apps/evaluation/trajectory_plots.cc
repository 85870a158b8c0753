#include <plumbline/apps/evaluation/trajectory_plots.h>
#include <plumbline/core/number_text.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <string>
#include <utility>

namespace plumbline {
namespace {

constexpr int kPathHeight = 720;  // px
constexpr int kErrorHeight = 280;

// The two axes of the widest picture, in their order.
std::pair<int, int> WidestAxes(const std::vector<Pose3>& poses) {
  Eigen::Vector3d low = poses.front().translation;
  Eigen::Vector3d high = low;
  for (const Pose3& pose : poses) {
    low = low.cwiseMin(pose.translation);
    high = high.cwiseMax(pose.translation);
  }
  int narrowest = 2;
  for (const int axis : {1, 0}) {
    if (high[axis] - low[axis] < high[narrowest] - low[narrowest]) {
      narrowest = axis;
    }
  }
  return {narrowest == 0 ? 1 : 0, narrowest == 2 ? 1 : 2};
}

PlotSeries Path(const char* name, const std::vector<Pose3>& poses,
                const std::pair<int, int>& axes) {
  PlotSeries series;
  series.name = name;
  for (const Pose3& pose : poses) {
    series.x.push_back(pose.translation[axes.first]);
    series.y.push_back(pose.translation[axes.second]);
  }
  return series;
}

LinePlot ErrorPlot(const std::string& title, const char* unit,
                   const TrajectoryComparison& comparison,
                   const std::vector<double>& times,
                   const std::vector<double>& errors) {
  LinePlot plot;
  plot.title = title;
  plot.x_label = comparison.has_times ? "time, s" : "pose";
  plot.y_label = unit;
  plot.height = kErrorHeight;
  PlotSeries line;
  line.name = "error";
  line.x = times;
  line.y = errors;
  plot.series.push_back(std::move(line));
  if (times.empty()) return plot;
  const ErrorSummary summary = SummarizeErrors(errors);
  for (const auto& [name, value] : {std::make_pair("rmse", summary.rmse),
                                    std::make_pair("median", summary.median)}) {
    PlotSeries level;
    level.name = name;
    level.x = {times.front(), times.back()};
    level.y = {value, value};
    level.dashed = true;
    plot.series.push_back(std::move(level));
  }
  return plot;
}

}  // namespace

std::vector<LinePlot> PlotComparison(const TrajectoryComparison& comparison) {
  const PosePairs& pairs = comparison.pairs;
  constexpr std::array<const char*, 3> kNames = {"x, m", "y, m", "z, m"};
  std::vector<LinePlot> plots;
  LinePlot paths;
  const std::pair<int, int> axes = WidestAxes(pairs.reference);
  paths.title = "paths";
  paths.x_label = kNames[static_cast<std::size_t>(axes.first)];
  paths.y_label = kNames[static_cast<std::size_t>(axes.second)];
  paths.equal_axes = true;
  paths.height = kPathHeight;
  paths.series.push_back(Path("reference", pairs.reference, axes));
  paths.series.back().dashed = true;
  paths.series.back().color = 6;
  paths.series.push_back(Path("trajectory", pairs.estimate, axes));
  plots.push_back(std::move(paths));

  std::vector<double> times;
  for (const double time : pairs.times) {
    times.push_back(time - pairs.times.front());
  }
  plots.push_back(ErrorPlot("absolute pose error, translation", "m", comparison,
                            times, comparison.absolute.translation));
  plots.push_back(ErrorPlot("absolute pose error, rotation", "degrees",
                            comparison, times,
                            comparison.absolute.rotation_deg));
  if (comparison.relative.steps.empty()) return plots;
  std::vector<double> ends;
  for (const auto& step : comparison.relative.steps) {
    ends.push_back(times[step.second]);
  }
  std::string delta;
  AppendNumber(comparison.steps.delta, &delta);
  delta += comparison.steps.delta_is_m     ? " m"
           : comparison.steps.delta == 1.0 ? " pose"
                                           : " poses";
  plots.push_back(
      ErrorPlot("relative pose error over " + delta + ", translation", "m",
                comparison, ends, comparison.relative.translation));
  plots.push_back(ErrorPlot("relative pose error over " + delta + ", rotation",
                            "degrees", comparison, ends,
                            comparison.relative.rotation_deg));
  return plots;
}

void WritePoseErrors(const TrajectoryComparison& comparison,
                     std::ostream& output) {
  const RelativeErrors& relative = comparison.relative;
  // The step that ends at each pair, none: the number of steps.
  std::vector<std::size_t> ending(comparison.pairs.times.size(),
                                  relative.steps.size());
  for (std::size_t i = 0; i < relative.steps.size(); ++i) {
    ending[relative.steps[i].second] = i;
  }
  output << "time,ape_m,ape_deg,rpe_m,rpe_deg\n";
  std::string line;
  for (std::size_t i = 0; i < ending.size(); ++i) {
    line.clear();
    AppendNumber(comparison.pairs.times[i], &line);
    line += ',';
    AppendNumber(comparison.absolute.translation[i], &line);
    line += ',';
    AppendNumber(comparison.absolute.rotation_deg[i], &line);
    line += ',';
    if (ending[i] < relative.steps.size()) {
      AppendNumber(relative.translation[ending[i]], &line);
      line += ',';
      AppendNumber(relative.rotation_deg[ending[i]], &line);
    } else {
      line += ',';
    }
    output << line << '\n';
  }
}

}  // namespace plumbline
