#include <gtest/gtest.h>
#include <plumbline/factors/angle.h>
#include <plumbline/factors/point_line_distance.h>

#include <cmath>
#include <memory>

#include "factors/factors_test_util.h"

namespace plumbline {
namespace {

using testing::Evaluate;
using testing::Random;

TEST(PointLineDistanceTest, HorizontalLineByHand) {
  // Anchor (10, 20), d = 1, alpha = 0: the line y = 21.
  const std::unique_ptr<ceres::CostFunction> cost(
      PointLineDistance::Create(0.5, Eigen::Vector2d(10.0, 20.0), 4.0));
  const auto result = Evaluate(*cost, {{13.0, 23.5}, {1.0, 0.0}});
  EXPECT_DOUBLE_EQ(result.residual[0], 8.0);  // 4 (2.5 - 0.5)
  EXPECT_DOUBLE_EQ(result.jacobians[0](0, 0), 0.0);
  EXPECT_DOUBLE_EQ(result.jacobians[0](0, 1), 4.0);
  EXPECT_DOUBLE_EQ(result.jacobians[1](0, 0), -4.0);
  EXPECT_DOUBLE_EQ(result.jacobians[1](0, 1), -12.0);  // -4 (13 - 10)
}

TEST(PointLineDistanceTest, VerticalLineByHand) {
  // Anchor (10, 20), d = 1, alpha = pi/2: the line x = 9, upwards; the point is
  // 2 to its left.
  const PointLineDistance relation(0.0, Eigen::Vector2d(10.0, 20.0), 1.0);
  const double point[2] = {7.0, -55.0};
  const double line[2] = {1.0, kPi / 2};
  double residual = 0.0;
  ASSERT_TRUE(relation(point, line, &residual));
  EXPECT_NEAR(residual, 2.0, 1e-14);
}

TEST(PointLineDistanceTest, EquationOfThePaperAtTheOrigin) {
  Random random(5);
  for (int i = 0; i < 50; ++i) {
    const double point[2] = {random.Uniform(-9, 9), random.Uniform(-9, 9)};
    const double line[2] = {random.Uniform(-9, 9), random.Uniform(-kPi, kPi)};
    double residual = 0.0;
    PointLineDistance(0.0, Eigen::Vector2d::Zero(), 1.0)(point, line,
                                                         &residual);
    EXPECT_NEAR(
        residual,
        -line[0] - point[0] * std::sin(line[1]) + point[1] * std::cos(line[1]),
        1e-13);
  }
}

TEST(PointLineDistanceTest, TurnedRoundTheDistanceChangesSign) {
  const PointLineDistance relation(0.0, Eigen::Vector2d(1.0, 1.0), 1.0);
  const double point[2] = {4.0, 3.0};
  const double line[2] = {0.7, 0.4};
  const double turned[2] = {-0.7, 0.4 - kPi};
  double residual[2];
  relation(point, line, &residual[0]);
  relation(point, turned, &residual[1]);
  EXPECT_NEAR(residual[0], -residual[1], 1e-14);
}

TEST(PointLineDistanceTest, JacobiansMatchDifferences) {
  Random random(6);
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector2d anchor(random.Uniform(-9, 9), random.Uniform(-9, 9));
    const std::unique_ptr<ceres::CostFunction> cost(
        PointLineDistance::Create<3>(0.2, anchor, 3.0));
    testing::ExpectJacobiansMatchDifferences(
        *cost, {{random.Uniform(-9, 9), random.Uniform(-9, 9), 0.3},
                {random.Uniform(-9, 9), random.Uniform(-4, 4)}});
  }
  // Degenerate: the point on the anchor, the line through it, at the cut.
  const std::unique_ptr<ceres::CostFunction> cost(
      PointLineDistance::Create(0.0, Eigen::Vector2d(2.0, 3.0), 1.0));
  testing::ExpectJacobiansMatchDifferences(*cost, {{2.0, 3.0}, {0.0, kPi}});
}

TEST(PointLineDistanceTest, UnchangedWhenTheWorldMoves) {
  const Eigen::Vector2d anchor(10.0, 20.0);
  const std::unique_ptr<ceres::CostFunction> near(
      PointLineDistance::Create(0.5, anchor, 4.0));
  const auto reference = Evaluate(*near, {{13.0, 23.5}, {1.0, 0.3}});
  for (const Pose2& motion : testing::WorldMotions()) {
    const std::unique_ptr<ceres::CostFunction> cost(
        PointLineDistance::Create(0.5, TransformPoint(motion, anchor), 4.0));
    const auto result =
        Evaluate(*cost, {testing::MovePoint(motion, {13.0, 23.5}),
                         testing::MoveLine(motion, {1.0, 0.3})});
    EXPECT_NEAR(result.residual[0], reference.residual[0], 1e-10);
    // The normal equations of the line do not change either: far from the
    // origin a line relative to the origin would be ill-conditioned.
    EXPECT_NEAR(result.jacobians[1](0, 0), reference.jacobians[1](0, 0), 1e-10);
    EXPECT_NEAR(result.jacobians[1](0, 1), reference.jacobians[1](0, 1), 1e-10);
  }
}

}  // namespace
}  // namespace plumbline
