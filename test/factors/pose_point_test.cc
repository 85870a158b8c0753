#include <gtest/gtest.h>
#include <plumbline/factors/pose_point.h>

#include <memory>

#include "factors/factors_test_util.h"

namespace plumbline {
namespace {

using testing::Evaluate;
using testing::Random;
using testing::Weight2;

TEST(PosePointTest, ByHand) {
  // Looking up from (1, 2), the point (4, 6) is 4 m ahead and 3 m to the right.
  const std::unique_ptr<ceres::CostFunction> cost(
      PosePoint::Create(Eigen::Vector2d(3.5, -3.25), Weight2()));
  const auto result = Evaluate(*cost, {{1.0, 2.0, kPi / 2}, {4.0, 6.0}});
  EXPECT_NEAR(result.residual[0], 2 * 0.5 + 0.25, 1e-14);
  EXPECT_NEAR(result.residual[1], 3 * 0.25, 1e-14);
  Eigen::Matrix2d point;
  point << -1.0, 2.0,  //
      -3.0, 0.0;
  EXPECT_LT((result.jacobians[1] - point).norm(), 1e-14);
  Eigen::Matrix<double, 2, 3> pose;
  pose << 1.0, -2.0, -10.0,  //
      3.0, 0.0, -12.0;
  EXPECT_LT((result.jacobians[0] - pose).norm(), 1e-14);
}

TEST(PosePointTest, InverseOfTransformPoint) {
  Random random(31);
  for (int i = 0; i < 50; ++i) {
    const Pose2 pose(random.Uniform(-9, 9), random.Uniform(-9, 9),
                     random.Uniform(-9, 9));
    const Eigen::Vector2d seen(random.Uniform(-9, 9), random.Uniform(-9, 9));
    const Eigen::Vector2d point = TransformPoint(pose, seen);
    double residual[2];
    PosePoint(seen, Weight2())(pose.data(), point.data(), residual);
    for (double row : residual) EXPECT_NEAR(row, 0.0, 1e-13);
  }
}

TEST(PosePointTest, WholeTurnsDoNotMatter) {
  const PosePoint relation(Eigen::Vector2d(1.0, 2.0), Weight2());
  const double point[2] = {3.0, 1.0};
  const double pose[3] = {0.5, 0.25, 3.0};
  const double turned[3] = {0.5, 0.25, 3.0 - 2 * kPi};
  double residual[2];
  double other[2];
  relation(pose, point, residual);
  relation(turned, point, other);
  EXPECT_NEAR(residual[0], other[0], 1e-14);
  EXPECT_NEAR(residual[1], other[1], 1e-14);
}

TEST(PosePointTest, JacobiansMatchDifferences) {
  Random random(32);
  const std::unique_ptr<ceres::CostFunction> cost(
      PosePoint::Create(Eigen::Vector2d(1.0, -0.5), Weight2()));
  for (int i = 0; i < 100; ++i) {
    testing::ExpectJacobiansMatchDifferences(
        *cost,
        {{random.Uniform(-9, 9), random.Uniform(-9, 9), random.Uniform(-4, 4)},
         {random.Uniform(-9, 9), random.Uniform(-9, 9)}});
  }
  // The point on the pose.
  testing::ExpectJacobiansMatchDifferences(*cost,
                                           {{2.0, 3.0, kPi}, {2.0, 3.0}});
}

TEST(PosePointTest, UnchangedWhenTheWorldMoves) {
  const std::unique_ptr<ceres::CostFunction> cost(
      PosePoint::Create(Eigen::Vector2d(1.0, -0.5), Weight2()));
  const testing::Block pose = {1.0, 2.0, 3.0};
  const testing::Block point = {-4.0, 0.5};
  const auto reference = Evaluate(*cost, {pose, point});
  for (const Pose2& motion : testing::WorldMotions()) {
    const auto result = Evaluate(*cost, {testing::MovePose(motion, pose),
                                         testing::MovePoint(motion, point)});
    EXPECT_LT((result.residual - reference.residual).norm(), 1e-10);
  }
}

}  // namespace
}  // namespace plumbline
