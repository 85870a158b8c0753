#include <gtest/gtest.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/wall_pair.h>
#include <plumbline/factors/angle.h>

#include <cmath>
#include <optional>

namespace plumbline {
namespace {

using Eigen::Vector2d;

TEST(WallTest, PointsOnIt) {
  // From (1, 2) upwards, seen from 0.5 m below that point to 1.5 m above it.
  const Wall wall = MakeWall(Vector2d(1.0, 2.0), 0.5 * kPi, -0.5, 1.5);
  EXPECT_NEAR((wall.At(wall.begin) - Vector2d(1.0, 1.5)).norm(), 0.0, 1e-12);
  EXPECT_NEAR((wall.At(wall.end) - Vector2d(1.0, 3.5)).norm(), 0.0, 1e-12);
  EXPECT_NEAR((wall.Middle() - Vector2d(1.0, 2.5)).norm(), 0.0, 1e-12);
  EXPECT_DOUBLE_EQ(wall.length(), 2.0);
  EXPECT_EQ(wall.pose(), Pose2(1.0, 2.0, 0.5 * kPi));
}

TEST(WallTest, LeftOfItIsPositive) {
  const Wall wall = MakeWall(Vector2d(1.0, 2.0), 0.5 * kPi, 0.0, 1.0);
  EXPECT_NEAR((wall.normal() - Vector2d(-1.0, 0.0)).norm(), 0.0, 1e-12);
  const Vector2d left(-2.0, 6.0);
  EXPECT_NEAR(wall.Across(left), 3.0, 1e-12);
  EXPECT_NEAR(wall.Along(left), 4.0, 1e-12);
  EXPECT_NEAR(wall.Across(Vector2d(1.5, 2.0)), -0.5, 1e-12);
}

TEST(WallTest, MiddleOfWhatTwoWallsHaveInCommon) {
  const Wall wall = MakeWall(Eigen::Vector2d(1.0, 2.0), kPi / 2, 0.0, 4.0);
  // Beside its upper half, the other way round.
  const Wall beside = MakeWall(Eigen::Vector2d(1.1, 8.0), -kPi / 2, 0.0, 4.0);
  EXPECT_TRUE(MiddleOfCommonPart(wall, beside)
                  .isApprox(Pose2(1.0, 5.0, kPi / 2), 1e-12));
  // Of two that have nothing in common the middle of the gap.
  const Wall above = MakeWall(Eigen::Vector2d(1.0, 8.0), kPi / 2, 0.0, 1.0);
  EXPECT_TRUE(MiddleOfCommonPart(wall, above)
                  .isApprox(Pose2(1.0, 7.0, kPi / 2), 1e-12));
}

TEST(WallTest, IntervalOfAnotherWall) {
  const Wall wall = MakeWall(Vector2d(10.0, 0.0), 0.0, 0.0, 4.0);
  // The other way round, and turned away by 60 degrees.
  const Wall back = MakeWall(Vector2d(15.0, 0.3), kPi, 0.0, 3.0);
  EXPECT_NEAR(wall.IntervalOf(back).first, 2.0, 1e-12);
  EXPECT_NEAR(wall.IntervalOf(back).second, 5.0, 1e-12);
  const Wall turned = MakeWall(Vector2d(12.0, 0.0), kPi / 3.0, -1.0, 2.0);
  EXPECT_NEAR(wall.IntervalOf(turned).first, 1.5, 1e-12);
  EXPECT_NEAR(wall.IntervalOf(turned).second, 3.0, 1e-12);
  EXPECT_NEAR(Overlap({wall.begin, wall.end}, wall.IntervalOf(back)), 2.0,
              1e-12);
}

TEST(WallTest, IntervalLosesNothingFarFromTheOrigin) {
  const Vector2d far(1e7, -1e7);
  const Wall wall = MakeWall(far, 0.3, 0.0, 4.0);
  const Wall other = MakeWall(far, 0.3, 0.125, 2.5);
  EXPECT_DOUBLE_EQ(wall.IntervalOf(other).first, 0.125);
  EXPECT_DOUBLE_EQ(wall.IntervalOf(other).second, 2.5);
}

TEST(WallTest, OverlapOfAGapIsNegative) {
  EXPECT_DOUBLE_EQ(Overlap({0.0, 2.0}, {1.0, 5.0}), 1.0);
  EXPECT_DOUBLE_EQ(Overlap({0.0, 2.0}, {3.0, 5.0}), -1.0);
}

TEST(WallTest, OfFeatures) {
  Registry registry;
  RegisterBuiltinRelations(&registry);
  Feature segment;
  segment.type = &registry.GetFeature("segment");
  segment.parameters = {1.0, 2.0, 0.25};
  segment.extent_begin = -1.0;
  segment.extent_end = 3.0;
  const std::optional<Wall> wall = WallOf(segment);
  ASSERT_TRUE(wall);
  EXPECT_EQ(wall->pose(), Pose2(1.0, 2.0, 0.25));
  EXPECT_DOUBLE_EQ(wall->begin, -1.0);
  EXPECT_DOUBLE_EQ(wall->end, 3.0);

  // d to the left of the direction, from the anchor (Eq. 12).
  Feature line;
  line.type = &registry.GetFeature("line");
  line.parameters = {0.5, 0.7};
  line.anchor = {100.0, -50.0};
  line.extent_end = 2.0;
  const std::optional<Wall> of_line = WallOf(line);
  ASSERT_TRUE(of_line);
  EXPECT_NEAR(of_line->Across(Vector2d(100.0, -50.0)), -0.5, 1e-12);
  EXPECT_NEAR(of_line->Along(Vector2d(100.0, -50.0)), 0.0, 1e-12);
  const Vector2d& foot = of_line->position;
  EXPECT_NEAR(
      (foot.y() + 50.0) * std::cos(0.7) - (foot.x() - 100.0) * std::sin(0.7),
      0.5, 1e-12);

  Feature point;
  point.type = &registry.GetFeature("point");
  EXPECT_FALSE(WallOf(point));
}

}  // namespace
}  // namespace plumbline
