#include <cairo-svg.h>
#include <cairo.h>
#include <plumbline/core/atomic_file.h>
#include <plumbline/core/error.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/wall_pair.h>
#include <plumbline/core/xml_text.h>
#include <plumbline/detectors/merged_walls.h>
#include <plumbline/outputs/map_drawing.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <map>
#include <memory>
#include <numeric>
#include <optional>
#include <utility>

namespace plumbline {
namespace {

struct Color {
  double r, g, b;
};

constexpr Color Rgb(int hex) {
  return {((hex >> 16) & 255) / 255.0, ((hex >> 8) & 255) / 255.0,
          (hex & 255) / 255.0};
}

// Okabe and Ito's palette (jfly.uni-koeln.de/color) without its light colours,
// then two of Paul Tol's muted scheme: told apart with any kind of colour
// vision, and dark enough for thin lines on white.
constexpr Color kClusterColors[] = {Rgb(0x0072B2), Rgb(0xD55E00), Rgb(0x009E73),
                                    Rgb(0xCC79A7), Rgb(0x332288), Rgb(0x56B4E9),
                                    Rgb(0x882255), Rgb(0x999933)};
constexpr int kNumClusterColors =
    sizeof(kClusterColors) / sizeof(kClusterColors[0]);
// All clusters past the palette share one colour; they hold little wall.
constexpr Color kMoreClustersColor = Rgb(0x8C6D5A);
constexpr Color kNoClusterColor = Rgb(0x4D4D4D);
constexpr Color kCircleColor = Rgb(0xE69F00);
constexpr Color kRectangleColor = Rgb(0xFBF4DC);
constexpr Color kRectangleEdgeColor = Rgb(0xDCCB98);
constexpr Color kEllipseColor = Rgb(0xCC3311);
constexpr Color kPathColor = Rgb(0xA9BDCE);
constexpr Color kPointColor = Rgb(0xC4C4C4);
constexpr Color kInkColor = Rgb(0x222222);

struct CairoDeleter {
  void operator()(cairo_t* cr) const { cairo_destroy(cr); }
  void operator()(cairo_surface_t* s) const { cairo_surface_destroy(s); }
};
using Cairo = std::unique_ptr<cairo_t, CairoDeleter>;
using Surface = std::unique_ptr<cairo_surface_t, CairoDeleter>;

cairo_status_t AppendBytes(void* closure, const unsigned char* data,
                           unsigned int length) {
  static_cast<std::string*>(closure)->append(
      reinterpret_cast<const char*>(data), length);
  return CAIRO_STATUS_SUCCESS;
}

void CheckStatus(cairo_status_t status) {
  if (status != CAIRO_STATUS_SUCCESS) {
    throw PLUMBLINE_ERROR(
        std::string("cairo: ") + cairo_status_to_string(status),
        "a picture that cairo can draw");
  }
}

void CheckOptions(const MapDrawingOptions& options) {
  if (options.long_side < 200 || options.long_side > 20000) {
    throw PLUMBLINE_ERROR(
        "long side of " + std::to_string(options.long_side) + " px",
        "200 to 20000");
  }
}

struct Bounds {
  double min_x = std::numeric_limits<double>::infinity();
  double min_y = std::numeric_limits<double>::infinity();
  double max_x = -std::numeric_limits<double>::infinity();
  double max_y = -std::numeric_limits<double>::infinity();

