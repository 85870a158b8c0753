#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/registry.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/detectors/visible_wall.h>
#include <plumbline/factors/angle.h>

#include <Eigen/Core>
#include <cmath>
#include <limits>
#include <optional>

namespace plumbline {
namespace {

using ::testing::ElementsAre;

VisibleWall WallAt(double x, double y, double angle, double half_length) {
  VisibleWall wall;
  wall.middle = {x, y};
  wall.angle = angle;
  wall.direction = {std::cos(angle), std::sin(angle)};
  wall.half_length = half_length;
  return wall;
}

class VisiblePartTest : public ::testing::Test {
 protected:
  VisiblePartTest() {
    RegisterBuiltins(&registry_);
    segment_.type = &registry_.GetFeature("segment");
    segment_.parameters = {1.0, 2.0, 0.5 * kPi};
    segment_.extent_begin = -1.0;
    segment_.extent_end = 4.0;
  }

  Registry registry_;
  Feature segment_;
};

TEST_F(VisiblePartTest, LiesAboutItsMiddle) {
  const std::optional<VisibleWall> wall = VisiblePartOf(segment_);
  ASSERT_TRUE(wall);
  EXPECT_EQ(wall->feature, &segment_);
  EXPECT_NEAR(wall->middle.x(), 1.0, 1e-12);
  EXPECT_NEAR(wall->middle.y(), 3.5, 1e-12);
  EXPECT_EQ(wall->half_length, 2.5);
  EXPECT_NEAR(wall->direction.y(), 1.0, 1e-12);
}

TEST_F(VisiblePartTest, WhatHasNoFiniteOneHasNone) {
  segment_.extent_end = segment_.extent_begin;
  EXPECT_FALSE(VisiblePartOf(segment_));
  segment_.extent_end = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(VisiblePartOf(segment_));
  segment_.extent_end = 4.0;
  segment_.parameters[0] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(VisiblePartOf(segment_));
  Feature point;
  point.type = &registry_.GetFeature("point");
  EXPECT_FALSE(VisiblePartOf(point));
}

TEST(VisibleWallTest, IntervalIsTheShadowOnALine) {
  const VisibleWall wall = WallAt(2.0, 1.0, DegToRad(60.0), 3.0);
  const Interval interval =
      IntervalAlong(wall, {1.0, 0.0}, Eigen::Vector2d::UnitX());
  EXPECT_NEAR(interval.first, 1.0 - 1.5, 1e-12);
  EXPECT_NEAR(interval.second, 1.0 + 1.5, 1e-12);
}

TEST(VisibleWallTest, RunningBesideTakesHalfOfTheShorter) {
  EXPECT_TRUE(RunsBeside({0.0, 10.0}, {9.0, 10.9}));
  EXPECT_FALSE(RunsBeside({0.0, 10.0}, {9.1, 11.0}));
  EXPECT_FALSE(RunsBeside({0.0, 1.0}, {2.0, 3.0}));
}

TEST(VisibleWallGridTest, FindsWhatPassesNearAndNothingFarOff) {
  VisibleWallGrid grid(1.0);
  const VisibleWall wall = WallAt(0.0, 0.5, 0.0, 5.0);
  grid.Add(0, wall, 0.0);
  grid.Add(1, WallAt(4.5, 1.4, 0.5 * kPi, 0.6), 0.0);
  grid.Add(2, WallAt(0.0, 9.5, 0.0, 5.0), 0.0);
  grid.Add(3, WallAt(9.5, 0.5, 0.0, 1.0), 0.0);
  EXPECT_THAT(grid.Near(wall, 0.0), ElementsAre(0, 1));
  // The walls count further past their ends.
  EXPECT_THAT(grid.Near(wall, 3.0), ElementsAre(0, 1, 3));
}

}  // namespace
}  // namespace plumbline
