#include <gtest/gtest.h>
#include <plumbline/detectors/planar_curve.h>
#include <plumbline/factors/angle.h>

#include <cmath>
#include <vector>

namespace plumbline {
namespace {

using Points = std::vector<Eigen::Vector2d>;

TEST(PlanarCurveTest, DistanceAndPlaceOnALine) {
  PlanarCurve line;
  line.position = {1.0, 2.0};
  line.direction = DegToRad(90.0);
  // Up along x = 1: the left side is towards smaller x.
  EXPECT_NEAR(line.SignedDistance({0.5, 7.0}), 0.5, 1e-12);
  EXPECT_NEAR(line.SignedDistance({4.0, 0.0}), -3.0, 1e-12);
  EXPECT_NEAR(line.Along({4.0, 5.0}), 3.0, 1e-12);
}

TEST(PlanarCurveTest, DistanceAndPlaceOnACircle) {
  PlanarCurve circle;
  circle.kind = CurveKind::kCircle;
  circle.position = {1.0, 2.0};
  circle.radius = 2.0;
  EXPECT_NEAR(circle.SignedDistance({1.0, 5.0}), 1.0, 1e-12);
  EXPECT_NEAR(circle.SignedDistance({1.0, 2.0}), -2.0, 1e-12);
  EXPECT_NEAR(circle.Along({1.0, 5.0}), kPi, 1e-12);
}

TEST(PlanarCurveTest, LineMinimizesOrthogonalDistances) {
  PlanarCurve line;
  // Vertical, where a fit of y over x would fail.
  ASSERT_TRUE(
      FitLine(Points{{3.1, 0.0}, {2.9, 1.0}, {2.9, 2.0}, {3.1, 3.0}}, &line));
  EXPECT_NEAR(line.position.x(), 3.0, 1e-12);
  EXPECT_NEAR(line.position.y(), 1.5, 1e-12);
  EXPECT_NEAR(std::abs(line.direction), kPi / 2, 1e-12);
  EXPECT_NEAR(RootMeanSquareDistance(line, {{3.1, 0.0}, {2.9, 1.0}}), 0.1,
              1e-12);
}

TEST(PlanarCurveTest, NoLineWithoutDirection) {
  PlanarCurve line;
  EXPECT_FALSE(FitLine({}, &line));
  EXPECT_FALSE(FitLine(Points{{1.0, 1.0}}, &line));
  EXPECT_FALSE(FitLine(Points{{1.0, 1.0}, {1.0, 1.0}}, &line));
  // A square has none either.
  EXPECT_FALSE(
      FitLine(Points{{0.0, 0.0}, {1.0, 0.0}, {1.0, 1.0}, {0.0, 1.0}}, &line));
}

TEST(PlanarCurveTest, CircleFarFromTheOrigin) {
  Points points;
  for (int i = 0; i < 10; ++i) {
    // An arc of 90 degrees.
    const double angle = DegToRad(10.0 * i);
    points.push_back(
        {1e4 + 2.0 * std::cos(angle), -2e4 + 2.0 * std::sin(angle)});
  }
  PlanarCurve circle;
  ASSERT_TRUE(FitCircle(points, &circle));
  EXPECT_NEAR(circle.position.x(), 1e4, 1e-6);
  EXPECT_NEAR(circle.position.y(), -2e4, 1e-6);
  EXPECT_NEAR(circle.radius, 2.0, 1e-6);
}

TEST(PlanarCurveTest, CircleMinimizesDistances) {
  // Alternately 0.1 m outside and inside a circle of 1 m about (5, 5).
  Points points;
  for (int i = 0; i < 12; ++i) {
    const double angle = DegToRad(30.0 * i);
    const double radius = i % 2 == 0 ? 1.1 : 0.9;
    points.push_back(
        {5.0 + radius * std::cos(angle), 5.0 + radius * std::sin(angle)});
  }
  PlanarCurve circle;
  ASSERT_TRUE(FitCircle(points, &circle));
  EXPECT_NEAR(circle.position.x(), 5.0, 1e-6);
  EXPECT_NEAR(circle.radius, 1.0, 1e-6);
  EXPECT_NEAR(RootMeanSquareDistance(circle, points), 0.1, 1e-6);
}

TEST(PlanarCurveTest, NoCircleThroughALine) {
  PlanarCurve circle;
  EXPECT_FALSE(FitCircle(Points{{0.0, 0.0}, {1.0, 0.0}}, &circle));
  EXPECT_FALSE(FitCircle(Points{{0.0, 0.0}, {1.0, 1.0}, {2.0, 2.0}, {3.0, 3.0}},
                         &circle));
  EXPECT_FALSE(FitCircle(Points(5, Eigen::Vector2d(1.0, 2.0)), &circle));
  EXPECT_FALSE(CircleThrough({0.0, 0.0}, {1.0, 1.0}, {2.0, 2.0}, &circle));
  EXPECT_FALSE(CircleThrough({0.0, 0.0}, {0.0, 0.0}, {2.0, 2.0}, &circle));
}

TEST(PlanarCurveTest, CircleThroughThreePoints) {
  PlanarCurve circle;
  ASSERT_TRUE(CircleThrough({4.0, 1.0}, {1.0, 4.0}, {-2.0, 1.0}, &circle));
  EXPECT_NEAR(circle.position.x(), 1.0, 1e-12);
  EXPECT_NEAR(circle.position.y(), 1.0, 1e-12);
  EXPECT_NEAR(circle.radius, 3.0, 1e-12);
}

}  // namespace
}  // namespace plumbline
