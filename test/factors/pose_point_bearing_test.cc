#include <gtest/gtest.h>
#include <plumbline/factors/pose_point_bearing.h>

#include <cmath>
#include <memory>

#include "factors/factors_test_util.h"

namespace plumbline {
namespace {

using testing::Evaluate;
using testing::Random;

TEST(PosePointBearingTest, ByHand) {
  // Straight up from (1, 1), seen by one who looks up to the right.
  const std::unique_ptr<ceres::CostFunction> cost(
      PosePointBearing::Create(kPi / 4 - 0.1, 5.0));
  const auto result = Evaluate(*cost, {{1.0, 1.0, kPi / 4}, {1.0, 3.0}});
  EXPECT_NEAR(result.residual[0], 0.5, 1e-14);
  EXPECT_NEAR(result.jacobians[0](0, 0), 2.5, 1e-14);
  EXPECT_NEAR(result.jacobians[0](0, 1), 0.0, 1e-14);
  EXPECT_NEAR(result.jacobians[0](0, 2), -5.0, 1e-14);
  EXPECT_NEAR(result.jacobians[1](0, 0), -2.5, 1e-14);
  EXPECT_NEAR(result.jacobians[1](0, 1), 0.0, 1e-14);
}

TEST(PosePointBearingTest, ErrorIsWrapped) {
  const PosePointBearing relation(0.2, 1.0);
  const double pose[3] = {2.0, 1.0, 3.0};
  const double point[2] = {2.0 + std::cos(-3.0), 1.0 + std::sin(-3.0)};
  double residual = 0.0;
  relation(pose, point, &residual);
  EXPECT_NEAR(residual, 0.08318530717958648, 1e-14);  // 2 pi - 6.2
  const double back[3] = {2.0, 1.0, -3.0};
  const double other[2] = {2.0 + std::cos(3.0), 1.0 + std::sin(3.0)};
  relation(back, other, &residual);
  EXPECT_NEAR(residual, -0.48318530717958648, 1e-14);  // 6 - 2 pi - 0.2
}

TEST(PosePointBearingTest, NoDirectionNoResidual) {
  const std::unique_ptr<ceres::CostFunction> cost(
      PosePointBearing::Create(0.5, 3.0));
  for (const double distance : {0.0, 1e-300, 1e-10}) {
    const auto result =
        Evaluate(*cost, {{2.0, -1.0, 0.1}, {2.0 + distance, -1.0}});
    EXPECT_EQ(result.residual[0], 0.0);
    EXPECT_EQ(result.jacobians[0].norm(), 0.0);
    EXPECT_EQ(result.jacobians[1].norm(), 0.0);
  }
  const auto near = Evaluate(*cost, {{0.0, 0.0, 0.1}, {1e-8, 0.0}});
  EXPECT_NEAR(near.residual[0], 3.0 * -0.6, 1e-14);
}

TEST(PosePointBearingTest, JacobiansMatchDifferences) {
  Random random(33);
  for (int i = 0; i < 100; ++i) {
    const double x = random.Uniform(-9, 9);
    const double y = random.Uniform(-9, 9);
    const double theta = random.Uniform(-4, 4);
    const double direction = random.Uniform(-kPi, kPi);
    const double distance = random.Uniform(0.5, 9);
    const std::unique_ptr<ceres::CostFunction> cost(PosePointBearing::Create(
        NormalizeAngle(direction - theta + random.Uniform(-3, 3)), 2.0));
    testing::ExpectJacobiansMatchDifferences(
        *cost, {{x, y, theta},
                {x + distance * std::cos(direction),
                 y + distance * std::sin(direction)}});
  }
}

TEST(PosePointBearingTest, UnchangedWhenTheWorldMoves) {
  const std::unique_ptr<ceres::CostFunction> cost(
      PosePointBearing::Create(-1.5, 2.0));
  const testing::Block pose = {1.0, 2.0, 3.0};
  const testing::Block point = {-4.0, 0.5};
  const auto reference = Evaluate(*cost, {pose, point});
  for (const Pose2& motion : testing::WorldMotions()) {
    const auto result = Evaluate(*cost, {testing::MovePose(motion, pose),
                                         testing::MovePoint(motion, point)});
    EXPECT_NEAR(result.residual[0], reference.residual[0], 1e-10);
  }
}

}  // namespace
}  // namespace plumbline
