#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/apps/evaluation/grid_file.h>
#include <plumbline/apps/evaluation/traced_rooms.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "../../refusal.h"

namespace plumbline {
namespace {

using Eigen::Vector2d;
using ::testing::HasSubstr;

// Two rooms of 6 x 4 and 2 x 2.5 m with a wall between, 0.1 m a pixel, in a
// picture of 10 x 6 m.
std::string TwoRooms() {
  std::string first, second;
  for (int row = 10; row < 50; ++row) {
    const std::string run = "[" + std::to_string(row);
    first += (row == 10 ? "" : ",") + run + ",5,64]";
    if (row >= 25) second += (row == 25 ? "" : ",") + run + ",67,86]";
  }
  return R"({"name":"two","metres_per_pixel":0.1,"size":[60,100],"rooms":[)"
         R"({"runs":[)" +
         first + R"(]},{"area_px":500,"runs":[)" + second + "]}]}";
}

TracedRooms ParseRooms(const std::string& text) {
  InputStream input("rooms.json", text);
  return ReadTracedRooms(&input);
}

TEST(ReadTracedRoomsTest, Labels) {
  const TracedRooms rooms = ParseRooms(TwoRooms());
  EXPECT_EQ(rooms.name, "two");
  EXPECT_EQ(rooms.count, 2);
  EXPECT_EQ(rooms.width, 100);
  EXPECT_EQ(rooms.height, 60);
  EXPECT_EQ(std::count(rooms.labels.begin(), rooms.labels.end(), 1), 2400);
  EXPECT_EQ(std::count(rooms.labels.begin(), rooms.labels.end(), 2), 500);
  // Rows of the file run down, those of the labels up.
  const TracedRooms top = ParseRooms(
      R"({"name":"","metres_per_pixel":1,"size":[3,2],
          "rooms":[{"runs":[[0,1,1]]}]})");
  EXPECT_EQ(top.labels, (std::vector<std::uint16_t>{0, 0, 0, 0, 0, 1}));
}

TEST(ReadTracedRoomsTest, BrokenFilesAreNamed) {
  const auto error_of = [](const std::string& members) {
    return Refusal([&] { ParseRooms("{\"name\":\"a\"," + members + "}"); });
  };
  EXPECT_THAT(Refusal([] { ParseRooms("{"); }),
              HasSubstr("rooms.json:1: is no valid JSON"));
  EXPECT_THAT(Refusal([] { ParseRooms("{}"); }),
              HasSubstr("'name' is missing"));
  EXPECT_THAT(error_of(R"("metres_per_pixel":0)"),
              HasSubstr("'metres_per_pixel' is no side of a pixel"));
  EXPECT_THAT(error_of(R"("metres_per_pixel":1,"size":[2])"),
              HasSubstr("'size' has no two elements"));
  EXPECT_THAT(error_of(R"("metres_per_pixel":1,"size":[0,2])"),
              HasSubstr("'size[0]' is no side of a picture"));
  EXPECT_THAT(error_of(R"("metres_per_pixel":1,"size":[60000,60000])"),
              HasSubstr("'size' is too large"));
  const std::string head = R"("metres_per_pixel":1,"size":[4,4],"rooms":)";
  EXPECT_THAT(error_of(head + "[]"), HasSubstr("'rooms' has 0 elements"));
  EXPECT_THAT(error_of(head + R"([{"runs":[]}])"),
              HasSubstr("'rooms[0].runs' is empty"));
  EXPECT_THAT(error_of(head + R"([{"runs":[[0,0]]}])"),
              HasSubstr("'rooms[0].runs[0]' has 2 elements"));
  for (const char* run : {"[4,0,0]", "[-1,0,0]", "[0,2,1]", "[0,0,4]"}) {
    EXPECT_THAT(error_of(head + R"([{"runs":[[0,0,0],)" + run + "]}]"),
                HasSubstr("'rooms[0].runs[1]' lies outside"))
        << run;
  }
  EXPECT_THAT(error_of(head + R"([{"runs":[[0,0,1]]},{"runs":[[0,1,2]]}])"),
              HasSubstr("'rooms[1].runs[0]' has a pixel of room 1"));
}

// What a robot saw of the two rooms, turned, shifted, and 4 % larger; the plan
// knows where they are.
struct Seen {
  SpaceGrid space;
  BuildingPlan plan;
  Vector2d middle = Vector2d(9.3, 7.1);
  double turn = DegToRad(130.0);
  double scale = 1.04;

  Vector2d At(double x, double y) const {
    const Vector2d p = scale * Vector2d(x - 5.0, y - 3.0);
    return middle + Vector2d(std::cos(turn) * p[0] - std::sin(turn) * p[1],
                             std::sin(turn) * p[0] + std::cos(turn) * p[1]);
  }
  // Of the traced frame.
  PlanRoom Room(double x1, double y1, double x2, double y2) const {
    PlanRoom room;
    room.outline.shell = {At(x1, y1), At(x2, y1), At(x2, y2), At(x1, y2)};
    return room;
  }

