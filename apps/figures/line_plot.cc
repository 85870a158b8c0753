#include <plumbline/apps/figures/line_plot.h>
#include <plumbline/core/error.h>
#include <plumbline/core/xml_text.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numeric>
#include <sstream>

namespace plumbline {
namespace {

// Colours that people with colour blindness tell apart (Okabe and Ito 2008).
constexpr std::array<const char*, 7> kColors = {"#0072B2", "#D55E00", "#009E73",
                                                "#CC79A7", "#E69F00", "#56B4E9",
                                                "#000000"};
constexpr int kLeft = 74;
constexpr int kRight = 24;
constexpr int kTop = 40;
constexpr int kBottom = 56;
// About what a letter under the axis takes, and the space between two words.
constexpr double kLetter = 6.6;
constexpr double kBetweenWords = 8.0;
// Of words that are written upwards; longer ones run into the axis' label.
constexpr int kMostRoomForWords = 90;
constexpr int kLegendRow = 20;
constexpr int kTitleSize = 15;
constexpr int kLeastTitleSize = 8;

std::string Number(double value, const char* format = "%.2f") {
  char text[64];
  std::snprintf(text, sizeof(text), format, value);
  return text;
}

// As a person writes it: 0.25, 10, 1e-05.
std::string Label(double value) {
  if (std::abs(value) < 1e-12) return "0";
  return Number(value, "%.6g");
}

struct Range {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();

  void Add(double value) {
    if (!std::isfinite(value)) return;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  // At least a little wide.
  void Settle() {
    if (!(low <= high)) low = 0.0, high = 1.0;
    if (high - low <= 1e-9 * std::max(std::abs(low), std::abs(high))) {
      const double half = low == 0.0 ? 0.5 : 0.5 * std::abs(low);
      low -= half;
      high += half;
    }
  }
};

void CheckSizes(const PlotSeries& series) {
  const bool has_band = !series.low.empty() || !series.high.empty();
  if (series.x.size() != series.y.size() ||
      (has_band && (series.low.size() != series.y.size() ||
                    series.high.size() != series.y.size()))) {
    throw PLUMBLINE_ERROR(
        "sizes of x, y, low and high of '" + series.name + "' disagree",
        "as many of each");
  }
}

class PlotWriter {
 public:
  PlotWriter(const LinePlot& plot, int top, std::ostringstream* output)
      : plot_(plot), output_(*output) {
    for (const PlotSeries& series : plot.series) {
      CheckSizes(series);
      for (const double x : series.x) x_.Add(OnX(x));
      for (const double y : series.y) y_.Add(OnY(y));
      for (const double y : series.low) y_.Add(OnY(y));
      for (const double y : series.high) y_.Add(OnY(y));
    }
    x_.Settle();
    if (!plot.log_y) y_.low = std::min(y_.low, 0.0);
    y_.Settle();
    const double margin = 0.05 * (y_.high - y_.low);
    y_.high += margin;
    if (y_.low < 0.0 || plot.log_y) y_.low -= margin;
    left_ = kLeft;
    right_ = plot.width - kRight - static_cast<int>(LegendWidth(plot));
    top_ = top + kTop;
    under_axis_ = kBottom;
    if (!WordsFitBesideEachOther()) {
      double longest = 0.0;
      for (const auto& [x, word] : plot.x_ticks) {
        longest = std::max(longest, kLetter * static_cast<double>(word.size()));
      }
      // In place of one row of them.
      under_axis_ +=
          std::clamp(static_cast<int>(longest) - 8, 0, kMostRoomForWords);
    }
    bottom_ = top + plot.height - under_axis_;
  }

  int under_axis() const { return under_axis_; }

  void Write() {
    Text(plot_.width / 2.0, top_ - 16, "middle", TitleSize(), plot_.title,
         true);
    WriteAxes();
    int next_color = 0;
    std::vector<int> colors;
    for (const PlotSeries& series : plot_.series) {
      colors.push_back(series.color >= 0 ? series.color : next_color++);
    }
    for (std::size_t i = 0; i < colors.size(); ++i) {
      WriteBand(plot_.series[i], Color(colors[i]));
    }
    for (std::size_t i = 0; i < colors.size(); ++i) {
      WriteLine(plot_.series[i], Color(colors[i]));
    }
    WriteLegend(colors);
  }

 private:
  static const char* Color(int index) {
    return kColors[static_cast<std::size_t>(index) % kColors.size()];
  }

  // On the axis; NaN where a logarithmic one has no place for it.
  static double OnAxis(double value, bool is_log) {
    if (!is_log) return value;
    return value > 0.0 ? std::log10(value)
                       : std::numeric_limits<double>::quiet_NaN();
  }
  double OnX(double x) const { return OnAxis(x, plot_.log_x); }
  double OnY(double y) const { return OnAxis(y, plot_.log_y); }

  double X(double x) const {
    return left_ + (OnX(x) - x_.low) / (x_.high - x_.low) * (right_ - left_);
  }
  double Y(double y) const {
    return bottom_ - (OnY(y) - y_.low) / (y_.high - y_.low) * (bottom_ - top_);
  }

