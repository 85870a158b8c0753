#include <plumbline/apps/figures/heat_map.h>
#include <plumbline/core/error.h>
#include <plumbline/core/xml_text.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <limits>
#include <sstream>

namespace plumbline {
namespace {

constexpr int kTop = 48;
constexpr int kBottom = 24;
constexpr int kCellHeight = 34;
constexpr int kLetter = 7;  // px of width, about
constexpr int kTitleLetter = 9;
constexpr int kTitleLeft = 18;
constexpr int kScaleWidth = 110;
constexpr int kScaleSteps = 24;

// Nine of viridis' colours, equally far from each other.
constexpr std::array<std::array<int, 3>, 9> kViridis = {{{68, 1, 84},
                                                         {71, 44, 122},
                                                         {59, 81, 139},
                                                         {44, 113, 142},
                                                         {33, 144, 141},
                                                         {39, 173, 129},
                                                         {92, 200, 99},
                                                         {170, 220, 50},
                                                         {253, 231, 37}}};

std::string Label(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.4g", value);
  return text;
}

int TextWidth(const std::string& text) {
  return kLetter * static_cast<int>(text.size());
}

struct Layout {
  int left = 0;
  int cell_width = 0;
  int top = 0;
  int width = 0;
  int height = 0;
};

Layout MakeLayout(const HeatMap& map) {
  Layout layout;
  for (const std::string& row : map.rows) {
    layout.left = std::max(layout.left, TextWidth(row));
  }
  layout.left += 44;
  layout.cell_width = 70;
  for (const std::string& column : map.columns) {
    layout.cell_width = std::max(layout.cell_width, TextWidth(column) + 12);
  }
  for (const std::vector<double>& row : map.values) {
    for (const double value : row) {
      layout.cell_width =
          std::max(layout.cell_width, TextWidth(Label(value)) + 12);
    }
  }
  layout.top = kTop + 24;
  const int columns = static_cast<int>(map.columns.size());
  const int rows = static_cast<int>(map.rows.size());
  layout.width = std::max(
      layout.left + columns * layout.cell_width + kScaleWidth,
      kTitleLetter * static_cast<int>(map.title.size()) + 2 * kTitleLeft);
  layout.height = layout.top + std::max(rows * kCellHeight, 120) + kBottom;
  return layout;
}

void Text(double x, double y, const char* anchor, const char* style,
          const std::string& text, std::ostringstream* output) {
  *output << "<text x=\"" << x << "\" y=\"" << y << "\" text-anchor=\""
          << anchor << "\" " << style << '>' << EscapeXml(text) << "</text>\n";
}

// Where a value lies between the least and the greatest.
class Scale {
 public:
  explicit Scale(const std::vector<std::vector<double>>& values)
      : is_logarithmic_(IsLogarithmic(values)) {
    for (const std::vector<double>& row : values) {
      for (const double value : row) {
        if (!std::isfinite(value)) continue;
        low_ = std::min(low_, value);
        high_ = std::max(high_, value);
      }
    }
  }
  bool is_empty() const { return low_ > high_; }
  double Share(double value) const {
    if (high_ <= low_) return 0.5;
    return is_logarithmic_ ? std::log(value / low_) / std::log(high_ / low_)
                           : (value - low_) / (high_ - low_);
  }
  double Value(double share) const {
    return is_logarithmic_ ? low_ * std::pow(high_ / low_, share)
                           : low_ + share * (high_ - low_);
  }

