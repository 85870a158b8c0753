#include <gtest/gtest.h>
#include <plumbline/factors/rectangle_orientation.h>

#include <cmath>
#include <memory>

#include "factors/factors_test_util.h"

namespace plumbline {
namespace {

using testing::Evaluate;
using testing::Random;

TEST(RectangleOrientationTest, ByHand) {
  const std::unique_ptr<ceres::CostFunction> cost(
      RectangleOrientation::Create(0.25, 4.0));
  const auto result = Evaluate(*cost, {{9.0, 8.0, 0.5, 2.0, 1.0}, {1.25}});
  EXPECT_DOUBLE_EQ(result.residual[0], 2.0);  // 4 (1.25 - 0.5 - 0.25)
  Eigen::MatrixXd rectangle(1, 5);
  rectangle << 0, 0, -4, 0, 0;
  EXPECT_EQ(result.jacobians[0], rectangle);
  EXPECT_DOUBLE_EQ(result.jacobians[1](0, 0), 4.0);
}

TEST(RectangleOrientationTest, IsTakenModuloPi) {
  const double orientation = -0.1;
  const auto residual = [&](double theta, double expected) {
    const double rectangle[5] = {0.0, 0.0, theta, 2.0, 1.0};
    double value = 0.0;
    RectangleOrientation(expected, 1.0)(rectangle, &orientation, &value);
    return value;
  };
  EXPECT_NEAR(residual(3.0, 0.0), 0.04159265358979312, 1e-15);  // pi - 3.1
  EXPECT_NEAR(residual(3.0 - kPi, 0.0), 0.04159265358979312, 1e-15);
  // The sides across: the same rectangle turned by a right angle.
  EXPECT_NEAR(residual(3.0 - kPi / 2, kPi / 2), 0.04159265358979312, 1e-15);
  EXPECT_NEAR(residual(3.0 + kPi / 2, -kPi / 2), 0.04159265358979312, 1e-15);
  // A right angle is not zero.
  EXPECT_NEAR(std::abs(residual(-0.1 + kPi / 2, 0.0)), kPi / 2, 1e-15);
}

TEST(RectangleOrientationTest, JacobiansMatchDifferences) {
  Random random(44);
  for (int i = 0; i < 50; ++i) {
    const std::unique_ptr<ceres::CostFunction> cost(
        RectangleOrientation::Create(i % 2 * kPi / 2, 3.0));
    const double theta = random.Uniform(-kPi, kPi);
    const double turn =
        random.Uniform(-1.5, 1.5) + (i % 3 - 1) * kPi + i % 2 * kPi / 2;
    testing::ExpectJacobiansMatchDifferences(
        *cost, {{random.Uniform(-9, 9), random.Uniform(-9, 9), theta, 2.0, 1.0},
                {theta + turn}});
    testing::ExpectJacobiansMatchDifferences(
        *cost, {{0.0, 0.0, kPi, 0.0, 0.0}, {-kPi + i % 2 * kPi / 2}});
  }
}

TEST(RectangleOrientationTest, UnchangedWhenTheWorldMoves) {
  const std::unique_ptr<ceres::CostFunction> cost(
      RectangleOrientation::Create(0.25, 4.0));
  for (const Pose2& motion : testing::WorldMotions()) {
    const auto result = Evaluate(
        *cost, {testing::MoveRectangle(motion, {9.0, 8.0, 0.5, 2.0, 1.0}),
                testing::MoveOrientation(motion, {1.25})});
    EXPECT_NEAR(result.residual[0], 2.0, 1e-12);
  }
}

}  // namespace
}  // namespace plumbline
