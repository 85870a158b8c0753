#include <gtest/gtest.h>
#include <plumbline/factors/information.h>
#include <plumbline/factors/pose_segment_points.h>

#include <cmath>
#include <memory>
#include <vector>

#include "factors/factors_test_util.h"

namespace plumbline {
namespace {

using testing::Block;
using testing::Evaluate;
using testing::Random;

Eigen::Matrix3d VoteWeight() {
  Eigen::Matrix3d weight;
  weight << 2.0, 1.0, 0.0, 0.0, 3.0, 0.5, 0.0, 0.0, 4.0;
  return weight;
}

TEST(PoseSegmentPointsTest, ByHand) {
  // The segment points up at x = 2, the robot is 1 to its left and looks up as
  // well: the wall's normal is the robot's y axis, the distance 1.
  const std::vector<Block> blocks = {{1.0, 5.0, kPi / 2}, {2.0, 1.0, kPi / 2}};
  const std::unique_ptr<ceres::CostFunction> plain(PoseSegmentPoints::Create(
      Eigen::Vector3d::Zero(), Eigen::Matrix3d::Identity()));
  auto result = Evaluate(*plain, blocks);
  EXPECT_NEAR(result.residual[0], 0.0, 1e-15);
  EXPECT_NEAR(result.residual[1], 1.0, 1e-15);
  EXPECT_NEAR(result.residual[2], 1.0, 1e-15);
  const std::unique_ptr<ceres::CostFunction> weighted(
      PoseSegmentPoints::Create(Eigen::Vector3d(0.5, 0.0, 0.25), VoteWeight()));
  result = Evaluate(*weighted, blocks);
  EXPECT_NEAR(result.residual[0], 0.0, 1e-14);    // 2 * -0.5 + 1
  EXPECT_NEAR(result.residual[1], 3.375, 1e-14);  // 3 * 1 + 0.5 * 0.75
  EXPECT_NEAR(result.residual[2], 3.0, 1e-14);    // 4 * 0.75
}

TEST(PoseSegmentPointsTest, SumOfSquaredDistancesOfItsPoints) {
  // Points at (1, -1) and (3, -1) of a robot at the origin, wall y = -0.5 seen
  // from above: both are 0.5 below it.
  const std::vector<Eigen::Vector3d> points = {{1.0, -1.0, 1.0},
                                               {3.0, -1.0, 1.0}};
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& p : points) information += p * p.transpose();
  const std::unique_ptr<ceres::CostFunction> cost(PoseSegmentPoints::Create(
      Eigen::Vector3d::Zero(), SqrtInformation(information)));
  const auto at_origin =
      Evaluate(*cost, {{0.0, 0.0, 0.0}, {7.0, -0.5, 0.0}}).residual;
  EXPECT_NEAR(at_origin.squaredNorm(), 0.5, 1e-12);

  Random random(20);
  for (int i = 0; i < 50; ++i) {
    const Pose2 pose(random.Uniform(-9, 9), random.Uniform(-9, 9),
                     random.Uniform(-kPi, kPi));
    const Pose2 segment(random.Uniform(-9, 9), random.Uniform(-9, 9),
                        random.Uniform(-kPi, kPi));
    double sum = 0.0;
    for (const Eigen::Vector3d& p : points) {
      const Eigen::Vector2d in_segment = TransformPoint(
          Inverse(segment), TransformPoint(pose, Eigen::Vector2d(p.head<2>())));
      sum += in_segment.y() * in_segment.y();
    }
    const auto residual =
        Evaluate(*cost, {{pose[0], pose[1], pose[2]},
                         {segment[0], segment[1], segment[2]}})
            .residual;
    EXPECT_NEAR(residual.squaredNorm(), sum, 1e-9 * (1.0 + sum));
  }
}

TEST(PoseSegmentPointsTest, JacobiansMatchDifferences) {
  Random random(21);
  const std::unique_ptr<ceres::CostFunction> cost(
      PoseSegmentPoints::Create(Eigen::Vector3d(0.1, -0.2, 0.3), VoteWeight()));
  for (int i = 0; i < 100; ++i) {
    testing::ExpectJacobiansMatchDifferences(
        *cost, {{random.Uniform(-9, 9), random.Uniform(-9, 9),
                 random.Uniform(-kPi, kPi)},
                {random.Uniform(-9, 9), random.Uniform(-9, 9),
                 random.Uniform(-kPi, kPi)}});
  }
  testing::ExpectJacobiansMatchDifferences(*cost, {{0, 0, kPi}, {0, 0, -kPi}});
}

TEST(PoseSegmentPointsTest, NoJumpAtPi) {
  const std::unique_ptr<ceres::CostFunction> cost(
      PoseSegmentPoints::Create(Eigen::Vector3d::Zero(), VoteWeight()));
  const auto below =
      Evaluate(*cost, {{1.0, 2.0, kPi - 1e-12}, {0.0, 0.0, 0.3}});
  const auto above =
      Evaluate(*cost, {{1.0, 2.0, -kPi + 1e-12}, {0.0, 0.0, 0.3}});
  EXPECT_LT((below.residual - above.residual).norm(), 1e-10);
}

TEST(PoseSegmentPointsTest, NothingAlongTheSegment) {
  const std::unique_ptr<ceres::CostFunction> cost(
      PoseSegmentPoints::Create(Eigen::Vector3d::Zero(), VoteWeight()));
  const Block pose = {1.0, 2.0, 0.4};
  const double direction = 0.7;
  const auto here = Evaluate(*cost, {pose, {0.5, -1.0, direction}});
  const auto there =
      Evaluate(*cost, {pose,
                       {0.5 + 5.0 * std::cos(direction),
                        -1.0 + 5.0 * std::sin(direction), direction}});
  EXPECT_LT((here.residual - there.residual).norm(), 1e-12);
}

TEST(PoseSegmentPointsTest, UnchangedWhenTheWorldMoves) {
  const std::unique_ptr<ceres::CostFunction> cost(
      PoseSegmentPoints::Create(Eigen::Vector3d::Zero(), VoteWeight()));
  const Block pose = {1.0, 2.0, 3.0};
  const Block segment = {0.0, 4.0, 1.2};
  const auto reference = Evaluate(*cost, {pose, segment});
  for (const Pose2& motion : testing::WorldMotions()) {
    const auto result = Evaluate(*cost, {testing::MovePose(motion, pose),
                                         testing::MovePose(motion, segment)});
    EXPECT_LT((result.residual - reference.residual).norm(), 1e-9);
  }
}

}  // namespace
}  // namespace plumbline
