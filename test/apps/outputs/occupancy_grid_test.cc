#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/error.h>
#include <plumbline/outputs/occupancy_grid.h>
#include <unistd.h>

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <random>
#include <set>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

using Eigen::Vector2d;
using ::testing::HasSubstr;

// -- A reader written to the documentation of map_server (wiki.ros.org) and of
// nav2_map_server: the map of a YAML file and its picture.

enum class Cell { kFree, kOccupied, kUnknown };

struct RosMap {
  int width = 0;
  int height = 0;
  double resolution = 0.0;
  double origin[3] = {0.0, 0.0, 0.0};
  // In the order of nav_msgs/OccupancyGrid: lower left first, row by row.
  std::vector<Cell> data;

  Cell At(double x, double y) const {
    const int column =
        static_cast<int>(std::floor((x - origin[0]) / resolution));
    const int row = static_cast<int>(std::floor((y - origin[1]) / resolution));
    EXPECT_TRUE(column >= 0 && column < width && row >= 0 && row < height);
    return data[static_cast<std::size_t>(row) * width + column];
  }
};

// Netpbm's raw PGM: magic, width, height, maximum, one white space, bytes;
// comments go from # to the end of the line.
std::vector<int> ReadPgm(std::istream& file, int* width, int* height,
                         int* maximum) {
  const auto token = [&file] {
    std::string text;
    while (file >> text && text[0] == '#') std::getline(file, text);
    return text;
  };
  EXPECT_EQ(token(), "P5");
  *width = std::stoi(token());
  *height = std::stoi(token());
  *maximum = std::stoi(token());
  file.get();
  std::vector<int> values;
  for (int c = file.get(); c != EOF; c = file.get()) values.push_back(c);
  return values;
}

RosMap ReadRosMap(const std::filesystem::path& yaml) {
  std::map<std::string, std::string> entries;
  std::ifstream file(yaml);
  EXPECT_TRUE(file) << yaml;
  std::string line;
  while (std::getline(file, line)) {
    const std::size_t colon = line.find(": ");
    EXPECT_NE(colon, std::string::npos) << line;
    entries[line.substr(0, colon)] = line.substr(colon + 2);
  }
  for (const char* key : {"image", "resolution", "origin", "negate",
                          "occupied_thresh", "free_thresh"}) {
    EXPECT_EQ(entries.count(key), 1u) << key;
  }
  RosMap map;
  map.resolution = std::stod(entries["resolution"]);
  EXPECT_EQ(std::sscanf(entries["origin"].c_str(), "[%lf, %lf, %lf]",
                        &map.origin[0], &map.origin[1], &map.origin[2]),
            3);
  const bool negate = entries["negate"] == "1";
  const double occupied = std::stod(entries["occupied_thresh"]);
  const double free = std::stod(entries["free_thresh"]);
  // Left out, it is trinary.
  entries.emplace("mode", "trinary");
  EXPECT_EQ(entries["mode"], "trinary");

  // The image's place is relative to the YAML file.
  std::ifstream picture(yaml.parent_path() / entries["image"],
                        std::ios::binary);
  EXPECT_TRUE(picture);
  int maximum = 0;
  const std::vector<int> values =
      ReadPgm(picture, &map.width, &map.height, &maximum);
  EXPECT_EQ(maximum, 255);
  EXPECT_EQ(values.size(), static_cast<std::size_t>(map.width) * map.height);
  map.data.resize(values.size());
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      // The top row of the picture has the largest y.
      const int value =
          values[static_cast<std::size_t>(map.height - 1 - y) * map.width + x];
      const double p = negate ? value / 255.0 : (255 - value) / 255.0;
      map.data[static_cast<std::size_t>(y) * map.width + x] =
          p > occupied ? Cell::kOccupied
          : p < free   ? Cell::kFree
                       : Cell::kUnknown;
    }
  }
  return map;
}

// -- Scans --------------------------------------------------------------------

Scan MakeScan(double start_degrees, double step_degrees,
              const std::vector<float>& ranges) {
  Scan scan;
  scan.start_angle = DegToRad(start_degrees);
  scan.angle_step = DegToRad(step_degrees);
  scan.maximum_range = 80.0;
  scan.ranges = ranges;
  return scan;
}

