#include <gtest/gtest.h>
#include <plumbline/apps/simulation/building.h>
#include <plumbline/apps/simulation/building_clutter.h>
#include <plumbline/apps/simulation/building_tour.h>
#include <plumbline/apps/simulation/world_file.h>
#include <plumbline/core/error.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

std::string FileOf(const World& world) {
  std::ostringstream output;
  WriteWorld(world, output);
  return output.str();
}

TEST(BuildingTest, OfficeHasAnObliqueWingColumnsAndFurniture) {
  const World world = MakeWorld("office", 3, 1.0);
  const WorldSurfaces surfaces = MakeSurfaces(world);
  ASSERT_EQ(surfaces.orientations_deg.size(), 4u);
  EXPECT_NEAR(surfaces.orientations_deg[0], -60.0, 1e-6);
  EXPECT_NEAR(surfaces.orientations_deg[1], 0.0, 1e-6);
  EXPECT_NEAR(surfaces.orientations_deg[2], 30.0, 1e-6);
  EXPECT_NEAR(surfaces.orientations_deg[3], 90.0, 1e-6);
  EXPECT_EQ(world.circles.size(), 4u);
  EXPECT_GT(world.boxes.size(), 10u);
  EXPECT_GT(world.path.size(), 8u);
}

TEST(BuildingTest, SeedDrawsTheDimensionsAndNothingElseDoes) {
  EXPECT_EQ(FileOf(MakeWorld("office", 3, 1.0)),
            FileOf(MakeWorld("office", 3, 1.0)));
  EXPECT_NE(FileOf(MakeWorld("office", 3, 1.0)),
            FileOf(MakeWorld("office", 4, 1.0)));
}

TEST(BuildingTest, EqualIntervalsMakeASymmetricGrid) {
  BuildingOptions options;
  options.block_length = {13.0, 13.0};
  options.block_height = {11.0, 11.0};
  options.visited_share = 0.0;
  options.hall_length = 0.0;
  options.wing_length = 0.0;
  const World world = MakeBuilding(options, 1);
  double right = 0.0;
  double top = 0.0;
  for (const Eigen::Vector2d& point : world.path) {
    right = std::max(right, point.x());
    top = std::max(top, point.y());
  }
  EXPECT_EQ(right, 26.0);
  EXPECT_EQ(top, 11.0);
}

TEST(BuildingTest, KillianLikeHasLongLoops) {
  const World world = MakeWorld("killian_like", 1, 1.0);
  double way = 0.0;
  for (std::size_t i = 1; i < world.path.size(); ++i) {
    way += (world.path[i] - world.path[i - 1]).norm();
  }
  EXPECT_GT(way, 900.0);
  EXPECT_LT(way, 2500.0);
}

TEST(BuildingTest, SizeMultipliesTheBlocks) {
  EXPECT_GT(MakeWorld("office", 1, 2.0).walls.size(),
            2 * MakeWorld("office", 1, 1.0).walls.size());
  EXPECT_FALSE(MakeWorld("office", 1, 0.1).walls.empty());
}

TEST(BuildingTest, RefusesWhatItCannotBuild) {
  EXPECT_THROW(MakeWorld("castle", 1, 1.0), Error);
  EXPECT_THROW(MakeWorld("office", 1, 0.0), Error);
  EXPECT_THROW(MakeWorld("office", 1, std::nan("")), Error);
  BuildingOptions options;
  options.wing_angle_deg = 80.0;
  EXPECT_THROW(MakeBuilding(options, 1), Error);
  options = {};
  options.wing_length = 3.0;
  EXPECT_THROW(MakeBuilding(options, 1), Error);
  options = {};
  options.block_height = {5.0, 5.0};
  EXPECT_THROW(MakeBuilding(options, 1), Error);
  options = {};
  options.columns = 0;
  EXPECT_THROW(MakeBuilding(options, 1), Error);
}

TEST(BuildingTest, BlocksOfASymmetricBuildingAreAlike) {
  BuildingOptions options = SymmetricOptions();
  options.block_length = {14.0, 14.0};
  options.block_height = {11.0, 11.0};
  const World world = MakeBuilding(options, 2);
  const auto is_there = [&world](const Eigen::Vector2d& begin,
                                 const Eigen::Vector2d& end) {
    return std::any_of(world.walls.begin(), world.walls.end(),
                       [&](const WorldWall& wall) {
                         return (wall.begin - begin).norm() < 1e-9 &&
                                (wall.end - end).norm() < 1e-9;
                       });
  };
  // Walls well inside the first block are in all others, too.
  int inside = 0;
  for (const WorldWall& wall : world.walls) {
    const Eigen::Vector2d low = wall.begin.cwiseMin(wall.end);
    const Eigen::Vector2d high = wall.begin.cwiseMax(wall.end);
    if (low.x() < 0.5 || high.x() > 13.5 || low.y() < 0.5 || high.y() > 10.5) {
      continue;
    }
    ++inside;
    for (int column = 0; column < 3; ++column) {
      for (int row = 0; row < 2; ++row) {
        const Eigen::Vector2d shift(14.0 * column, 11.0 * row);
        EXPECT_TRUE(is_there(wall.begin + shift, wall.end + shift))
            << wall.begin.transpose() << " in block " << column << " " << row;
      }
    }
  }
  EXPECT_GT(inside, 10);
  // An office has no two blocks alike.
  options.identical_blocks = false;
  const World office = MakeBuilding(options, 2);
  EXPECT_NE(office.walls.size(), world.walls.size());
}

