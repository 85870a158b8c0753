#include <gtest/gtest.h>
#include <plumbline/factors/pose2.h>

#include <Eigen/Core>

#include "factors/factors_test_util.h"

namespace plumbline {
namespace {

using testing::Random;

Pose2 RandomPose(Random* random) {
  return {random->Uniform(-20.0, 20.0), random->Uniform(-20.0, 20.0),
          random->Uniform(-kPi, kPi)};
}

void ExpectNear(const Pose2& actual, const Pose2& expected, double tolerance) {
  EXPECT_NEAR(actual[0], expected[0], tolerance);
  EXPECT_NEAR(actual[1], expected[1], tolerance);
  EXPECT_NEAR(NormalizeAngle(actual[2] - expected[2]), 0.0, tolerance);
}

TEST(Pose2Test, ComposesByHand) {
  // Facing +y at (1, 2): 3 ahead and 1 to the left is (0, 5).
  ExpectNear(Compose(Pose2(1.0, 2.0, kPi / 2), Pose2(3.0, 1.0, 0.25)),
             Pose2(0.0, 5.0, kPi / 2 + 0.25), 1e-15);
  const Eigen::Vector2d moved =
      TransformPoint(Pose2(1.0, 2.0, kPi / 2), Eigen::Vector2d(3.0, 1.0));
  EXPECT_NEAR(moved[0], 0.0, 1e-15);
  EXPECT_NEAR(moved[1], 5.0, 1e-15);
}

TEST(Pose2Test, InvertsByHand) {
  ExpectNear(Inverse(Pose2(1.0, 2.0, kPi / 2)), Pose2(-2.0, 1.0, -kPi / 2),
             1e-15);
}

TEST(Pose2Test, BetweenByHand) {
  ExpectNear(Between(Pose2(1.0, 2.0, kPi / 2), Pose2(0.0, 4.0, kPi)),
             Pose2(2.0, 1.0, kPi / 2), 1e-15);
}

TEST(Pose2Test, TransformsPointsAndDirectionsByHand) {
  const PoseTransform transform(Pose2(1.0, 2.0, M_PI / 2));
  EXPECT_NEAR((transform.Point({3.0, 4.0}) - Eigen::Vector2d(-3.0, 5.0)).norm(),
              0.0, 1e-15);
  EXPECT_NEAR(
      (transform.Direction({3.0, 4.0}) - Eigen::Vector2d(-4.0, 3.0)).norm(),
      0.0, 1e-15);
}

TEST(Pose2Test, HeadingsAreWrapped) {
  EXPECT_DOUBLE_EQ(Compose(Pose2(0, 0, 3.0), Pose2(0, 0, 1.0))[2],
                   4.0 - 2.0 * kPi);
  EXPECT_EQ(Inverse(Pose2(0, 0, kPi))[2], kPi);
  EXPECT_DOUBLE_EQ(Between(Pose2(0, 0, 3.0), Pose2(0, 0, -3.0))[2],
                   2.0 * kPi - 6.0);
}

TEST(Pose2Test, GroupLaws) {
  Random random(1);
  for (int i = 0; i < 100; ++i) {
    const Pose2 a = RandomPose(&random);
    const Pose2 b = RandomPose(&random);
    const Pose2 c = RandomPose(&random);
    ExpectNear(Compose(a, Inverse(a)), Pose2::Zero(), 1e-13);
    ExpectNear(Compose(Inverse(a), a), Pose2::Zero(), 1e-13);
    ExpectNear(Compose(Compose(a, b), c), Compose(a, Compose(b, c)), 1e-12);
    ExpectNear(Between(a, b), Compose(Inverse(a), b), 1e-12);
    ExpectNear(Compose(a, Between(a, b)), b, 1e-12);
  }
}

TEST(Pose2Test, BetweenIsAccurateFarFromTheOrigin) {
  const Pose2 a(1e7, -1e7, 1.0);
  const Pose2 b(1e7 + 1.0, -1e7 + 2.0, 1.5);
  ExpectNear(Between(a, b), Between(Pose2(0, 0, 1.0), Pose2(1.0, 2.0, 1.5)),
             1e-15);
}

TEST(Pose2Test, JacobiansMatchDifferences) {
  Random random(2);
  const double step = 1e-6;
  for (int i = 0; i < 50; ++i) {
    const Pose2 a = RandomPose(&random);
    const Pose2 b = RandomPose(&random);
    const Eigen::Matrix3d first = ComposeJacobianFirst(a, b);
    const Eigen::Matrix3d second = ComposeJacobianSecond(a);
    const Eigen::Matrix3d inverse = InverseJacobian(a);
    const Eigen::Matrix3d between_first = BetweenJacobianFirst(a, b);
    const Eigen::Matrix3d between_second = BetweenJacobianSecond(a);
    for (int p = 0; p < 3; ++p) {
      const Pose2 d = step * Pose2::Unit(p);
      Pose2 by_first = Compose(Pose2(a + d), b) - Compose(Pose2(a - d), b);
      Pose2 by_second = Compose(a, Pose2(b + d)) - Compose(a, Pose2(b - d));
      Pose2 by_inverse = Inverse(Pose2(a + d)) - Inverse(Pose2(a - d));
      Pose2 by_seer = Between(Pose2(a + d), b) - Between(Pose2(a - d), b);
      Pose2 by_seen = Between(a, Pose2(b + d)) - Between(a, Pose2(b - d));
      for (Pose2* difference :
           {&by_first, &by_second, &by_inverse, &by_seer, &by_seen}) {
        (*difference)[2] = NormalizeAngle((*difference)[2]);
        *difference /= 2.0 * step;
      }
      EXPECT_LT((by_first - first.col(p)).norm(), 1e-7);
      EXPECT_LT((by_second - second.col(p)).norm(), 1e-7);
      EXPECT_LT((by_inverse - inverse.col(p)).norm(), 1e-7);
      EXPECT_LT((by_seer - between_first.col(p)).norm(), 1e-7);
      EXPECT_LT((by_seen - between_second.col(p)).norm(), 1e-7);
    }
  }
}

TEST(Pose2Test, UncertaintyByHand) {
  // A heading error of 0.1 at 10 m ahead is an error of 1 m to the side.
  UncertainPose2 turn;
  turn.covariance(2, 2) = 0.01;
  UncertainPose2 ahead;
  ahead.mean = Pose2(10.0, 0.0, 0.0);
  ahead.covariance(0, 0) = 0.25;
  const UncertainPose2 sum = Compose(turn, ahead);
  Eigen::Matrix3d expected;
  expected << 0.25, 0.0, 0.0,  //
      0.0, 1.0, 0.1,           //
      0.0, 0.1, 0.01;
  EXPECT_LT((sum.covariance - expected).norm(), 1e-14);

  // Turned by a right angle, the error along x is one along y.
  UncertainPose2 quarter;
  quarter.mean = Pose2(0.0, 0.0, kPi / 2);
  const UncertainPose2 turned = Compose(quarter, ahead);
  EXPECT_NEAR(turned.covariance(0, 0), 0.0, 1e-15);
  EXPECT_NEAR(turned.covariance(1, 1), 0.25, 1e-15);

  const UncertainPose2 there_and_back = Inverse(Inverse(sum));
  EXPECT_LT((there_and_back.covariance - sum.covariance).norm(), 1e-13);
}

}  // namespace
}  // namespace plumbline
