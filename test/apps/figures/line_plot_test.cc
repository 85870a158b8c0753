#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/apps/figures/line_plot.h>
#include <plumbline/core/error.h>
#include <unistd.h>

#include <cstdio>
#include <fstream>
#include <iterator>
#include <limits>
#include <string>
#include <vector>

namespace plumbline {
namespace {

using ::testing::DoubleNear;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::Pointwise;

LinePlot TwoPoints() {
  LinePlot plot;
  plot.title = "a < b & c";
  plot.x_label = "time, s";
  plot.y_label = "error, m";
  PlotSeries series;
  series.name = "line";
  series.x = {0.0, 1.0};
  series.y = {0.0, 1.0};
  plot.series.push_back(series);
  return plot;
}

TEST(LinePlotTest, RoundTicks) {
  EXPECT_THAT(RoundTicks(0.0, 1.0, 6),
              Pointwise(DoubleNear(1e-12),
                        std::vector<double>{0.0, 0.2, 0.4, 0.6, 0.8, 1.0}));
  EXPECT_THAT(
      RoundTicks(0.0, 0.37, 8),
      Pointwise(DoubleNear(1e-12), std::vector<double>{0.0, 0.1, 0.2, 0.3}));
  EXPECT_THAT(RoundTicks(-30.0, 40.0, 5),
              Pointwise(DoubleNear(1e-12),
                        std::vector<double>{-20.0, 0.0, 20.0, 40.0}));
  EXPECT_THAT(RoundTicks(2.0, 2.0, 5), ElementsAre(2.0));
}

TEST(LinePlotTest, LogTicks) {
  EXPECT_THAT(LogTicks(0.1, 10.0, 10),
              Pointwise(DoubleNear(1e-12),
                        std::vector<double>{0.1, 0.2, 0.5, 1, 2, 5, 10}));
  // Powers alone when there are many.
  EXPECT_THAT(LogTicks(3.0, 2e5, 10),
              Pointwise(DoubleNear(1e-6),
                        std::vector<double>{10, 100, 1000, 1e4, 1e5}));
  EXPECT_THAT(LogTicks(2.5, 4.0, 10), ElementsAre());
  EXPECT_THAT(LogTicks(2.0, 2.0, 5), ElementsAre(2.0));
}

TEST(LinePlotTest, LogarithmicAxes) {
  LinePlot plot = TwoPoints();
  plot.log_x = plot.log_y = true;
  // Zero has no place there.
  plot.series[0].x = {0.0, 1.0, 10.0, 100.0};
  plot.series[0].y = {5.0, 1.0, 10.0, 100.0};
  // x from 74 to 809, y from 404 to 40 with a margin of 5 % at both ends: the
  // middle is in the middle.
  EXPECT_THAT(PlotSvg({plot}),
              HasSubstr("<polyline points=\"74.00,387.45 441.50,222.00 "
                        "809.00,56.55 \""));
}

TEST(LinePlotTest, PutsPointsWhereTheyBelong) {
  const std::string svg = PlotSvg({TwoPoints()});
  EXPECT_THAT(svg, HasSubstr("width=\"900\" height=\"460\""));
  // The axes go from (74, 404) to (809, 40); y ends 5 % above the largest.
  EXPECT_THAT(svg,
              HasSubstr("<polyline points=\"74.00,404.00 809.00,57.33 \""));
  EXPECT_THAT(svg, HasSubstr("a &lt; b &amp; c"));
  EXPECT_THAT(svg, HasSubstr(">error, m</text>"));
  EXPECT_THAT(svg, HasSubstr(">0.2</text>"));
}

TEST(LinePlotTest, PlotsStandBelowEachOther) {
  const std::string svg = PlotSvg({TwoPoints(), TwoPoints()});
  EXPECT_THAT(svg, HasSubstr("width=\"900\" height=\"920\""));
  EXPECT_THAT(svg, HasSubstr("74.00,404.00 809.00,57.33"));
  EXPECT_THAT(svg, HasSubstr("74.00,864.00 809.00,517.33"));
}

TEST(LinePlotTest, WordsInPlaceOfNumbers) {
  LinePlot plot = TwoPoints();
  plot.x_ticks = {{0.0, "start"}, {1.0, "end"}, {7.0, "beyond"}};
  const std::string svg = PlotSvg({plot});
  EXPECT_THAT(svg, HasSubstr(">start</text>"));
  EXPECT_THAT(svg, HasSubstr(">end</text>"));
  EXPECT_THAT(svg, Not(HasSubstr("beyond")));
}

// Beside each other where they have room; only otherwise is there more space
// under the axis.
TEST(LinePlotTest, WordsStandUprightWhereTheyHaveRoom) {
  LinePlot plot = TwoPoints();
  const int room = RoomUnderAxis(plot);
  plot.x_ticks = {{0.0, "0.02"}, {0.5, "0.1"}, {1.0, "2"}};
  EXPECT_EQ(RoomUnderAxis(plot), room);
  EXPECT_THAT(PlotSvg({plot}), Not(HasSubstr("rotate(-90 445")));
  EXPECT_THAT(PlotSvg({plot}), HasSubstr("text-anchor=\"middle\">0.1</text>"));
  // 735 px of axis: a hundredth of it is not enough for three letters.
  plot.x_ticks = {{0.0, "0.02"}, {0.5, "0.1"}, {0.51, "0.2"}};
  EXPECT_EQ(RoomUnderAxis(plot), room + 18);
  EXPECT_THAT(PlotSvg({plot}), HasSubstr("rotate(-90 445.50"));
  plot.x_ticks.emplace_back(0.52, std::string(100, 'w'));
  EXPECT_EQ(RoomUnderAxis(plot), room + 90);
  // What is not on the axis takes none.
  plot.x_ticks = {{0.0, "0.02"}, {7.0, std::string(100, 'w')}, {7.0, "w"}};
  EXPECT_EQ(RoomUnderAxis(plot), room);
}

TEST(LinePlotTest, LongTitlesAreSmaller) {
  LinePlot plot = TwoPoints();
  plot.width = 450;
  plot.title = std::string(50, 'w');
  EXPECT_THAT(PlotSvg({plot}), HasSubstr("<text x=\"225.00\" y=\"24.00\" "
                                         "font-size=\"15\""));
  plot.title = std::string(75, 'w');
  EXPECT_THAT(PlotSvg({plot}), HasSubstr("<text x=\"225.00\" y=\"24.00\" "
                                         "font-size=\"10\""));
}

TEST(LinePlotTest, BandsDashesAndMarkers) {
  LinePlot plot = TwoPoints();
  plot.series[0].low = {0.0, 0.9};
  plot.series[0].high = {0.1, 1.0};
  plot.series[0].dashed = true;
  plot.series[0].markers = true;
  const std::string svg = PlotSvg({plot});
  EXPECT_THAT(svg, HasSubstr("<polygon points=\"74.00,369.33 809.00,57.33 "
                             "809.00,92.00 74.00,404.00 \""));
  EXPECT_THAT(svg, HasSubstr("stroke-dasharray"));
  EXPECT_THAT(svg, HasSubstr("<circle cx=\"809.00\" cy=\"57.33\""));
}

TEST(LinePlotTest, PassesOverWhatIsNoNumber) {
  LinePlot plot = TwoPoints();
  plot.series[0].x.push_back(std::numeric_limits<double>::infinity());
  plot.series[0].y.push_back(std::numeric_limits<double>::quiet_NaN());
  const std::string svg = PlotSvg({plot});
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
  EXPECT_THAT(svg, Not(HasSubstr("inf")));
  EXPECT_THAT(svg, HasSubstr("74.00,404.00 809.00,57.33"));
}

TEST(LinePlotTest, EmptyAndConstantPlots) {
  EXPECT_THAT(PlotSvg({}), HasSubstr("</svg>"));
  LinePlot plot;
  EXPECT_THAT(PlotSvg({plot}), Not(HasSubstr("nan")));
  plot = TwoPoints();
  plot.series[0].x = {3.0, 3.0};
  plot.series[0].y = {0.0, 0.0};
  EXPECT_THAT(PlotSvg({plot}), Not(HasSubstr("nan")));
}

TEST(LinePlotTest, RefusesSizesThatDisagree) {
  LinePlot plot = TwoPoints();
  plot.series[0].y.pop_back();
  EXPECT_THROW(PlotSvg({plot}), Error);
  plot = TwoPoints();
  plot.series[0].low = {0.0, 0.0};
  EXPECT_THROW(PlotSvg({plot}), Error);
}

TEST(PlotSvgTest, RowsOfSeveralPlots) {
  LinePlot plot;
  plot.width = 300;
  plot.height = 200;
  LinePlot tall = plot;
  tall.height = 250;
  const std::string svg = PlotSvg({plot, tall, plot}, 2);
  EXPECT_NE(svg.find("width=\"600\" height=\"450\""), std::string::npos);
  EXPECT_NE(svg.find("translate(300 0)"), std::string::npos);
  EXPECT_EQ(PlotSvg({plot}, 2).find("translate"), std::string::npos);
  EXPECT_NE(PlotSvg({plot}, 2).find("width=\"300\" height=\"200\""),
            std::string::npos);
}

TEST(LinePlotTest, AxesOfAMapAreEqual) {
  LinePlot plot;
  plot.equal_axes = true;
  plot.width = 600;
  plot.height = 400;
  PlotSeries series;
  series.x = {100.0, 103.0, 103.0, 100.0};
  series.y = {50.0, 50.0, 51.0, 51.0};
  plot.series.push_back(series);
  const std::string svg = PlotSvg({plot});
  const std::string mark = "<polyline points=\"";
  const std::size_t at = svg.find(mark);
  ASSERT_NE(at, std::string::npos);
  double x[4], y[4];
  ASSERT_EQ(std::sscanf(svg.c_str() + at + mark.size(),
                        "%lf,%lf %lf,%lf %lf,%lf %lf,%lf", &x[0], &y[0], &x[1],
                        &y[1], &x[2], &y[2], &x[3], &y[3]),
            8);
  EXPECT_NEAR(x[1] - x[0], 3.0 * (y[1] - y[2]), 0.05);
  // In the middle, and not from 0 on.
  EXPECT_GT(x[1] - x[0], 400.0);
}

TEST(LinePlotTest, Png) {
  const std::string path =
      ::testing::TempDir() + "line_plot_" + std::to_string(getpid()) + ".png";
  WritePlotPng({TwoPoints()}, path);
  std::ifstream file(path, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(file),
                          std::istreambuf_iterator<char>()};
  std::remove(path.c_str());
  ASSERT_GT(bytes.size(), 1000u);
  EXPECT_EQ(bytes.substr(1, 3), "PNG");
  // Width and height: two pixels to a px.
  EXPECT_EQ(bytes.substr(16, 8), std::string("\0\0\x07\x08\0\0\x03\x98", 8));
}

}  // namespace
}  // namespace plumbline
