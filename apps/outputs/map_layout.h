#ifndef PLUMBLINE_OUTPUTS_MAP_LAYOUT_H_
#define PLUMBLINE_OUTPUTS_MAP_LAYOUT_H_

#include <plumbline/outputs/map_drawing.h>
#include <plumbline/outputs/map_palette.h>

#include <Eigen/Core>
#include <array>
#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {

/// Largest length of the form 1, 2 or 5 times a power of ten that is at most
/// `longest` (> 0), m.
double ScaleBarLength(double longest);

namespace map_page {

/// A box around what is drawn, m, map frame; empty at first.
struct Bounds {
  double min_x = std::numeric_limits<double>::infinity();
  double min_y = std::numeric_limits<double>::infinity();
  double max_x = -std::numeric_limits<double>::infinity();
  double max_y = -std::numeric_limits<double>::infinity();

  /// Grows so that it has this point.
  void Add(double x, double y);
};

/// Whether there is a place for it on a page: one runaway number must not
/// shrink the rest of the map to nothing.
bool IsDrawable(double x, double y);
/// The same of a wall, a circle, an ellipse and a rectangle.
bool IsDrawable(const DrawnWall& wall);
bool IsDrawable(const DrawnCircle& circle);
bool IsDrawable(const DrawnEllipse& ellipse);
bool IsDrawable(const DrawnRectangle& rectangle);

/// Corners of a rectangle, m, map frame, counterclockwise from behind on the
/// right.
std::array<Eigen::Vector2d, 4> CornersOf(const DrawnRectangle& rectangle);

/// What an entry of the legend shows beside its text.
enum class Swatch {
  kWall,
  kClosure,
  kCircle,
  kCenter,
  kRectangle,
  kPath,
  kPoint
};

/// A line of the legend.
struct LegendEntry {
  Swatch swatch;
  Color color;
  std::string text;
};

/// What the legend of a drawing says: what is in it, and nothing else.
std::vector<LegendEntry> MakeLegend(const MapDrawing& drawing);

/// A length as the scale bar has it: "5 m".
std::string ScaleBarText(double length);

/// Where everything goes on the page, px; origin at the top left.
struct Layout {
  double width = 0.0;
  double height = 0.0;
  /// px per metre; map (x, y) is drawn at (left + scale x', bottom - scale y')
  /// with x', y' relative to the bounds' lower left corner, which keeps
  /// accuracy far from the origin.
  double scale = 1.0;
  double left = 0.0;
  double bottom = 0.0;
  Bounds bounds;
  /// A thousandth of the longer side: the unit of widths and letters.
  double unit = 1.0;
  double title_baseline = 0.0;
  /// Of the scale bar: length in m, left end and baseline of its text.
  double bar_length = 0.0;
  double bar_x = 0.0;
  double bar_y = 0.0;
  std::vector<LegendEntry> legend;
  /// Left end and baseline of each entry's swatch.
  std::vector<std::pair<double, double>> legend_positions;

  /// Of a point of the map.
  double X(double x) const { return left + scale * (x - bounds.min_x); }
  double Y(double y) const { return bottom - scale * (y - bounds.min_y); }
};

/// How wide a text is in letters of a size, px.
using TextWidth = std::function<double(const std::string& text, double size)>;

/// The page of a drawing whose longer side is `long_side`, px, or a little more
/// where a legend takes much room below a wide map.
Layout MakeLayout(const MapDrawing& drawing, double long_side,
                  const TextWidth& text_width);

/// Sizes and widths, in Layout::unit.
constexpr double kMargin = 28.0;
constexpr double kTitleSize = 20.0;
constexpr double kTextSize = 14.0;
constexpr double kRowHeight = 22.0;
constexpr double kSwatchWidth = 26.0;
/// The page is at least so wide that a legend fits, and the map so high.
constexpr double kLeastWidth = 420.0;
constexpr double kLeastHeight = 120.0;

}  // namespace map_page
}  // namespace plumbline

#endif  // PLUMBLINE_OUTPUTS_MAP_LAYOUT_H_
