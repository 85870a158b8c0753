#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/detectors/corridor_axis.h>
#include <plumbline/factors/angle.h>

#include <cmath>
#include <optional>
#include <vector>

namespace plumbline {
namespace {

using ::testing::Pair;

// A face from one end to the other, seen from its left.
WallFace SideWall(double x1, double y1, double x2, double y2) {
  WallFace face;
  const Eigen::Vector2d begin(x1, y1);
  const Eigen::Vector2d end(x2, y2);
  face.length = (end - begin).norm();
  face.middle = 0.5 * (begin + end);
  face.wall = MakeWall(begin, std::atan2(y2 - y1, x2 - x1), 0.0, face.length);
  return face;
}

TEST(CorridorAxisTest, LiesHalfWayBetweenTwoFaces) {
  // Common to both is 2 to 8.
  const CorridorAxis axis = AxisBetween(SideWall(0.0, -1.0, 8.0, -1.0),
                                        SideWall(10.0, 1.5, 2.0, 1.5));
  EXPECT_NEAR(axis.angle, 0.0, 1e-12);
  EXPECT_NEAR(axis.half_width, 1.25, 1e-12);
  EXPECT_NEAR(axis.origin.x(), 5.0, 1e-12);
  EXPECT_NEAR(axis.origin.y(), 0.25, 1e-12);
  // The face on the right comes first: the other way round it runs back.
  const CorridorAxis back = AxisBetween(SideWall(10.0, 1.5, 2.0, 1.5),
                                        SideWall(0.0, -1.0, 8.0, -1.0));
  EXPECT_NEAR(std::abs(back.angle), kPi, 1e-12);
  EXPECT_NEAR(back.half_width, 1.25, 1e-12);
}

TEST(CorridorAxisTest, TheLongerFaceDecidesItsDirection) {
  const double turn = 0.04;
  const WallFace straight = SideWall(0.0, -1.0, 8.0, -1.0);
  const WallFace turned = SideWall(4.0 + std::cos(turn), 1.0 + std::sin(turn),
                                   4.0 - std::cos(turn), 1.0 - std::sin(turn));
  const double share = std::pow(2.0, 3.0) / (std::pow(2.0, 3.0) + 512.0);
  EXPECT_NEAR(AxisBetween(straight, turned).angle, share * turn, 1e-9);
  EXPECT_NEAR(NormalizeAngle(AxisBetween(turned, straight).angle - kPi),
              share * turn, 1e-9);
}

TEST(CorridorAxisTest, AFaceIsOnTheSideThatItLooksFrom) {
  CorridorAxis axis;
  axis.origin = {2.0, 0.0};
  axis.half_width = 1.0;
  const SideFace right = OnSide(axis, SideWall(0.0, -1.1, 4.0, -1.1), 3);
  EXPECT_EQ(right.face, 3u);
  EXPECT_EQ(right.side, kRightSide);
  EXPECT_NEAR(right.past, 0.1, 1e-12);
  EXPECT_NEAR(right.turn, 0.0, 1e-12);
  EXPECT_NEAR(right.along, 0.0, 1e-12);
  EXPECT_THAT(right.interval, Pair(-2.0, 2.0));
  // Nearer than its side, and turned to the left by 0.01 in its own direction.
  const double x = 2.0 * std::cos(0.01);
  const double y = 2.0 * std::sin(0.01);
  const SideFace left =
      OnSide(axis, SideWall(5.0 + x, 0.8 + y, 5.0 - x, 0.8 - y), 0);
  EXPECT_EQ(left.side, kLeftSide);
  EXPECT_NEAR(left.past, -0.2, 1e-12);
  EXPECT_NEAR(left.turn, 0.01, 1e-12);
  EXPECT_NEAR(left.along, 3.0, 1e-12);
}

TEST(CorridorAxisTest, ReachEndsAtWallsAcross) {
  CorridorAxis axis;
  axis.half_width = 1.0;
  const std::vector<WallFace> none;
  const std::optional<Interval> open = FreeReach(axis, {0.0, 4.0}, none, 0);
  ASSERT_TRUE(open);
  EXPECT_TRUE(std::isinf(open->first) && std::isinf(open->second));
  const std::vector<WallFace> faces = {
      // Across, on either side, the nearest not first.
      SideWall(9.0, -1.0, 9.0, 1.0), SideWall(6.0, -1.0, 6.0, 1.0),
      SideWall(-3.0, 1.0, -3.0, -1.0),
      // A door leaf that leaves half of the corridor open, and a side.
      SideWall(5.0, -1.0, 5.0, 0.4), SideWall(0.0, -1.0, 4.0, -1.0)};
  const std::optional<Interval> reach = FreeReach(axis, {0.0, 4.0}, faces, 0);
  ASSERT_TRUE(reach);
  EXPECT_THAT(*reach, Pair(-3.0, 6.0));
  EXPECT_FALSE(FreeReach(axis, {0.0, 7.0}, faces, 0));
}

TEST(CorridorAxisTest, FacesAreJoinedAcrossOpenings) {
  std::vector<SideFace> faces(4);
  faces[0].interval = {9.0, 12.0};
  faces[1].interval = {5.0, 7.0};
  faces[2].interval = {20.0, 25.0};
  faces[3].interval = {-4.0, -1.0};
  for (std::size_t i = 0; i < faces.size(); ++i) faces[i].face = i;
  const auto joined = [&](double max_opening) {
    std::vector<std::size_t> indices;
    for (const SideFace& on : JoinedTo({0.0, 3.0}, faces, max_opening)) {
      indices.push_back(on.face);
    }
    return indices;
  };
  EXPECT_THAT(joined(0.5), ::testing::IsEmpty());
  EXPECT_THAT(joined(1.5), ::testing::ElementsAre(3));
  // The first is reached over the second.
  EXPECT_THAT(joined(2.5), ::testing::ElementsAre(0, 1, 3));
  EXPECT_THAT(joined(8.0), ::testing::ElementsAre(0, 1, 2, 3));
}

TEST(CorridorAxisTest, AnotherCorridorContainsIt) {
  CorridorAxis hall;
  hall.half_width = 1.0;
  CorridorAxis axis;
  axis.origin = {3.0, 0.5};
  axis.angle = kPi - 0.1;
  EXPECT_TRUE(axis.IsWithin(hall, {0.0, 4.0}));
  EXPECT_FALSE(axis.IsWithin(hall, {0.0, 2.0}));
  axis.angle = 0.5 * kPi;
  EXPECT_FALSE(axis.IsWithin(hall, {0.0, 4.0}));
  axis.angle = 0.0;
  axis.origin.y() = 1.5;
  EXPECT_FALSE(axis.IsWithin(hall, {0.0, 4.0}));
}

TEST(CorridorAxisTest, LengthsOfIntervals) {
  const std::vector<Interval> intervals = {{4.0, 6.0}, {0.0, 2.0}, {1.0, 3.0}};
  EXPECT_DOUBLE_EQ(UnionLength(intervals), 5.0);
  EXPECT_DOUBLE_EQ(UnionLength({}), 0.0);
  EXPECT_THAT(Hull(intervals), Pair(0.0, 6.0));
}

}  // namespace
}  // namespace plumbline