 private:
  bool is_logarithmic_;
  double low_ = std::numeric_limits<double>::infinity();
  double high_ = -std::numeric_limits<double>::infinity();
};

void WriteMap(const HeatMap& map, const Layout& layout, int offset,
              std::ostringstream* output) {
  const int top = offset + layout.top;
  const int columns = static_cast<int>(map.columns.size());
  const int rows = static_cast<int>(map.rows.size());
  const int right = layout.left + columns * layout.cell_width;
  // From the left, since it may be wider than the table.
  Text(kTitleLeft, offset + 20, "start",
       "font-size=\"15\" font-weight=\"bold\"", map.title, output);
  Text((layout.left + right) / 2.0, offset + 42, "middle", "font-size=\"13\"",
       map.x_label, output);
  const double middle = top + rows * kCellHeight / 2.0;
  const std::string turned =
      "font-size=\"13\" transform=\"rotate(-90 18 " + Label(middle) + ")\"";
  Text(18, middle, "middle", turned.c_str(), map.y_label, output);
  for (int column = 0; column < columns; ++column) {
    Text(layout.left + (column + 0.5) * layout.cell_width, top - 8, "middle",
         "font-size=\"12\"", map.columns[column], output);
  }
  const Scale scale(map.values);
  for (int row = 0; row < rows; ++row) {
    const int y = top + row * kCellHeight;
    Text(layout.left - 8, y + kCellHeight / 2.0 + 4, "end", "font-size=\"12\"",
         map.rows[row], output);
    for (int column = 0; column < columns; ++column) {
      const double value = map.values[row][column];
      const bool is_number = std::isfinite(value);
      const double share = is_number ? scale.Share(value) : 0.0;
      const int x = layout.left + column * layout.cell_width;
      *output << "<rect x=\"" << x << "\" y=\"" << y << "\" width=\""
              << layout.cell_width << "\" height=\"" << kCellHeight
              << "\" fill=\"" << (is_number ? HeatColor(share) : "#eeeeee")
              << "\" stroke=\"white\"/>\n";
      // Light on the dark half.
      const char* const style = !is_number ? "font-size=\"12\" fill=\"#888888\""
                                : share < 0.6
                                    ? "font-size=\"12\" fill=\"white\""
                                    : "font-size=\"12\" fill=\"black\"";
      Text(x + layout.cell_width / 2.0, y + kCellHeight / 2.0 + 4, "middle",
           style, is_number ? Label(value) : "-", output);
    }
  }
  if (map.framed_row >= 0 && map.framed_column >= 0) {
    *output << "<rect x=\""
            << layout.left + map.framed_column * layout.cell_width + 1
            << "\" y=\"" << top + map.framed_row * kCellHeight + 1
            << "\" width=\"" << layout.cell_width - 2 << "\" height=\""
            << kCellHeight - 2
            << "\" fill=\"none\" stroke=\"#D55E00\" stroke-width=\"3\"/>\n";
  }
  if (scale.is_empty()) return;
  const double step = 120.0 / kScaleSteps;
  for (int i = 0; i < kScaleSteps; ++i) {
    *output << "<rect x=\"" << right + 20 << "\" y=\""
            << top + 120.0 - (i + 1) * step << "\" width=\"16\" height=\""
            << step + 0.5 << "\" fill=\"" << HeatColor((i + 0.5) / kScaleSteps)
            << "\"/>\n";
  }
  for (const double share : {0.0, 0.5, 1.0}) {
    Text(right + 42, top + 120.0 * (1.0 - share) + 4, "start",
         "font-size=\"12\"", Label(scale.Value(share)), output);
  }
}

}  // namespace

bool IsLogarithmic(const std::vector<std::vector<double>>& values) {
  double low = std::numeric_limits<double>::infinity();
  double high = 0.0;
  for (const std::vector<double>& row : values) {
    for (const double value : row) {
      if (!std::isfinite(value)) continue;
      low = std::min(low, value);
      high = std::max(high, value);
    }
  }
  return low > 0.0 && high > 50.0 * low;
}

std::string HeatColor(double share) {
  const double place =
      std::min(std::max(share, 0.0), 1.0) * (kViridis.size() - 1);
  const auto below =
      std::min(static_cast<std::size_t>(place), kViridis.size() - 2);
  const double fraction = place - static_cast<double>(below);
  int color[3];
  for (int i = 0; i < 3; ++i) {
    color[i] =
        static_cast<int>(std::lround((1.0 - fraction) * kViridis[below][i] +
                                     fraction * kViridis[below + 1][i]));
  }
  char text[8];
  std::snprintf(text, sizeof(text), "#%02x%02x%02x", color[0] & 0xff,
                color[1] & 0xff, color[2] & 0xff);
  return text;
}

std::string HeatMapSvg(const std::vector<HeatMap>& maps) {
  int width = 0;
  int height = 0;
  for (const HeatMap& map : maps) {
    bool fits = map.values.size() == map.rows.size();
    for (const std::vector<double>& row : map.values) {
      fits = fits && row.size() == map.columns.size();
    }
    if (!fits) {
      throw PLUMBLINE_ERROR("sizes of '" + map.title + "' disagree",
                            "a value for every row and column");
    }
    const Layout layout = MakeLayout(map);
    width = std::max(width, layout.width);
    height += layout.height;
  }
  std::ostringstream output;
  output << "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"" << width
         << "\" height=\"" << height << "\" viewBox=\"0 0 " << width << ' '
         << height << "\" font-family=\"sans-serif\">\n"
         << "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n";
  int offset = 0;
  for (const HeatMap& map : maps) {
    const Layout layout = MakeLayout(map);
    WriteMap(map, layout, offset, &output);
    offset += layout.height;
  }
  output << "</svg>\n";
  return output.str();
}

}  // namespace plumbline
