#include <gtest/gtest.h>
#include <plumbline/factors/point_circle_distance.h>

#include <memory>

#include "factors/factors_test_util.h"

namespace plumbline {
namespace {

using testing::Evaluate;
using testing::Random;

TEST(PointCircleDistanceTest, ByHand) {
  const std::unique_ptr<ceres::CostFunction> cost(
      PointCircleDistance::Create(0.5, 10.0));
  const auto outside = Evaluate(*cost, {{4.0, 6.0}, {1.0, 2.0, 2.0}});
  EXPECT_DOUBLE_EQ(outside.residual[0], 25.0);  // 10 (5 - 2 - 0.5)
  EXPECT_DOUBLE_EQ(outside.jacobians[0](0, 0), 6.0);
  EXPECT_DOUBLE_EQ(outside.jacobians[0](0, 1), 8.0);
  EXPECT_DOUBLE_EQ(outside.jacobians[1](0, 0), -6.0);
  EXPECT_DOUBLE_EQ(outside.jacobians[1](0, 1), -8.0);
  EXPECT_DOUBLE_EQ(outside.jacobians[1](0, 2), -10.0);
  const auto inside = Evaluate(*cost, {{1.0, 3.0}, {1.0, 2.0, 2.0}});
  EXPECT_DOUBLE_EQ(inside.residual[0], -15.0);  // 10 (1 - 2 - 0.5)
}

TEST(PointCircleDistanceTest, JacobiansMatchDifferences) {
  Random random(7);
  const std::unique_ptr<ceres::CostFunction> cost(
      PointCircleDistance::Create<3>(0.1, 3.0));
  for (int i = 0; i < 100; ++i) {
    testing::ExpectJacobiansMatchDifferences(
        *cost,
        {{random.Uniform(-5, 5), random.Uniform(-5, 5), 0.5},
         {random.Uniform(-5, 5), random.Uniform(-5, 5), random.Uniform(0, 4)}},
        1e-5);
  }
}

TEST(PointCircleDistanceTest, FiniteAtTheCentre) {
  const std::unique_ptr<ceres::CostFunction> cost(
      PointCircleDistance::Create(0.0, 2.0));
  const auto result = Evaluate(*cost, {{1.0, 2.0}, {1.0, 2.0, 3.0}});
  EXPECT_DOUBLE_EQ(result.residual[0], -6.0);
  EXPECT_DOUBLE_EQ(result.jacobians[0].norm(), 2.0);
  EXPECT_DOUBLE_EQ(result.jacobians[1](0, 2), -2.0);
  EXPECT_TRUE(result.jacobians[1].allFinite());
}

TEST(PointCircleDistanceTest, UnchangedWhenTheWorldMoves) {
  const std::unique_ptr<ceres::CostFunction> cost(
      PointCircleDistance::Create(0.5, 10.0));
  for (const Pose2& motion : testing::WorldMotions()) {
    const auto result =
        Evaluate(*cost, {testing::MovePoint(motion, {4.0, 6.0}),
                         testing::MovePoint(motion, {1.0, 2.0, 2.0})});
    EXPECT_NEAR(result.residual[0], 25.0, 1e-10);
  }
}

}  // namespace
}  // namespace plumbline
