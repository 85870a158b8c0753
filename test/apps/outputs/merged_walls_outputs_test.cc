#include <gtest/gtest.h>
#include <plumbline/core/registry.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/detectors/same_wall.h>
#include <plumbline/outputs/map_drawing.h>
#include <plumbline/outputs/summary.h>

#include <utility>
#include <vector>

#include "detectors/closed_walls.h"

namespace plumbline {
namespace {

using MergedWallsOutputsTest = ClosedWallsTest;

TEST_F(MergedWallsOutputsTest, OutputsShowOneWall) {
  const FeatureId a = AddSegment(0.0, 0.0, 4.0);
  const FeatureId b = AddSegment(3.0, 0.0, 4.0);
  EXPECT_EQ(DrawingFromGraph(graph_, {}).walls.size(), 2u);
  EXPECT_TRUE(DrawingFromGraph(graph_, {}).closures.empty());
  const ConstraintId closure = Close(a, b);
  MapDrawing drawing = DrawingFromGraph(graph_, {});
  ASSERT_EQ(drawing.walls.size(), 1u);
  EXPECT_NEAR(drawing.walls[0].x1, 0.0, 1e-12);
  EXPECT_NEAR(drawing.walls[0].x2, 7.0, 1e-12);
  EXPECT_EQ(drawing.walls[0].members, (std::vector<FeatureId>{a, b}));
  // Marked at the middle of the common part.
  ASSERT_EQ(drawing.closures.size(), 1u);
  EXPECT_NEAR(drawing.closures[0][0], 3.5, 1e-12);
  EXPECT_NEAR(drawing.closures[0][1], 0.0, 1e-12);

  Summary summary;
  CountGraph(graph_, &summary);
  EXPECT_EQ(summary.closures.proposed, 1);
  EXPECT_EQ(summary.closures.live, 1);
  EXPECT_EQ(summary.closures.broken, 0);
  Transaction transaction;
  transaction.BreakConstraint(closure);
  graph_.Apply(std::move(transaction));
  CountGraph(graph_, &summary);
  EXPECT_EQ(summary.closures.proposed, 1);
  EXPECT_EQ(summary.closures.live, 0);
  EXPECT_EQ(summary.closures.broken, 1);
}

}  // namespace
}  // namespace plumbline