  void Add(double x, double y) {
    min_x = std::min(min_x, x);
    min_y = std::min(min_y, y);
    max_x = std::max(max_x, x);
    max_y = std::max(max_y, y);
  }
};

/// Whether there is a place for it on a page: one runaway number must not
/// shrink the rest of the map to nothing.
bool IsDrawable(double x, double y) {
  constexpr double kFarthest = 1e7;  // m; a quarter round the earth
  return std::abs(x) <= kFarthest && std::abs(y) <= kFarthest;
}

bool IsDrawable(const DrawnWall& wall) {
  return IsDrawable(wall.x1, wall.y1) && IsDrawable(wall.x2, wall.y2);
}

bool IsDrawable(const DrawnCircle& circle) {
  return IsDrawable(circle.x, circle.y) && IsDrawable(circle.radius, 0.0) &&
         circle.radius > 0.0;
}

// Counterclockwise from behind on the right.
std::array<Eigen::Vector2d, 4> CornersOf(const DrawnRectangle& rectangle) {
  const Eigen::Vector2d center(rectangle.x, rectangle.y);
  const Eigen::Vector2d along =
      rectangle.half_length * Eigen::Vector2d(std::cos(rectangle.direction),
                                              std::sin(rectangle.direction));
  const Eigen::Vector2d across =
      rectangle.half_width * Eigen::Vector2d(-std::sin(rectangle.direction),
                                             std::cos(rectangle.direction));
  return {center - along - across, center + along - across,
          center + along + across, center - along + across};
}

bool IsDrawable(const DrawnEllipse& ellipse) {
  return IsDrawable(ellipse.x, ellipse.y) &&
         IsDrawable(ellipse.major, ellipse.minor) &&
         std::isfinite(ellipse.direction);
}

bool IsDrawable(const DrawnRectangle& rectangle) {
  for (const Eigen::Vector2d& corner : CornersOf(rectangle)) {
    if (!IsDrawable(corner.x(), corner.y())) return false;
  }
  return true;
}

Bounds BoundsOf(const MapDrawing& drawing) {
  Bounds bounds;
  for (const DrawnWall& wall : drawing.walls) {
    if (!IsDrawable(wall)) continue;
    bounds.Add(wall.x1, wall.y1);
    bounds.Add(wall.x2, wall.y2);
  }
  for (const DrawnCircle& circle : drawing.circles) {
    if (!IsDrawable(circle)) continue;
    bounds.Add(circle.x - circle.radius, circle.y - circle.radius);
    bounds.Add(circle.x + circle.radius, circle.y + circle.radius);
  }
  for (const DrawnEllipse& ellipse : drawing.ellipses) {
    if (!IsDrawable(ellipse)) continue;
    const double c = std::cos(ellipse.direction);
    const double d = std::sin(ellipse.direction);
    const double x = std::hypot(ellipse.major * c, ellipse.minor * d);
    const double y = std::hypot(ellipse.major * d, ellipse.minor * c);
    bounds.Add(ellipse.x - x, ellipse.y - y);
    bounds.Add(ellipse.x + x, ellipse.y + y);
  }
  for (const DrawnRectangle& rectangle : drawing.rectangles) {
    if (!IsDrawable(rectangle)) continue;
    for (const Eigen::Vector2d& corner : CornersOf(rectangle)) {
      bounds.Add(corner.x(), corner.y());
    }
  }
  for (const Pose2& pose : drawing.path) {
    if (IsDrawable(pose[0], pose[1])) bounds.Add(pose[0], pose[1]);
  }
  for (const auto* points : {&drawing.points, &drawing.centers}) {
    for (const Eigen::Vector2d& point : *points) {
      if (IsDrawable(point[0], point[1])) bounds.Add(point[0], point[1]);
    }
  }
  if (!(bounds.min_x <= bounds.max_x)) {
    bounds.Add(-5.0, -5.0);
    bounds.Add(5.0, 5.0);
  }
  // A single point or an axis-parallel wall has to have room as well.
  const double least = 1.0;
  if (bounds.max_x - bounds.min_x < least) {
    const double middle = 0.5 * (bounds.min_x + bounds.max_x);
    bounds.Add(middle - 0.5 * least, bounds.min_y);
    bounds.Add(middle + 0.5 * least, bounds.min_y);
  }
  if (bounds.max_y - bounds.min_y < least) {
    const double middle = 0.5 * (bounds.min_y + bounds.max_y);
    bounds.Add(bounds.min_x, middle - 0.5 * least);
    bounds.Add(bounds.min_x, middle + 0.5 * least);
  }
  return bounds;
}

enum class Swatch {
  kWall,
  kClosure,
  kCircle,
  kCenter,
  kRectangle,
  kPath,
  kPoint
};

struct LegendEntry {
  Swatch swatch;
  Color color;
  std::string text;
};

Color ClusterColor(int cluster) {
  if (cluster < 0) return kNoClusterColor;
  if (cluster >= kNumClusterColors) return kMoreClustersColor;
  return kClusterColors[cluster];
}

std::string DirectionText(double direction) {
  // Rounded first, so that 179.97 degrees reads as 0.0 and not as 180.0.
  const double degrees =
      std::round(RadToDeg(NormalizeAxial(direction)) * 10.0) / 10.0;
  char text[32];
  std::snprintf(text, sizeof(text), "%.1f\xC2\xB0",
                std::fmod(degrees + 180.0, 180.0));
  return text;
}

std::vector<LegendEntry> Legend(const MapDrawing& drawing) {
  bool has_none = false;
  int num_clusters = 0;
  for (const DrawnWall& wall : drawing.walls) {
    has_none |= wall.cluster < 0;
    num_clusters = std::max(num_clusters, wall.cluster + 1);
  }
  std::vector<LegendEntry> legend;
  const int shown = std::min(num_clusters, kNumClusterColors);
  for (int i = 0; i < shown; ++i) {
    const bool known =
        i < static_cast<int>(drawing.cluster_directions.size()) &&
        std::isfinite(drawing.cluster_directions[i]);
    legend.push_back({Swatch::kWall, ClusterColor(i),
                      known ? DirectionText(drawing.cluster_directions[i])
                            : "direction " + std::to_string(i + 1)});
  }
  if (num_clusters > shown) {
    legend.push_back(
        {Swatch::kWall, kMoreClustersColor,
         std::to_string(num_clusters - shown) + " more directions"});
  }
  if (has_none) {
    legend.push_back({Swatch::kWall, kNoClusterColor,
                      num_clusters > 0 ? "no common direction" : "walls"});
  }
  if (!drawing.closures.empty()) {
    legend.push_back({Swatch::kClosure, kInkColor, "seen again"});
  }
  if (!drawing.circles.empty()) {
    legend.push_back({Swatch::kCircle, kCircleColor, "circles"});
  }
  if (!drawing.ellipses.empty()) {
    legend.push_back({Swatch::kCircle, kEllipseColor, drawing.ellipses_title});
  }
  if (!drawing.centers.empty()) {
    legend.push_back({Swatch::kCenter, kCircleColor, "common centres"});
  }
  if (!drawing.rectangles.empty()) {
    legend.push_back({Swatch::kRectangle, kRectangleColor, "rectangles"});
  }
  if (!drawing.points.empty()) {
    legend.push_back({Swatch::kPoint, kPointColor, "points"});
  }
  if (drawing.path.size() > 1) {
    legend.push_back({Swatch::kPath, kPathColor, "path"});
  }
  return legend;
}

std::string ScaleBarText(double length) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.10g m", length);
  return text;
}

/// Where everything goes on the page, px; origin at the top left.
struct Layout {
  double width = 0.0;
  double height = 0.0;
  /// px per metre; map (x, y) is drawn at (left + scale x', top - scale y')
  /// with x', y' relative to the bounds' lower left corner, which keeps
  /// accuracy far from the origin.
  double scale = 1.0;
  double left = 0.0;
  double bottom = 0.0;
  Bounds bounds;
  /// A thousandth of the longer side: the unit of widths and letters.
  double unit = 1.0;
  double title_baseline = 0.0;
  double bar_length = 0.0;
  double bar_x = 0.0;
  double bar_y = 0.0;
  std::vector<LegendEntry> legend;
  /// Left end and baseline of each entry's swatch.
  std::vector<std::pair<double, double>> legend_positions;

