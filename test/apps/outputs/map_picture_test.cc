#include <cairo.h>
#include <gtest/gtest.h>
#include <plumbline/core/error.h>
#include <plumbline/core/registry.h>
#include <plumbline/outputs/map_drawing.h>
#include <plumbline/outputs/map_picture.h>
#include <unistd.h>

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>
#include <string>

#include "drawn_graph.h"

namespace plumbline {
namespace {

constexpr int kFirstColor = 0x0072B2;
constexpr int kSecondColor = 0xD55E00;
constexpr int kNoClusterColor = 0x4D4D4D;
constexpr int kWhite = 0xFFFFFF;

/// A decoded PNG.
class Picture {
 public:
  explicit Picture(const std::string& path)
      : surface_(cairo_image_surface_create_from_png(path.c_str())) {
    EXPECT_EQ(cairo_surface_status(surface_), CAIRO_STATUS_SUCCESS);
  }
  ~Picture() { cairo_surface_destroy(surface_); }
  Picture(const Picture&) = delete;
  Picture& operator=(const Picture&) = delete;

  int width() const { return cairo_image_surface_get_width(surface_); }
  int height() const { return cairo_image_surface_get_height(surface_); }
  int at(int x, int y) const {
    const unsigned char* row = cairo_image_surface_get_data(surface_) +
                               static_cast<std::ptrdiff_t>(y) *
                                   cairo_image_surface_get_stride(surface_);
    return static_cast<int>(reinterpret_cast<const std::uint32_t*>(row)[x] &
                            0xFFFFFF);
  }
  /// Pixels of a colour in the columns from `left` up to `right` and the rows
  /// from `top` up to `bottom`, in fractions of the picture.
  int Count(int color, double left, double top, double right,
            double bottom) const {
    int count = 0;
    for (int y = static_cast<int>(top * height());
         y < static_cast<int>(bottom * height()); ++y) {
      for (int x = static_cast<int>(left * width());
           x < static_cast<int>(right * width()); ++x) {
        count += at(x, y) == color;
      }
    }
    return count;
  }