  static std::vector<double> Ticks(const Range& range, bool is_log, int count) {
    return is_log ? LogTicks(std::pow(10.0, range.low),
                             std::pow(10.0, range.high), count)
                  : RoundTicks(range.low, range.high, count);
  }

  void Line(double x1, double y1, double x2, double y2,
            const std::string& style) {
    output_ << "<line x1=\"" << Number(x1) << "\" y1=\"" << Number(y1)
            << "\" x2=\"" << Number(x2) << "\" y2=\"" << Number(y2) << "\" "
            << style << "/>\n";
  }

  void Text(double x, double y, const char* anchor, int size,
            const std::string& text, bool bold = false, double turn = 0.0) {
    output_ << "<text x=\"" << Number(x) << "\" y=\"" << Number(y)
            << "\" font-size=\"" << size << "\" text-anchor=\"" << anchor
            << '"';
    if (bold) output_ << " font-weight=\"bold\"";
    if (turn != 0.0) {
      output_ << " transform=\"rotate(" << Number(turn, "%g") << ' '
              << Number(x) << ' ' << Number(y) << ")\"";
    }
    output_ << '>' << EscapeXml(text) << "</text>\n";
  }

  // Smaller where the title would be wider than the plot: a bold letter is
  // about 0.6 of its size wide.
  int TitleSize() const {
    if (plot_.title.empty()) return kTitleSize;
    const double most =
        plot_.width / (0.6 * static_cast<double>(plot_.title.size()));
    return std::clamp(static_cast<int>(most), kLeastTitleSize, kTitleSize);
  }

  bool IsOnAxis(double x) const {
    return OnX(x) >= x_.low && OnX(x) <= x_.high;
  }

  bool WordsFitBesideEachOther() const {
    std::vector<std::pair<double, double>> ends;
    for (const auto& [x, word] : plot_.x_ticks) {
      if (!IsOnAxis(x)) continue;
      const double half = 0.5 * kLetter * static_cast<double>(word.size());
      ends.emplace_back(X(x) - half, X(x) + half);
    }
    std::sort(ends.begin(), ends.end());
    for (std::size_t i = 1; i < ends.size(); ++i) {
      if (ends[i].first < ends[i - 1].second + kBetweenWords) return false;
    }
    return true;
  }

  void WriteAxes() {
    for (const double y : Ticks(y_, plot_.log_y, 8)) {
      Line(left_, Y(y), right_, Y(y), "stroke=\"#dddddd\"");
      Text(left_ - 8, Y(y) + 4, "end", 12, Label(y));
    }
    if (plot_.x_ticks.empty()) {
      for (const double x : Ticks(x_, plot_.log_x, 10)) {
        Line(X(x), bottom_, X(x), bottom_ + 5, "stroke=\"black\"");
        Text(X(x), bottom_ + 19, "middle", 12, Label(x));
      }
    }
    const bool is_level = WordsFitBesideEachOther();
    for (const auto& [x, word] : plot_.x_ticks) {
      if (!IsOnAxis(x)) continue;
      Line(X(x), bottom_, X(x), bottom_ + 5, "stroke=\"black\"");
      if (is_level) {
        Text(X(x), bottom_ + 19, "middle", 12, word);
      } else {
        Text(X(x) + 4, bottom_ + 10, "end", 11, word, false, -90.0);
      }
    }
    output_ << "<rect x=\"" << left_ << "\" y=\"" << top_ << "\" width=\""
            << right_ - left_ << "\" height=\"" << bottom_ - top_
            << "\" fill=\"none\" stroke=\"black\"/>\n";
    Text((left_ + right_) / 2.0, bottom_ + under_axis_ - 14, "middle", 13,
         plot_.x_label);
    Text(18, (top_ + bottom_) / 2.0, "middle", 13, plot_.y_label, false, -90.0);
  }

  void WriteBand(const PlotSeries& series, const char* color) {
    std::string forward;
    std::string backward;
    for (std::size_t i = 0; i < series.low.size(); ++i) {
      if (!std::isfinite(OnX(series.x[i])) ||
          !std::isfinite(OnY(series.low[i])) ||
          !std::isfinite(OnY(series.high[i]))) {
        continue;
      }
      const std::string x = Number(X(series.x[i]));
      forward += x + ',' + Number(Y(series.high[i])) + ' ';
      backward = x + ',' + Number(Y(series.low[i])) + ' ' + backward;
    }
    if (forward.empty()) return;
    output_ << "<polygon points=\"" << forward << backward << "\" fill=\""
            << color << "\" fill-opacity=\"0.15\"/>\n";
  }

