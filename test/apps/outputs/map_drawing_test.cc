#include <gtest/gtest.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/transaction.h>
#include <plumbline/factors/angle.h>
#include <plumbline/outputs/map_drawing.h>

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "drawn_graph.h"

namespace plumbline {
namespace {

using MapDrawingTest = testing::DrawnGraphTest;

TEST_F(MapDrawingTest, WallEndsOfSegmentsAndLines) {
  DrawnWall wall;
  // At (1, 2), looking up, from 1 m behind to 3 m ahead.
  ASSERT_TRUE(
      WallEnds(MakeFeature("segment", {1.0, 2.0, kPi / 2}, -1.0, 3.0), &wall));
  EXPECT_NEAR(wall.x1, 1.0, 1e-12);
  EXPECT_NEAR(wall.y1, 1.0, 1e-12);
  EXPECT_NEAR(wall.x2, 1.0, 1e-12);
  EXPECT_NEAR(wall.y2, 5.0, 1e-12);
  // The line x = 8: direction up, d = y cos - x sin = -(8 - 10) = 2 from the
  // anchor (10, 20), whose foot point is (8, 20).
  Feature line = MakeFeature("line", {2.0, kPi / 2}, -1.0, 4.0);
  line.anchor = {10.0, 20.0};
  ASSERT_TRUE(WallEnds(line, &wall));
  EXPECT_NEAR(wall.x1, 8.0, 1e-12);
  EXPECT_NEAR(wall.y1, 19.0, 1e-12);
  EXPECT_NEAR(wall.x2, 8.0, 1e-12);
  EXPECT_NEAR(wall.y2, 24.0, 1e-12);
  EXPECT_FALSE(WallEnds(MakeFeature("line", {2.0, 0.0}), &wall));
  EXPECT_FALSE(WallEnds(MakeFeature("circle", {0.0, 0.0, 1.0}, 0, 1), &wall));
}

TEST_F(MapDrawingTest, ClustersOfAGraphByLengthOfWall) {
  Graph graph;
  Transaction transaction;
  const FeatureId short_wall =
      transaction.AddFeature(MakeFeature("segment", {0.0, 0.0, 0.2}, 0.0, 1.0));
  const FeatureId long_wall =
      transaction.AddFeature(MakeFeature("line", {0.0, 1.5}, 0.0, 5.0));
  const FeatureId broken_wall = transaction.AddFeature(
      MakeFeature("segment", {0.0, 0.0, 0.7}, 0.0, 20.0));
  transaction.AddFeature(MakeFeature("segment", {0.0, 0.0, 0.7}, 0.0, 0.0));
  transaction.AddFeature(MakeFeature("circle", {1.0, 2.0, 0.5}));
  transaction.AddFeature(MakeFeature("point", {3.0, 4.0}));
  transaction.AddFeature(MakeFeature("pose", {5.0, 6.0, 0.5}));
  const FeatureId first =
      transaction.AddFeature(MakeFeature("orientation", {0.25}));
  const FeatureId second =
      transaction.AddFeature(MakeFeature("orientation", {1.5}));
  transaction.AddConstraint(Tie("segment_orientation", short_wall, first));
  transaction.AddConstraint(Tie("line_orientation", long_wall, second));
  transaction.AddConstraint(Tie("segment_orientation", broken_wall, first));
  const TransactionResult result = graph.Apply(std::move(transaction));
  Transaction breaking;
  breaking.BreakConstraint(result.constraints[2]);
  graph.Apply(std::move(breaking));

  const MapDrawing drawing = DrawingFromGraph(graph, {});
  ASSERT_EQ(drawing.walls.size(), 3u);
  EXPECT_EQ(drawing.walls[0].id, result.features[0]);
  EXPECT_EQ(drawing.walls[0].cluster, 1);
  EXPECT_EQ(drawing.walls[1].cluster, 0);
  EXPECT_EQ(drawing.walls[2].cluster, -1);
  EXPECT_EQ(drawing.cluster_directions, (std::vector<double>{1.5, 0.25}));
  ASSERT_EQ(drawing.circles.size(), 1u);
  EXPECT_EQ(drawing.circles[0].radius, 0.5);
  ASSERT_EQ(drawing.points.size(), 1u);
  EXPECT_EQ(drawing.points[0], Eigen::Vector2d(3.0, 4.0));
  ASSERT_EQ(drawing.path.size(), 1u);
  EXPECT_EQ(drawing.path[0], Pose2(5.0, 6.0, 0.5));

  // A path that is given takes the place of the poses.
  const std::vector<Pose2> path = {Pose2(7.0, 8.0, 0.0), Pose2(9.0, 8.0, 0.0)};
  EXPECT_EQ(DrawingFromGraph(graph, path).path, path);
}

}  // namespace
}  // namespace plumbline
