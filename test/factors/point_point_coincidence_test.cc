#include <gtest/gtest.h>
#include <plumbline/factors/point_point_coincidence.h>

#include <memory>

#include "factors/factors_test_util.h"

namespace plumbline {
namespace {

using testing::Evaluate;
using testing::Random;
using testing::Weight2;

TEST(PointPointCoincidenceTest, ByHand) {
  const std::unique_ptr<ceres::CostFunction> cost(
      PointPointCoincidence::Create(Eigen::Vector2d(1.0, -1.0), Weight2()));
  // Displacement (3, 4), error (2, 5): L error = (4 + 5, 15).
  const auto result = Evaluate(*cost, {{1.0, 2.0}, {4.0, 6.0}});
  EXPECT_DOUBLE_EQ(result.residual[0], 9.0);
  EXPECT_DOUBLE_EQ(result.residual[1], 15.0);
  EXPECT_LT((result.jacobians[1] - Weight2()).norm(), 1e-15);
  EXPECT_LT((result.jacobians[0] + Weight2()).norm(), 1e-15);
}

TEST(PointPointCoincidenceTest, JacobiansMatchDifferences) {
  Random random(4);
  const std::unique_ptr<ceres::CostFunction> cost(
      PointPointCoincidence::Create<3, 3>(Eigen::Vector2d(0.5, 0.0),
                                          Weight2()));
  for (int i = 0; i < 20; ++i) {
    testing::ExpectJacobiansMatchDifferences(
        *cost, {{random.Uniform(-5, 5), random.Uniform(-5, 5), 1.0},
                {random.Uniform(-5, 5), random.Uniform(-5, 5), 2.0}});
  }
  testing::ExpectJacobiansMatchDifferences(*cost,
                                           {{1.0, 1.0, 0.0}, {1.0, 1.0, 0.0}});
}

TEST(PointPointCoincidenceTest, UnchangedWhenTheWorldMoves) {
  // Turning leaves |r| alone only when L is a multiple of the identity.
  const std::unique_ptr<ceres::CostFunction> cost(PointPointCoincidence::Create(
      Eigen::Vector2d::Zero(), 2.0 * Eigen::Matrix2d::Identity()));
  for (const Pose2& motion : testing::WorldMotions()) {
    const auto result =
        Evaluate(*cost, {testing::MovePoint(motion, {1.0, 2.0}),
                         testing::MovePoint(motion, {4.0, 6.0})});
    EXPECT_NEAR(result.residual.norm(), 10.0, 1e-10);
  }
}

}  // namespace
}  // namespace plumbline
