#include <ceres/ceres.h>
#include <gtest/gtest.h>
#include <plumbline/factors/angle.h>
#include <plumbline/factors/information.h>
#include <plumbline/factors/wall_visibility.h>

#include <cmath>
#include <memory>
#include <vector>

#include "factors/factors_test_util.h"

namespace plumbline {
namespace {

using testing::Block;
using testing::Evaluate;
using testing::Random;

std::unique_ptr<ceres::CostFunction> Visibility(
    double x, double y, double side,
    const Eigen::Matrix3d& weight = Eigen::Matrix3d::Identity()) {
  return std::unique_ptr<ceres::CostFunction>(
      WallVisibility::Create(Eigen::Vector3d(x, y, side), weight));
}

// How far a point of the pose's frame lies to the left of the segment.
double Across(const Block& pose, const Block& segment, double x, double y) {
  return TransformPoint(Inverse(Pose2(segment[0], segment[1], segment[2])),
                        TransformPoint(Pose2(pose[0], pose[1], pose[2]),
                                       Eigen::Vector2d(x, y)))
      .y();
}

TEST(WallVisibilityTest, ByHand) {
  // The robot at (1, 2) looks up, along y. The wall y = 5 was seen from below:
  // it runs towards -x. The sight line ends 0.5 behind it, at (0, 5.5).
  const Block pose = {1.0, 2.0, kPi / 2};
  const Block wall = {4.0, 5.0, kPi};
  auto result = Evaluate(*Visibility(3.5, 1.0, 1.0), {pose, wall});
  // Back along the robot's x axis.
  EXPECT_NEAR(result.residual[0], -0.5, 1e-14);
  EXPECT_NEAR(result.residual[1], 0.0, 1e-14);
  EXPECT_EQ(result.residual[2], 0.0);
  // The wall would have to go up, or the robot down.
  EXPECT_NEAR(result.jacobians[0](0, 1), -1.0, 1e-14);
  EXPECT_NEAR(result.jacobians[1](0, 1), 1.0, 1e-14);

  Eigen::Matrix3d weight;
  weight << 2.0, 1.0, 0.0, 0.0, 3.0, 0.5, 0.0, 0.0, 4.0;
  // The same wall, the robot looks along x: the end is at (1 + 2, 2 + 3.25).
  result =
      Evaluate(*Visibility(2.0, 3.25, 1.0, weight), {{1.0, 2.0, 0.0}, wall});
  EXPECT_NEAR(result.residual[0], -0.25, 1e-14);  // 1 * -0.25
  EXPECT_NEAR(result.residual[1], -0.75, 1e-14);  // 3 * -0.25
  EXPECT_EQ(result.residual[2], 0.0);
}

TEST(WallVisibilityTest, FromBehindTheFace) {
  // The wall y = 5, seen from below, the robot above it looks down to y = 4.8.
  const Block pose = {0.0, 7.0, 0.0};
  const Block wall = {4.0, 5.0, kPi};
  const auto result = Evaluate(*Visibility(0.0, -2.2, -1.0), {pose, wall});
  EXPECT_NEAR(result.residual[1], 0.2, 1e-14);
  // On the right side of it nothing is said.
  EXPECT_EQ(Evaluate(*Visibility(0.0, -1.9, -1.0), {pose, wall}).residual,
            Eigen::Vector3d::Zero());
}

TEST(WallVisibilityTest, OneSided) {
  Random random(51);
  int held = 0;
  int violated = 0;
  for (int i = 0; i < 200; ++i) {
    const Block pose = {random.Uniform(-9, 9), random.Uniform(-9, 9),
                        random.Uniform(-kPi, kPi)};
    const Block wall = {random.Uniform(-9, 9), random.Uniform(-9, 9),
                        random.Uniform(-kPi, kPi)};
    const double x = random.Uniform(-9, 9);
    const double y = random.Uniform(-9, 9);
    const double side = random.Uniform(0, 1) < 0.5 ? 1.0 : -1.0;
    const double behind = -side * Across(pose, wall, x, y);
    const auto result = Evaluate(*Visibility(x, y, side), {pose, wall});
    EXPECT_NEAR(result.residual.norm(), std::max(0.0, behind), 1e-12);
    if (behind > 0.0) {
      ++violated;
    } else {
      ++held;
      EXPECT_EQ(result.residual, Eigen::Vector3d::Zero());
      for (const Eigen::MatrixXd& jacobian : result.jacobians) {
        EXPECT_TRUE(jacobian.isZero(0.0));
      }
    }
  }
  EXPECT_GT(held, 50);
  EXPECT_GT(violated, 50);
}

TEST(WallVisibilityTest, ChiSquareOfTheViolation) {
  Random random(52);
  for (int i = 0; i < 50; ++i) {
    const Block pose = {random.Uniform(-9, 9), random.Uniform(-9, 9),
                        random.Uniform(-kPi, kPi)};
    const Block wall = {random.Uniform(-9, 9), random.Uniform(-9, 9),
                        random.Uniform(-kPi, kPi)};
    const double turn = wall[2] - pose[2];
    const Eigen::Matrix3d information = WallVisibilityInformation(
        Eigen::Vector2d(-std::sin(turn), std::cos(turn)), 0.05);
    EXPECT_EQ(InformationRank(information), 1);
    const double behind = Across(pose, wall, 3.0, -1.0);
    const double side = behind > 0.0 ? -1.0 : 1.0;
    const auto result =
        Evaluate(*Visibility(3.0, -1.0, side, SqrtInformation(information)),
                 {pose, wall});
    EXPECT_NEAR(result.residual.norm(), std::abs(behind) / 0.05,
                1e-9 * (1.0 + std::abs(behind) / 0.05));
  }
}

TEST(WallVisibilityTest, JacobiansMatchDifferences) {
  Random random(53);
  Eigen::Matrix3d weight;
  weight << 2.0, 1.0, 0.0, 0.0, 3.0, 0.5, 0.0, 0.0, 4.0;
  int compared = 0;
  while (compared < 100) {
    const Block pose = {random.Uniform(-9, 9), random.Uniform(-9, 9),
                        random.Uniform(-kPi, kPi)};
    const Block wall = {random.Uniform(-9, 9), random.Uniform(-9, 9),
                        random.Uniform(-kPi, kPi)};
    const double x = random.Uniform(-9, 9);
    const double y = random.Uniform(-9, 9);
    // Away from the edge of the inequality.
    if (std::abs(Across(pose, wall, x, y)) < 1e-3) continue;
    testing::ExpectJacobiansMatchDifferences(*Visibility(x, y, 1.0, weight),
                                             {pose, wall});
    ++compared;
  }
}

TEST(WallVisibilityTest, FiniteAndContinuousAtTheEdge) {
  const auto cost = Visibility(3.0, 0.0, 1.0);
  const Block pose = {0.0, 0.0, 0.0};
  // The wall x = 3, seen from the origin, then a hair before and behind it.
  for (const double x : {3.0, 3.0 - 1e-12, 3.0 + 1e-12, 3.0 - 1e-300}) {
    const auto result = Evaluate(*cost, {pose, {x, 0.0, kPi / 2}});
    EXPECT_LT(result.residual.norm(), 1e-11);
    for (const Eigen::MatrixXd& jacobian : result.jacobians) {
      EXPECT_TRUE(jacobian.allFinite());
    }
  }
}

TEST(WallVisibilityTest, NoJumpAtPi) {
  const auto cost = Visibility(3.0, 1.0, 1.0);
  for (const double step : {1e-12, -1e-12}) {
    const auto here = Evaluate(*cost, {{1.0, 2.0, kPi}, {0.0, 4.0, 0.3}});
    const auto there =
        Evaluate(*cost, {{1.0, 2.0, -kPi + step}, {0.0, 4.0, 0.3}});
    EXPECT_GT(here.residual.norm(), 1.0);
    EXPECT_LT((here.residual - there.residual).norm(), 1e-10);
  }
}

TEST(WallVisibilityTest, UnchangedWhenTheWorldMoves) {
  const auto cost = Visibility(3.0, 1.0, -1.0);
  const Block pose = {1.0, 2.0, 3.0};
  const Block wall = {0.0, -4.0, 1.2};
  const auto reference = Evaluate(*cost, {pose, wall});
  ASSERT_GT(reference.residual.norm(), 0.1);
  for (const Pose2& motion : testing::WorldMotions()) {
    const auto result = Evaluate(*cost, {testing::MovePose(motion, pose),
                                         testing::MovePose(motion, wall)});
    EXPECT_LT((result.residual - reference.residual).norm(), 1e-9);
  }
}

TEST(WallVisibilityTest, NothingAlongTheWall) {
  const Block pose = {1.0, 2.0, 0.4};
  const double direction = -2.0;
  // Behind the wall, whichever side that is.
  const double across = Across(pose, {0.5, 1.0, direction}, 3.0, 1.0);
  const auto cost = Visibility(3.0, 1.0, across > 0.0 ? -1.0 : 1.0);
  const auto here = Evaluate(*cost, {pose, {0.5, 1.0, direction}});
  ASSERT_GT(here.residual.norm(), 0.1);
  const auto there =
      Evaluate(*cost, {pose,
                       {0.5 + 5.0 * std::cos(direction),
                        1.0 + 5.0 * std::sin(direction), direction}});
  EXPECT_LT((here.residual - there.residual).norm(), 1e-12);
}

TEST(WallVisibilityTest, ASightLineAlongTheWall) {
  // Parallel to the wall and 0.3 behind it, whatever its length.
  for (const double x : {0.0, 1.0, 100.0}) {
    const auto result =
        Evaluate(*Visibility(x, -0.3, 1.0), {{0, 0, 0}, {0, 0, 0}});
    EXPECT_NEAR(result.residual[1], 0.3, 1e-13);
    EXPECT_TRUE(result.jacobians[1].allFinite());
  }
}

// Solves for the wall with the pose held and a weak idea of where it is.
double SolvedWall(double wall_y, double end_y) {
  double pose[3] = {0.0, 0.0, 0.0};
  double wall[3] = {5.0, wall_y, kPi};
  ceres::Problem problem;
  problem.AddResidualBlock(
      WallVisibility::Create(Eigen::Vector3d(2.0, end_y, 1.0),
                             SqrtInformation(WallVisibilityInformation(
                                 Eigen::Vector2d::UnitY(), 0.001))),
      nullptr, pose, wall);
  problem.SetParameterBlockConstant(pose);
  problem.SetManifold(wall, new ceres::SubsetManifold(3, {0, 2}));
  ceres::Solver::Options options;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  EXPECT_TRUE(summary.IsSolutionUsable());
  return wall[1];
}

TEST(WallVisibilityTest, PushesAWallBackAndPullsNone) {
  // The wall was seen from below, the sight line ends at y = 4.
  EXPECT_NEAR(SolvedWall(3.5, 4.0), 4.0, 1e-6);
  EXPECT_EQ(SolvedWall(4.5, 4.0), 4.5);
}

}  // namespace
}  // namespace plumbline