 private:
  cairo_surface_t* surface_;
};

class MapPictureTest : public testing::DrawnGraphTest {
 protected:
  MapPictureTest() {
    folder_ = std::filesystem::temp_directory_path() /
              ("map_picture_test_" + std::to_string(getpid()) + "_" +
               ::testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::create_directories(folder_);
  }
  ~MapPictureTest() override { std::filesystem::remove_all(folder_); }

  std::string File(const std::string& name) const {
    return (folder_ / name).string();
  }

  static std::string Read(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    std::stringstream text;
    text << file.rdbuf();
    return text.str();
  }

  static DrawnWall Wall(double x1, double y1, double x2, double y2,
                        int cluster) {
    DrawnWall wall;
    wall.x1 = x1;
    wall.y1 = y1;
    wall.x2 = x2;
    wall.y2 = y2;
    wall.cluster = cluster;
    return wall;
  }

  std::filesystem::path folder_;
};

TEST_F(MapPictureTest, WallsStandWhereTheyAre) {
  MapDrawing drawing;
  drawing.cluster_directions = {0.0, kPi / 2};
  // A horizontal wall in the upper half, a vertical one on the left: y points
  // up in the map and down in the picture.
  drawing.walls = {Wall(2.0, 9.0, 10.0, 9.0, 0), Wall(0.0, 0.0, 0.0, 10.0, 1)};
  MapDrawingOptions options;
  options.long_side = 1000;
  WriteMapPng(drawing, File("map.png"), options);
  const Picture picture(File("map.png"));
  EXPECT_EQ(std::max(picture.width(), picture.height()), 1000);
  EXPECT_EQ(picture.at(0, 0), kWhite);
  // Clear of the legend, which shows both colours at the bottom.
  EXPECT_GT(picture.Count(kFirstColor, 0.3, 0.0, 1.0, 0.4), 500);
  EXPECT_EQ(picture.Count(kFirstColor, 0.0, 0.4, 1.0, 0.9), 0);
  EXPECT_GT(picture.Count(kSecondColor, 0.0, 0.0, 0.2, 0.9), 500);
  EXPECT_EQ(picture.Count(kSecondColor, 0.2, 0.0, 1.0, 0.9), 0);
  EXPECT_GT(picture.Count(kFirstColor, 0.0, 0.9, 1.0, 1.0), 20);
  EXPECT_GT(picture.Count(kSecondColor, 0.0, 0.9, 1.0, 1.0), 20);
  // Letters at the bottom are smoothed in every grey.
  EXPECT_EQ(picture.Count(kNoClusterColor, 0.0, 0.0, 1.0, 0.9), 0);
}

TEST_F(MapPictureTest, ScaleBarIsAsLongAsItSays) {
  MapDrawing drawing;
  // 40 m: a fifth of the page is some 8.5 m, so the bar is 5 m long, an eighth
  // of the wall.
  drawing.walls = {Wall(0.0, 0.0, 40.0, 0.0, -1),
                   Wall(0.0, 10.0, 40.0, 10.0, -1)};
  WriteMapPng(drawing, File("map.png"));
  const Picture picture(File("map.png"));
  const auto widest_run = [&picture](int color, double top, double bottom) {
    int widest = 0;
    for (int y = static_cast<int>(top * picture.height());
         y < static_cast<int>(bottom * picture.height()); ++y) {
      int run = 0;
      for (int x = 0; x < picture.width(); ++x) {
        run = picture.at(x, y) == color ? run + 1 : 0;
        widest = std::max(widest, run);
      }
    }
    return widest;
  };
  const int wall = widest_run(kNoClusterColor, 0.0, 0.85);
  const int bar = widest_run(0x222222, 0.85, 1.0);
  // Round caps lengthen the wall by its width, ticks the bar by theirs.
  EXPECT_NEAR(bar, wall / 8.0, 6.0);
  EXPECT_GT(wall, 2000);
}

TEST_F(MapPictureTest, SvgIsInMetres) {
  MapDrawing drawing;
  drawing.title = "walls & <columns>";
  drawing.walls = {Wall(100.0, 50.0, 140.0, 50.0, 0)};
  drawing.circles = {{120.0, 60.0, 2.0, 3}};
  drawing.path = {Pose2(100.0, 55.0, 0.0), Pose2(140.0, 55.0, 0.0)};
  WriteMapSvg(drawing, File("map.svg"));
  const std::string svg = Read(File("map.svg"));
  EXPECT_EQ(svg.compare(0, 5, "<?xml"), 0);
  EXPECT_NE(svg.find("<title>walls &amp; &lt;columns&gt;</title>"),
            std::string::npos);
  EXPECT_EQ(svg.substr(svg.size() - 14), "</svg>\n</svg>\n");
  double left, top, width, height;
  const std::size_t box = svg.find("viewBox=\"");
  ASSERT_NE(box, std::string::npos);
  ASSERT_EQ(std::sscanf(svg.c_str() + box, "viewBox=\"%lf %lf %lf %lf\"", &left,
                        &top, &width, &height),
            4);
  // The map (100..140, 50..62) lies inside with margins of 2.8 % of the page,
  // and y points down.
  EXPECT_NEAR(width, 40.0 / (1.0 - 2 * 0.028), 0.05);
  EXPECT_NEAR(left, 100.0 - 0.028 * width, 0.05);
  EXPECT_LT(top, -62.0);
  EXPECT_GT(top, -70.0);
  EXPECT_GT(top + height, -50.0);
}

TEST_F(MapPictureTest, SameDrawingSameBytes) {
  MapDrawing drawing;
  drawing.title = "twice";
  drawing.cluster_directions = {0.1};
  for (int i = 0; i < 50; ++i) {
    drawing.walls.push_back(Wall(i, 0.3 * i, i + 2.0, 0.1 * i, i % 3 - 1));
    drawing.path.emplace_back(i, std::sin(0.1 * i), 0.0);
  }
  for (int i = 0; i < 6000; ++i) {
    drawing.points.emplace_back(25.0 + 20.0 * std::cos(i),
                                5.0 * std::sin(3 * i));
  }
  for (const std::string name : {"a", "b"}) {
    WriteMapSvg(drawing, File(name + ".svg"));
    WriteMapPng(drawing, File(name + ".png"));
  }
  // Not EXPECT_EQ, which would print both.
  EXPECT_TRUE(Read(File("a.svg")) == Read(File("b.svg")));
  EXPECT_TRUE(Read(File("a.png")) == Read(File("b.png")));
}

TEST_F(MapPictureTest, DegenerateDrawings) {
  const double nan = std::nan("");
  const double infinity = std::numeric_limits<double>::infinity();
  std::vector<MapDrawing> drawings(5);
  drawings[1].walls = {Wall(nan, 0.0, 1.0, 1.0, 0),
                       Wall(0.0, 0.0, infinity, 0.0, 7)};
  drawings[1].circles = {
      {nan, 0.0, 1.0, 0}, {0.0, 0.0, -1.0, 1}, {1e300, 0.0, 1.0, 2}};
  drawings[1].rectangles = {{0.0, 0.0, nan, 1.0, 1.0, 0},
                            {0.0, 0.0, 0.0, 1e300, 1.0, 1}};
  drawings[1].path = {Pose2(nan, nan, nan)};
  drawings[1].points = {{infinity, 0.0}};
  // A single point; a very long and thin map, both ways.
  drawings[2].path = {Pose2(1e6, -1e6, 0.0)};
  drawings[3].walls = {Wall(0.0, 0.0, 5000.0, 0.0, 0)};
  drawings[4].walls = {Wall(0.0, 0.0, 0.0, 5000.0, 20)};
  for (const MapDrawing& drawing : drawings) {
    WriteMapPng(drawing, File("map.png"));
    WriteMapSvg(drawing, File("map.svg"));
    const Picture picture(File("map.png"));
    EXPECT_EQ(picture.at(0, 0), kWhite);
    EXPECT_LE(picture.width(), 2400);
    EXPECT_LE(picture.height(), 2401);
    EXPECT_EQ(Read(File("map.svg")).find("nan"), std::string::npos);
  }
}

TEST_F(MapPictureTest, RefusesWhatCannotBe) {
  MapDrawingOptions options;
  options.long_side = 10;
  EXPECT_THROW(WriteMapPng({}, File("map.png"), options), Error);
  options.long_side = 1000000;
  EXPECT_THROW(WriteMapSvg({}, File("map.svg"), options), Error);
  EXPECT_THROW(WriteMapPng({}, File("no/such/folder/map.png")), Error);
  EXPECT_FALSE(std::filesystem::exists(File("map.png")));
}

TEST_F(MapPictureTest, PointsAndCommonCenters) {
  Graph graph;
  Transaction transaction;
  transaction.AddFeature(MakeFeature("point", {1.0, 2.0}));
  transaction.AddFeature(MakeFeature("point", {9.0, 2.0}));
  Feature center = MakeFeature("point", {5.0, 8.0});
  center.is_virtual = true;
  center.level = 2;
  transaction.AddFeature(center);
  graph.Apply(std::move(transaction));
  const MapDrawing drawing = DrawingFromGraph(graph, {});
  ASSERT_EQ(drawing.points.size(), 2u);
  EXPECT_EQ(drawing.points[1], Eigen::Vector2d(9.0, 2.0));
  ASSERT_EQ(drawing.centers.size(), 1u);
  EXPECT_EQ(drawing.centers[0], Eigen::Vector2d(5.0, 8.0));
  WriteMapPng(drawing, File("map.png"));
  const Picture picture(File("map.png"));
  constexpr int kCircleColor = 0xE69F00;
  // The cross is in the middle at the top, its entry in the legend below.
  EXPECT_GT(picture.Count(kCircleColor, 0.3, 0.0, 0.7, 0.4), 10);
  EXPECT_EQ(picture.Count(kCircleColor, 0.0, 0.4, 1.0, 0.85), 0);
  EXPECT_GT(picture.Count(kCircleColor, 0.0, 0.85, 1.0, 1.0), 10);
}

TEST_F(MapPictureTest, Rectangles) {
  Graph graph;
  Transaction transaction;
  // 8 m along 0.2 rad, 4 m across; a wall on its left side has the direction
  // across, one below has none.
  Feature rectangle = MakeFeature("rectangle", {5.0, 3.0, 0.2, 4.0, 2.0});
  rectangle.is_virtual = true;
  rectangle.level = 1;
  const FeatureId room = transaction.AddFeature(rectangle);
  const FeatureId left = transaction.AddFeature(
      MakeFeature("segment", {1.0, 3.0, 1.8}, -2.0, 2.0));
  const FeatureId below = transaction.AddFeature(
      MakeFeature("segment", {5.0, 1.0, 0.2}, -4.0, 4.0));
  const FeatureId across =
      transaction.AddFeature(MakeFeature("orientation", {0.2 - kPi / 2}));
  Constraint tie = Tie("rectangle_orientation", room, across);
  tie.expected[0] = kPi / 2;
  transaction.AddConstraint(tie);
  for (const auto& [wall, side] :
       {std::pair(left, -kPi / 2), std::pair(below, 0.0)}) {
    tie = Tie("segment_rectangle", wall, room);
    tie.expected = Eigen::Vector2d(0.0, side);
    tie.information = Eigen::Matrix2d::Identity();
    transaction.AddConstraint(tie);
  }
  graph.Apply(std::move(transaction));
  MapDrawing drawing = DrawingFromGraph(graph, {});
  ASSERT_EQ(drawing.rectangles.size(), 1u);
  EXPECT_EQ(drawing.rectangles[0].x, 5.0);
  EXPECT_EQ(drawing.rectangles[0].direction, 0.2);
  EXPECT_EQ(drawing.rectangles[0].half_length, 4.0);
  EXPECT_EQ(drawing.rectangles[0].half_width, 2.0);
  ASSERT_EQ(drawing.walls.size(), 2u);
  EXPECT_EQ(drawing.walls[0].cluster, 0);
  EXPECT_EQ(drawing.walls[1].cluster, -1);

  // Alone: it fills the page, and its corners at two opposite ends of the sides
  // are farthest right and up.
  drawing.walls.clear();
  WriteMapPng(drawing, File("map.png"));
  const Picture picture(File("map.png"));
  constexpr int kRectangleColor = 0xFBF4DC;
  EXPECT_EQ(picture.at(picture.width() / 2, picture.height() / 2),
            kRectangleColor);
  EXPECT_EQ(picture.Count(kRectangleColor, 0.02, 0.02, 0.08, 0.08), 0);
  const double area = picture.Count(kRectangleColor, 0.0, 0.0, 1.0, 0.9) /
                      (static_cast<double>(picture.width()) * picture.height());
  // 32 m^2 in a box of 8.63 m times 5.51 m and its margins.
  EXPECT_GT(area, 0.45);
  EXPECT_LT(area, 0.67);
  // In the legend.
  EXPECT_GT(picture.Count(kRectangleColor, 0.0, 0.92, 1.0, 1.0), 100);
}

}  // namespace
}  // namespace plumbline
