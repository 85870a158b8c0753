#include <plumbline/apps/cli/app.h>
#include <plumbline/apps/figures/heat_map.h>
#include <plumbline/apps/figures/line_plot.h>
#include <plumbline/apps/sweep/sweep_overview.h>
#include <plumbline/core/error.h>
#include <plumbline/core/number_text.h>
#include <plumbline/core/version.h>
#include <plumbline/core/xml_text.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <map>
#include <set>
#include <sstream>

namespace plumbline {
namespace {

constexpr int kPlotWidth = 460;  // px
// Without what stands under the x axis.
constexpr int kPlotHeight = 204;
constexpr int kPlotColumns = 2;

// Means and their intervals are asked for again and again.
class Overview {
 public:
  Overview(const SweepResult& result, const OverviewOptions& options)
      : result(result), options(options), settings(Settings(result)) {
    const std::vector<std::string> names = FigureNames(result);
    for (const std::string& figure : options.figures) {
      if (!names.empty() && !IsFigure(result, figure)) {
        throw Error("--figures", 0, "no run has a figure '" + figure + "'",
                    "columns of sweep.csv");
      }
    }
    if (!options.objective.empty()) {
      best = FindBest(result, options.objective, options.minimize);
    }
    if (best && !result.definition.one_at_a_time) reference = best->setting;
    for (std::size_t i = 0; i < settings.size(); ++i) {
      by_values_[settings[i].values] = i;
    }
  }

  std::size_t num_axes() const { return result.definition.axes.size(); }
  bool is_table() const {
    return num_axes() == 2 && !result.definition.one_at_a_time;
  }

  const Estimate& Mean(std::size_t setting, const std::string& figure) const {
    const auto key = std::make_pair(setting, figure);
    const auto known = means_.find(key);
    if (known != means_.end()) return known->second;
    return means_[key] =
               MeanOfNumbers(FigureValues(result, settings[setting], figure));
  }

  // The reference setting with other values of one or two axes.
  std::size_t Setting(std::size_t axis, std::size_t value,
                      std::size_t other_axis, std::size_t other_value) const {
    const std::vector<SweepAxis>& axes = result.definition.axes;
    std::vector<std::string> values = settings[reference].values;
    values[other_axis] = axes[other_axis].values[other_value];
    values[axis] = axes[axis].values[value];
    return by_values_.at(values);
  }

  const SweepResult& result;
  const OverviewOptions& options;
  std::vector<SweepSetting> settings;
  std::optional<BestSetting> best;
  // The setting that the others are compared with.
  std::size_t reference = 0;

 private:
  std::map<std::vector<std::string>, std::size_t> by_values_;
  mutable std::map<std::pair<std::size_t, std::string>, Estimate> means_;
};

// Where the values of an axis lie on the paper.
struct Positions {
  std::vector<double> x;
  // Words in the place of numbers; empty: numbers.
  std::vector<std::pair<double, std::string>> ticks;
};

Positions Place(const SweepAxis& axis) {
  Positions positions;
  double low = 0.0;
  double high = 0.0;
  for (const std::string& value : axis.values) {
    double number = 0.0;
    if (!ParseNumber(value, &number) || !std::isfinite(number)) {
      // Words: one beside the other.
      positions.x.clear();
      for (std::size_t i = 0; i < axis.values.size(); ++i) {
        positions.x.push_back(static_cast<double>(i));
        positions.ticks.emplace_back(positions.x.back(), axis.values[i]);
      }
      return positions;
    }
    low = positions.x.empty() ? number : std::min(low, number);
    high = positions.x.empty() ? number : std::max(high, number);
    positions.x.push_back(number);
  }
  if (low > 0.0 && high > 20.0 * low) {
    for (std::size_t i = 0; i < axis.values.size(); ++i) {
      positions.x[i] = std::log10(positions.x[i]);
      positions.ticks.emplace_back(positions.x[i], axis.values[i]);
    }
  }
  return positions;
}

LinePlot MakeLinePlot(const Overview& overview, std::size_t axis,
                      const std::string& figure) {
  const SweepAxis& values = overview.result.definition.axes[axis];
  const Positions positions = Place(values);
  // Lines go from left to right.
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < values.values.size(); ++i) order.push_back(i);
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return positions.x[a] < positions.x[b];
  });
  LinePlot plot;
  plot.title = figure;
  plot.x_label = values.flag;
  plot.x_ticks = positions.ticks;
  plot.width = kPlotWidth;
  PlotSeries series;
  const bool has_band = overview.result.definition.trials > 1;
  series.markers = true;
  for (const std::size_t i : order) {
    const std::size_t setting = overview.Setting(axis, i, axis, i);
    const Estimate& mean = overview.Mean(setting, figure);
    series.x.push_back(positions.x[i]);
    series.y.push_back(mean.value);
    if (!has_band) continue;
    series.low.push_back(mean.low);
    series.high.push_back(mean.high);
  }
  plot.series.push_back(std::move(series));
  // All axes of a page are of one height, whatever stands under them.
  plot.height = kPlotHeight + RoomUnderAxis(plot);
  return plot;
}

