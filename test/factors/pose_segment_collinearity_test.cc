#include <ceres/problem.h>
#include <ceres/solver.h>
#include <gtest/gtest.h>
#include <plumbline/factors/pose_segment_collinearity.h>

#include <cmath>
#include <memory>

#include "factors/factors_test_util.h"

namespace plumbline {
namespace {

using testing::Block;
using testing::Evaluate;
using testing::Random;
using testing::Weight2;

TEST(PoseSegmentCollinearityTest, ByHand) {
  // The segment points up at x = 2, the pose is 1 to its left and turned by 0.5
  // against it. Error (1 - 0.75, 0.5 - 0.25).
  const Eigen::Vector2d expected(0.75, 0.25);
  const std::vector<Block> blocks = {{1.0, 5.0, kPi / 2 + 0.5},
                                     {2.0, 1.0, kPi / 2}};
  const std::unique_ptr<ceres::CostFunction> free(
      PoseSegmentCollinearity::Create(expected, Weight2()));
  const std::unique_ptr<ceres::CostFunction> clamped(
      PoseSegmentCollinearityClamped::Create(expected, Weight2()));
  for (const auto* cost : {free.get(), clamped.get()}) {
    const auto result = Evaluate(*cost, blocks);
    EXPECT_NEAR(result.residual[0], 0.75, 1e-14);  // 2 * 0.25 + 0.25
    EXPECT_NEAR(result.residual[1], 0.75, 1e-14);
    // Nothing is said about the way along the segment.
    EXPECT_NEAR(result.jacobians[0](0, 0), -2.0, 1e-14);
    EXPECT_NEAR(result.jacobians[0](0, 1), 0.0, 1e-14);
    EXPECT_NEAR(result.jacobians[0](0, 2), 1.0, 1e-14);
    EXPECT_NEAR(result.jacobians[0](1, 2), 3.0, 1e-14);
  }
}

TEST(PoseSegmentCollinearityTest, EquationOfThePaper) {
  Random random(10);
  for (int i = 0; i < 50; ++i) {
    const double p[3] = {random.Uniform(-9, 9), random.Uniform(-9, 9),
                         random.Uniform(-1.5, 1.5)};
    const double s[3] = {random.Uniform(-9, 9), random.Uniform(-9, 9),
                         random.Uniform(-1.5, 1.5)};
    double residual[2];
    PoseSegmentCollinearity(Eigen::Vector2d::Zero(),
                            Eigen::Matrix2d::Identity())(p, s, residual);
    EXPECT_NEAR(residual[0],
                s[0] * std::sin(s[2]) - s[1] * std::cos(s[2]) -
                    p[0] * std::sin(s[2]) + p[1] * std::cos(s[2]),
                1e-13);
    EXPECT_NEAR(residual[1], p[2] - s[2], 1e-13);
  }
}

TEST(PoseSegmentCollinearityTest, HeadingErrorIsWrappedModuloTwoPi) {
  const PoseSegmentCollinearity relation(Eigen::Vector2d(0.0, 0.2),
                                         Eigen::Matrix2d::Identity());
  const double pose[3] = {0.0, 0.0, -3.0};
  const double segment[3] = {0.0, 0.0, 3.0};
  const double turned[3] = {0.0, 0.0, 3.0 - kPi};
  double residual[2];
  relation(pose, segment, residual);
  EXPECT_NEAR(residual[1], 0.08318530717958648, 1e-14);  // 2 pi - 6.2
  relation(pose, turned, residual);
  EXPECT_NEAR(residual[1], 0.08318530717958648 - kPi, 1e-14);
}

TEST(PoseSegmentCollinearityTest, JacobiansMatchDifferences) {
  Random random(11);
  const std::unique_ptr<ceres::CostFunction> cost(
      PoseSegmentCollinearity::Create(Eigen::Vector2d(0.5, 0.0), Weight2()));
  for (int i = 0; i < 100; ++i) {
    const double heading = random.Uniform(-kPi, kPi);
    testing::ExpectJacobiansMatchDifferences(
        *cost, {{random.Uniform(-9, 9), random.Uniform(-9, 9),
                 NormalizeAngle(heading + random.Uniform(-3.0, 3.0))},
                {random.Uniform(-9, 9), random.Uniform(-9, 9), heading}});
  }
  testing::ExpectJacobiansMatchDifferences(*cost, {{0, 0, kPi}, {0, 0, -kPi}});
}

TEST(PoseSegmentCollinearityTest, ClampedSegmentHasNoDerivative) {
  Random random(12);
  const Eigen::Vector2d expected(0.5, -0.25);
  const std::unique_ptr<ceres::CostFunction> free(
      PoseSegmentCollinearity::Create(expected, Weight2()));
  const std::unique_ptr<ceres::CostFunction> clamped(
      PoseSegmentCollinearityClamped::Create(expected, Weight2()));
  for (int i = 0; i < 20; ++i) {
    std::vector<Block> blocks(2);
    for (Block& block : blocks) {
      block = {random.Uniform(-9, 9), random.Uniform(-9, 9),
               random.Uniform(-kPi, kPi)};
    }
    const auto of_free = Evaluate(*free, blocks);
    const auto of_clamped = Evaluate(*clamped, blocks);
    EXPECT_EQ(of_clamped.residual, of_free.residual);
    EXPECT_EQ(of_clamped.jacobians[0], of_free.jacobians[0]);
    EXPECT_EQ(of_clamped.jacobians[1], Eigen::MatrixXd::Zero(2, 3));
    EXPECT_GT(of_free.jacobians[1].norm(), 1.0);
  }
}

TEST(PoseSegmentCollinearityTest, ClampedMovesThePoseOnly) {
  // Two walls at a right angle fix a pose; they stay where they are.
  double pose[3] = {0.3, -0.2, 0.1};
  double wall_x[3] = {0.0, 2.0, 0.0};
  double wall_y[3] = {3.0, 0.0, kPi / 2};
  ceres::Problem problem;
  const Eigen::Matrix2d weight = 10.0 * Eigen::Matrix2d::Identity();
  problem.AddResidualBlock(PoseSegmentCollinearityClamped::Create(
                               Eigen::Vector2d(-2.0, 0.0), weight),
                           nullptr, pose, wall_x);
  problem.AddResidualBlock(PoseSegmentCollinearityClamped::Create(
                               Eigen::Vector2d(3.0, -kPi / 2), weight),
                           nullptr, pose, wall_y);
  ceres::Solver::Options options;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  ASSERT_TRUE(summary.IsSolutionUsable());
  for (double value : pose) EXPECT_NEAR(value, 0.0, 1e-8);
  EXPECT_EQ(wall_x[1], 2.0);
  EXPECT_EQ(wall_y[0], 3.0);
  EXPECT_EQ(wall_y[2], kPi / 2);
}

TEST(PoseSegmentCollinearityTest, UnchangedWhenTheWorldMoves) {
  const std::unique_ptr<ceres::CostFunction> cost(
      PoseSegmentCollinearity::Create(Eigen::Vector2d(0.5, -0.25), Weight2()));
  const Block pose = {1.0, 2.0, 3.0};
  const Block segment = {0.0, 4.0, 1.2};
  const auto reference = Evaluate(*cost, {pose, segment});
  for (const Pose2& motion : testing::WorldMotions()) {
    const auto result = Evaluate(*cost, {testing::MovePose(motion, pose),
                                         testing::MovePose(motion, segment)});
    EXPECT_LT((result.residual - reference.residual).norm(), 1e-10);
  }
}

}  // namespace
}  // namespace plumbline