// What a laser at (x, y) sees all around in a room from (0, 0) to (6, 4).
Scan RoomScan(double x, double y) {
  std::vector<float> ranges;
  for (int i = 0; i < 720; ++i) {
    const double angle = DegToRad(-180.0 + 0.5 * i);
    const double c = std::cos(angle);
    const double s = std::sin(angle);
    const double to_x = c > 1e-9 ? (6.0 - x) / c : c < -1e-9 ? -x / c : 1e9;
    const double to_y = s > 1e-9 ? (4.0 - y) / s : s < -1e-9 ? -y / s : 1e9;
    ranges.push_back(static_cast<float>(std::min(to_x, to_y)));
  }
  return MakeScan(-180.0, 0.5, ranges);
}

// Rows from the top, '#' occupied, '.' free, ' ' unknown.
std::string Picture(const OccupancyGrid& grid) {
  std::string text;
  for (int row = grid.height() - 1; row >= 0; --row) {
    for (int column = 0; column < grid.width(); ++column) {
      switch (grid.Pixel(column, row)) {
        case OccupancyGrid::kOccupied:
          text += '#';
          break;
        case OccupancyGrid::kFree:
          text += '.';
          break;
        default:
          text += ' ';
      }
    }
    text += '\n';
  }
  return text;
}

OccupancyOptions Coarse() {
  OccupancyOptions options;
  options.resolution = 1.0;
  options.border = 0;
  options.min_hits = 1;
  return options;
}

TEST(OccupancyGridTest, RaysClearTheirWayAndHitTheirEnd) {
  OccupancyGrid grid(Vector2d(0, 0), Vector2d(5.5, 3.5), Coarse());
  EXPECT_EQ(grid.width(), 6);
  EXPECT_EQ(grid.height(), 4);
  // Two beams from (0.5, 0.5): along x to (4.5, 0.5), along y to (0.5, 2.5).
  grid.AddScan(MakeScan(0.0, 90.0, {4.0f, 2.0f}), Pose2(0.5, 0.5, 0.0));
  EXPECT_EQ(Picture(grid),
            "      \n"
            "#     \n"
            ".     \n"
            "....# \n");
  // Turned by the pose and moved by the laser's place on the robot: from (3.5,
  // 3.5) down to (3.5, 1.5).
  Scan scan = MakeScan(0.0, 1.0, {2.0f});
  scan.laser_offset = Pose2(1.0, 0.0, DegToRad(-90.0));
  grid.AddScan(scan, Pose2(2.5, 3.5, 0.0));
  EXPECT_EQ(Picture(grid),
            "   .  \n"
            "#  .  \n"
            ".  #  \n"
            "....# \n");
}

TEST(OccupancyGridTest, SlantedRaysLeaveNoHoles) {
  OccupancyGrid grid(Vector2d(0, 0), Vector2d(9.5, 9.5), Coarse());
  // 3-4-5: from (0.5, 0.5) to (8.5, 6.5), a row for 4/3 of a column; where
  // two rows are as near, the upper one.
  grid.AddScan(MakeScan(RadToDeg(std::atan2(3.0, 4.0)), 1.0, {10.0f}),
               Pose2(0.5, 0.5, 0.0));
  EXPECT_EQ(Picture(grid),
            "          \n"
            "          \n"
            "          \n"
            "        # \n"
            "      ..  \n"
            "     .    \n"
            "    .     \n"
            "  ..      \n"
            " .        \n"
            ".         \n");
}

// Cells that a ray passes on its way by Bresenham's rule, one after the other.
std::set<std::pair<int, int>> CellsOnTheWay(int x, int y, int to_x, int to_y) {
  std::set<std::pair<int, int>> cells;
  const int dx = std::abs(to_x - x);
  const int dy = -std::abs(to_y - y);
  int error = dx + dy;
  while (x != to_x || y != to_y) {
    cells.insert({x, y});
    const int doubled = 2 * error;
    if (doubled >= dy) {
      error += dy;
      x += to_x > x ? 1 : -1;
    }
    if (doubled <= dx) {
      error += dx;
      y += to_y > y ? 1 : -1;
    }
  }
  return cells;
}

