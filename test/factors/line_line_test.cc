#include <gtest/gtest.h>
#include <plumbline/factors/line_line.h>

#include <memory>

#include "factors/factors_test_util.h"

namespace plumbline {
namespace {

using testing::Evaluate;
using testing::Random;
using testing::Weight2;

TEST(LineLineTest, ByHand) {
  // y = 1 against the line x = 1 upwards, which is 2 m to the left of its
  // anchor (3, 4) and so at -1 from the origin.
  const std::unique_ptr<ceres::CostFunction> cost(LineLine::Create(
      Eigen::Vector2d(-2.5, kPi / 2 - 0.25), Eigen::Vector2d::Zero(),
      Eigen::Vector2d(3.0, 4.0), Weight2()));
  const auto result = Evaluate(*cost, {{1.0, 0.0}, {2.0, kPi / 2}});
  EXPECT_NEAR(result.residual[0], 2 * 0.5 + 0.25, 1e-14);
  EXPECT_NEAR(result.residual[1], 3 * 0.25, 1e-14);
  Eigen::Matrix2d first;
  first << -2.0, -1.0,  //
      0.0, -3.0;
  EXPECT_LT((result.jacobians[0] - first).norm(), 1e-14);
  // Turning the second line about its anchor moves it by -4 at the origin.
  Eigen::Matrix2d second;
  second << 2.0, -7.0,  //
      0.0, 3.0;
  EXPECT_LT((result.jacobians[1] - second).norm(), 1e-14);
}

TEST(LineLineTest, AngleIsWrapped) {
  const LineLine relation(Eigen::Vector2d(0.0, 0.2), Eigen::Vector2d::Zero(),
                          Eigen::Vector2d::Zero(), Eigen::Matrix2d::Identity());
  const double line1[2] = {0.0, 3.0};
  const double line2[2] = {0.0, -3.0};
  double residual[2];
  relation(line1, line2, residual);
  EXPECT_NEAR(residual[1], 0.08318530717958648, 1e-14);  // 2 pi - 6.2
  relation(line2, line1, residual);
  EXPECT_NEAR(residual[1], -0.48318530717958648, 1e-14);  // 6 - 2 pi - 0.2
}

TEST(LineLineTest, JacobiansMatchDifferences) {
  Random random(36);
  for (int i = 0; i < 100; ++i) {
    const double alpha = random.Uniform(-kPi, kPi);
    const double turn = random.Uniform(-3, 3);
    const std::unique_ptr<ceres::CostFunction> cost(LineLine::Create(
        Eigen::Vector2d(random.Uniform(-3, 3), 0.1),
        Eigen::Vector2d(random.Uniform(-9, 9), random.Uniform(-9, 9)),
        Eigen::Vector2d(random.Uniform(-9, 9), random.Uniform(-9, 9)),
        Weight2()));
    testing::ExpectJacobiansMatchDifferences(
        *cost, {{random.Uniform(-9, 9), alpha},
                {random.Uniform(-9, 9), alpha + turn}});
  }
}

TEST(LineLineTest, UnchangedWhenTheWorldIsTurned) {
  const Eigen::Vector2d anchor1(10.0, 20.0);
  const Eigen::Vector2d anchor2(-3.0, 5.0);
  const testing::Block line1 = {1.0, 0.3};
  const testing::Block line2 = {-2.0, 2.0};
  const Eigen::Vector2d expected(0.5, -1.0);
  const std::unique_ptr<ceres::CostFunction> near(
      LineLine::Create(expected, anchor1, anchor2, Weight2()));
  const auto reference = Evaluate(*near, {line1, line2});
  const Pose2 turn(0.0, 0.0, 2.0);
  const std::unique_ptr<ceres::CostFunction> cost(
      LineLine::Create(expected, TransformPoint(turn, anchor1),
                       TransformPoint(turn, anchor2), Weight2()));
  const auto result = Evaluate(
      *cost, {testing::MoveLine(turn, line1), testing::MoveLine(turn, line2)});
  EXPECT_LT((result.residual - reference.residual).norm(), 1e-12);
}

TEST(LineLineTest, ParallelLinesMayBeMovedAndTurned) {
  const Eigen::Vector2d anchor1(10.0, 20.0);
  const Eigen::Vector2d anchor2(-3.0, 5.0);
  const testing::Block line1 = {1.0, 0.3};
  const testing::Block line2 = {-2.0, 0.3};
  const std::unique_ptr<ceres::CostFunction> near(
      LineLine::Create(Eigen::Vector2d::Zero(), anchor1, anchor2, Weight2()));
  const auto reference = Evaluate(*near, {line1, line2});
  for (const Pose2& motion : testing::WorldMotions()) {
    const std::unique_ptr<ceres::CostFunction> cost(LineLine::Create(
        Eigen::Vector2d::Zero(), TransformPoint(motion, anchor1),
        TransformPoint(motion, anchor2), Weight2()));
    const auto result = Evaluate(*cost, {testing::MoveLine(motion, line1),
                                         testing::MoveLine(motion, line2)});
    EXPECT_LT((result.residual - reference.residual).norm(), 1e-10);
  }
}

}  // namespace
}  // namespace plumbline
