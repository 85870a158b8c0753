#include <gtest/gtest.h>
#include <plumbline/factors/angle.h>
#include <plumbline/outputs/map_layout.h>

#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

namespace plumbline::map_page {
namespace {

TEST(ScaleBarTest, RoundLengths) {
  EXPECT_DOUBLE_EQ(ScaleBarLength(9.99), 5.0);
  EXPECT_DOUBLE_EQ(ScaleBarLength(10.0), 10.0);
  EXPECT_DOUBLE_EQ(ScaleBarLength(1.0), 1.0);
  EXPECT_DOUBLE_EQ(ScaleBarLength(1.99), 1.0);
  EXPECT_DOUBLE_EQ(ScaleBarLength(2.0), 2.0);
  EXPECT_DOUBLE_EQ(ScaleBarLength(0.034), 0.02);
  EXPECT_DOUBLE_EQ(ScaleBarLength(740.0), 500.0);
}

DrawnWall WallOnPage(double x1, double y1, double x2, double y2, int cluster) {
  DrawnWall wall;
  wall.x1 = x1;
  wall.y1 = y1;
  wall.x2 = x2;
  wall.y2 = y2;
  wall.cluster = cluster;
  return wall;
}

// Half as wide as high, each letter.
double HalfWide(const std::string& text, double size) {
  return 0.5 * size * static_cast<double>(text.size());
}

TEST(MapLegendTest, SaysWhatIsInTheDrawing) {
  EXPECT_TRUE(MakeLegend({}).empty());
  MapDrawing drawing;
  drawing.walls = {WallOnPage(0.0, 0.0, 1.0, 0.0, 0),
                   WallOnPage(0.0, 0.0, 0.0, 1.0, 1),
                   WallOnPage(0.0, 0.0, 1.0, 1.0, -1)};
  // 179.97 degrees are none.
  drawing.cluster_directions = {DegToRad(179.97)};
  drawing.circles = {{0.0, 0.0, 1.0, 0}};
  const std::vector<LegendEntry> legend = MakeLegend(drawing);
  ASSERT_EQ(legend.size(), 4u);
  EXPECT_EQ(legend[0].text, "0.0\xC2\xB0");
  EXPECT_EQ(legend[1].text, "direction 2");
  EXPECT_EQ(legend[2].text, "no common direction");
  EXPECT_EQ(legend[3].text, "circles");
  EXPECT_EQ(legend[3].swatch, Swatch::kCircle);
}

TEST(MapLegendTest, ClustersPastThePaletteShareALine) {
  MapDrawing drawing;
  drawing.walls = {WallOnPage(0.0, 0.0, 1.0, 0.0, kNumClusterColors + 2)};
  const std::vector<LegendEntry> legend = MakeLegend(drawing);
  ASSERT_EQ(legend.size(), static_cast<std::size_t>(kNumClusterColors + 1));
  EXPECT_EQ(legend.back().text, "3 more directions");
}

TEST(MapLayoutTest, TheMapLiesWithinTheMarginsToScale) {
  MapDrawing drawing;
  drawing.walls = {WallOnPage(100.0, -50.0, 140.0, -30.0, -1)};
  const Layout layout = MakeLayout(drawing, 1000.0, HalfWide);
  EXPECT_EQ(layout.width, 1000.0);
  EXPECT_EQ(layout.unit, 1.0);
  EXPECT_NEAR(layout.X(100.0), kMargin, 1e-9);
  EXPECT_NEAR(layout.X(140.0), 1000.0 - kMargin, 1e-9);
  EXPECT_NEAR(layout.scale, (1000.0 - 2.0 * kMargin) / 40.0, 1e-9);
  // y of the page points down; without a title the map begins at the top.
  EXPECT_NEAR(layout.Y(-30.0), kMargin, 1e-9);
  EXPECT_NEAR(layout.Y(-50.0), kMargin + 20.0 * layout.scale, 1e-9);
  EXPECT_LE(layout.bar_length * layout.scale, 0.2 * layout.width);
  EXPECT_GT(layout.bar_y, layout.Y(-50.0));
}

TEST(MapLayoutTest, ATallMapIsAsHighAsItMayBe) {
  MapDrawing drawing;
  drawing.walls = {WallOnPage(0.0, 0.0, 0.0, 100.0, -1)};
  const Layout layout = MakeLayout(drawing, 1000.0, HalfWide);
  EXPECT_NEAR(layout.height, 1000.0, 1.0);
  // Room for the legend, however narrow the map is.
  EXPECT_EQ(layout.width, kLeastWidth);
}

TEST(MapLayoutTest, ALegendThatIsTooLongGetsMoreRows) {
  MapDrawing drawing;
  for (int i = 0; i < kNumClusterColors; ++i) {
    drawing.walls.push_back(WallOnPage(0.0, i, 10.0, i, i));
  }
  const Layout layout = MakeLayout(drawing, 1000.0, HalfWide);
  ASSERT_EQ(layout.legend_positions.size(), layout.legend.size());
  EXPECT_GT(layout.legend_positions.back().second,
            layout.legend_positions.front().second);
  for (std::size_t i = 0; i < layout.legend.size(); ++i) {
    EXPECT_LE(layout.legend_positions[i].first + kSwatchWidth + 8.0 +
                  HalfWide(layout.legend[i].text, kTextSize),
              layout.width - kMargin + 1e-9);
  }
}

TEST(MapLayoutTest, WhatHasNoPlaceIsPassedOver) {
  MapDrawing drawing;
  drawing.walls = {WallOnPage(0.0, 0.0, 10.0, 5.0, -1)};
  const Layout alone = MakeLayout(drawing, 1000.0, HalfWide);
  drawing.circles = {{std::nan(""), 0.0, 1.0, 0}, {0.0, 0.0, -1.0, 1}};
  drawing.path = {Pose2(1e300, 0.0, 0.0)};
  drawing.points = {{0.0, std::numeric_limits<double>::infinity()}};
  const Layout layout = MakeLayout(drawing, 1000.0, HalfWide);
  EXPECT_EQ(layout.bounds.max_x, alone.bounds.max_x);
  EXPECT_EQ(layout.bounds.min_y, alone.bounds.min_y);
  // Nothing at all is a page of 10 m.
  EXPECT_EQ(MakeLayout({}, 1000.0, HalfWide).bounds.max_x, 5.0);
}

}  // namespace
}  // namespace plumbline::map_page