// Memory is taken in squares of 64 cells; rays come from inside and outside.
TEST(OccupancyGridTest, RaysPassFromSquareToSquare) {
  std::mt19937 engine(5);
  std::uniform_int_distribution<int> column(-90, 290);
  std::uniform_int_distribution<int> row(-90, 240);
  int seen = 0;
  for (int trial = 0; trial < 300; ++trial) {
    OccupancyOptions options = Coarse();
    options.usable_range = 1000.0;
    OccupancyGrid grid(Vector2d(0, 0), Vector2d(199.5, 149.5), options);
    const int x = column(engine);
    const int y = row(engine);
    const int to_x = column(engine);
    const int to_y = row(engine);
    if (x == to_x && y == to_y) continue;
    const double range = std::hypot(to_x - x, to_y - y);
    const double angle = RadToDeg(std::atan2(to_y - y, to_x - x));
    grid.AddScan(MakeScan(angle, 1.0, {static_cast<float>(range)}),
                 Pose2(x + 0.5, y + 0.5, 0.0));
    const auto way = CellsOnTheWay(x, y, to_x, to_y);
    for (int v = 0; v < grid.height(); ++v) {
      for (int u = 0; u < grid.width(); ++u) {
        const int expected = u == to_x && v == to_y  ? OccupancyGrid::kOccupied
                             : way.count({u, v}) > 0 ? OccupancyGrid::kFree
                                                     : OccupancyGrid::kUnknown;
        ASSERT_EQ(grid.Pixel(u, v), expected)
            << x << ' ' << y << " to " << to_x << ' ' << to_y << " at " << u
            << ' ' << v;
        seen += expected != OccupancyGrid::kUnknown;
      }
    }
    int known = 0;
    std::pair<int, int> last(-1, -1);
    grid.VisitKnown([&](int u, int v, std::uint8_t pixel) {
      EXPECT_EQ(pixel, grid.Pixel(u, v));
      EXPECT_LT(last, std::make_pair(v, u));
      last = {v, u};
      ++known;
    });
    seen -= known;
  }
  EXPECT_EQ(seen, 0);
}

TEST(OccupancyGridTest, NoReturnsAndFarReturns) {
  OccupancyOptions options = Coarse();
  options.usable_range = 3.0;
  OccupancyGrid grid(Vector2d(0, 0), Vector2d(5.5, 1.5), options);
  // The first beam returns from too far, the second not at all, the third from
  // the robot itself.
  grid.AddScan(MakeScan(0.0, 90.0, {5.0f, 0.0f, 0.05f}), Pose2(0.5, 0.5, 0.0));
  EXPECT_EQ(Picture(grid),
            "      \n"
            "....  \n");
}

TEST(OccupancyGridTest, EvidenceIsCountedScanByScan) {
  OccupancyOptions options = Coarse();
  options.min_hits = 2;
  OccupancyGrid grid(Vector2d(0, 0), Vector2d(9.5, 0.5), options);
  const Pose2 pose(0.5, 0.5, 0.0);
  const Scan near = MakeScan(0.0, 1e-4, {4.0f, 4.0f, 4.0f});
  const Scan far = MakeScan(0.0, 1e-4, {8.0f, 8.0f, 8.0f});
  // Three beams of one scan are one hit: no evidence yet.
  grid.AddScan(near, pose);
  EXPECT_EQ(Picture(grid), "....      \n");
  grid.AddScan(near, pose);
  EXPECT_EQ(Picture(grid), "....#     \n");
  // Two hits of eight are a quarter, of nine less.
  for (int i = 0; i < 6; ++i) grid.AddScan(far, pose);
  EXPECT_EQ(Picture(grid), "....#...# \n");
  grid.AddScan(far, pose);
  EXPECT_EQ(Picture(grid), "........# \n");
}

