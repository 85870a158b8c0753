#ifndef PLUMBLINE_APPS_FIGURES_LINE_PLOT_H_
#define PLUMBLINE_APPS_FIGURES_LINE_PLOT_H_

#include <string>
#include <utility>
#include <vector>

namespace plumbline {

/// A line of a plot. Points that are not finite are passed over.
struct PlotSeries {
  std::string name;
  std::vector<double> x;
  std::vector<double> y;
  /// A band around the line, of the size of y, or both empty.
  std::vector<double> low;
  std::vector<double> high;
  bool dashed = false;
  /// Marks the points.
  bool markers = false;
  /// Index into the colours; -1: the next one.
  int color = -1;
};

/// Lines over a pair of axes. The y axis starts at 0 unless a value is negative
/// or the axis is logarithmic.
struct LinePlot {
  std::string title;
  std::string x_label;
  std::string y_label;
  /// Logarithmic axes: numbers that are not positive are passed over.
  bool log_x = false;
  bool log_y = false;
  /// A unit is as long on both axes, as in a map; y need not start at 0.
  bool equal_axes = false;
  std::vector<PlotSeries> series;
  /// Words under the x axis in the place of numbers, where they belong; written
  /// upwards when they have no room beside each other. Empty: numbers.
  std::vector<std::pair<double, std::string>> x_ticks;
  /// px, with the legend to the right of the axes.
  int width = 900;
  int height = 460;
};

/// Numbers from `low` to `high` in steps of 1, 2 or 5 times a power of ten, at
/// most `count` of them (at least 2).
std::vector<double> RoundTicks(double low, double high, int count);

/// 1, 2 and 5 times powers of ten from `low` to `high` (both > 0); powers of
/// ten alone when those are more than `count`.
std::vector<double> LogTicks(double low, double high, int count);

/// What a plot needs of its height under the x axis, px.
int RoomUnderAxis(const LinePlot& plot);

/// The plots as one SVG document, in rows of `columns`, below each other. The
/// same plots give the same bytes. Throws Error when a series has sizes that
/// disagree.
std::string PlotSvg(const std::vector<LinePlot>& plots, int columns = 1);

/// Writes the same picture as PNG, two pixels to a px, whole or not at all.
/// Throws Error, too, when the file cannot be written.
void WritePlotPng(const std::vector<LinePlot>& plots, const std::string& path,
                  int columns = 1);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_FIGURES_LINE_PLOT_H_
