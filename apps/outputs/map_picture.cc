#include <plumbline/core/atomic_file.h>
#include <plumbline/core/error.h>
#include <plumbline/core/xml_text.h>
#include <plumbline/outputs/map_layout.h>
#include <plumbline/outputs/map_picture.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <map>
#include <memory>
#include <plumbline/outputs/late_cairo.inc>
#include <vector>

namespace plumbline {
namespace map_page {
namespace {

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

constexpr double kWallWidth = 2.0;           // units
constexpr double kPathWidth = 1.1;           // units
constexpr double kClosureWidth = 0.5;        // units
constexpr double kClosureLength = 7.0;       // units
constexpr double kRectangleEdgeWidth = 0.5;  // units
constexpr double kPointRadius = 1.6;         // units
constexpr double kCrossReach = 4.0;          // units, of a common centre

// With the letters of the picture.
Layout LayoutOf(const MapDrawing& drawing, const MapDrawingOptions& options) {
  const Surface scratch(cairo_image_surface_create(CAIRO_FORMAT_ARGB32, 1, 1));
  const Cairo cr(cairo_create(scratch.get()));
  SelectFont(cr.get());
  return MakeLayout(drawing, options.long_side,
                    [&cr](const std::string& text, double size) {
                      cairo_text_extents_t extents;
                      cairo_set_font_size(cr.get(), size);
                      cairo_text_extents(cr.get(), text.c_str(), &extents);
                      return extents.x_advance;
                    });
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
}  // namespace map_page

void WriteMapSvg(const MapDrawing& drawing, const std::string& path,
                 const MapDrawingOptions& options) {
  map_page::CheckOptions(options);
  const map_page::Layout layout = map_page::LayoutOf(drawing, options);
  std::string bytes;
  const map_page::Surface surface(cairo_svg_surface_create_for_stream(
      map_page::AppendBytes, &bytes, layout.width, layout.height));
  map_page::CheckStatus(cairo_surface_status(surface.get()));
  {
    const map_page::Cairo cr(cairo_create(surface.get()));
    map_page::Draw(cr.get(), drawing, layout);
  }
  cairo_surface_finish(surface.get());
  map_page::CheckStatus(cairo_surface_status(surface.get()));
  map_page::WriteBytes(path,
                       map_page::PutInMetres(bytes, layout, drawing.title));
}

void WriteMapPng(const MapDrawing& drawing, const std::string& path,
                 const MapDrawingOptions& options) {
  map_page::CheckOptions(options);
  const map_page::Layout layout = map_page::LayoutOf(drawing, options);
  const map_page::Surface surface(cairo_image_surface_create(
      CAIRO_FORMAT_RGB24, static_cast<int>(layout.width),
      static_cast<int>(layout.height)));
  map_page::CheckStatus(cairo_surface_status(surface.get()));
  {
    const map_page::Cairo cr(cairo_create(surface.get()));
    map_page::Draw(cr.get(), drawing, layout);
  }
  std::string bytes;
  map_page::CheckStatus(cairo_surface_write_to_png_stream(
      surface.get(), map_page::AppendBytes, &bytes));
  map_page::WriteBytes(path, bytes);
}

}  // namespace plumbline