  Seen() {
    plan.rooms = {Room(0.5, 1.0, 6.5, 5.0), Room(6.7, 1.0, 8.7, 3.5)};
    space.origin = Vector2d(-1.5, -2.2);
    space.width = 340;
    space.height = 320;
    for (int row = 0; row < space.height; ++row) {
      for (int column = 0; column < space.width; ++column) {
        const bool is_inside = std::any_of(
            plan.rooms.begin(), plan.rooms.end(), [&](const PlanRoom& room) {
              return room.outline.Contains(space.Middle(column, row));
            });
        space.cells.push_back(is_inside ? Space::kFree : Space::kUnknown);
      }
    }
  }
};

TEST(TracedRoomsTest, ArePlacedOverFreeSpace) {
  const Seen seen;
  const TracedPlacement placement =
      PlaceTracedRooms(ParseRooms(TwoRooms()), seen.space);
  EXPECT_NEAR(placement.turn, seen.turn, DegToRad(0.6));
  EXPECT_NEAR(placement.scale, seen.scale, 0.011);
  EXPECT_LT((placement.center - seen.middle).norm(), 0.15);
  EXPECT_GT(placement.overlap, 0.95);
  SpaceGrid nothing = seen.space;
  std::fill(nothing.cells.begin(), nothing.cells.end(), Space::kUnknown);
  EXPECT_THAT(
      Refusal([&] { PlaceTracedRooms(ParseRooms(TwoRooms()), nothing); }),
      HasSubstr("nothing in the grid was seen free"));
}

// Pixels of 10 m are within what each file may have.
TEST(TracedRoomsTest, BuildingsOfKilometresAreRefused) {
  TracedRooms rooms = ParseRooms(TwoRooms());
  SpaceGrid grid;
  grid.width = 3000;
  grid.height = 1;
  grid.cells.assign(3000, Space::kFree);
  grid.resolution = 10.0;
  EXPECT_THAT(Refusal([&] { PlaceTracedRooms(rooms, grid); }),
              HasSubstr("is 30000 x 10 m large"));
  grid.resolution = 0.05;
  rooms.metres_per_pixel = 10.0;
  EXPECT_THAT(Refusal([&] { PlaceTracedRooms(rooms, grid); }),
              HasSubstr("picture of the rooms 1000 x 600 m"));
}

TEST(TracedRoomsTest, ManyRoomsAreRefused) {
  TracedRooms rooms = ParseRooms(TwoRooms());
  rooms.count = 65535;
  SpaceGrid grid;
  grid.width = grid.height = 1;
  grid.cells = {Space::kFree};
  BuildingPlan plan;
  plan.rooms.resize(10000);
  EXPECT_THAT(Refusal([&] { EvaluateTracedRooms(plan, rooms, grid); }),
              HasSubstr("lies under 10000 rooms"));
}

TEST(TracedRoomsTest, PlansAreMeasured) {
  Seen seen;
  const TracedRooms rooms = ParseRooms(TwoRooms());
  TracedEvaluation result = EvaluateTracedRooms(seen.plan, rooms, seen.space);
  EXPECT_EQ(result.traced, 2);
  EXPECT_EQ(result.seen, 2);
  EXPECT_EQ(result.found, 2);
  EXPECT_EQ(result.drawn, 2);
  EXPECT_GT(result.mean_iou, 0.9);
  EXPECT_GT(result.precision, 0.97);
  EXPECT_GT(result.recall, 0.95);

  // A third of the large room is cut off, the small one is missing.
  seen.plan.rooms = {seen.Room(0.5, 1.0, 4.5, 5.0),
                     seen.Room(4.5, 1.0, 6.5, 5.0)};
  result = EvaluateTracedRooms(seen.plan, rooms, seen.space);
  EXPECT_EQ(result.found, 1);
  ASSERT_EQ(result.iou.size(), 2u);
  EXPECT_NEAR(result.iou[0], 2.0 / 3.0, 0.05);
  EXPECT_NEAR(result.iou[1], 0.0, 0.05);
  EXPECT_NEAR(result.mean_iou, 1.0 / 3.0, 0.05);

  // Half of the small room was not seen: it is not asked for.
  for (std::size_t i = 0; i < seen.space.cells.size(); ++i) {
    const int row = static_cast<int>(i) / seen.space.width;
    const int column = static_cast<int>(i) % seen.space.width;
    if (seen.Room(6.6, 0.0, 8.8, 2.5)
            .outline.Contains(seen.space.Middle(column, row))) {
      seen.space.cells[i] = Space::kUnknown;
    }
  }
  result = EvaluateTracedRooms(seen.plan, rooms, seen.space);
  EXPECT_EQ(result.seen, 1);
  EXPECT_EQ(result.iou[1], -1.0);
}

// The grid ends where the robot saw nothing more, in the middle of a room.
TEST(TracedRoomsTest, RoomsReachBeyondTheGrid) {
  Seen seen;
  seen.turn = 0.0;
  seen.scale = 1.0;
  // The plan has what was seen of the large room: five of six metres.
  seen.plan.rooms = {seen.Room(1.5, 1.0, 6.5, 5.0),
                     seen.Room(6.7, 1.0, 8.7, 3.5)};
  seen.space.origin = seen.At(1.5, 0.5);
  seen.space.width = 160;
  seen.space.height = 100;
  seen.space.cells.clear();
  for (int row = 0; row < seen.space.height; ++row) {
    for (int column = 0; column < seen.space.width; ++column) {
      const bool is_inside = std::any_of(
          seen.plan.rooms.begin(), seen.plan.rooms.end(),
          [&](const PlanRoom& room) {
            return room.outline.Contains(seen.space.Middle(column, row));
          });
      seen.space.cells.push_back(is_inside ? Space::kFree : Space::kUnknown);
    }
  }
  const TracedEvaluation result =
      EvaluateTracedRooms(seen.plan, ParseRooms(TwoRooms()), seen.space);
  EXPECT_EQ(result.seen, 2);
  ASSERT_EQ(result.iou.size(), 2u);
  EXPECT_NEAR(result.iou[0], 5.0 / 6.0, 0.05);
}

class GridFileTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() /
              ("plumbline_grid_file_" + std::to_string(getpid()));
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  std::string Write(const std::string& name, const std::string& contents) {
    std::ofstream(folder_ / name, std::ios::binary) << contents;
    return (folder_ / name).string();
  }