TEST(OccupancyGridTest, CountersDoNotRunOver) {
  OccupancyGrid grid(Vector2d(0, 0), Vector2d(3.5, 0.5), Coarse());
  const Scan scan = MakeScan(0.0, 1.0, {2.0f});
  for (int i = 0; i < 200000; ++i) grid.AddScan(scan, Pose2(0.5, 0.5, 0.0));
  EXPECT_EQ(Picture(grid), "..# \n");
}

TEST(OccupancyGridTest, ThreadsMakeTheSameGrid) {
  // A robot that goes to and fro in a room, with a pillar that it looks past.
  std::vector<Scan> scans;
  std::vector<Pose2> poses;
  for (int i = 0; i < 41; ++i) {
    Scan scan;
    scan.start_angle = -kPi;
    scan.angle_step = DegToRad(2.0);
    for (int beam = 0; beam < 180; ++beam) {
      scan.ranges.push_back(
          static_cast<float>(2.0 + 0.02 * ((beam * 7 + i * 13) % 50)));
    }
    scans.push_back(scan);
    // Stands still where a thread's share ends.
    poses.push_back({0.1 * std::abs(20 - std::min(i, 19)), 0.01 * i, 0.1 * i});
  }
  const OccupancyGrid expected = MakeOccupancyGrid(scans, poses, {});
  for (const int threads : {2, 3, 5}) {
    OccupancyOptions options;
    options.num_threads = threads;
    const OccupancyGrid grid = MakeOccupancyGrid(scans, poses, options);
    ASSERT_EQ(grid.width(), expected.width());
    ASSERT_EQ(grid.height(), expected.height());
    EXPECT_EQ(grid.origin(), expected.origin());
    std::string row, expected_row;
    bool is_free = false;
    for (int i = 0; i < grid.height(); ++i) {
      grid.Row(i, &row);
      expected.Row(i, &expected_row);
      ASSERT_EQ(row, expected_row) << threads << ' ' << i;
      is_free = is_free || row.find(static_cast<char>(OccupancyGrid::kFree)) !=
                               std::string::npos;
    }
    EXPECT_TRUE(is_free);
  }
}

TEST(OccupancyGridTest, WhatLiesOutsideIsLeftOut) {
  OccupancyGrid grid(Vector2d(0, 0), Vector2d(3.5, 0.5), Coarse());
  grid.AddScan(MakeScan(0.0, 180.0, {40.0f, 40.0f}), Pose2(1.5, 0.5, 0.0));
  EXPECT_EQ(Picture(grid), "....\n");
  // From outside through the grid.
  OccupancyGrid other(Vector2d(0, 0), Vector2d(3.5, 0.5), Coarse());
  other.AddScan(MakeScan(0.0, 1.0, {42.0f}), Pose2(-40.5, 0.5, 0.0));
  EXPECT_EQ(Picture(other), ".#  \n");
  other.AddScan(MakeScan(0.0, 1.0, {2.0f}), Pose2(std::nan(""), 0.5, 0.0));
  other.AddScan(MakeScan(0.0, 1.0, {2.0f}), Pose2(1e30, 0.5, 0.0));
  other.AddScan(MakeScan(0.0, 1.0, {std::nanf("")}), Pose2(0.5, 0.5, 0.0));
  EXPECT_EQ(Picture(other), ".#  \n");
}

TEST(OccupancyGridTest, CellsAreAlignedAndHoldBothCorners) {
  OccupancyOptions options;
  options.resolution = 0.25;
  options.border = 2;
  const OccupancyGrid grid(Vector2d(-1.1, 10.3), Vector2d(1.1, 10.3), options);
  EXPECT_EQ(grid.origin()[0], -1.25 - 0.5);
  EXPECT_EQ(grid.origin()[1], 10.25 - 0.5);
  EXPECT_EQ(grid.width(), 10 + 4);
  EXPECT_EQ(grid.height(), 1 + 4);
}

