#include <gtest/gtest.h>
#include <plumbline/factors/pose_end_points.h>

#include <memory>

#include "factors/factors_test_util.h"

namespace plumbline {
namespace {

using testing::Evaluate;
using testing::Random;

Eigen::Matrix4d Weight() {
  Eigen::Matrix4d weight;
  weight << 2.0, 1.0, 0.0, 0.5,  //
      0.0, 3.0, -1.0, 0.0,       //
      0.0, 0.0, 4.0, 1.0,        //
      0.0, 0.0, 0.0, 5.0;
  return weight;
}

testing::Block MoveEnds(const Pose2& motion, const testing::Block& ends) {
  const testing::Block first = testing::MovePoint(motion, {ends[0], ends[1]});
  const testing::Block second = testing::MovePoint(motion, {ends[2], ends[3]});
  return {first[0], first[1], second[0], second[1]};
}

TEST(PoseEndPointsTest, ByHand) {
  // Looking up from (1, 2): (4, 6) is 4 m ahead and 3 m to the right, (0, 2) is
  // 1 m to the left.
  const std::unique_ptr<ceres::CostFunction> cost(PoseEndPoints::Create(
      Eigen::Vector4d(3.5, -3.25, -0.125, 0.0), Weight()));
  const auto result =
      Evaluate(*cost, {{1.0, 2.0, kPi / 2}, {4.0, 6.0, 0.0, 2.0}});
  // The error is (0.5, 0.25, 0.125, 1).
  EXPECT_NEAR(result.residual[0], 1.0 + 0.25 + 0.5, 1e-14);
  EXPECT_NEAR(result.residual[1], 0.75 - 0.125, 1e-14);
  EXPECT_NEAR(result.residual[2], 0.5 + 1.0, 1e-14);
  EXPECT_NEAR(result.residual[3], 5.0, 1e-14);
  Eigen::Matrix4d turn = Eigen::Matrix4d::Zero();
  turn(0, 1) = turn(2, 3) = 1.0;
  turn(1, 0) = turn(3, 2) = -1.0;
  EXPECT_LT((result.jacobians[1] - Weight() * turn).norm(), 1e-14);
}

TEST(PoseEndPointsTest, JacobiansMatchDifferences) {
  Random random(37);
  const std::unique_ptr<ceres::CostFunction> cost(
      PoseEndPoints::Create(Eigen::Vector4d(1.0, -0.5, 2.0, 0.25), Weight()));
  for (int i = 0; i < 100; ++i) {
    testing::ExpectJacobiansMatchDifferences(
        *cost,
        {{random.Uniform(-9, 9), random.Uniform(-9, 9), random.Uniform(-4, 4)},
         {random.Uniform(-9, 9), random.Uniform(-9, 9), random.Uniform(-9, 9),
          random.Uniform(-9, 9)}});
  }
  // Both ends on the pose.
  testing::ExpectJacobiansMatchDifferences(
      *cost, {{2.0, 3.0, kPi}, {2.0, 3.0, 2.0, 3.0}});
}

TEST(PoseEndPointsTest, WholeTurnsDoNotMatter) {
  const std::unique_ptr<ceres::CostFunction> cost(
      PoseEndPoints::Create(Eigen::Vector4d(1.0, -0.5, 2.0, 0.25), Weight()));
  const testing::Block ends = {3.0, 1.0, -2.0, 0.5};
  const auto a = Evaluate(*cost, {{0.5, 0.25, 3.0}, ends});
  const auto b = Evaluate(*cost, {{0.5, 0.25, 3.0 + 2 * kPi}, ends});
  EXPECT_LT((a.residual - b.residual).norm(), 1e-13);
}

TEST(PoseEndPointsTest, UnchangedWhenTheWorldMoves) {
  const std::unique_ptr<ceres::CostFunction> cost(
      PoseEndPoints::Create(Eigen::Vector4d(1.0, -0.5, 2.0, 0.25), Weight()));
  const testing::Block pose = {1.0, 2.0, 3.0};
  const testing::Block ends = {-4.0, 0.5, 3.0, 1.0};
  const auto reference = Evaluate(*cost, {pose, ends});
  for (const Pose2& motion : testing::WorldMotions()) {
    const auto result = Evaluate(
        *cost, {testing::MovePose(motion, pose), MoveEnds(motion, ends)});
    EXPECT_LT((result.residual - reference.residual).norm(), 1e-10);
  }
}

}  // namespace
}  // namespace plumbline
