#ifndef PLUMBLINE_APPS_FIGURES_PLOT_CANVAS_H_
#define PLUMBLINE_APPS_FIGURES_PLOT_CANVAS_H_

#include <plumbline/apps/figures/line_plot.h>

#include <cstddef>
#include <string>
#include <vector>

namespace plumbline {

/// What a plot is drawn with: px, x to the right, y down. Colours are "#rrggbb"
/// or "black".
class PlotCanvas {
 public:
  enum class Anchor { kStart, kMiddle, kEnd };
  struct Point {
    double x;
    double y;
  };
  struct Stroke {
    const char* color;
    double width = 1.0;
    bool dashed = false;
  };

  virtual ~PlotCanvas() = default;

  /// What is drawn up to EndPlot is shifted to the right.
  virtual void BeginPlot(int left) = 0;
  virtual void EndPlot() = 0;
  virtual void Line(double x1, double y1, double x2, double y2,
                    const Stroke& stroke) = 0;
  /// `turn` is in degrees, clockwise about (x, y).
  virtual void Text(double x, double y, Anchor anchor, int size,
                    const std::string& text, bool bold, double turn) = 0;
  /// The edges of a rectangle, thin and black.
  virtual void Box(int x, int y, int width, int height) = 0;
  virtual void Polygon(const std::vector<Point>& points, const char* color,
                       double opacity) = 0;
  virtual void Polyline(const std::vector<Point>& points,
                        const Stroke& stroke) = 0;
  virtual void Dot(const Point& center, int radius, const char* color) = 0;
};

/// Plots in rows of `columns`, below each other; keeps a reference to them.
class PlotSheet {
 public:
  PlotSheet(const std::vector<LinePlot>& plots, int columns);

  /// px
  int width() const { return width_; }
  int height() const { return height_; }

  /// Throws Error when a series has sizes that disagree.
  void Draw(PlotCanvas* canvas) const;

 private:
  const std::vector<LinePlot>& plots_;
  std::size_t per_row_;
  int column_width_ = 0;
  std::vector<int> row_heights_;
  int width_ = 0;
  int height_ = 0;
};

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_FIGURES_PLOT_CANVAS_H_
