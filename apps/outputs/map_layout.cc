#include <plumbline/factors/angle.h>
#include <plumbline/outputs/map_layout.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>

namespace plumbline {

double ScaleBarLength(double longest) {
  const double power = std::pow(10.0, std::floor(std::log10(longest)));
  // One rounding step must not cost a whole step of the bar.
  const double slack = 1.0 + 1e-9;
  for (const double factor : {10.0, 5.0, 2.0}) {
    if (factor * power <= longest * slack) return factor * power;
  }
  return power;
}

namespace map_page {

void Bounds::Add(double x, double y) {
  min_x = std::min(min_x, x);
  min_y = std::min(min_y, y);
  max_x = std::max(max_x, x);
  max_y = std::max(max_y, y);
}

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

namespace {

std::string DirectionText(double direction) {
  // Rounded first, so that 179.97 degrees reads as 0.0 and not as 180.0.
  const double degrees =
      std::round(RadToDeg(NormalizeAxial(direction)) * 10.0) / 10.0;
  char text[32];
  std::snprintf(text, sizeof(text), "%.1f\xC2\xB0",
                std::fmod(degrees + 180.0, 180.0));
  return text;
}

}  // namespace

std::vector<LegendEntry> MakeLegend(const MapDrawing& drawing) {
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

namespace {

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

}  // namespace

Layout MakeLayout(const MapDrawing& drawing, double long_side,
                  const TextWidth& text_width) {
  Layout layout;
  layout.bounds = BoundsOf(drawing);
  layout.legend = MakeLegend(drawing);
  const double unit = long_side / 1000.0;
  layout.unit = unit;
  const double margin = kMargin * unit;
  const double header = drawing.title.empty() ? 0.0 : 1.6 * kTitleSize * unit;
  const double map_width = layout.bounds.max_x - layout.bounds.min_x;
  const double map_height = layout.bounds.max_y - layout.bounds.min_y;

  std::vector<double> entry_widths;
  for (const LegendEntry& entry : layout.legend) {
    entry_widths.push_back((kSwatchWidth + 8.0 + 22.0) * unit +
                           text_width(entry.text, kTextSize * unit));
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
        text_width(ScaleBarText(bar_length), kTextSize * unit) + 36.0 * unit;
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

}  // namespace map_page
}  // namespace plumbline
