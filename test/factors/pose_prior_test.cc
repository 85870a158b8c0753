#include <gtest/gtest.h>
#include <plumbline/factors/pose_prior.h>

#include <memory>

#include "factors/factors_test_util.h"

namespace plumbline {
namespace {

using testing::Evaluate;
using testing::Random;
using testing::Weight3;

TEST(PosePriorTest, ByHand) {
  // Looking up from (1, 2), the pose at (4, 6) is 4 m ahead, 3 m to the right.
  const std::unique_ptr<ceres::CostFunction> cost(
      PosePrior::Create(Pose2(1.0, 2.0, kPi / 2), Weight3()));
  const auto result = Evaluate(*cost, {{4.0, 6.0, kPi / 2 + 0.25}});
  EXPECT_NEAR(result.residual[0], 8.0 - 3.0 + 0.125, 1e-14);
  EXPECT_NEAR(result.residual[1], -9.0 - 0.25, 1e-14);
  EXPECT_NEAR(result.residual[2], 1.0, 1e-14);
  Eigen::Matrix3d turn;
  turn << 0, 1, 0, -1, 0, 0, 0, 0, 1;
  EXPECT_LT((result.jacobians[0] - Weight3() * turn).norm(), 1e-14);
}

TEST(PosePriorTest, AgreesWithBetween) {
  Random random(38);
  for (int i = 0; i < 50; ++i) {
    const Pose2 expected(random.Uniform(-9, 9), random.Uniform(-9, 9),
                         random.Uniform(-4, 4));
    const Pose2 pose(random.Uniform(-9, 9), random.Uniform(-9, 9),
                     random.Uniform(-4, 4));
    Eigen::Vector3d residual;
    PosePrior(expected, Weight3())(pose.data(), residual.data());
    EXPECT_LT((residual - Weight3() * Between(expected, pose)).norm(), 1e-12);
  }
}

TEST(PosePriorTest, HeadingErrorIsWrapped) {
  const PosePrior relation(Pose2(0.0, 0.0, 3.0), Eigen::Matrix3d::Identity());
  const double pose[3] = {0.0, 0.0, -3.0};
  double residual[3];
  relation(pose, residual);
  EXPECT_NEAR(residual[2], 0.28318530717958648, 1e-14);  // 2 pi - 6
}

TEST(PosePriorTest, JacobiansMatchDifferences) {
  Random random(39);
  for (int i = 0; i < 100; ++i) {
    const double heading = random.Uniform(-kPi, kPi);
    const std::unique_ptr<ceres::CostFunction> cost(PosePrior::Create(
        Pose2(random.Uniform(-9, 9), random.Uniform(-9, 9), heading),
        Weight3()));
    testing::ExpectJacobiansMatchDifferences(
        *cost, {{random.Uniform(-9, 9), random.Uniform(-9, 9),
                 NormalizeAngle(heading + random.Uniform(-3.0, 3.0))}});
  }
}

TEST(PosePriorTest, UnchangedWhenTheWorldMoves) {
  const testing::Block expected = {1.0, 2.0, 3.0};
  const testing::Block pose = {0.0, 4.0, 1.2};
  const std::unique_ptr<ceres::CostFunction> near(
      PosePrior::Create(Pose2(1.0, 2.0, 3.0), Weight3()));
  const auto reference = Evaluate(*near, {pose});
  for (const Pose2& motion : testing::WorldMotions()) {
    const testing::Block moved = testing::MovePose(motion, expected);
    const std::unique_ptr<ceres::CostFunction> cost(
        PosePrior::Create(Pose2(moved[0], moved[1], moved[2]), Weight3()));
    const auto result = Evaluate(*cost, {testing::MovePose(motion, pose)});
    EXPECT_LT((result.residual - reference.residual).norm(), 1e-10);
  }
}

}  // namespace
}  // namespace plumbline
