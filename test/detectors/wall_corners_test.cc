#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/detectors/visible_wall.h>
#include <plumbline/detectors/wall_corners.h>
#include <plumbline/factors/angle.h>

#include <Eigen/Core>
#include <cmath>
#include <vector>

namespace plumbline {
namespace {

using ::testing::ElementsAre;

class WallCornersTest : public ::testing::Test {
 protected:
  // A wall from one end to the other; returns its index.
  int AddWall(double x1, double y1, double x2, double y2) {
    VisibleWall wall;
    wall.middle = {0.5 * (x1 + x2), 0.5 * (y1 + y2)};
    wall.angle = std::atan2(y2 - y1, x2 - x1);
    wall.direction = {std::cos(wall.angle), std::sin(wall.angle)};
    wall.half_length = 0.5 * std::hypot(x2 - x1, y2 - y1);
    walls_.push_back(wall);
    return static_cast<int>(walls_.size()) - 1;
  }

  WallCorners Corners() {
    constexpr double kReach = 1.5;
    WallCornerOptions options;
    options.gate_angle = DegToRad(3.0);
    VisibleWallGrid grid(options.max_opening);
    for (std::size_t i = 0; i < walls_.size(); ++i) {
      grid.Add(static_cast<int>(i), walls_[i], kReach);
    }
    return WallCorners(walls_, grid, kReach, options);
  }

  std::vector<VisibleWall> walls_;
};

TEST_F(WallCornersTest, WallsThatMeetSquarelyMakeOne) {
  const int bottom = AddWall(0.0, 0.0, 5.0, 0.0);
  const int right = AddWall(5.3, 0.4, 5.3, 4.0);
  const WallCorners corners = Corners();
  ASSERT_EQ(corners.size(), 1);
  const WallCorner& corner = corners.corner(0);
  EXPECT_EQ(corner.first, bottom);
  EXPECT_EQ(corner.second, right);
  EXPECT_EQ(corner.Other(bottom), right);
  EXPECT_EQ(corner.Other(right), bottom);
  EXPECT_LT((corner.position - Eigen::Vector2d(5.3, 0.0)).norm(), 1e-9);
  EXPECT_EQ(corners.Between(bottom, right), 0);
  EXPECT_EQ(corners.Between(right, bottom), 0);
}

TEST_F(WallCornersTest, WallsAtAnAngleOrTooFarFromItMakeNone) {
  const int bottom = AddWall(0.0, 0.0, 5.0, 0.0);
  const int slanting = AddWall(5.0, 0.2, 5.5, 4.0);
  const int far = AddWall(-0.6, 0.0, -0.6, 4.0);
  const WallCorners corners = Corners();
  EXPECT_EQ(corners.size(), 0);
  EXPECT_EQ(corners.Between(bottom, slanting), -1);
  EXPECT_EQ(corners.Between(bottom, far), -1);
}

TEST_F(WallCornersTest, PartsOfAWallLieInLineAndItsOtherFaceDoesNot) {
  const int wall = AddWall(0.0, 0.0, 5.0, 0.0);
  const int beyond_a_door = AddWall(6.0, 0.05, 9.0, 0.05);
  AddWall(0.0, 0.08, 5.0, 0.08);    // beside it
  AddWall(-4.0, 0.3, -0.5, 0.3);    // off across
  AddWall(13.0, 0.05, 15.0, 0.05);  // too far from either
  const WallCorners corners = Corners();
  EXPECT_THAT(corners.InLineWith(wall), ElementsAre(wall, beyond_a_door));
}

TEST_F(WallCornersTest, CornersAlongAWallAreTheNearestBothWays) {
  const int wall = AddWall(0.0, 0.0, 60.0, 0.0);
  std::vector<int> across;
  for (int i = 0; i <= 30; ++i) {
    across.push_back(AddWall(2.0 * i, 0.1, 2.0 * i, 4.0));
  }
  const WallCorners corners = Corners();
  const int from = corners.Between(wall, across[5]);
  ASSERT_GE(from, 0);
  std::vector<double> places;
  for (const WallCorners::OnWall& found :
       corners.Along(from, wall, 3.0, 100.0)) {
    EXPECT_EQ(found.wall, wall);
    places.push_back(corners.corner(found.corner).position.x());
  }
  // All but the next one to the left, and 16 of those to the right.
  ASSERT_EQ(places.size(), 4u + 16u);
  EXPECT_NEAR(places.front(), 14.0, 1e-9);
  EXPECT_NEAR(places[15], 44.0, 1e-9);
  EXPECT_NEAR(places[16], 6.0, 1e-9);
  EXPECT_NEAR(places.back(), 0.0, 1e-9);
  EXPECT_EQ(corners.Along(from, wall, 1.0, 5.0).size(), 4u);
}

}  // namespace
}  // namespace plumbline