TEST(BuildingTourTest, VisitsLieOnTheWay) {
  BuildingVisit near;
  near.junction = {2.0, 0.0};
  near.excursion = {{2.0, 3.0}};
  BuildingVisit far;
  far.junction = {8.0, 0.0};
  far.excursion = {{8.0, -3.0}, {9.0, -3.0}, {8.0, -3.0}};
  BuildingVisit elsewhere;
  elsewhere.junction = {5.0, 1.0};
  std::vector<BuildingVisit> visits = {far, near, elsewhere};
  std::vector<Eigen::Vector2d> path;
  WalkCorridor({0.0, 0.0}, {10.0, 0.0}, &visits, &path);
  // In the order of the way, not of the list.
  ASSERT_EQ(path.size(), 9u);
  EXPECT_EQ(path[1], Eigen::Vector2d(2.0, 3.0));
  EXPECT_EQ(path[5], Eigen::Vector2d(9.0, -3.0));
  EXPECT_EQ(path.back(), Eigen::Vector2d(10.0, 0.0));
  EXPECT_TRUE(visits[0].done);
  EXPECT_FALSE(visits[2].done);
  // Once is enough.
  path.clear();
  WalkCorridor({10.0, 0.0}, {0.0, 0.0}, &visits, &path);
  EXPECT_EQ(path.size(), 1u);
}

TEST(BuildingTourTest, EveryCorridorFromEndToEnd) {
  const std::vector<double> xs = {0.0, 10.0, 25.0};
  const std::vector<double> ys = {0.0, 8.0, 20.0};
  const std::vector<Eigen::Vector2d> path = TourCorridors(xs, ys, {});
  const auto leads = [&path](const Eigen::Vector2d& a,
                             const Eigen::Vector2d& b) {
    for (std::size_t i = 1; i < path.size(); ++i) {
      if ((path[i - 1] == a && path[i] == b) ||
          (path[i - 1] == b && path[i] == a)) {
        return true;
      }
    }
    return false;
  };
  for (const double y : ys) EXPECT_TRUE(leads({0.0, y}, {25.0, y})) << y;
  for (const double x : xs) EXPECT_TRUE(leads({x, 0.0}, {x, 20.0})) << x;
  for (std::size_t i = 1; i < path.size(); ++i) {
    EXPECT_GT((path[i] - path[i - 1]).norm(), 1e-6);
  }
}

// A corridor of 2 m x 40 m with a wall on the left only, and a room.
World OneCorridor(ClutterPlaces* places) {
  World world;
  world.walls = {{{0.0, 1.1}, {40.0, 1.1}, 0.2}};
  world.path = {{0.0, 0.0}, {40.0, 0.0}};
  places->half_width = 1.0;
  places->wall_thickness = 0.2;
  places->corridors = {{{0.0, 0.0}, {40.0, 0.0}}};
  BuildingRoom room;
  room.corner = {0.0, 1.2};
  room.width = 40.0;
  room.depth = 6.0;
  places->rooms = {room};
  return world;
}

TEST(BuildingClutterTest, StandsWhereItIsInNobodysWay) {
  ClutterPlaces places;
  World world = OneCorridor(&places);
  places.doors = {{20.0, 1.1}};
  BuildingOptions options;
  options.furniture = 40;
  options.corridor_clutter = 8.0;
  SimulationRandom random(1);
  AddClutter(options, places, &random, &world);
  int in_room = 0;
  int in_corridor = 0;
  for (const WorldBox& box : world.boxes) {
    (box.center.y() > 1.2 ? in_room : in_corridor) += 1;
    // Clear of the robot and the door, and at the side that has a wall.
    EXPECT_GT(box.center.y() - box.width / 2, 0.55);
    EXPECT_GT((box.center - places.doors[0]).norm(), 0.7);
  }
  EXPECT_GT(in_room, 5);
  EXPECT_GT(in_corridor, 2);
  for (std::size_t i = 0; i < world.boxes.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      EXPECT_GT((world.boxes[i].center - world.boxes[j].center).norm(), 0.5);
    }
  }
}

TEST(BuildingClutterTest, NoneWhereNoneIsAskedFor) {
  ClutterPlaces places;
  World world = OneCorridor(&places);
  BuildingOptions options;
  options.furniture = 0;
  options.corridor_clutter = 0.0;
  SimulationRandom random(1);
  AddClutter(options, places, &random, &world);
  EXPECT_TRUE(world.boxes.empty());
}

}  // namespace
}  // namespace plumbline
