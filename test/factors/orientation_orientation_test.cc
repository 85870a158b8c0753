#include <gtest/gtest.h>
#include <plumbline/factors/orientation_orientation.h>

#include <memory>

#include "factors/factors_test_util.h"

namespace plumbline {
namespace {

using testing::Evaluate;
using testing::Random;

TEST(OrientationOrientationTest, ByHand) {
  const std::unique_ptr<ceres::CostFunction> cost(
      OrientationOrientation::Create(0.25, 4.0));
  const auto result = Evaluate(*cost, {{0.5}, {1.25}});
  EXPECT_DOUBLE_EQ(result.residual[0], 2.0);
  EXPECT_DOUBLE_EQ(result.jacobians[0](0, 0), -4.0);
  EXPECT_DOUBLE_EQ(result.jacobians[1](0, 0), 4.0);
}

TEST(OrientationOrientationTest, RightAngleEitherWay) {
  // o2 is o1 turned by +90 or -90 degrees: orientations cannot tell.
  const OrientationOrientation relation(kPi / 2, 1.0);
  const double o1 = 3.0;
  const double left = 3.0 + kPi / 2 + 0.01 - 2.0 * kPi;
  const double right = 3.0 - kPi / 2 + 0.01;
  double residual = 0.0;
  relation(&o1, &left, &residual);
  EXPECT_NEAR(residual, 0.01, 1e-14);
  relation(&o1, &right, &residual);
  EXPECT_NEAR(residual, 0.01, 1e-14);
}

TEST(OrientationOrientationTest, JacobiansMatchDifferences) {
  Random random(15);
  const std::unique_ptr<ceres::CostFunction> cost(
      OrientationOrientation::Create(kPi / 2, 3.0));
  for (int i = 0; i < 50; ++i) {
    const double o1 = random.Uniform(-kPi, kPi);
    const double turn = random.Uniform(-1.5, 1.5) + (i % 3 - 1) * kPi;
    testing::ExpectJacobiansMatchDifferences(*cost,
                                             {{o1}, {o1 + kPi / 2 + turn}});
  }
}

TEST(OrientationOrientationTest, UnchangedWhenTheWorldMoves) {
  const std::unique_ptr<ceres::CostFunction> cost(
      OrientationOrientation::Create(0.25, 4.0));
  for (const Pose2& motion : testing::WorldMotions()) {
    const auto result =
        Evaluate(*cost, {testing::MoveOrientation(motion, {0.5}),
                         testing::MoveOrientation(motion, {1.25})});
    EXPECT_NEAR(result.residual[0], 2.0, 1e-13);
  }
}

}  // namespace
}  // namespace plumbline
