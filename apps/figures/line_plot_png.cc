#include <plumbline/apps/figures/line_plot.h>
#include <plumbline/apps/figures/plot_canvas.h>
#include <plumbline/core/atomic_file.h>
#include <plumbline/core/error.h>

#include <cstdio>
#include <memory>
#include <ostream>
#include <plumbline/outputs/late_cairo.inc>
#include <string>

namespace plumbline {
namespace {

// Pixels of the picture to a px of the plot: letters stay sharp.
constexpr double kScale = 2.0;

struct CairoDeleter {
  void operator()(cairo_t* cr) const { cairo_destroy(cr); }
  void operator()(cairo_surface_t* s) const { cairo_surface_destroy(s); }
};

class CairoCanvas : public PlotCanvas {
 public:
  explicit CairoCanvas(cairo_t* cr) : cr_(cr) {}

  void BeginPlot(int left) override {
    cairo_save(cr_);
    cairo_translate(cr_, left, 0.0);
  }
  void EndPlot() override { cairo_restore(cr_); }

  void Line(double x1, double y1, double x2, double y2,
            const Stroke& stroke) override {
    cairo_move_to(cr_, x1, y1);
    cairo_line_to(cr_, x2, y2);
    Draw(stroke);
  }

  void Text(double x, double y, Anchor anchor, int size,
            const std::string& text, bool bold, double turn) override {
    constexpr double kDegree = 0.017453292519943295;
    cairo_select_font_face(
        cr_, "sans-serif", CAIRO_FONT_SLANT_NORMAL,
        bold ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
    cairo_set_font_size(cr_, size);
    cairo_text_extents_t extents;
    cairo_text_extents(cr_, text.c_str(), &extents);
    cairo_save(cr_);
    cairo_translate(cr_, x, y);
    cairo_rotate(cr_, turn * kDegree);
    cairo_move_to(cr_,
                  anchor == Anchor::kStart    ? 0.0
                  : anchor == Anchor::kMiddle ? -0.5 * extents.x_advance
                                              : -extents.x_advance,
                  0.0);
    cairo_set_source_rgb(cr_, 0.0, 0.0, 0.0);
    cairo_show_text(cr_, text.c_str());
    cairo_restore(cr_);
    // It leaves a point behind that a line would begin at.
    cairo_new_path(cr_);
  }

  void Box(int x, int y, int width, int height) override {
    cairo_rectangle(cr_, x, y, width, height);
    Draw({"black"});
  }

  void Polygon(const std::vector<Point>& points, const char* color,
               double opacity) override {
    Trace(points);
    cairo_close_path(cr_);
    SetColor(color, opacity);
    cairo_fill(cr_);
  }

  void Polyline(const std::vector<Point>& points,
                const Stroke& stroke) override {
    Trace(points);
    Draw(stroke);
  }

  void Dot(const Point& center, int radius, const char* color) override {
    constexpr double kFullTurn = 6.283185307179586;
    cairo_new_sub_path(cr_);
    cairo_arc(cr_, center.x, center.y, radius, 0.0, kFullTurn);
    SetColor(color, 1.0);
    cairo_fill(cr_);
  }

 private:
  void SetColor(const char* color, double opacity) {
    unsigned int red = 0, green = 0, blue = 0;
    std::sscanf(color, "#%2x%2x%2x", &red, &green, &blue);
    cairo_set_source_rgba(cr_, red / 255.0, green / 255.0, blue / 255.0,
                          opacity);
  }

  void Trace(const std::vector<Point>& points) {
    for (const Point& point : points) cairo_line_to(cr_, point.x, point.y);
  }

  void Draw(const Stroke& stroke) {
    const double dashes[] = {7.0, 4.0};
    SetColor(stroke.color, 1.0);
    cairo_set_line_width(cr_, stroke.width);
    cairo_set_line_join(cr_, CAIRO_LINE_JOIN_ROUND);
    cairo_set_dash(cr_, dashes, stroke.dashed ? 2 : 0, 0.0);
    cairo_stroke(cr_);
  }

  cairo_t* cr_;
};

cairo_status_t Append(void* closure, const unsigned char* data,
                      unsigned int length) {
  auto* output = static_cast<std::ostream*>(closure);
  output->write(reinterpret_cast<const char*>(data), length);
  return *output ? CAIRO_STATUS_SUCCESS : CAIRO_STATUS_WRITE_ERROR;
}

void CheckStatus(cairo_status_t status) {
  if (status == CAIRO_STATUS_SUCCESS) return;
  throw PLUMBLINE_ERROR(std::string("cairo: ") + cairo_status_to_string(status),
                        "plots that it can draw");
}

}  // namespace

void WritePlotPng(const std::vector<LinePlot>& plots, const std::string& path,
                  int columns) {
  const PlotSheet sheet(plots, columns);
  const std::unique_ptr<cairo_surface_t, CairoDeleter> surface(
      cairo_image_surface_create(CAIRO_FORMAT_RGB24,
                                 static_cast<int>(kScale * sheet.width()),
                                 static_cast<int>(kScale * sheet.height())));
  const std::unique_ptr<cairo_t, CairoDeleter> cr(cairo_create(surface.get()));
  CheckStatus(cairo_status(cr.get()));
  cairo_set_source_rgb(cr.get(), 1.0, 1.0, 1.0);
  cairo_paint(cr.get());
  cairo_scale(cr.get(), kScale, kScale);
  CairoCanvas canvas(cr.get());
  sheet.Draw(&canvas);
  CheckStatus(cairo_status(cr.get()));
  WriteFileAtomically(path, [&](std::ostream& output) {
    CheckStatus(
        cairo_surface_write_to_png_stream(surface.get(), Append, &output));
  });
}

}  // namespace plumbline