  double X(double x) const { return left + scale * (x - bounds.min_x); }
  double Y(double y) const { return bottom - scale * (y - bounds.min_y); }
};

constexpr double kMargin = 28.0;             // units
constexpr double kTitleSize = 20.0;          // units, letters
constexpr double kTextSize = 14.0;           // units, letters
constexpr double kRowHeight = 22.0;          // units
constexpr double kSwatchWidth = 26.0;        // units
constexpr double kWallWidth = 2.0;           // units
constexpr double kPathWidth = 1.1;           // units
constexpr double kClosureWidth = 0.5;        // units
constexpr double kClosureLength = 7.0;       // units
constexpr double kRectangleEdgeWidth = 0.5;  // units
constexpr double kPointRadius = 1.6;         // units
constexpr double kCrossReach = 4.0;          // units, of a common centre
constexpr double kLeastWidth = 420.0;        // units, so that a legend fits
constexpr double kLeastHeight = 120.0;       // units, of the map itself

double TextWidth(cairo_t* cr, const std::string& text, double size) {
  cairo_text_extents_t extents;
  cairo_set_font_size(cr, size);
  cairo_text_extents(cr, text.c_str(), &extents);
  return extents.x_advance;
}

void SelectFont(cairo_t* cr) {
  cairo_select_font_face(cr, "sans-serif", CAIRO_FONT_SLANT_NORMAL,
                         CAIRO_FONT_WEIGHT_NORMAL);
  // Hinting depends on the user's desktop settings; the bytes must not.
  cairo_font_options_t* font_options = cairo_font_options_create();
  cairo_font_options_set_antialias(font_options, CAIRO_ANTIALIAS_GRAY);
  cairo_font_options_set_hint_style(font_options, CAIRO_HINT_STYLE_NONE);
  cairo_font_options_set_hint_metrics(font_options, CAIRO_HINT_METRICS_OFF);
  cairo_set_font_options(cr, font_options);
  cairo_font_options_destroy(font_options);
}

Layout MakeLayout(const MapDrawing& drawing, const MapDrawingOptions& options) {
  Layout layout;
  layout.bounds = BoundsOf(drawing);
  layout.legend = Legend(drawing);
  const double long_side = options.long_side;
  const double unit = long_side / 1000.0;
  layout.unit = unit;
  const double margin = kMargin * unit;
  const double header = drawing.title.empty() ? 0.0 : 1.6 * kTitleSize * unit;
  const double map_width = layout.bounds.max_x - layout.bounds.min_x;
  const double map_height = layout.bounds.max_y - layout.bounds.min_y;

  const Surface scratch(cairo_image_surface_create(CAIRO_FORMAT_ARGB32, 1, 1));
  const Cairo cr(cairo_create(scratch.get()));
  SelectFont(cr.get());
  std::vector<double> entry_widths;
  for (const LegendEntry& entry : layout.legend) {
    entry_widths.push_back((kSwatchWidth + 8.0 + 22.0) * unit +
                           TextWidth(cr.get(), entry.text, kTextSize * unit));
  }

  // The legend's rows depend on the width, the width on the scale, the scale
  // on the height of the legend: start with one row and add until it holds.
  for (int rows = 1;; ++rows) {
    const double footer = (0.8 + rows) * kRowHeight * unit;
    const double scale =
        std::min((long_side - 2.0 * margin) / map_width,
                 (long_side - 2.0 * margin - header - footer) / map_height);
    const double width =
        std::max(kLeastWidth * unit, scale * map_width + 2.0 * margin);
    const double inner_height =
        std::max(kLeastHeight * unit, scale * map_height);
    const double height = inner_height + 2.0 * margin + header + footer;
    const double bar_length = ScaleBarLength(0.2 * width / scale);
    const double bar_px = bar_length * scale;
    const double legend_left =
        margin + bar_px + 12.0 * unit +
        TextWidth(cr.get(), ScaleBarText(bar_length), kTextSize * unit) +
        36.0 * unit;
    const double footer_top = margin + header + inner_height;
    const double first_row = footer_top + 1.3 * kRowHeight * unit;
    double x = legend_left;
    int row = 0;
    layout.legend_positions.clear();
    for (const double entry_width : entry_widths) {
      // The gap behind an entry may stand in the margin.
      if (x > legend_left && x + entry_width - 22.0 * unit > width - margin) {
        x = legend_left;
        ++row;
      }
      layout.legend_positions.push_back(
          {x, first_row + row * kRowHeight * unit});
      x += entry_width;
    }
    if (row + 1 > rows) continue;
    layout.scale = scale;
    layout.width = std::ceil(width);
    layout.height = std::ceil(height);
    layout.left = 0.5 * (width - scale * map_width);
    layout.bottom = margin + header + 0.5 * (inner_height + scale * map_height);
    layout.title_baseline = margin + kTitleSize * unit * 0.8;
    layout.bar_length = bar_length;
    layout.bar_x = margin;
    layout.bar_y = first_row;
    return layout;
  }
}

void SetColor(cairo_t* cr, const Color& color) {
  cairo_set_source_rgb(cr, color.r, color.g, color.b);
}

// The current path as an area with a thin edge.
void FillRectangle(cairo_t* cr, double unit) {
  SetColor(cr, kRectangleColor);
  cairo_fill_preserve(cr);
  SetColor(cr, kRectangleEdgeColor);
  cairo_set_line_width(cr, kRectangleEdgeWidth * unit);
  cairo_stroke(cr);
}

void DrawRectangles(cairo_t* cr, const MapDrawing& drawing,
                    const Layout& layout) {
  std::vector<const DrawnRectangle*> rectangles;
  for (const DrawnRectangle& rectangle : drawing.rectangles) {
    if (IsDrawable(rectangle)) rectangles.push_back(&rectangle);
  }
  // What lies in another is seen.
  std::stable_sort(rectangles.begin(), rectangles.end(),
                   [](const DrawnRectangle* a, const DrawnRectangle* b) {
                     return std::abs(a->half_length * a->half_width) >
                            std::abs(b->half_length * b->half_width);
                   });
  for (const DrawnRectangle* rectangle : rectangles) {
    for (const Eigen::Vector2d& corner : CornersOf(*rectangle)) {
      cairo_line_to(cr, layout.X(corner.x()), layout.Y(corner.y()));
    }
    cairo_close_path(cr);
    FillRectangle(cr, layout.unit);
  }
}

void DrawPoints(cairo_t* cr, const MapDrawing& drawing, const Layout& layout) {
  if (drawing.points.empty()) return;
  SetColor(cr, kPointColor);
  // A few landmarks are seen as dots; a cloud of scan points is marked on a
  // fine grid, so that the drawing does not grow with the log.
  if (drawing.points.size() <= 5000) {
    for (const Eigen::Vector2d& point : drawing.points) {
      if (!IsDrawable(point[0], point[1])) continue;
      cairo_new_sub_path(cr);
      cairo_arc(cr, layout.X(point[0]), layout.Y(point[1]),
                kPointRadius * layout.unit, 0.0, 2.0 * kPi);
      cairo_close_path(cr);
    }
    cairo_fill(cr);
    return;
  }
  const double cell = 0.8 * layout.unit;
  const int columns = static_cast<int>(layout.width / cell) + 1;
  const int rows = static_cast<int>(layout.height / cell) + 1;
  std::vector<bool> marked(static_cast<std::size_t>(columns) * rows, false);
  for (const Eigen::Vector2d& point : drawing.points) {
    if (!IsDrawable(point[0], point[1])) continue;
    const int column = static_cast<int>(layout.X(point[0]) / cell);
    const int row = static_cast<int>(layout.Y(point[1]) / cell);
    if (column < 0 || column >= columns || row < 0 || row >= rows) continue;
    marked[static_cast<std::size_t>(row) * columns + column] = true;
  }
  // A stroke a row: short SVG text, and no attribute longer than XML parsers
  // take.
  cairo_save(cr);
  cairo_set_line_cap(cr, CAIRO_LINE_CAP_BUTT);
  cairo_set_line_width(cr, cell);
  for (int row = 0; row < rows; ++row) {
    const std::size_t base = static_cast<std::size_t>(row) * columns;
    const double y = (row + 0.5) * cell;
    for (int column = 0; column < columns; ++column) {
      if (!marked[base + column]) continue;
      const int begin = column;
      while (column < columns && marked[base + column]) ++column;
      cairo_move_to(cr, begin * cell, y);
      cairo_line_to(cr, column * cell, y);
    }
    cairo_stroke(cr);
  }
  cairo_restore(cr);
}

void DrawPath(cairo_t* cr, const MapDrawing& drawing, const Layout& layout) {
  SetColor(cr, kPathColor);
  cairo_set_line_width(cr, kPathWidth * layout.unit);
  // What the eye cannot tell apart is not drawn: a long log has 10^5 poses.
  const double least = 0.3 * layout.unit;
  bool started = false;
  double last_x = 0.0;
  double last_y = 0.0;
  for (std::size_t i = 0; i < drawing.path.size(); ++i) {
    const Pose2& pose = drawing.path[i];
    if (!IsDrawable(pose[0], pose[1])) continue;
    const double x = layout.X(pose[0]);
    const double y = layout.Y(pose[1]);
    if (!started) {
      cairo_move_to(cr, x, y);
    } else if (std::hypot(x - last_x, y - last_y) >= least ||
               i + 1 == drawing.path.size()) {
      cairo_line_to(cr, x, y);
    } else {
      continue;
    }
    started = true;
    last_x = x;
    last_y = y;
  }
  cairo_stroke(cr);
}

void DrawWalls(cairo_t* cr, const MapDrawing& drawing, const Layout& layout) {
  // One path a colour. The longest cluster is drawn first, so that the rare
  // ones are not hidden; walls without a cluster lie under all.
  std::map<int, std::vector<const DrawnWall*>> by_color;
  for (const DrawnWall& wall : drawing.walls) {
    if (!IsDrawable(wall)) continue;
    by_color[std::min(std::max(wall.cluster, -1), kNumClusterColors)].push_back(
        &wall);
  }
  cairo_set_line_width(cr, kWallWidth * layout.unit);
  for (const auto& entry : by_color) {
    SetColor(cr, ClusterColor(entry.first));
    for (const DrawnWall* wall : entry.second) {
      cairo_move_to(cr, layout.X(wall->x1), layout.Y(wall->y1));
      cairo_line_to(cr, layout.X(wall->x2), layout.Y(wall->y2));
    }
    cairo_stroke(cr);
  }
}

// A short line across each wall that was seen again.
void DrawClosures(cairo_t* cr, const MapDrawing& drawing,
                  const Layout& layout) {
  if (drawing.closures.empty()) return;
  SetColor(cr, kInkColor);
  cairo_set_line_width(cr, kClosureWidth * layout.unit);
  for (const Pose2& closure : drawing.closures) {
    if (!IsDrawable(closure[0], closure[1])) continue;
    const double x = layout.X(closure[0]);
    const double y = layout.Y(closure[1]);
    // Across on the page, where y points down.
    const double half = 0.5 * kClosureLength * layout.unit;
    const double dx = -std::sin(closure[2]) * half;
    const double dy = -std::cos(closure[2]) * half;
    cairo_move_to(cr, x - dx, y - dy);
    cairo_line_to(cr, x + dx, y + dy);
  }
  cairo_stroke(cr);
}

void DrawCircles(cairo_t* cr, const MapDrawing& drawing, const Layout& layout) {
  SetColor(cr, kCircleColor);
  cairo_set_line_width(cr, kWallWidth * layout.unit);
  for (const DrawnCircle& circle : drawing.circles) {
    if (!IsDrawable(circle)) continue;
    cairo_new_sub_path(cr);
    // A column of a large building is still a dot.
    cairo_arc(cr, layout.X(circle.x), layout.Y(circle.y),
              std::max(layout.scale * circle.radius, 1.2 * layout.unit), 0.0,
              2.0 * kPi);
    cairo_close_path(cr);
  }
  cairo_stroke(cr);
}

void DrawEllipses(cairo_t* cr, const MapDrawing& drawing,
                  const Layout& layout) {
  SetColor(cr, kEllipseColor);
  cairo_set_line_width(cr, kPathWidth * layout.unit);
  for (const DrawnEllipse& ellipse : drawing.ellipses) {
    if (!IsDrawable(ellipse)) continue;
    cairo_matrix_t before;
    cairo_get_matrix(cr, &before);
    cairo_translate(cr, layout.X(ellipse.x), layout.Y(ellipse.y));
    // y of the page points downwards.
    cairo_rotate(cr, -ellipse.direction);
    // What is known exactly is a dash, and a matrix must not be singular.
    const double least = 0.05 * layout.unit;
    cairo_scale(cr, std::max(layout.scale * ellipse.major, least),
                std::max(layout.scale * ellipse.minor, least));
    cairo_new_sub_path(cr);
    cairo_arc(cr, 0.0, 0.0, 1.0, 0.0, 2.0 * kPi);
    cairo_close_path(cr);
    // The line is as wide in every direction.
    cairo_set_matrix(cr, &before);
    cairo_stroke(cr);
  }
}

void AddCross(cairo_t* cr, double x, double y, double reach) {
  cairo_move_to(cr, x - reach, y);
  cairo_line_to(cr, x + reach, y);
  cairo_move_to(cr, x, y - reach);
  cairo_line_to(cr, x, y + reach);
}

void DrawCenters(cairo_t* cr, const MapDrawing& drawing, const Layout& layout) {
  SetColor(cr, kCircleColor);
  cairo_set_line_width(cr, 0.75 * kWallWidth * layout.unit);
  for (const Eigen::Vector2d& center : drawing.centers) {
    if (!IsDrawable(center[0], center[1])) continue;
    AddCross(cr, layout.X(center[0]), layout.Y(center[1]),
             kCrossReach * layout.unit);
  }
  cairo_stroke(cr);
}

void DrawText(cairo_t* cr, double x, double y, double size,
              const std::string& text) {
  SetColor(cr, kInkColor);
  cairo_set_font_size(cr, size);
  cairo_move_to(cr, x, y);
  cairo_show_text(cr, text.c_str());
}

void DrawFrame(cairo_t* cr, const MapDrawing& drawing, const Layout& layout) {
  const double unit = layout.unit;
  const double text_size = kTextSize * unit;
  // Letters' middle lies about a third of their size over the baseline.
  const double middle = 0.35 * text_size;
  if (!drawing.title.empty()) {
    DrawText(cr, kMargin * unit, layout.title_baseline, kTitleSize * unit,
             drawing.title);
  }
  const double bar_px = layout.bar_length * layout.scale;
  const double y = layout.bar_y - middle;
  cairo_set_line_cap(cr, CAIRO_LINE_CAP_BUTT);
  cairo_set_line_width(cr, 1.5 * unit);
  SetColor(cr, kInkColor);
  cairo_move_to(cr, layout.bar_x, y - 4.0 * unit);
  cairo_line_to(cr, layout.bar_x, y + 4.0 * unit);
  cairo_move_to(cr, layout.bar_x + bar_px, y - 4.0 * unit);
  cairo_line_to(cr, layout.bar_x + bar_px, y + 4.0 * unit);
  cairo_move_to(cr, layout.bar_x, y);
  cairo_line_to(cr, layout.bar_x + bar_px, y);
  cairo_stroke(cr);
  DrawText(cr, layout.bar_x + bar_px + 8.0 * unit, layout.bar_y, text_size,
           ScaleBarText(layout.bar_length));

  for (std::size_t i = 0; i < layout.legend.size(); ++i) {
    const LegendEntry& entry = layout.legend[i];
    const double x = layout.legend_positions[i].first;
    const double baseline = layout.legend_positions[i].second;
    const double end = x + kSwatchWidth * unit;
    SetColor(cr, entry.color);
    if (entry.swatch == Swatch::kCircle) {
      cairo_set_line_width(cr, kWallWidth * unit);
      cairo_new_sub_path(cr);
      cairo_arc(cr, end - 7.0 * unit, baseline - middle, 5.0 * unit, 0.0,
                2.0 * kPi);
    } else if (entry.swatch == Swatch::kClosure) {
      cairo_set_line_width(cr, kClosureWidth * unit);
      cairo_move_to(cr, end - 7.0 * unit,
                    baseline - middle - 0.5 * kClosureLength * unit);
      cairo_line_to(cr, end - 7.0 * unit,
                    baseline - middle + 0.5 * kClosureLength * unit);
    } else if (entry.swatch == Swatch::kCenter) {
      cairo_set_line_width(cr, 0.75 * kWallWidth * unit);
      AddCross(cr, end - 7.0 * unit, baseline - middle, kCrossReach * unit);
    } else if (entry.swatch == Swatch::kRectangle) {
      cairo_rectangle(cr, end - 14.0 * unit, baseline - middle - 5.0 * unit,
                      14.0 * unit, 10.0 * unit);
      FillRectangle(cr, unit);
    } else if (entry.swatch == Swatch::kPoint) {
      cairo_new_sub_path(cr);
      cairo_arc(cr, end - 7.0 * unit, baseline - middle, kPointRadius * unit,
                0.0, 2.0 * kPi);
      cairo_fill(cr);
    } else {
      // Thicker than in the map: colour is hard to tell on a thin line.
      cairo_set_line_width(cr,
                           (entry.swatch == Swatch::kWall ? 2.0 * kWallWidth
                                                          : 1.5 * kPathWidth) *
                               unit);
      cairo_move_to(cr, x, baseline - middle);
      cairo_line_to(cr, end, baseline - middle);
    }
    cairo_stroke(cr);
    DrawText(cr, end + 8.0 * unit, baseline, text_size, entry.text);
  }
}

void Draw(cairo_t* cr, const MapDrawing& drawing, const Layout& layout) {
  SetColor(cr, {1.0, 1.0, 1.0});
  cairo_paint(cr);
  SelectFont(cr);
  cairo_set_line_join(cr, CAIRO_LINE_JOIN_ROUND);
  cairo_set_line_cap(cr, CAIRO_LINE_CAP_ROUND);
  DrawRectangles(cr, drawing, layout);
  DrawPoints(cr, drawing, layout);
  DrawPath(cr, drawing, layout);
  DrawWalls(cr, drawing, layout);
  DrawClosures(cr, drawing, layout);
  DrawCircles(cr, drawing, layout);
  DrawCenters(cr, drawing, layout);
  DrawEllipses(cr, drawing, layout);
  DrawFrame(cr, drawing, layout);
  CheckStatus(cairo_status(cr));
}

/// Cairo's page in px put into an outer viewBox in metres: cairo itself rounds
/// coordinates to 1/256 of its unit, too coarse for metres.
std::string PutInMetres(const std::string& svg, const Layout& layout,
                        const std::string& title) {
  const std::size_t begin = svg.find("<svg");
  const std::size_t end =
      begin == std::string::npos ? begin : svg.find('>', begin);
  if (end == std::string::npos) {
    throw PLUMBLINE_ERROR("cairo wrote no <svg> element", "SVG text");
  }
  const double left = layout.bounds.min_x - layout.left / layout.scale;
  const double top = layout.bounds.min_y + layout.bottom / layout.scale;
  const double width = layout.width / layout.scale;
  const double height = layout.height / layout.scale;
  char numbers[512];
  std::string header =
      "<svg xmlns=\"http://www.w3.org/2000/svg\" "
      "xmlns:xlink=\"http://www.w3.org/1999/xlink\" ";
  std::snprintf(numbers, sizeof(numbers),
                "width=\"%.0f\" height=\"%.0f\" "
                "viewBox=\"%.6f %.6f %.6f %.6f\">\n",
                layout.width / 2.0, layout.height / 2.0, left, -top, width,
                height);
  header += numbers;
  if (!title.empty()) header += "<title>" + EscapeXml(title) + "</title>\n";
  std::snprintf(numbers, sizeof(numbers),
                "<svg x=\"%.6f\" y=\"%.6f\" width=\"%.6f\" height=\"%.6f\" "
                "viewBox=\"0 0 %.0f %.0f\">",
                left, -top, width, height, layout.width, layout.height);
  header += numbers;
  std::string body = svg.substr(end + 1);
  // Cairo counts the surfaces of the process in this id, to which nothing
  // refers; the bytes must not depend on what was drawn before.
  const std::string id = "id=\"surface";
  const std::size_t number = body.find(id);
  if (number != std::string::npos) {
    const std::size_t quote = body.find('"', number + id.size());
    body.replace(number, quote - number, "id=\"map");
  }
  return svg.substr(0, begin) + header + body + "</svg>\n";
}

void WriteBytes(const std::string& path, const std::string& bytes) {
  WriteFileAtomically(path, [&bytes](std::ostream& output) {
    output.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  });
}

}  // namespace

