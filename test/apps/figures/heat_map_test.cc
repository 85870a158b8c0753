#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/apps/figures/heat_map.h>
#include <plumbline/core/error.h>

#include <cmath>
#include <string>

namespace plumbline {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

HeatMap MakeMap() {
  HeatMap map;
  map.title = "a < b";
  map.x_label = "columns";
  map.y_label = "rows";
  map.columns = {"c0", "c1", "c2"};
  map.rows = {"r0", "r1"};
  map.values = {{1.0, 2.0, 3.0}, {4.0, NAN, 5.0}};
  return map;
}

TEST(HeatMapTest, ColorsRunFromDarkToLight) {
  EXPECT_EQ(HeatColor(0.0), "#440154");
  EXPECT_EQ(HeatColor(0.5), "#21908d");
  EXPECT_EQ(HeatColor(1.0), "#fde725");
  EXPECT_EQ(HeatColor(-1.0), HeatColor(0.0));
  EXPECT_EQ(HeatColor(2.0), HeatColor(1.0));
  // Halfway between the first two of nine.
  EXPECT_EQ(HeatColor(1.0 / 16), "#461767");
}

TEST(HeatMapTest, WideRangesAreLogarithmic) {
  EXPECT_FALSE(IsLogarithmic({{1.0, 50.0}}));
  EXPECT_TRUE(IsLogarithmic({{1.0, NAN}, {51.0}}));
  EXPECT_FALSE(IsLogarithmic({{0.0, 1000.0}}));
  EXPECT_FALSE(IsLogarithmic({{-1.0, 1000.0}}));
  EXPECT_FALSE(IsLogarithmic({}));
}

// What is longer than the table is wide, or than a cell, is not cut off.
TEST(HeatMapTest, LongTextsHaveRoom) {
  HeatMap map = MakeMap();
  map.columns = {"c0"};
  map.values = {{1.0}, {2.0}};
  map.title = std::string(50, 'w');
  std::string svg = HeatMapSvg({map});
  EXPECT_THAT(svg, HasSubstr("<text x=\"18\" y=\"20\" text-anchor=\"start\""));
  EXPECT_THAT(svg, HasSubstr("<svg xmlns=\"http://www.w3.org/2000/svg\" "
                             "width=\"486\""));
  EXPECT_THAT(svg, HasSubstr("width=\"70\" height=\"34\""));
  map.values = {{-0.00012346}, {2.0}};
  EXPECT_THAT(HeatMapSvg({map}), HasSubstr("width=\"82\" height=\"34\""));
}

TEST(HeatMapTest, CellsHaveTheirColorsAndNumbers) {
  HeatMap map = MakeMap();
  const std::string svg = HeatMapSvg({map});
  EXPECT_THAT(svg, HasSubstr(">a &lt; b</text>"));
  for (const std::string text :
       {"c0", "c2", "r0", "r1", "columns", "rows", "1", "4", "5", "-"}) {
    EXPECT_THAT(svg, HasSubstr(">" + text + "</text>")) << text;
  }
  EXPECT_THAT(svg, HasSubstr("fill=\"" + HeatColor(0.25) + "\""));
  EXPECT_THAT(svg, HasSubstr("fill=\"#eeeeee\""));
  EXPECT_THAT(svg, Not(HasSubstr("#D55E00")));
  EXPECT_EQ(svg, HeatMapSvg({map}));
  map.framed_row = 1;
  map.framed_column = 2;
  EXPECT_THAT(HeatMapSvg({map}), HasSubstr("#D55E00"));
}

TEST(HeatMapTest, EmptyAndEvenOnesAreDrawn) {
  HeatMap map = MakeMap();
  map.values = {{NAN, NAN, NAN}, {NAN, NAN, INFINITY}};
  EXPECT_THAT(HeatMapSvg({map}), Not(HasSubstr("nan")));
  map.values = {{7.0, 7.0, 7.0}, {7.0, 7.0, 7.0}};
  EXPECT_THAT(HeatMapSvg({map}), HasSubstr(HeatColor(0.5)));
  map.values.pop_back();
  EXPECT_THROW(HeatMapSvg({map}), Error);
  map = MakeMap();
  map.columns.pop_back();
  EXPECT_THROW(HeatMapSvg({map}), Error);
}

}  // namespace
}  // namespace plumbline