  std::filesystem::path folder_;
};

TEST_F(GridFileTest, ReadsAMap) {
  Write("map.pgm", std::string("P5\n# made by hand\n3 2\n255\n") +
                       std::string("\x00\xfe\xcd\xfe\xfe\x00", 6));
  const std::string yaml = Write("map.yaml",
                                 "image: map.pgm\nmode: trinary\n"
                                 "resolution: 0.5\norigin: [-1, 2.5, 0]\n"
                                 "negate: 0\noccupied_thresh: 0.65\n"
                                 "free_thresh: 0.196\n");
  const SpaceGrid grid = ReadSpaceGrid(yaml);
  EXPECT_EQ(grid.width, 3);
  EXPECT_EQ(grid.height, 2);
  EXPECT_EQ(grid.resolution, 0.5);
  EXPECT_EQ(grid.origin, Vector2d(-1.0, 2.5));
  EXPECT_EQ(grid.At(0, 1), Space::kOccupied);
  EXPECT_EQ(grid.At(1, 1), Space::kFree);
  EXPECT_EQ(grid.At(2, 1), Space::kUnknown);
  EXPECT_EQ(grid.At(0, 0), Space::kFree);
  EXPECT_EQ(grid.At(2, 0), Space::kOccupied);
}

TEST_F(GridFileTest, BrokenMapsAreNamed) {
  const std::string good = "image: map.pgm\nresolution: 0.5\n";
  const auto error_of = [&](const std::string& yaml, const std::string& pgm) {
    Write("map.pgm", pgm);
    const std::string path = Write("map.yaml", yaml);
    return Refusal([&] { ReadSpaceGrid(path); });
  };
  const std::string origin = "origin: [0, 0, 0]\n";
  EXPECT_THAT(error_of("x: 1\n", ""), HasSubstr("is no map of map_server"));
  EXPECT_THAT(error_of("image: a\nresolution: -1\n", ""),
              HasSubstr("map.yaml:2: 'resolution' is wrong"));
  EXPECT_THAT(error_of(good + "origin: [0, 0, 1]\n", ""),
              HasSubstr("map.yaml:3: 'origin' is wrong"));
  EXPECT_THAT(error_of(good + origin, "P2\n"), HasSubstr("is no PGM"));
  EXPECT_THAT(error_of(good + origin, "P5\n3 x\n"),
              HasSubstr("has no width, height and maximum"));
  EXPECT_THAT(error_of(good + origin, "P5\n3 2\n255\nabcde"),
              HasSubstr("ends early"));
  EXPECT_THAT(error_of(good + origin, "P5\n999999999 2\n255\n"),
              HasSubstr("has no width"));
  EXPECT_THAT(error_of("image: none.pgm\nresolution: 0.5\n" + origin, ""),
              HasSubstr("none.pgm"));
}

}  // namespace
}  // namespace plumbline