double ScaleBarLength(double longest) {
  const double power = std::pow(10.0, std::floor(std::log10(longest)));
  // One rounding step must not cost a whole step of the bar.
  const double slack = 1.0 + 1e-9;
  for (const double factor : {10.0, 5.0, 2.0}) {
    if (factor * power <= longest * slack) return factor * power;
  }
  return power;
}

bool WallEnds(const Feature& feature, DrawnWall* wall) {
  const std::optional<Wall> seen = WallOf(feature);
  if (!seen || !(seen->end > seen->begin)) return false;
  const Eigen::Vector2d begin = seen->At(seen->begin);
  const Eigen::Vector2d end = seen->At(seen->end);
  wall->x1 = begin.x();
  wall->y1 = begin.y();
  wall->x2 = end.x();
  wall->y2 = end.y();
  wall->id = feature.id;
  return true;
}

namespace {

bool IsLiveStructure(const Constraint& constraint) {
  return constraint.state == ConstraintState::kLive &&
         constraint.kind == ConstraintClass::kStructure;
}

// The orientation of a rectangle's sides in the direction phi, or kNoId.
FeatureId OrientationOfSide(const Graph& graph, FeatureId rectangle,
                            double phi) {
  for (const ConstraintId id : graph.ConstraintsOf(rectangle)) {
    const Constraint& constraint = graph.GetConstraint(id);
    if (IsLiveStructure(constraint) &&
        constraint.type->Is(RelationRole::kDirection) &&
        std::abs(NormalizeAxial(constraint.expected[0] - phi)) < 0.25 * kPi) {
      return constraint.features[1];
    }
  }
  return kNoId;
}

// The orientation feature that live structure ties a wall to, itself or as a
// side of a rectangle, or kNoId.
FeatureId OrientationOf(const Graph& graph, FeatureId wall) {
  FeatureId by_rectangle = kNoId;
  for (const ConstraintId id : graph.ConstraintsOf(wall)) {
    const Constraint& constraint = graph.GetConstraint(id);
    if (!IsLiveStructure(constraint)) continue;
    for (const FeatureId other : constraint.features) {
      const FeatureType& type = *graph.GetFeature(other).type;
      if (type.Is(FeatureRole::kDirection)) return other;
      if (type.Is(FeatureRole::kRectangle) && by_rectangle == kNoId) {
        by_rectangle = OrientationOfSide(graph, other, constraint.expected[1]);
      }
    }
  }
  return by_rectangle;
}

}  // namespace