TEST(OccupancyGridTest, SoManyScansInEvenSteps) {
  std::vector<Scan> scans;
  std::vector<Pose2> poses;
  for (int i = 0; i < 5; ++i) {
    scans.push_back(MakeScan(0.0, 1.0, {2.0f}));
    poses.emplace_back(0.5, i + 0.5, 0.0);
  }
  OccupancyOptions options = Coarse();
  EXPECT_EQ(Picture(MakeOccupancyGrid(scans, poses, options)),
            "..#\n..#\n..#\n..#\n..#\n");
  options.max_scans = 3;
  EXPECT_EQ(Picture(MakeOccupancyGrid(scans, poses, options)),
            "..#\n   \n..#\n   \n..#\n");
  options.max_scans = 5;
  EXPECT_EQ(Picture(MakeOccupancyGrid(scans, poses, options)),
            "..#\n..#\n..#\n..#\n..#\n");
}

TEST(OccupancyGridTest, WhatIsSeenThroughAPaneIsNotFree) {
  // Three degrees of what is seen of the room are a pane in its right wall.
  std::vector<Scan> scans;
  std::vector<Pose2> poses;
  for (int i = 0; i < 3; ++i) {
    scans.push_back(RoomScan(3.0, 2.0));
    for (int beam = 357; beam <= 363; ++beam) {
      scans.back().ranges[static_cast<std::size_t>(beam)] = 9.0f;
    }
    poses.emplace_back(3.0, 2.0, 0.0);
  }
  OccupancyOptions options;
  const auto free_beyond = [&] {
    const OccupancyGrid grid = MakeOccupancyGrid(scans, poses, options);
    int free = 0;
    int occupied = 0;
    int inside = 0;
    for (int row = 0; row < grid.height(); ++row) {
      for (int column = 0; column < grid.width(); ++column) {
        const double x = grid.origin()[0] + (column + 0.5) * options.resolution;
        const std::uint8_t pixel = grid.Pixel(column, row);
        free += x > 6.5 && pixel == OccupancyGrid::kFree;
        occupied += x > 6.5 && pixel == OccupancyGrid::kOccupied;
        inside += x < 6.0 && pixel == OccupancyGrid::kFree;
      }
    }
    EXPECT_GT(inside, 9000);
    return free + occupied;
  };
  EXPECT_EQ(free_beyond(), 0);
  options.least_passage = 0.0;
  EXPECT_GT(free_beyond(), 100);
}

TEST(OccupancyGridTest, FewBeamsOfARobotThatStandsAreNoGlimpses) {
  for (const double step : {1.0, 2.0, 4.0}) {
    // A hall of 40 m x 12 m.
    std::vector<float> ranges;
    for (double angle = -180.0; angle < 180.0; angle += step) {
      const double c = std::abs(std::cos(DegToRad(angle)));
      const double s = std::abs(std::sin(DegToRad(angle)));
      ranges.push_back(static_cast<float>(
          std::min(20.0 / std::max(1e-9, c), 6.0 / std::max(1e-9, s))));
    }
    const std::vector<Scan> scans(2, MakeScan(-180.0, step, ranges));
    const std::vector<Pose2> poses(2, Pose2(0.0, 0.0, 0.0));
    OccupancyOptions options;
    const std::string kept = Picture(MakeOccupancyGrid(scans, poses, options));
    options.least_passage = 0.0;
    EXPECT_EQ(kept, Picture(MakeOccupancyGrid(scans, poses, options))) << step;
  }
}

TEST(OccupancyGridTest, TooManyCellsAreRefusedWithWhatWouldDo) {
  OccupancyOptions options;
  options.max_cells = 1000000;
  const Vector2d high(1000.0, 500.0);
  std::string message;
  try {
    OccupancyGrid(Vector2d::Zero(), high, options);
    FAIL() << "made";
  } catch (const Error& error) {
    message = error.what();
  }
  EXPECT_THAT(message, HasSubstr("expected at most 1000000"));
  const std::string words = "cells of ";
  options.resolution =
      std::stod(message.substr(message.rfind(words) + words.size()));
  EXPECT_GT(options.resolution, 0.70);
  EXPECT_LT(options.resolution, 0.80);
  EXPECT_NO_THROW(OccupancyGrid(Vector2d::Zero(), high, options));
  // As thin as a hair.
  options.resolution = 0.001;
  try {
    OccupancyGrid(Vector2d::Zero(), Vector2d(1e5, 0.0), options);
    FAIL() << "made";
  } catch (const Error& error) {
    message = error.what();
  }
  options.resolution =
      std::stod(message.substr(message.rfind(words) + words.size()));
  EXPECT_NO_THROW(OccupancyGrid(Vector2d::Zero(), Vector2d(1e5, 0.0), options));
}

