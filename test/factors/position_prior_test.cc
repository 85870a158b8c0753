#include <gtest/gtest.h>
#include <plumbline/factors/position_prior.h>

#include <memory>

#include "factors/factors_test_util.h"

namespace plumbline {
namespace {

using testing::Evaluate;
using testing::Random;
using testing::Weight2;

TEST(PositionPriorTest, ByHand) {
  const std::unique_ptr<ceres::CostFunction> cost(
      PositionPrior::Create(Eigen::Vector2d(1.0, 2.0), Weight2()));
  const auto result = Evaluate(*cost, {{1.5, 2.25}});
  EXPECT_DOUBLE_EQ(result.residual[0], 1.25);
  EXPECT_DOUBLE_EQ(result.residual[1], 0.75);
  EXPECT_LT((result.jacobians[0] - Weight2()).norm(), 1e-15);
}

TEST(PositionPriorTest, HeadingDoesNotCount) {
  const std::unique_ptr<ceres::CostFunction> cost(
      PositionPrior::Create<3>(Eigen::Vector2d(1.0, 2.0), Weight2()));
  for (const double heading : {0.0, 3.0, -kPi}) {
    const auto result = Evaluate(*cost, {{1.5, 2.25, heading}});
    EXPECT_DOUBLE_EQ(result.residual[0], 1.25);
    EXPECT_DOUBLE_EQ(result.residual[1], 0.75);
    EXPECT_EQ(result.jacobians[0].col(2).norm(), 0.0);
  }
}

TEST(PositionPriorTest, JacobiansMatchDifferences) {
  Random random(40);
  for (int i = 0; i < 20; ++i) {
    const std::unique_ptr<ceres::CostFunction> cost(PositionPrior::Create<3>(
        Eigen::Vector2d(random.Uniform(-9, 9), random.Uniform(-9, 9)),
        Weight2()));
    testing::ExpectJacobiansMatchDifferences(
        *cost, {{random.Uniform(-9, 9), random.Uniform(-9, 9),
                 random.Uniform(-4, 4)}});
  }
}

// Moved, nothing changes; turned, the error turns with the world.
TEST(PositionPriorTest, WhenTheWorldMoves) {
  const Eigen::Vector2d expected(1.0, 2.0);
  for (const Pose2& motion : testing::WorldMotions()) {
    const std::unique_ptr<ceres::CostFunction> cost(PositionPrior::Create(
        TransformPoint(motion, expected), Eigen::Matrix2d::Identity()));
    const auto result =
        Evaluate(*cost, {testing::MovePoint(motion, {1.5, 2.25})});
    const Eigen::Vector2d error =
        TransformPoint(Pose2(0.0, 0.0, motion[2]), Eigen::Vector2d(0.5, 0.25));
    EXPECT_LT((result.residual - error).norm(), 1e-10);
  }
}

}  // namespace
}  // namespace plumbline
