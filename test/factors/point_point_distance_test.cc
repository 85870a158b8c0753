#include <ceres/problem.h>
#include <ceres/solver.h>
#include <gtest/gtest.h>
#include <plumbline/factors/point_point_distance.h>

#include <cmath>
#include <memory>

#include "factors/factors_test_util.h"

namespace plumbline {
namespace {

using testing::Block;
using testing::Evaluate;
using testing::Random;

TEST(PointPointDistanceTest, ByHand) {
  const std::unique_ptr<ceres::CostFunction> cost(
      PointPointDistance::Create(4.5, 2.0));
  const auto result = Evaluate(*cost, {{1.0, 2.0}, {4.0, 6.0}});
  EXPECT_DOUBLE_EQ(result.residual[0], 1.0);
  EXPECT_DOUBLE_EQ(result.jacobians[0](0, 0), -1.2);
  EXPECT_DOUBLE_EQ(result.jacobians[0](0, 1), -1.6);
  EXPECT_DOUBLE_EQ(result.jacobians[1](0, 0), 1.2);
  EXPECT_DOUBLE_EQ(result.jacobians[1](0, 1), 1.6);
}

TEST(PointPointDistanceTest, FurtherEntriesDoNotEnter) {
  const std::unique_ptr<ceres::CostFunction> cost(
      PointPointDistance::Create<3, 3>(0.0, 1.0));
  const auto result = Evaluate(*cost, {{0.0, 0.0, 7.0}, {0.0, -2.0, 0.5}});
  EXPECT_DOUBLE_EQ(result.residual[0], 2.0);
  EXPECT_EQ(result.jacobians[0](0, 2), 0.0);
  EXPECT_EQ(result.jacobians[1](0, 2), 0.0);
}

TEST(PointPointDistanceTest, JacobiansMatchDifferences) {
  Random random(3);
  const std::unique_ptr<ceres::CostFunction> plain(
      PointPointDistance::Create(1.5, 3.0));
  const std::unique_ptr<ceres::CostFunction> mixed(
      PointPointDistance::Create<3, 2>(1.5, 3.0));
  for (int i = 0; i < 100; ++i) {
    const Block a = {random.Uniform(-5, 5), random.Uniform(-5, 5)};
    const Block b = {random.Uniform(-5, 5), random.Uniform(-5, 5)};
    const Block pose = {a[0], a[1], random.Uniform(-kPi, kPi)};
    testing::ExpectJacobiansMatchDifferences(*plain, {a, b}, 1e-5);
    testing::ExpectJacobiansMatchDifferences(*mixed, {pose, b}, 1e-5);
  }
  // Nearly coincident: the gradient turns within the distance itself.
  testing::ExpectJacobiansMatchDifferences(
      *plain, {{1.0, 1.0}, {1.0 + 1e-6, 1.0 - 1e-6}}, 1e-4, 1e-9);
}

TEST(PointPointDistanceTest, FiniteAtZeroDistance) {
  const std::unique_ptr<ceres::CostFunction> cost(
      PointPointDistance::Create(1.5, 2.0));
  const auto result = Evaluate(*cost, {{1.0, 2.0}, {1.0, 2.0}});
  EXPECT_DOUBLE_EQ(result.residual[0], -3.0);
  EXPECT_DOUBLE_EQ(result.jacobians[0](0, 0), -2.0);
  EXPECT_EQ(result.jacobians[0](0, 1), 0.0);
  EXPECT_DOUBLE_EQ(result.jacobians[1](0, 0), 2.0);
  EXPECT_EQ(result.jacobians[1](0, 1), 0.0);
}

TEST(PointPointDistanceTest, SolverLeavesZeroDistance) {
  double p1[2] = {1.0, 1.0};
  double p2[2] = {1.0, 1.0};
  ceres::Problem problem;
  problem.AddResidualBlock(PointPointDistance::Create(2.0, 10.0), nullptr, p1,
                           p2);
  problem.SetParameterBlockConstant(p1);
  ceres::Solver::Options options;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  EXPECT_TRUE(summary.IsSolutionUsable());
  EXPECT_NEAR(std::hypot(p2[0] - p1[0], p2[1] - p1[1]), 2.0, 1e-6);
}

TEST(PointPointDistanceTest, UnchangedWhenTheWorldMoves) {
  const std::unique_ptr<ceres::CostFunction> cost(
      PointPointDistance::Create(4.5, 2.0));
  for (const Pose2& motion : testing::WorldMotions()) {
    const auto result =
        Evaluate(*cost, {testing::MovePoint(motion, {1.0, 2.0}),
                         testing::MovePoint(motion, {4.0, 6.0})});
    EXPECT_NEAR(result.residual[0], 1.0, 1e-10);
  }
}

}  // namespace
}  // namespace plumbline
