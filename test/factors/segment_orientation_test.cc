#include <gtest/gtest.h>
#include <plumbline/factors/segment_orientation.h>

#include <memory>

#include "factors/factors_test_util.h"

namespace plumbline {
namespace {

using testing::Evaluate;
using testing::Random;

TEST(SegmentOrientationTest, ByHand) {
  const std::unique_ptr<ceres::CostFunction> cost(
      SegmentOrientation::Create(0.25, 4.0));
  const auto result = Evaluate(*cost, {{9.0, 8.0, 0.5}, {1.25}});
  EXPECT_DOUBLE_EQ(result.residual[0], 2.0);
  EXPECT_EQ(result.jacobians[0](0, 0), 0.0);
  EXPECT_EQ(result.jacobians[0](0, 1), 0.0);
  EXPECT_DOUBLE_EQ(result.jacobians[0](0, 2), -4.0);
  EXPECT_DOUBLE_EQ(result.jacobians[1](0, 0), 4.0);
}

TEST(SegmentOrientationTest, BothSidesOfAWallAreAlike) {
  const SegmentOrientation relation(0.1, 2.0);
  const double orientation = 1.5;
  const double front[3] = {1.0, 2.0, -1.6};
  const double back[3] = {1.0, 2.0, -1.6 + kPi};
  double residual[2];
  relation(front, &orientation, &residual[0]);
  relation(back, &orientation, &residual[1]);
  EXPECT_NEAR(residual[0], 2.0 * (3.0 - kPi), 1e-14);
  EXPECT_NEAR(residual[1], residual[0], 1e-14);
}

TEST(SegmentOrientationTest, JacobiansMatchDifferences) {
  Random random(14);
  const std::unique_ptr<ceres::CostFunction> cost(
      SegmentOrientation::Create(0.0, 3.0));
  for (int i = 0; i < 50; ++i) {
    const double theta = random.Uniform(-kPi, kPi);
    const double turn = random.Uniform(-1.5, 1.5) + (i % 3 - 1) * kPi;
    testing::ExpectJacobiansMatchDifferences(
        *cost, {{random.Uniform(-9, 9), random.Uniform(-9, 9), theta},
                {theta + turn}});
  }
  testing::ExpectJacobiansMatchDifferences(*cost, {{0.0, 0.0, kPi}, {-kPi}});
}

TEST(SegmentOrientationTest, UnchangedWhenTheWorldMoves) {
  const std::unique_ptr<ceres::CostFunction> cost(
      SegmentOrientation::Create(0.25, 4.0));
  for (const Pose2& motion : testing::WorldMotions()) {
    const auto result =
        Evaluate(*cost, {testing::MovePose(motion, {9.0, 8.0, 0.5}),
                         testing::MoveOrientation(motion, {1.25})});
    EXPECT_NEAR(result.residual[0], 2.0, 1e-13);
  }
}

}  // namespace
}  // namespace plumbline
