#include <gtest/gtest.h>
#include <plumbline/core/error.h>
#include <plumbline/core/registry.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/detectors/merged_walls.h>
#include <plumbline/detectors/same_wall.h>

#include <cmath>
#include <utility>
#include <vector>

#include "detectors/closed_walls.h"

namespace plumbline {
namespace {

TEST(UnitePiecesTest, ByHand) {
  // 3 m at y = 0 and 1 m at y = 0.04 along x: the line is at y = 0.01.
  const WallPiece united = UnitePieces(
      {{Pose2(10.0, 0.0, 0.0), -2.0, 1.0}, {Pose2(10.5, 0.04, 0.0), 0.0, 1.0}});
  EXPECT_NEAR(united.pose[0], 10.0, 1e-12);
  EXPECT_NEAR(united.pose[1], 0.01, 1e-12);
  EXPECT_NEAR(united.pose[2], 0.0, 1e-12);
  EXPECT_NEAR(united.begin, -2.0, 1e-12);
  EXPECT_NEAR(united.end, 1.5, 1e-12);
}

TEST(UnitePiecesTest, DirectionsAcrossTheCut) {
  // Equal pieces at 179 and -179 degrees are one at 180.
  const WallPiece united =
      UnitePieces({{Pose2(0.0, 0.0, DegToRad(179.0)), -1.0, 1.0},
                   {Pose2(0.0, 0.0, DegToRad(-179.0)), -1.0, 1.0}});
  EXPECT_NEAR(std::abs(united.pose[2]), kPi, 1e-12);
  EXPECT_NEAR(united.end - united.begin, 2.0 * std::cos(DegToRad(1.0)), 1e-12);
}

TEST(UnitePiecesTest, OneAndNone) {
  const WallPiece alone = {Pose2(1.0, 2.0, 3.0), -0.1, 0.2};
  EXPECT_EQ(UnitePieces({alone}).pose, alone.pose);
  EXPECT_THROW(UnitePieces({}), Error);
  // Without any length.
  const WallPiece point = {Pose2(1.0, 2.0, 0.5), 0.0, 0.0};
  EXPECT_TRUE(UnitePieces({point, point}).pose.allFinite());
}

using MergeWallsTest = ClosedWallsTest;

TEST_F(MergeWallsTest, ClosedWallsAreOneByWayOfOthers) {
  const FeatureId a = AddSegment(0.0, 0.0, 4.0);
  const FeatureId other = AddSegment(0.0, 5.0, 2.0);
  const FeatureId b = AddSegment(3.0, 0.02, 4.0);
  const FeatureId c = AddSegment(6.0, -0.02, 4.0);
  Close(a, b);
  const ConstraintId last = Close(b, c);
  std::vector<MergedWall> walls = MergeWalls(graph_);
  ASSERT_EQ(walls.size(), 2u);
  EXPECT_EQ(walls[0].members, (std::vector<FeatureId>{a, b, c}));
  EXPECT_EQ(walls[0].wall.id, a);
  EXPECT_EQ(walls[0].wall.observations, 9);
  EXPECT_NEAR(walls[0].wall.parameters[1], 0.0, 1e-12);
  EXPECT_NEAR(walls[0].wall.extent_end - walls[0].wall.extent_begin, 10.0,
              1e-12);
  EXPECT_EQ(walls[1].members, (std::vector<FeatureId>{other}));
  EXPECT_EQ(walls[1].wall.parameters, graph_.GetFeature(other).parameters);
  // The graph has what it had.
  EXPECT_EQ(graph_.num_features(), 4u);

  Transaction transaction;
  transaction.BreakConstraint(last);
  graph_.Apply(std::move(transaction));
  walls = MergeWalls(graph_);
  ASSERT_EQ(walls.size(), 3u);
  EXPECT_EQ(walls[0].members, (std::vector<FeatureId>{a, b}));
  EXPECT_EQ(walls[2].members, (std::vector<FeatureId>{c}));
}

TEST_F(MergeWallsTest, AnEmptyGraph) {
  EXPECT_TRUE(MergeWalls(graph_).empty());
}

}  // namespace
}  // namespace plumbline
