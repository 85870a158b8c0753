#include <gtest/gtest.h>
#include <plumbline/core/rigid_motion.h>
#include <plumbline/factors/angle.h>
#include <plumbline/outputs/building_frame.h>

#include <cmath>
#include <vector>

#include "core/graph_fixture.h"

namespace plumbline {
namespace {

using Eigen::Vector2d;

using BuildingFrameTest = GraphFixture;

// A room that is turned by `angle`.
TEST_F(BuildingFrameTest, WallsRunAlongTheAxes) {
  const double angle = DegToRad(62.0);
  const PoseTransform turn(Pose2(20.0, -7.0, angle));
  const std::vector<Vector2d> corners = {
      {0.0, 0.0}, {8.0, 0.0}, {8.0, 5.0}, {0.0, 5.0}};
  std::vector<FeatureId> walls;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    walls.push_back(
        Add(Wall(turn.Point(corners[i]), turn.Point(corners[(i + 1) % 4]))));
  }
  const Pose2 frame = BuildingFrame(
      graph_,
      {Pose2(turn.Point({4.0, 2.0})[0], turn.Point({4.0, 2.0})[1], 0.0)});
  EXPECT_LE(std::abs(frame[2]), DegToRad(45.0) + 1e-12);
  const std::unique_ptr<Graph> moved = Moved(frame, graph_);
  Vector2d low(1e9, 1e9);
  for (const FeatureId id : walls) {
    const Feature& wall = moved->GetFeature(id);
    EXPECT_NEAR(WrapAngle(wall.parameters[2], 0.5 * kPi), 0.0, 1e-9);
    low = low.cwiseMin(Vector2d(wall.parameters[0], wall.parameters[1]));
  }
  EXPECT_LT(low.norm(), 1e-9);

  // Nothing to go by.
  Graph empty;
  EXPECT_EQ(BuildingFrame(empty, {Pose2(1.0, 2.0, 0.5)}), Pose2(Pose2::Zero()));
}

}  // namespace
}  // namespace plumbline
