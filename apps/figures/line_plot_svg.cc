#include <plumbline/apps/figures/line_plot.h>
#include <plumbline/apps/figures/plot_canvas.h>
#include <plumbline/core/xml_text.h>

#include <cstdio>
#include <sstream>

namespace plumbline {
namespace {

std::string Number(double value, const char* format = "%.2f") {
  char text[64];
  std::snprintf(text, sizeof(text), format, value);
  return text;
}

class SvgCanvas : public PlotCanvas {
 public:
  explicit SvgCanvas(std::ostringstream* output) : output_(*output) {}

  void BeginPlot(int left) override {
    is_shifted_ = left > 0;
    if (is_shifted_)
      output_ << "<g transform=\"translate(" << left << " 0)\">\n";
  }
  void EndPlot() override {
    if (is_shifted_) output_ << "</g>\n";
  }

  void Line(double x1, double y1, double x2, double y2,
            const Stroke& stroke) override {
    output_ << "<line x1=\"" << Number(x1) << "\" y1=\"" << Number(y1)
            << "\" x2=\"" << Number(x2) << "\" y2=\"" << Number(y2) << "\" "
            << Style(stroke) << "/>\n";
  }

  void Text(double x, double y, Anchor anchor, int size,
            const std::string& text, bool bold, double turn) override {
    output_ << "<text x=\"" << Number(x) << "\" y=\"" << Number(y)
            << "\" font-size=\"" << size << "\" text-anchor=\""
            << (anchor == Anchor::kStart    ? "start"
                : anchor == Anchor::kMiddle ? "middle"
                                            : "end")
            << '"';
    if (bold) output_ << " font-weight=\"bold\"";
    if (turn != 0.0) {
      output_ << " transform=\"rotate(" << Number(turn, "%g") << ' '
              << Number(x) << ' ' << Number(y) << ")\"";
    }
    output_ << '>' << EscapeXml(text) << "</text>\n";
  }

  void Box(int x, int y, int width, int height) override {
    output_ << "<rect x=\"" << x << "\" y=\"" << y << "\" width=\"" << width
            << "\" height=\"" << height
            << "\" fill=\"none\" stroke=\"black\"/>\n";
  }

  void Polygon(const std::vector<Point>& points, const char* color,
               double opacity) override {
    output_ << "<polygon points=\"" << List(points) << "\" fill=\"" << color
            << "\" fill-opacity=\"" << Number(opacity, "%g") << "\"/>\n";
  }

  void Polyline(const std::vector<Point>& points,
                const Stroke& stroke) override {
    output_ << "<polyline points=\"" << List(points) << "\" fill=\"none\" "
            << Style(stroke) << "/>\n";
  }

  void Dot(const Point& center, int radius, const char* color) override {
    output_ << "<circle cx=\"" << Number(center.x) << "\" cy=\""
            << Number(center.y) << "\" r=\"" << radius << "\" fill=\"" << color
            << "\"/>\n";
  }

 private:
  static std::string Style(const Stroke& stroke) {
    std::string style = std::string("stroke=\"") + stroke.color + '"';
    if (stroke.width != 1.0) {
      style += " stroke-width=\"" + Number(stroke.width, "%g") + '"';
    }
    if (stroke.dashed) style += " stroke-dasharray=\"7 4\"";
    return style;
  }

  static std::string List(const std::vector<Point>& points) {
    std::string list;
    for (const Point& point : points) {
      list += Number(point.x) + ',' + Number(point.y) + ' ';
    }
    return list;
  }

  std::ostringstream& output_;
  bool is_shifted_ = false;
};

}  // namespace

std::string PlotSvg(const std::vector<LinePlot>& plots, int columns) {
  const PlotSheet sheet(plots, columns);
  std::ostringstream output;
  output << "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\""
         << sheet.width() << "\" height=\"" << sheet.height()
         << "\" viewBox=\"0 0 " << sheet.width() << ' ' << sheet.height()
         << "\" font-family=\"sans-serif\">\n"
         << "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n";
  SvgCanvas canvas(&output);
  sheet.Draw(&canvas);
  output << "</svg>\n";
  return output.str();
}

}  // namespace plumbline