  void WriteLine(const PlotSeries& series, const char* color) {
    std::string points;
    for (std::size_t i = 0; i < series.y.size(); ++i) {
      if (!std::isfinite(OnX(series.x[i])) || !std::isfinite(OnY(series.y[i])))
        continue;
      const std::string x = Number(X(series.x[i]));
      const std::string y = Number(Y(series.y[i]));
      points += x + ',' + y + ' ';
      if (series.markers) {
        output_ << "<circle cx=\"" << x << "\" cy=\"" << y
                << "\" r=\"3\" fill=\"" << color << "\"/>\n";
      }
    }
    if (points.empty()) return;
    output_ << "<polyline points=\"" << points << "\" fill=\"none\" stroke=\""
            << color << "\" stroke-width=\"2\""
            << (series.dashed ? " stroke-dasharray=\"7 4\"" : "") << "/>\n";
  }

  // Width of the legend; 0 when no line has a name.
  static double LegendWidth(const LinePlot& plot) {
    std::size_t longest = 0;
    for (const PlotSeries& series : plot.series) {
      longest = std::max(longest, series.name.size());
    }
    return longest == 0 ? 0.0 : 40.0 + 6.8 * static_cast<double>(longest);
  }

  // To the right of the axes, where it covers nothing.
  void WriteLegend(const std::vector<int>& colors) {
    int row = 0;
    for (std::size_t i = 0; i < colors.size(); ++i) {
      const PlotSeries& series = plot_.series[i];
      if (series.name.empty()) continue;
      const double middle = top_ + kLegendRow * (row++ + 0.5);
      Line(right_ + 10, middle, right_ + 36, middle,
           std::string("stroke=\"") + Color(colors[i]) +
               "\" stroke-width=\"2\"" +
               (series.dashed ? " stroke-dasharray=\"7 4\"" : ""));
      Text(right_ + 42, middle + 4, "start", 12, series.name);
    }
  }

  const LinePlot& plot_;
  std::ostringstream& output_;
  Range x_;
  Range y_;
  int left_ = 0;
  int right_ = 0;
  int top_ = 0;
  int bottom_ = 0;
  int under_axis_ = kBottom;
};

}  // namespace

std::vector<double> RoundTicks(double low, double high, int count) {
  std::vector<double> ticks;
  if (!(high > low) || !std::isfinite(low) || !std::isfinite(high)) {
    return {low};
  }
  count = std::max(count, 2);
  const double wanted = (high - low) / (count - 1);
  const double power = std::pow(10.0, std::floor(std::log10(wanted)));
  double step = 10.0 * power;
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power >= wanted * (1 - 1e-9)) {
      step = factor * power;
      break;
    }
  }
  const double first = std::ceil(low / step - 1e-9);
  const double last = std::floor(high / step + 1e-9);
  for (double k = first; k <= last; k += 1.0) ticks.push_back(k * step);
  return ticks;
}

std::vector<double> LogTicks(double low, double high, int count) {
  if (!(low > 0.0) || !(high > low) || !std::isfinite(high)) return {low};
  std::vector<double> ticks;
  std::vector<double> powers;
  // A rounding step must not cost a tick at an end.
  const double slack = 1.0 + 1e-9;
  for (double exponent = std::floor(std::log10(low));
       exponent <= std::ceil(std::log10(high)); exponent += 1.0) {
    for (const double factor : {1.0, 2.0, 5.0}) {
      const double tick = factor * std::pow(10.0, exponent);
      if (tick * slack < low || tick > high * slack) continue;
      ticks.push_back(tick);
      if (factor == 1.0) powers.push_back(tick);
    }
  }
  return static_cast<int>(ticks.size()) <= count || powers.empty() ? ticks
                                                                   : powers;
}

int RoomUnderAxis(const LinePlot& plot) {
  std::ostringstream nowhere;
  return PlotWriter(plot, 0, &nowhere).under_axis();
}

std::string PlotSvg(const std::vector<LinePlot>& plots, int columns) {
  const auto per_row = static_cast<std::size_t>(std::max(columns, 1));
  int column_width = 0;
  for (const LinePlot& plot : plots) {
    column_width = std::max(column_width, plot.width);
  }
  std::vector<int> row_heights((plots.size() + per_row - 1) / per_row, 0);
  for (std::size_t i = 0; i < plots.size(); ++i) {
    int& height = row_heights[i / per_row];
    height = std::max(height, plots[i].height);
  }
  const int width =
      column_width * static_cast<int>(std::min(
                         per_row, std::max<std::size_t>(plots.size(), 1)));
  const int height = std::accumulate(row_heights.begin(), row_heights.end(), 0);
  std::ostringstream output;
  output << "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"" << width
         << "\" height=\"" << height << "\" viewBox=\"0 0 " << width << ' '
         << height << "\" font-family=\"sans-serif\">\n"
         << "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n";
  int top = 0;
  for (std::size_t i = 0; i < plots.size(); ++i) {
    const std::size_t column = i % per_row;
    if (column > 0) {
      output << "<g transform=\"translate("
             << column_width * static_cast<int>(column) << " 0)\">\n";
    }
    PlotWriter(plots[i], top, &output).Write();
    if (column > 0) output << "</g>\n";
    if (column + 1 == per_row) top += row_heights[i / per_row];
  }
  output << "</svg>\n";
  return output.str();
}

}  // namespace plumbline
