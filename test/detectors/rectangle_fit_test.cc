#include <gtest/gtest.h>
#include <plumbline/core/wall.h>
#include <plumbline/detectors/rectangle_fit.h>
#include <plumbline/detectors/visible_wall.h>
#include <plumbline/factors/angle.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <optional>
#include <vector>

namespace plumbline {
namespace {

VisibleWall WallAt(const Eigen::Vector2d& middle, double angle,
                   double half_length) {
  VisibleWall wall;
  wall.middle = middle;
  wall.angle = angle;
  wall.direction = {std::cos(angle), std::sin(angle)};
  wall.half_length = half_length;
  return wall;
}

WalledRectangle RectangleAt(double x, double y, double theta, double a,
                            double b) {
  WalledRectangle rectangle;
  rectangle.center = {x, y};
  rectangle.theta = theta;
  rectangle.a = a;
  rectangle.b = b;
  return rectangle;
}

TEST(RectangleFitTest, SidesRunCounterclockwiseRoundTheMiddle) {
  const WalledRectangle rectangle = RectangleAt(1.0, 2.0, 0.0, 3.0, 1.5);
  EXPECT_LT((rectangle.Middle(0) - Eigen::Vector2d(1.0, 0.5)).norm(), 1e-12);
  EXPECT_LT((rectangle.Middle(1) - Eigen::Vector2d(4.0, 2.0)).norm(), 1e-12);
  EXPECT_LT((rectangle.Middle(2) - Eigen::Vector2d(1.0, 3.5)).norm(), 1e-12);
  EXPECT_LT((rectangle.Middle(3) - Eigen::Vector2d(-2.0, 2.0)).norm(), 1e-12);
  EXPECT_EQ(rectangle.area(), 18.0);
}

TEST(RectangleFitTest, CommonAreaIsThatOfTheOverlap) {
  const WalledRectangle first = RectangleAt(0.0, 0.0, 0.0, 2.0, 1.0);
  EXPECT_NEAR(CommonArea(first, RectangleAt(3.0, 1.0, 0.0, 2.0, 1.0)), 1.0,
              1e-12);
  // A quarter turn exchanges its sides.
  EXPECT_NEAR(CommonArea(first, RectangleAt(0.0, 0.0, 0.5 * kPi, 2.0, 1.0)),
              4.0, 1e-12);
  EXPECT_EQ(CommonArea(first, RectangleAt(5.0, 0.0, 0.0, 2.0, 1.0)), 0.0);
}

// The walls of a room of 6 m by 3 m that is turned, beginning with any side:
// always the same rectangle.
TEST(RectangleFitTest, WhichSideIsFirstMakesNoDifference) {
  for (const double turn_deg : {10.0, 80.0, 130.0, -30.0}) {
    const double turn = DegToRad(turn_deg);
    const Eigen::Rotation2Dd rotation(turn);
    const Eigen::Vector2d center(4.0, -7.0);
    const std::vector<VisibleWall> walls = {
        WallAt(center + rotation * Eigen::Vector2d(0.5, -1.5), turn, 2.0),
        // Seen the other way round.
        WallAt(center + rotation * Eigen::Vector2d(3.0, 0.1), turn - 0.5 * kPi,
               1.0),
        WallAt(center + rotation * Eigen::Vector2d(-0.5, 1.5), turn, 2.2),
        WallAt(center + rotation * Eigen::Vector2d(-3.0, 0.0), turn + 0.5 * kPi,
               1.2)};
    for (std::size_t first = 0; first < walls.size(); ++first) {
      WallsOfSides sides;
      for (std::size_t k = 0; k < sides.size(); ++k) {
        sides[k] = {&walls[(first + k) % walls.size()]};
      }
      const WalledRectangle rectangle = FitRectangle(sides);
      EXPECT_LT((rectangle.center - center).norm(), 1e-9);
      EXPECT_LE(std::abs(rectangle.theta), 0.25 * kPi + 1e-12);
      EXPECT_NEAR(std::sin(4.0 * (rectangle.theta - turn)), 0.0, 1e-9);
      const bool is_along =
          std::abs(std::sin(rectangle.theta - turn)) < std::sqrt(0.5);
      EXPECT_NEAR(rectangle.a, is_along ? 3.0 : 1.5, 1e-9);
      EXPECT_NEAR(rectangle.b, is_along ? 1.5 : 3.0, 1e-9);
      for (int side = 0; side < WalledRectangle::kNumSides; ++side) {
        const auto& members = rectangle.sides[static_cast<std::size_t>(side)];
        ASSERT_EQ(members.size(), 1u);
        EXPECT_TRUE(members[0].is_new);
      }
    }
  }
}

TEST(RectangleFitTest, LongWallsOfASideCountMost) {
  const std::vector<VisibleWall> walls = {
      WallAt({0.0, 0.0}, 0.0, 3.0), WallAt({4.0, 0.4}, 0.0, 1.0),
      WallAt({5.0, 2.0}, 0.5 * kPi, 2.0), WallAt({2.0, 4.0}, 0.0, 3.0),
      WallAt({-3.0, 2.0}, 0.5 * kPi, 2.0)};
  const WalledRectangle rectangle = FitRectangle(
      {{{&walls[0], &walls[1]}, {&walls[2]}, {&walls[3]}, {&walls[4]}}});
  // The side lies 0.1 m above the longer of its two walls.
  EXPECT_NEAR(rectangle.b, 0.5 * (4.0 - 0.1), 1e-12);
  EXPECT_EQ(rectangle.sides[0].size(), 2u);
}

TEST(RectangleFitTest, WallIsOnASideWithinTheGates) {
  const WalledRectangle rectangle = RectangleAt(0.0, 0.0, 0.0, 3.0, 2.0);
  const double gate = 0.1;
  const double gate_angle = DegToRad(3.0);
  const auto on_bottom = [&](const VisibleWall& wall) {
    return IntervalOnSide(wall, rectangle, 0, gate, gate_angle);
  };
  const std::optional<Interval> interval =
      on_bottom(WallAt({1.0, -2.05}, 0.0, 1.5));
  ASSERT_TRUE(interval);
  EXPECT_NEAR(interval->first, -0.5, 1e-12);
  EXPECT_NEAR(interval->second, 2.5, 1e-12);
  EXPECT_FALSE(on_bottom(WallAt({1.0, -2.15}, 0.0, 1.5)));
  EXPECT_FALSE(on_bottom(WallAt({1.0, -2.0}, DegToRad(4.0), 1.5)));
  // More than half of it lies past the corner.
  EXPECT_FALSE(on_bottom(WallAt({3.2, -2.0}, 0.0, 1.5)));
  // It is on the bottom, so not at the top.
  EXPECT_FALSE(IntervalOnSide(WallAt({1.0, -2.0}, 0.0, 1.5), rectangle, 2, gate,
                              gate_angle));
}

}  // namespace
}  // namespace plumbline