TEST(OccupancyGridTest, NonsenseIsRefused) {
  OccupancyOptions options;
  const double inf = std::numeric_limits<double>::infinity();
  EXPECT_THROW(OccupancyGrid(Vector2d(0, 0), Vector2d(inf, 1), options), Error);
  EXPECT_THROW(OccupancyGrid(Vector2d(1, 0), Vector2d(0, 1), options), Error);
  EXPECT_THROW(MakeOccupancyGrid({}, {}, options), Error);
  EXPECT_THROW(MakeOccupancyGrid({}, {Pose2(0, 0, 0)}, options), Error);
  Scan scan;
  scan.ranges = {1.0f};
  const std::vector<Pose2> one = {Pose2(0, 0, 0)};
  EXPECT_NO_THROW(MakeOccupancyGrid({scan}, one, options));
  EXPECT_THROW(MakeOccupancyGrid({scan, scan}, one, options), Error);
  // Of an interrupted run there are poses as far as it came.
  EXPECT_NO_THROW(GatherOccupancyGrid({scan, scan}, one, options));
  options.resolution = 0.0;
  EXPECT_THROW(OccupancyGrid(Vector2d(0, 0), Vector2d(1, 1), options), Error);
}

TEST(OccupancyGridTest, RosReadsTheRoom) {
  const std::filesystem::path folder =
      std::filesystem::path(::testing::TempDir()) /
      ("occupancy_" + std::to_string(getpid()));
  std::filesystem::create_directories(folder);
  // The room stands at (10, -20) in the map.
  std::vector<Scan> scans;
  std::vector<Pose2> poses;
  for (const double x : {1.0, 2.0, 3.0}) {
    for (const double heading : {0.0, 1.0, -2.0}) {
      scans.push_back(RoomScan(x, 1.5));
      scans.back().start_angle -= heading;
      poses.push_back(Pose2(10.0 + x, -20.0 + 1.5, heading));
    }
  }
  const OccupancyOptions options;
  WriteOccupancyMap(MakeOccupancyGrid(scans, poses, options),
                    (folder / "occupancy").string());
  const RosMap map = ReadRosMap(folder / "occupancy.yaml");
  EXPECT_EQ(map.resolution, 0.05);
  EXPECT_EQ(map.origin[2], 0.0);
  // A wall is where it was seen, to a cell; inside is free, outside unknown.
  int occupied = 0;
  int unseen = 0;
  for (int row = 0; row < map.height; ++row) {
    for (int column = 0; column < map.width; ++column) {
      const double x = map.origin[0] + (column + 0.5) * map.resolution - 10.0;
      const double y = map.origin[1] + (row + 0.5) * map.resolution + 20.0;
      const double inside = std::min({x, 6.0 - x, y, 4.0 - y});
      const Cell cell = map.At(x + 10.0, y - 20.0);
      if (inside > 0.06) {
        EXPECT_NE(cell, Cell::kOccupied) << x << " " << y;
        unseen += cell == Cell::kUnknown;
      } else if (inside < -0.06) {
        EXPECT_EQ(cell, Cell::kUnknown) << x << " " << y;
      } else if (cell == Cell::kOccupied) {
        ++occupied;
      }
    }
  }
  // 20 m of wall in cells of 5 cm are 400.
  EXPECT_GT(occupied, 350);
  EXPECT_LT(occupied, 800);
  // Of 9,600; between two beams in a far corner.
  EXPECT_LT(unseen, 20);
  std::filesystem::remove_all(folder);
  EXPECT_THROW(WriteOccupancyMap(MakeOccupancyGrid(scans, poses, options),
                                 (folder / "occupancy").string()),
               Error);
}

}  // namespace
}  // namespace plumbline
