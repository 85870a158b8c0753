#ifndef PLUMBLINE_APPS_FIGURES_HEAT_MAP_H_
#define PLUMBLINE_APPS_FIGURES_HEAT_MAP_H_

#include <string>
#include <vector>

namespace plumbline {

/// A table of numbers, drawn in colours.
struct HeatMap {
  std::string title;
  std::string x_label;
  std::string y_label;
  /// Names of the columns, from left to right, and of the rows, from the top.
  std::vector<std::string> columns;
  std::vector<std::string> rows;
  /// By row, then column. What is not finite is drawn as an empty cell.
  std::vector<std::vector<double>> values;
  /// A cell to frame; -1: none.
  int framed_column = -1;
  int framed_row = -1;
};

/// Whether the colours of these values are spaced by their logarithms: all
/// positive, the largest more than 50 times the least.
bool IsLogarithmic(const std::vector<std::vector<double>>& values);

/// "#rrggbb" from dark blue over green to yellow (viridis; Smith and van der
/// Walt 2015) for a share of 0 to 1.
std::string HeatColor(double share);

/// The maps below each other as one SVG document, with the number in each cell
/// and a scale beside them. The same maps give the same bytes. Throws Error
/// when the sizes disagree.
std::string HeatMapSvg(const std::vector<HeatMap>& maps);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_FIGURES_HEAT_MAP_H_
