#include <plumbline/apps/figures/line_plot.h>
#include <plumbline/apps/figures/plot_canvas.h>
#include <plumbline/core/error.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numeric>

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
  // A null canvas: for what the plot measures.
  PlotWriter(const LinePlot& plot, int top, PlotCanvas* canvas)
      : plot_(plot), canvas_(canvas) {
    for (const PlotSeries& series : plot.series) {
      CheckSizes(series);
      for (const double x : series.x) x_.Add(OnX(x));
      for (const double y : series.y) y_.Add(OnY(y));
      for (const double y : series.low) y_.Add(OnY(y));
      for (const double y : series.high) y_.Add(OnY(y));
    }
    x_.Settle();
    if (!plot.log_y && !plot.equal_axes) y_.low = std::min(y_.low, 0.0);
    y_.Settle();
    const double margin = 0.05 * (y_.high - y_.low);
    y_.high += margin;
    if (y_.low < 0.0 || plot.log_y || plot.equal_axes) y_.low -= margin;
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
    if (plot.equal_axes) MakeAxesEqual();
  }

  int under_axis() const { return under_axis_; }

  void Write() {
    Text(plot_.width / 2.0, top_ - 16, PlotCanvas::Anchor::kMiddle, TitleSize(),
         plot_.title, true);
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

  // One unit is as long on both: the range with room to spare grows.
  void MakeAxesEqual() {
    const double x_unit = (right_ - left_) / (x_.high - x_.low);
    const double y_unit = (bottom_ - top_) / (y_.high - y_.low);
    Range& range = x_unit > y_unit ? x_ : y_;
    const double grow = std::max(x_unit, y_unit) / std::min(x_unit, y_unit);
    const double center = 0.5 * (range.low + range.high);
    const double half = 0.5 * (range.high - range.low) * grow;
    range.low = center - half;
    range.high = center + half;
  }

  void Line(double x1, double y1, double x2, double y2,
            const PlotCanvas::Stroke& stroke) {
    canvas_->Line(x1, y1, x2, y2, stroke);
  }

  void Text(double x, double y, PlotCanvas::Anchor anchor, int size,
            const std::string& text, bool bold = false, double turn = 0.0) {
    canvas_->Text(x, y, anchor, size, text, bold, turn);
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
      Line(left_, Y(y), right_, Y(y), {"#dddddd"});
      Text(left_ - 8, Y(y) + 4, PlotCanvas::Anchor::kEnd, 12, Label(y));
    }
    if (plot_.x_ticks.empty()) {
      for (const double x : Ticks(x_, plot_.log_x, 10)) {
        Line(X(x), bottom_, X(x), bottom_ + 5, {"black"});
        Text(X(x), bottom_ + 19, PlotCanvas::Anchor::kMiddle, 12, Label(x));
      }
    }
    const bool is_level = WordsFitBesideEachOther();
    for (const auto& [x, word] : plot_.x_ticks) {
      if (!IsOnAxis(x)) continue;
      Line(X(x), bottom_, X(x), bottom_ + 5, {"black"});
      if (is_level) {
        Text(X(x), bottom_ + 19, PlotCanvas::Anchor::kMiddle, 12, word);
      } else {
        Text(X(x) + 4, bottom_ + 10, PlotCanvas::Anchor::kEnd, 11, word, false,
             -90.0);
      }
    }
    canvas_->Box(left_, top_, right_ - left_, bottom_ - top_);
    Text((left_ + right_) / 2.0, bottom_ + under_axis_ - 14,
         PlotCanvas::Anchor::kMiddle, 13, plot_.x_label);
    Text(18, (top_ + bottom_) / 2.0, PlotCanvas::Anchor::kMiddle, 13,
         plot_.y_label, false, -90.0);
  }

  void WriteBand(const PlotSeries& series, const char* color) {
    std::vector<PlotCanvas::Point> points;
    std::vector<PlotCanvas::Point> backward;
    for (std::size_t i = 0; i < series.low.size(); ++i) {
      if (!std::isfinite(OnX(series.x[i])) ||
          !std::isfinite(OnY(series.low[i])) ||
          !std::isfinite(OnY(series.high[i]))) {
        continue;
      }
      points.push_back({X(series.x[i]), Y(series.high[i])});
      backward.push_back({X(series.x[i]), Y(series.low[i])});
    }
    if (points.empty()) return;
    points.insert(points.end(), backward.rbegin(), backward.rend());
    canvas_->Polygon(points, color, 0.15);
  }

  void WriteLine(const PlotSeries& series, const char* color) {
    std::vector<PlotCanvas::Point> points;
    for (std::size_t i = 0; i < series.y.size(); ++i) {
      if (!std::isfinite(OnX(series.x[i])) || !std::isfinite(OnY(series.y[i])))
        continue;
      points.push_back({X(series.x[i]), Y(series.y[i])});
      if (series.markers) canvas_->Dot(points.back(), 3, color);
    }
    if (points.empty()) return;
    canvas_->Polyline(points, {color, 2.0, series.dashed});
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
           {Color(colors[i]), 2.0, series.dashed});
      Text(right_ + 42, middle + 4, PlotCanvas::Anchor::kStart, 12,
           series.name);
    }
  }

  const LinePlot& plot_;
  PlotCanvas* canvas_;
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
  return PlotWriter(plot, 0, nullptr).under_axis();
}

PlotSheet::PlotSheet(const std::vector<LinePlot>& plots, int columns)
    : plots_(plots), per_row_(static_cast<std::size_t>(std::max(columns, 1))) {
  for (const LinePlot& plot : plots) {
    column_width_ = std::max(column_width_, plot.width);
  }
  row_heights_.assign((plots.size() + per_row_ - 1) / per_row_, 0);
  for (std::size_t i = 0; i < plots.size(); ++i) {
    int& height = row_heights_[i / per_row_];
    height = std::max(height, plots[i].height);
  }
  width_ =
      column_width_ * static_cast<int>(std::min(
                          per_row_, std::max<std::size_t>(plots.size(), 1)));
  height_ = std::accumulate(row_heights_.begin(), row_heights_.end(), 0);
}

void PlotSheet::Draw(PlotCanvas* canvas) const {
  int top = 0;
  for (std::size_t i = 0; i < plots_.size(); ++i) {
    const std::size_t column = i % per_row_;
    canvas->BeginPlot(column_width_ * static_cast<int>(column));
    PlotWriter(plots_[i], top, canvas).Write();
    canvas->EndPlot();
    if (column + 1 == per_row_) top += row_heights_[i / per_row_];
  }
}

}  // namespace plumbline