MapDrawing DrawingFromGraph(const Graph& graph,
                            const std::vector<Pose2>& path) {
  MapDrawing drawing;
  drawing.path = path;
  // Orientation of each wall, and length of wall of each orientation.
  std::vector<FeatureId> orientations;
  std::map<FeatureId, double> lengths;
  for (const MergedWall& merged : MergeWalls(graph)) {
    DrawnWall wall;
    if (!WallEnds(merged.wall, &wall)) continue;
    wall.members = merged.members;
    FeatureId orientation = kNoId;
    for (const FeatureId member : merged.members) {
      if (orientation == kNoId) orientation = OrientationOf(graph, member);
    }
    if (orientation != kNoId) {
      lengths[orientation] += merged.wall.extent_end - merged.wall.extent_begin;
    }
    orientations.push_back(orientation);
    drawing.walls.push_back(std::move(wall));
  }
  for (const Constraint* constraint : graph.Constraints()) {
    if (constraint->state == ConstraintState::kLive &&
        constraint->type->Is(RelationRole::kSameWall)) {
      drawing.closures.push_back(MiddleOfCommonPart(
          *WallOf(graph.GetFeature(constraint->features[0])),
          *WallOf(graph.GetFeature(constraint->features[1]))));
    }
  }
  for (const Feature* feature : graph.Features()) {
    const FeatureType& type = *feature->type;
    if (type.Is(FeatureRole::kCircle)) {
      drawing.circles.push_back({feature->parameters[0], feature->parameters[1],
                                 feature->parameters[2], feature->id});
    } else if (type.Is(FeatureRole::kRectangle)) {
      const auto& p = feature->parameters;
      drawing.rectangles.push_back({p[0], p[1], p[2], p[3], p[4], feature->id});
    } else if (type.Is(FeatureRole::kPoint)) {
      (feature->is_virtual ? drawing.centers : drawing.points)
          .emplace_back(feature->parameters[0], feature->parameters[1]);
    } else if (type.Is(FeatureRole::kPose) && path.empty()) {
      drawing.path.emplace_back(feature->parameters[0], feature->parameters[1],
                                feature->parameters[2]);
    }
  }
  std::vector<std::pair<FeatureId, double>> order(lengths.begin(),
                                                  lengths.end());
  std::stable_sort(
      order.begin(), order.end(),
      [](const auto& a, const auto& b) { return a.second > b.second; });
  std::map<FeatureId, int> clusters;
  for (std::size_t i = 0; i < order.size(); ++i) {
    clusters[order[i].first] = static_cast<int>(i);
    drawing.cluster_features.push_back(order[i].first);
    drawing.cluster_directions.push_back(
        graph.GetFeature(order[i].first).parameters[0]);
  }
  for (std::size_t i = 0; i < drawing.walls.size(); ++i) {
    if (orientations[i] != kNoId) {
      drawing.walls[i].cluster = clusters.at(orientations[i]);
    }
  }
  return drawing;
}

