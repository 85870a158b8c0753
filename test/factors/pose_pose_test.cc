#include <gtest/gtest.h>
#include <plumbline/factors/pose_pose.h>

#include <memory>

#include "factors/factors_test_util.h"

namespace plumbline {
namespace {

using testing::Block;
using testing::Evaluate;
using testing::Random;
using testing::Weight3;

TEST(PosePoseTest, ByHand) {
  // p2 seen from p1 is (2, 1, pi/2); the error is (0.5, 0.25, -0.125).
  const std::unique_ptr<ceres::CostFunction> cost(
      PosePose::Create(Pose2(1.5, 0.75, kPi / 2 + 0.125), Weight3()));
  const auto result = Evaluate(*cost, {{1.0, 2.0, kPi / 2}, {0.0, 4.0, kPi}});
  EXPECT_NEAR(result.residual[0], 2 * 0.5 + 0.25 - 0.5 * 0.125, 1e-14);
  EXPECT_NEAR(result.residual[1], 3 * 0.25 + 0.125, 1e-14);
  EXPECT_NEAR(result.residual[2], -0.5, 1e-14);
  // d e / d p2 is a turn by -theta1.
  Eigen::Matrix3d turn;
  turn << 0, 1, 0, -1, 0, 0, 0, 0, 1;
  EXPECT_LT((result.jacobians[1] - Weight3() * turn).norm(), 1e-14);
}

TEST(PosePoseTest, AgreesWithBetween) {
  Random random(8);
  for (int i = 0; i < 50; ++i) {
    const Block a = {random.Uniform(-9, 9), random.Uniform(-9, 9),
                     random.Uniform(-kPi, kPi)};
    const Block b = {random.Uniform(-9, 9), random.Uniform(-9, 9),
                     random.Uniform(-kPi, kPi)};
    const Pose2 relative =
        Between(Pose2(a[0], a[1], a[2]), Pose2(b[0], b[1], b[2]));
    double residual[3];
    PosePose(relative, Eigen::Matrix3d::Identity())(a.data(), b.data(),
                                                    residual);
    for (double row : residual) EXPECT_NEAR(row, 0.0, 1e-13);
  }
}

TEST(PosePoseTest, HeadingErrorIsWrapped) {
  const PosePose relation(Pose2(0.0, 0.0, 0.2), Eigen::Matrix3d::Identity());
  const double p1[3] = {0.0, 0.0, 3.0};
  const double p2[3] = {0.0, 0.0, -3.0};
  double residual[3];
  relation(p1, p2, residual);
  EXPECT_NEAR(residual[2], 0.08318530717958648, 1e-14);  // 2 pi - 6.2
  relation(p2, p1, residual);
  EXPECT_NEAR(residual[2], -0.48318530717958648, 1e-14);  // 6 - 2 pi - 0.2
}

TEST(PosePoseTest, JacobiansMatchDifferences) {
  Random random(9);
  for (int i = 0; i < 100; ++i) {
    const Pose2 relative(random.Uniform(-3, 3), random.Uniform(-3, 3), 0.0);
    const std::unique_ptr<ceres::CostFunction> cost(
        PosePose::Create(relative, Weight3()));
    const double heading = random.Uniform(-kPi, kPi);
    testing::ExpectJacobiansMatchDifferences(
        *cost, {{random.Uniform(-9, 9), random.Uniform(-9, 9), heading},
                {random.Uniform(-9, 9), random.Uniform(-9, 9),
                 NormalizeAngle(heading + random.Uniform(-3.0, 3.0))}});
  }
  const std::unique_ptr<ceres::CostFunction> cost(
      PosePose::Create(Pose2::Zero(), Weight3()));
  testing::ExpectJacobiansMatchDifferences(*cost, {{0, 0, kPi}, {0, 0, -kPi}});
}

TEST(PosePoseTest, UnchangedWhenTheWorldMoves) {
  const std::unique_ptr<ceres::CostFunction> cost(
      PosePose::Create(Pose2(1.5, 0.75, -2.0), Weight3()));
  const Block a = {1.0, 2.0, 3.0};
  const Block b = {0.0, 4.0, 1.2};
  const auto reference = Evaluate(*cost, {a, b});
  for (const Pose2& motion : testing::WorldMotions()) {
    const auto result = Evaluate(
        *cost, {testing::MovePose(motion, a), testing::MovePose(motion, b)});
    EXPECT_LT((result.residual - reference.residual).norm(), 1e-10);
  }
}

}  // namespace
}  // namespace plumbline
