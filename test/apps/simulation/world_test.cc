#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/apps/simulation/world.h>
#include <plumbline/apps/simulation/world_file.h>
#include <plumbline/core/error.h>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <string>

namespace plumbline {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

World ReadText(const std::string& text) {
  std::istringstream input(text);
  return ReadWorld(input, "test.world");
}

std::string ErrorOf(const std::string& text) {
  try {
    ReadText(text);
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

std::string Text(const World& world) {
  std::ostringstream output;
  WriteWorld(world, output);
  return output.str();
}

TEST(SimulationRandomTest, DrawsAreThoseOfTheStandardsEngine) {
  SimulationRandom random(5489);
  // The 1st output of mt19937_64 with its default seed 5489 is
  // 14514284786278117030; its upper 53 bits over 2^53.
  EXPECT_DOUBLE_EQ(random.Uniform(0.0, 1.0), 14514284786278117030.0 / 0x1p64);
}

TEST(SimulationRandomTest, GaussianHasMeanZeroAndVarianceOne) {
  SimulationRandom random(1);
  double sum = 0.0;
  double squares = 0.0;
  constexpr int kCount = 100000;
  for (int i = 0; i < kCount; ++i) {
    const double value = random.Gaussian();
    ASSERT_LE(std::abs(value), 6.0);
    sum += value;
    squares += value * value;
  }
  EXPECT_NEAR(sum / kCount, 0.0, 0.015);
  EXPECT_NEAR(squares / kCount, 1.0, 0.02);
}

TEST(WorldTest, ReadsEveryKind) {
  const World world = ReadText(
      "# a comment\n"
      "wall 0 0 10 0\n"
      "wall 0 5 10 5 0.2   # thick\n"
      "\n"
      "circle 1 2 0.3\n"
      "arc 4 5 6 30 120\n"
      "box 1 1 2 0.5 45\n"
      "path 1 2 3 4\n"
      "path 5 6\n");
  ASSERT_EQ(world.walls.size(), 2u);
  EXPECT_EQ(world.walls[0].thickness, 0.0);
  EXPECT_EQ(world.walls[1].thickness, 0.2);
  EXPECT_EQ(world.walls[1].end, Eigen::Vector2d(10, 5));
  ASSERT_EQ(world.circles.size(), 2u);
  EXPECT_EQ(world.circles[0].sweep_deg, 360.0);
  EXPECT_EQ(world.circles[1].begin_deg, 30.0);
  EXPECT_EQ(world.circles[1].sweep_deg, 90.0);
  ASSERT_EQ(world.boxes.size(), 1u);
  EXPECT_EQ(world.boxes[0].angle_deg, 45.0);
  EXPECT_THAT(world.path,
              ElementsAre(Eigen::Vector2d(1, 2), Eigen::Vector2d(3, 4),
                          Eigen::Vector2d(5, 6)));
}

TEST(WorldTest, ErrorsNameFileAndLine) {
  EXPECT_EQ(ErrorOf("wall 0 0 1 1\nwall 0 0 x 1\n"),
            "test.world:2: 'x' is not a number: expected a finite number");
  EXPECT_THAT(ErrorOf("wall 0 0 1\n"),
              HasSubstr("test.world:1: bad 'wall': expected wall x1 y1 x2 y2"));
  EXPECT_THAT(ErrorOf("wall 1 1 1 1\n"), HasSubstr("two different points"));
  EXPECT_THAT(ErrorOf("wall 0 0 1 1 -1\n"), HasSubstr("thickness"));
  EXPECT_THAT(ErrorOf("circle 0 0 0\n"), HasSubstr("radius above 0"));
  EXPECT_THAT(ErrorOf("arc 0 0 1 90 90\n"), HasSubstr("bad 'arc'"));
  EXPECT_THAT(ErrorOf("arc 0 0 1 0 361\n"), HasSubstr("bad 'arc'"));
  EXPECT_THAT(ErrorOf("box 0 0 1 0 0\n"), HasSubstr("sides above 0"));
  EXPECT_THAT(ErrorOf("path 1\n"), HasSubstr("bad 'path'"));
  EXPECT_THAT(ErrorOf("path\n"), HasSubstr("bad 'path'"));
  EXPECT_THAT(ErrorOf("circle 0 0 nan\n"), HasSubstr("'nan' is not a number"));
  EXPECT_THAT(ErrorOf("circle 0 0 1e999\n"), HasSubstr("is not a number"));
  EXPECT_THAT(ErrorOf("wall 0 0 1 0\npath 0 1 1e300 1\n"),
              HasSubstr("test.world:2: '1e300' is absurd"));
  EXPECT_THAT(ErrorOf("doorway 0 0 0 0\n"), HasSubstr("two different points"));
  EXPECT_THAT(ErrorOf("doorway 0 0 1\n"), HasSubstr("bad 'doorway'"));
  EXPECT_THAT(ErrorOf("house 1 2\n"),
              HasSubstr("test.world:1: 'house' is unknown"));
  EXPECT_THAT(ErrorOf("wall 0 0 9 0\n\ndoor 5 1 0.9\n"),
              HasSubstr("test.world:3: the door is in no wall"));
}

TEST(WorldTest, DoorsCutGapsWhereverTheyStandInTheFile) {
  const World world =
      ReadText("door 4 0.05 1\nwall 0 0 10 0 0.2\nwall 0 3 10 3\n");
  ASSERT_EQ(world.walls.size(), 3u);
  EXPECT_NEAR(world.walls[0].end.x(), 3.5, 1e-12);
  EXPECT_NEAR(world.walls[1].begin.x(), 4.5, 1e-12);
  EXPECT_EQ(world.walls[1].end.x(), 10.0);
  EXPECT_EQ(world.walls[2].begin.y(), 3.0);
}

TEST(WorldTest, DoorAtTheEndLeavesNoStump) {
  World world = ReadText("wall 0 0 1 0\n");
  EXPECT_EQ(CutDoor({0.5, 0.0}, 2.0, &world), 1);
  EXPECT_TRUE(world.walls.empty());
  EXPECT_EQ(CutDoor({0.5, 0.0}, 2.0, &world), 0);
}

TEST(WorldTest, WritesWhatItReads) {
  const std::string text =
      Text(ReadText("wall 0 0 10 0.5 0.2\ncircle 1 2 0.3\narc 4 5 6 30 120\n"
                    "box 1 1 2 0.5 45\npath 1 2\npath 3 4\n"));
  EXPECT_THAT(text, HasSubstr("arc 4.000000 5.000000 6.000000 30.000000 "
                              "120.000000\n"));
  EXPECT_EQ(Text(ReadText(text)), text);
}

TEST(WorldTest, SurfacesOfAThickWall) {
  const WorldSurfaces surfaces = MakeSurfaces(ReadText("wall 0 0 10 0 0.2\n"));
  ASSERT_EQ(surfaces.faces.size(), 4u);
  // Both sides first, then the ends, which have no orientation of their own.
  EXPECT_TRUE(surfaces.faces[0].begin.isApprox(Eigen::Vector2d(0, -0.1)));
  EXPECT_TRUE(surfaces.faces[0].end.isApprox(Eigen::Vector2d(10, -0.1)));
  EXPECT_TRUE(surfaces.faces[1].begin.isApprox(Eigen::Vector2d(10, 0.1)));
  EXPECT_TRUE(surfaces.faces[2].begin.isApprox(Eigen::Vector2d(10, -0.1)));
  EXPECT_TRUE(surfaces.faces[2].end.isApprox(Eigen::Vector2d(10, 0.1)));
  EXPECT_THAT(surfaces.orientations_deg, ElementsAre(0.0));
  EXPECT_EQ(surfaces.faces[0].orientation, 0);
  EXPECT_EQ(surfaces.faces[1].orientation, 0);
  EXPECT_EQ(surfaces.faces[2].orientation, -1);
}

TEST(WorldTest, OrientationsAreAxialAndClutterHasNone) {
  const WorldSurfaces surfaces = MakeSurfaces(
      ReadText("wall 0 0 0 5\nwall 0 5 0 0\nwall 4 4 0 0\nbox 9 9 1 1 0\n"));
  ASSERT_EQ(surfaces.orientations_deg.size(), 2u);
  EXPECT_NEAR(surfaces.orientations_deg[0], 45.0, 1e-9);
  EXPECT_NEAR(surfaces.orientations_deg[1], 90.0, 1e-9);
  ASSERT_EQ(surfaces.faces.size(), 7u);
  EXPECT_EQ(surfaces.faces[0].orientation, 1);
  EXPECT_EQ(surfaces.faces[1].orientation, 1);
  EXPECT_EQ(surfaces.faces[2].orientation, 0);
  EXPECT_EQ(surfaces.faces[3].orientation, -1);
  EXPECT_TRUE(surfaces.faces[3].begin.isApprox(Eigen::Vector2d(8.5, 8.5)));
}

TEST(WorldTest, RotationTurnsEverything) {
  World world =
      ReadText("wall 1 0 2 0\narc 0 3 1 10 20\nbox 1 0 2 1 5\npath 1 0 0 2\n");
  RotateWorld(90.0, &world);
  EXPECT_NEAR((world.walls[0].end - Eigen::Vector2d(0, 2)).norm(), 0, 1e-12);
  EXPECT_NEAR((world.circles[0].center - Eigen::Vector2d(-3, 0)).norm(), 0,
              1e-12);
  EXPECT_EQ(world.circles[0].begin_deg, 100.0);
  EXPECT_EQ(world.boxes[0].angle_deg, 95.0);
  EXPECT_NEAR((world.path[1] - Eigen::Vector2d(-2, 0)).norm(), 0, 1e-12);
}

}  // namespace
}  // namespace plumbline