void WriteMapSvg(const MapDrawing& drawing, const std::string& path,
                 const MapDrawingOptions& options) {
  CheckOptions(options);
  const Layout layout = MakeLayout(drawing, options);
  std::string bytes;
  const Surface surface(cairo_svg_surface_create_for_stream(
      AppendBytes, &bytes, layout.width, layout.height));
  CheckStatus(cairo_surface_status(surface.get()));
  {
    const Cairo cr(cairo_create(surface.get()));
    Draw(cr.get(), drawing, layout);
  }
  cairo_surface_finish(surface.get());
  CheckStatus(cairo_surface_status(surface.get()));
  WriteBytes(path, PutInMetres(bytes, layout, drawing.title));
}

void WriteMapPng(const MapDrawing& drawing, const std::string& path,
                 const MapDrawingOptions& options) {
  CheckOptions(options);
  const Layout layout = MakeLayout(drawing, options);
  const Surface surface(cairo_image_surface_create(
      CAIRO_FORMAT_RGB24, static_cast<int>(layout.width),
      static_cast<int>(layout.height)));
  CheckStatus(cairo_surface_status(surface.get()));
  {
    const Cairo cr(cairo_create(surface.get()));
    Draw(cr.get(), drawing, layout);
  }
  std::string bytes;
  CheckStatus(
      cairo_surface_write_to_png_stream(surface.get(), AppendBytes, &bytes));
  WriteBytes(path, bytes);
}

}  // namespace plumbline
