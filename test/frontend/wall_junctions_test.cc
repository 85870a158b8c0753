#include <gtest/gtest.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/wall.h>
#include <plumbline/frontend/wall_junctions.h>

#include <cmath>

namespace plumbline {
namespace {

// Two walls that meet at the origin, the first along x from -10 m, the second
// turned by an angle; the edge between them is where the test says.
class WallJunctionsTest : public ::testing::Test {
 protected:
  WallJunctionsTest() { RegisterBuiltinRelations(&registry_); }

  FeatureId AddWall(const Pose2& pose, double begin, double end) {
    Transaction transaction;
    Feature feature;
    feature.type = &registry_.GetFeature("segment");
    feature.parameters = {pose[0], pose[1], pose[2]};
    feature.extent_begin = begin;
    feature.extent_end = end;
    transaction.AddFeature(feature);
    return graph_.Apply(std::move(transaction)).features[0];
  }

  double End(FeatureId id) const { return graph_.GetFeature(id).extent_end; }
  double Begin(FeatureId id) const {
    return graph_.GetFeature(id).extent_begin;
  }
  int Move() { return MoveWallJunctions(WallJunctionOptions(), &graph_); }

  Registry registry_;
  Graph graph_;
};

TEST_F(WallJunctionsTest, TheEdgeIsWhereTheLinesIntersect) {
  const double turn = DegToRad(1.0);
  // The second has taken 3 m of the first. Its frame is in its middle.
  const FeatureId first = AddWall(Pose2(-6.0, 0.0, 0.0), -4.0, 3.0);
  const FeatureId second = AddWall(
      Pose2(5.0 * std::cos(turn), 5.0 * std::sin(turn), turn), -8.0, 5.0);
  EXPECT_EQ(Move(), 1);
  EXPECT_NEAR(End(first), 6.0, 1e-9);
  EXPECT_NEAR(Begin(second), -5.0, 1e-9);
  EXPECT_EQ(Begin(first), -4.0);
  EXPECT_EQ(End(second), 5.0);
  EXPECT_EQ(Move(), 0);
}

TEST_F(WallJunctionsTest, EitherWallGivesAndBothTurns) {
  double y = 0.0;
  for (const double degrees : {-4.0, 2.0}) {
    y += 50.0;
    const double turn = DegToRad(degrees);
    // The first has taken 1 m of the second, which lies 0.07 m off it there.
    const FeatureId first = AddWall(Pose2(0.0, y, 0.0), -8.0, 1.0);
    const FeatureId second = AddWall(Pose2(0.0, y, turn), 1.1, 9.0);
    EXPECT_EQ(Move(), 1);
    EXPECT_NEAR(End(first), 0.0, 1e-9);
    EXPECT_NEAR(Begin(second), 0.0, 1e-9);
  }
}

TEST_F(WallJunctionsTest, MovingTheWorldMakesNoDifference) {
  const Pose2 moved(120.0, -70.0, 2.5);
  const FeatureId first = AddWall(Compose(moved, Pose2(0, 0, 0)), -8.0, -2.0);
  const FeatureId second =
      AddWall(Compose(moved, Pose2(0, 0, DegToRad(1.5))), -1.9, 9.0);
  EXPECT_EQ(Move(), 1);
  EXPECT_NEAR(End(first), 0.0, 1e-6);
  EXPECT_NEAR(Begin(second), 0.0, 1e-6);
}

TEST_F(WallJunctionsTest, WhatIsNoEdgeStays) {
  const double turn = DegToRad(1.0);
  // A doorway in between; a step; a right angle; the other side; the same
  // direction; a part that lies too far off to be confused.
  AddWall(Pose2(0.0, 0.0, 0.0), -8.0, -2.0);
  AddWall(Pose2(0.0, 0.0, turn), -1.1, 9.0);
  AddWall(Pose2(0.0, 50.0, 0.0), -8.0, -2.0);
  AddWall(Pose2(0.0, 50.3, turn), -1.9, 9.0);
  AddWall(Pose2(0.0, 100.0, 0.0), -8.0, -0.1);
  AddWall(Pose2(0.0, 100.0, 0.5 * kPi), 0.0, 9.0);
  AddWall(Pose2(0.0, 150.0, 0.0), -8.0, -2.0);
  AddWall(Pose2(0.0, 150.0, turn + kPi), -9.0, 1.9);
  AddWall(Pose2(0.0, 200.0, 0.0), -8.0, -2.0);
  AddWall(Pose2(0.0, 200.0, DegToRad(0.05)), -1.9, 9.0);
  AddWall(Pose2(0.0, 250.0, 0.0), -8.0, -2.0);
  AddWall(Pose2(0.0, 250.0, DegToRad(10.0)), -1.9, 9.0);
  EXPECT_EQ(Move(), 0);
}

TEST_F(WallJunctionsTest, NoWallIsUsedUp) {
  AddWall(Pose2(0.0, 0.0, 0.0), -2.4, -2.0);
  AddWall(Pose2(-2.2, 0.0, DegToRad(1.0)), 0.3, 9.0);
  EXPECT_EQ(Move(), 0);
}

TEST_F(WallJunctionsTest, NothingToDo) {
  EXPECT_EQ(Move(), 0);
  AddWall(Pose2(0.0, 0.0, 0.0), -8.0, 1.0);
  EXPECT_EQ(Move(), 0);
}

}  // namespace
}  // namespace plumbline
