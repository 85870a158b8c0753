#include <gtest/gtest.h>
#include <plumbline/factors/pose_line.h>

#include <cmath>
#include <memory>

#include "factors/factors_test_util.h"

namespace plumbline {
namespace {

using testing::Evaluate;
using testing::Random;
using testing::Weight2;

TEST(PoseLineTest, ByHand) {
  // Anchor (10, 20), d = 1, alpha = 0: the line y = 21, 2.5 m to the left of
  // (13, 18.5) for one who looks along it, and turned by -0.5 against one whose
  // heading is 0.5.
  const std::unique_ptr<ceres::CostFunction> cost(PoseLine::Create(
      Eigen::Vector2d(2.0, -0.75), Eigen::Vector2d(10.0, 20.0), Weight2()));
  const auto result = Evaluate(*cost, {{13.0, 18.5, 0.5}, {1.0, 0.0}});
  EXPECT_NEAR(result.residual[0], 2 * 0.5 + 0.25, 1e-14);
  EXPECT_NEAR(result.residual[1], 3 * 0.25, 1e-14);
  Eigen::Matrix<double, 2, 3> pose;
  pose << 0.0, -2.0, -1.0,  //
      0.0, 0.0, -3.0;
  EXPECT_LT((result.jacobians[0] - pose).norm(), 1e-14);
  Eigen::Matrix2d line;
  line << 2.0, 7.0,  //
      0.0, 3.0;
  EXPECT_LT((result.jacobians[1] - line).norm(), 1e-14);
}

// The normal (theta, rho) of g2o, moved into the frame of the pose.
TEST(PoseLineTest, NormalForm) {
  Random random(34);
  for (int i = 0; i < 50; ++i) {
    const double pose[3] = {random.Uniform(-9, 9), random.Uniform(-9, 9),
                            random.Uniform(-kPi, kPi)};
    const double theta = random.Uniform(-kPi, kPi);
    const double rho = random.Uniform(-9, 9);
    const double line[2] = {rho, theta - kPi / 2};
    const double seen_theta = theta - pose[2];
    const double seen_rho =
        rho - std::cos(theta) * pose[0] - std::sin(theta) * pose[1];
    double residual[2];
    PoseLine(Eigen::Vector2d(seen_rho, seen_theta - kPi / 2),
             Eigen::Vector2d::Zero(), Weight2())(pose, line, residual);
    for (double row : residual) EXPECT_NEAR(row, 0.0, 1e-13);
  }
}

TEST(PoseLineTest, DirectionErrorIsWrapped) {
  const PoseLine relation(Eigen::Vector2d(0.0, 0.2), Eigen::Vector2d::Zero(),
                          Eigen::Matrix2d::Identity());
  const double pose[3] = {0.0, 0.0, 3.0};
  const double line[2] = {0.0, -3.0};
  double residual[2];
  relation(pose, line, residual);
  EXPECT_NEAR(residual[1], 0.08318530717958648, 1e-14);  // 2 pi - 6.2
  const double back[3] = {0.0, 0.0, -3.0};
  const double other[2] = {0.0, 3.0};
  relation(back, other, residual);
  EXPECT_NEAR(residual[1], -0.48318530717958648, 1e-14);  // 6 - 2 pi - 0.2
}

// Lines have a direction: the same line turned round is off by pi.
TEST(PoseLineTest, TurnedRound) {
  const PoseLine relation(Eigen::Vector2d(2.0, 0.25), Eigen::Vector2d::Zero(),
                          Eigen::Matrix2d::Identity());
  const double pose[3] = {0.0, 0.0, 0.0};
  const double line[2] = {-2.0, 0.25 - kPi};
  double residual[2];
  relation(pose, line, residual);
  EXPECT_NEAR(residual[0], -4.0, 1e-14);
  EXPECT_NEAR(std::abs(residual[1]), kPi, 1e-14);
}

TEST(PoseLineTest, JacobiansMatchDifferences) {
  Random random(35);
  for (int i = 0; i < 100; ++i) {
    const double theta = random.Uniform(-kPi, kPi);
    const double alpha = random.Uniform(-kPi, kPi);
    const std::unique_ptr<ceres::CostFunction> cost(PoseLine::Create(
        Eigen::Vector2d(random.Uniform(-3, 3),
                        NormalizeAngle(alpha - theta + random.Uniform(-3, 3))),
        Eigen::Vector2d(random.Uniform(-9, 9), random.Uniform(-9, 9)),
        Weight2()));
    testing::ExpectJacobiansMatchDifferences(
        *cost, {{random.Uniform(-9, 9), random.Uniform(-9, 9), theta},
                {random.Uniform(-9, 9), alpha}});
  }
}

TEST(PoseLineTest, UnchangedWhenTheWorldMoves) {
  const Eigen::Vector2d anchor(10.0, 20.0);
  const testing::Block pose = {13.0, 23.5, 2.0};
  const testing::Block line = {1.0, 0.3};
  const Eigen::Vector2d expected(0.5, -1.0);
  const std::unique_ptr<ceres::CostFunction> near(
      PoseLine::Create(expected, anchor, Weight2()));
  const auto reference = Evaluate(*near, {pose, line});
  for (const Pose2& motion : testing::WorldMotions()) {
    const std::unique_ptr<ceres::CostFunction> cost(
        PoseLine::Create(expected, TransformPoint(motion, anchor), Weight2()));
    const auto result = Evaluate(*cost, {testing::MovePose(motion, pose),
                                         testing::MoveLine(motion, line)});
    EXPECT_LT((result.residual - reference.residual).norm(), 1e-10);
    EXPECT_LT((result.jacobians[1] - reference.jacobians[1]).norm(), 1e-10);
  }
}

}  // namespace
}  // namespace plumbline