HeatMap MakeHeatMap(const Overview& overview, std::size_t row_axis,
                    std::size_t column_axis, const std::string& figure) {
  const std::vector<SweepAxis>& axes = overview.result.definition.axes;
  HeatMap map;
  map.title = figure;
  map.x_label = axes[column_axis].flag;
  map.y_label = axes[row_axis].flag;
  map.columns = axes[column_axis].values;
  map.rows = axes[row_axis].values;
  for (std::size_t row = 0; row < map.rows.size(); ++row) {
    map.values.emplace_back();
    for (std::size_t column = 0; column < map.columns.size(); ++column) {
      const std::size_t setting =
          overview.Setting(row_axis, row, column_axis, column);
      map.values.back().push_back(overview.Mean(setting, figure).value);
      if (overview.best && overview.best->setting == setting &&
          figure == overview.options.objective) {
        map.framed_row = static_cast<int>(row);
        map.framed_column = static_cast<int>(column);
      }
    }
  }
  return map;
}

// Heat maps beside each other, as many as the window has room for.
std::string Tiles(const std::vector<HeatMap>& maps) {
  std::string pictures = "<div class=\"plots\">\n";
  for (const HeatMap& map : maps) pictures += HeatMapSvg({map});
  return pictures + "</div>\n";
}

// The plots, all in one picture or, for a page, each in its own.
std::string Plots(const Overview& overview, bool one_picture) {
  if (overview.is_table()) {
    std::vector<HeatMap> maps;
    for (const std::string& figure : overview.options.figures) {
      maps.push_back(MakeHeatMap(overview, 0, 1, figure));
    }
    return one_picture ? HeatMapSvg(maps) : Tiles(maps);
  }
  std::vector<LinePlot> plots;
  for (const std::string& figure : overview.options.figures) {
    for (std::size_t axis = 0; axis < overview.num_axes(); ++axis) {
      if (overview.result.definition.axes[axis].values.size() < 2) continue;
      plots.push_back(MakeLinePlot(overview, axis, figure));
    }
  }
  if (one_picture) return PlotSvg(plots, kPlotColumns);
  std::string pictures = "<div class=\"plots lines\">\n";
  for (const LinePlot& plot : plots) pictures += PlotSvg({plot});
  return pictures + "</div>\n";
}

std::string NumberText(double value) {
  if (!std::isfinite(value)) return "-";
  char text[32];
  std::snprintf(text, sizeof(text), "%.5g", value);
  return text;
}

std::string EstimateText(const Estimate& estimate, int trials) {
  std::string text = NumberText(estimate.value);
  if (trials > 1 && std::isfinite(estimate.value)) {
    text += " [" + NumberText(estimate.low) + ", " + NumberText(estimate.high) +
            "]";
  }
  return text;
}

void WriteSettings(const Overview& overview, std::ostringstream* output) {
  const SweepDefinition& definition = overview.result.definition;
  *output << "<div class=\"wide\"><table>\n<tr>";
  for (const SweepAxis& axis : definition.axes) {
    *output << "<th>" << EscapeXml(axis.flag) << "</th>";
  }
  *output << "<th>done</th>";
  for (const std::string& figure : overview.options.figures) {
    *output << "<th>" << EscapeXml(figure) << "</th>";
  }
  *output << "<th>runs by seed</th></tr>\n";
  for (std::size_t i = 0; i < overview.settings.size(); ++i) {
    const SweepSetting& setting = overview.settings[i];
    const bool is_best = overview.best && overview.best->setting == i;
    *output << (is_best ? "<tr class=\"best\">" : "<tr>");
    for (const std::string& value : setting.values) {
      *output << "<td>" << EscapeXml(value) << "</td>";
    }
    *output << "<td>" << setting.done << " of " << setting.runs.size()
            << "</td>";
    for (const std::string& figure : overview.options.figures) {
      *output << "<td>"
              << EstimateText(overview.Mean(i, figure), definition.trials)
              << "</td>";
    }
    *output << "<td>";
    for (const std::size_t run : setting.runs) {
      *output << "<a href=\"runs/" << EscapeXml(overview.result.runs[run].name)
              << "/\">" << overview.result.runs[run].seed << "</a> ";
    }
    *output << "</td></tr>\n";
  }
  *output << "</table></div>\n";
}

constexpr char kPageHead[] = R"(<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width">
<title>Sweep</title>
<style>
body { font-family: sans-serif; margin: 1.5em; }
pre { background: #f4f4f4; padding: 0.7em; white-space: pre-wrap; overflow-wrap: anywhere; }
table { border-collapse: collapse; font-size: 90%; }
.wide { overflow-x: auto; }
.plots { display: flex; flex-wrap: wrap; gap: 0.5em; }
.plots.lines { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 460px), 1fr)); }
.plots.lines svg { width: 100%; max-width: 900px; }
@media (max-width: 600px) { body { margin: 0.7em; } }
th, td { border: 1px solid #cccccc; padding: 0.25em 0.6em; text-align: right; }
th { background: #f4f4f4; position: sticky; top: 0; }
td.words { text-align: left; }
tr.best td { background: #fff0dd; font-weight: bold; }
svg { max-width: 100%; height: auto; }
</style>
</head>
<body>
)";

// The words of a command as a line for a shell.
std::string CommandLine(const std::vector<std::string>& words) {
  std::string line;
  for (const std::string& word : words) {
    line += (line.empty() ? "" : " ") + QuoteForShell(word);
  }
  return line;
}

// What was run: commands, values of the flags, trials.
void WriteDefinition(const SweepDefinition& definition,
                     std::ostringstream* output) {
  *output << "<h1>Sweep</h1>\n<pre>"
          << EscapeXml(CommandLine(definition.command)) << "</pre>\n";
  if (!definition.evaluate.empty()) {
    *output << "<p>and after each run, in its folder {}:</p>\n<pre>"
            << EscapeXml(CommandLine(definition.evaluate)) << "</pre>\n";
  }
  *output << "<ul>\n";
  for (const SweepAxis& axis : definition.axes) {
    std::string values;
    for (const std::string& value : axis.values) {
      values += (values.empty() ? "" : ", ") + value;
    }
    *output << "<li>" << EscapeXml(axis.flag) << ": " << EscapeXml(values)
            << "</li>\n";
  }
  *output << "</ul>\n<p>"
          << (definition.one_at_a_time
                  ? "One flag at a time, the others at their first values. "
                  : "All combinations. ")
          << definition.trials << (definition.trials == 1 ? " run" : " runs")
          << " of each setting, seeds from " << definition.first_seed << ". "
          << (definition.trials > 1
                  ? "Means with 95 % confidence intervals (bootstrap)."
                  : "One run each: no confidence intervals.")
          << "</p>\n";
}

// The best setting, and those that are as good.
void WriteBest(const Overview& overview, std::ostringstream* output) {
  const SweepDefinition& definition = overview.result.definition;
  const OverviewOptions& options = overview.options;
  *output << "<h2>Best setting</h2>\n";
  if (!overview.best) {
    *output << "<p>No setting has all its runs done.</p>\n";
    return;
  }
  *output << "<p>" << (options.minimize ? "Least " : "Most ")
          << EscapeXml(options.objective) << ": "
          << EstimateText(overview.best->mean, definition.trials)
          << "</p>\n<pre>"
          << EscapeXml(SettingText(
                 definition, overview.settings[overview.best->setting].values))
          << "</pre>\n";
  if (overview.best->equals.empty()) return;
  *output << "<p>As good as far as one can tell:</p>\n<pre>";
  for (const std::size_t i : overview.best->equals) {
    *output << EscapeXml(SettingText(definition, overview.settings[i].values))
            << '\n';
  }
  *output << "</pre>\n";
}

// Plots of the figures over each flag, and heat maps over pairs of flags.
void WritePlots(const Overview& overview, std::ostringstream* output) {
  const SweepDefinition& definition = overview.result.definition;
  *output << "<h2>Plots</h2>\n";
  if (overview.num_axes() > 1 && !overview.is_table()) {
    *output << "<p>Where a plot varies one flag, the others are those of</p>\n"
               "<pre>"
            << EscapeXml(SettingText(
                   definition, overview.settings[overview.reference].values))
            << "</pre>\n";
  }
  *output << Plots(overview, false);
  if (overview.num_axes() <= 2 || definition.one_at_a_time) return;
  std::vector<HeatMap> maps;
  for (std::size_t row = 0; row < overview.num_axes(); ++row) {
    for (std::size_t column = row + 1; column < overview.num_axes(); ++column) {
      maps.push_back(
          MakeHeatMap(overview, row, column, overview.options.figures[0]));
    }
  }
  *output << Tiles(maps);
}

// Every run with every number that is not the same in all of them.
void WriteRuns(const SweepResult& result, std::ostringstream* output) {
  constexpr std::size_t kMostCells = 200000;
  std::vector<std::string> columns;
  std::vector<std::vector<std::string>> cells;
  std::size_t same = 0;
  for (const std::string& name : FigureNames(result)) {
    if (name == "seed" || name.compare(0, 6, "flags.") == 0) continue;
    std::vector<std::string> column;
    std::set<std::string> different;
    for (const std::optional<RunRecord>& record : result.records) {
      std::string text;
      if (record) {
        for (const auto& [figure, value] : record->figures) {
          if (figure == name && std::isfinite(value)) text = TableNumber(value);
        }
        if (record->status == RunStatus::kDone) different.insert(text);
      }
      column.push_back(std::move(text));
    }
    if (different.size() < 2 && result.runs.size() > 1) {
      ++same;
      continue;
    }
    columns.push_back(name);
    cells.push_back(std::move(column));
    if (columns.size() * result.runs.size() > kMostCells) {
      *output << "<p>The table of all runs is too large for a page.</p>\n";
      return;
    }
  }
  *output << "<div class=\"wide\"><table>\n<tr>";
  for (const SweepAxis& axis : result.definition.axes) {
    *output << "<th>" << EscapeXml(axis.flag) << "</th>";
  }
  *output << "<th>seed</th><th>status</th>";
  for (const std::string& column : columns) {
    *output << "<th>" << EscapeXml(column) << "</th>";
  }
  *output << "</tr>\n";
  for (std::size_t i = 0; i < result.runs.size(); ++i) {
    const SweepRun& run = result.runs[i];
    *output << "<tr>";
    for (const std::string& value : run.values) {
      *output << "<td>" << EscapeXml(value) << "</td>";
    }
    *output << "<td><a href=\"runs/" << EscapeXml(run.name) << "/\">"
            << run.seed << "</a></td><td>"
            << (result.records[i] ? RunStatusName(result.records[i]->status)
                                  : "not done yet")
            << "</td>";
    for (const std::vector<std::string>& column : cells) {
      *output << "<td>" << column[i] << "</td>";
    }
    *output << "</tr>\n";
  }
  *output << "</table></div>\n";
  if (same > 0) {
    *output << "<p>" << same
            << " further numbers are the same in all runs.</p>\n";
  }
}

// Runs that have no figures, and why.
void WriteFailures(const SweepResult& result, std::ostringstream* output) {
  std::ostringstream rows;
  for (std::size_t i = 0; i < result.runs.size(); ++i) {
    const std::optional<RunRecord>& record = result.records[i];
    if (record && record->status == RunStatus::kDone) continue;
    const std::string name = EscapeXml(result.runs[i].name);
    rows << "<tr><td class=\"words\">" << name << "</td><td class=\"words\">"
         << (record ? EscapeXml(record->reason) : "not done yet")
         << "</td><td>";
    if (record) rows << "<a href=\"runs/" << name << "/log.txt\">log</a>";
    rows << "</td></tr>\n";
  }
  if (rows.str().empty()) return;
  *output << "<h2>Runs without a result</h2>\n<table>\n"
          << rows.str() << "</table>\n";
}

}  // namespace

std::vector<std::string> ChooseFigures(const SweepResult& result,
                                       const std::string& objective,
                                       std::size_t count) {
  std::map<std::string, std::set<double>> values;
  for (const std::optional<RunRecord>& record : result.records) {
    if (!record) continue;
    for (const auto& [name, value] : record->figures) {
      values[name].insert(value);
    }
  }
  std::vector<std::string> chosen;
  const auto add = [&](const std::string& name) {
    if (chosen.size() < count &&
        std::find(chosen.begin(), chosen.end(), name) == chosen.end()) {
      chosen.push_back(name);
    }
  };
  if (values.count(objective) > 0) add(objective);
  for (const bool is_evaluation : {true, false}) {
    for (const std::string& name : FigureNames(result)) {
      const bool is_mean = name.compare(0, 11, "evaluation.") == 0 &&
                           name.find(".mean") != std::string::npos;
      if (is_mean != is_evaluation && is_evaluation) continue;
      if (name == "seed" || name.compare(0, 6, "flags.") == 0 ||
          IsMeasuredResource(name) || values[name].size() < 2) {
        continue;
      }
      add(name);
    }
  }
  return chosen;
}

std::string OverviewSvg(const SweepResult& result,
                        const OverviewOptions& options) {
  return Plots(Overview(result, options), true);
}

std::string OverviewHtml(const SweepResult& result,
                         const OverviewOptions& options) {
  const Overview overview(result, options);
  std::ostringstream page;
  page << kPageHead;
  WriteDefinition(result.definition, &page);
  if (!options.objective.empty()) WriteBest(overview, &page);
  if (!options.figures.empty() && overview.num_axes() > 0) {
    WritePlots(overview, &page);
  }
  page << "<h2>Settings</h2>\n";
  WriteSettings(overview, &page);
  WriteFailures(result, &page);
  page << "<h2>All runs</h2>\n";
  WriteRuns(result, &page);
  page << "<p>plumbline_sweep " << kVersion
       << "; every number of every run is in <a "
          "href=\"sweep.csv\">sweep.csv</a>.</p>\n</body>\n</html>\n";
  return page.str();
}

}  // namespace plumbline
