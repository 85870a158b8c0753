#include <ceres/problem.h>
#include <ceres/solver.h>
#include <gtest/gtest.h>
#include <plumbline/factors/angle_manifold.h>
#include <plumbline/factors/delta_loss.h>
#include <plumbline/factors/line_manifold.h>
#include <plumbline/factors/line_orientation.h>
#include <plumbline/factors/point_line_distance.h>

#include <cmath>
#include <memory>

#include "factors/factors_test_util.h"

namespace plumbline {
namespace {

using testing::Evaluate;
using testing::Random;

TEST(LineOrientationTest, ByHand) {
  const std::unique_ptr<ceres::CostFunction> cost(
      LineOrientation::Create(0.25, 4.0));
  const auto result = Evaluate(*cost, {{9.0, 0.5}, {1.25}});
  EXPECT_DOUBLE_EQ(result.residual[0], 2.0);  // 4 (1.25 - 0.5 - 0.25)
  EXPECT_EQ(result.jacobians[0](0, 0), 0.0);
  EXPECT_DOUBLE_EQ(result.jacobians[0](0, 1), -4.0);
  EXPECT_DOUBLE_EQ(result.jacobians[1](0, 0), 4.0);
}

TEST(LineOrientationTest, IsTakenModuloPi) {
  const LineOrientation relation(0.0, 1.0);
  const double orientation = -0.1;
  double residual = 0.0;
  const double near_pi[2] = {0.0, 3.0};
  relation(near_pi, &orientation, &residual);
  EXPECT_NEAR(residual, 0.04159265358979312, 1e-15);  // pi - 3.1
  // Turned round the line is the same.
  const double turned[2] = {0.0, 3.0 - kPi};
  double other = 0.0;
  relation(turned, &orientation, &other);
  EXPECT_NEAR(other, residual, 1e-15);
  // The cut is at a right angle; its upper end belongs to the interval.
  const double across[2] = {0.0, -0.1 + kPi / 2};
  relation(across, &orientation, &residual);
  EXPECT_NEAR(std::abs(residual), kPi / 2, 1e-15);
}

TEST(LineOrientationTest, JacobiansMatchDifferences) {
  Random random(13);
  const std::unique_ptr<ceres::CostFunction> cost(
      LineOrientation::Create(0.0, 3.0));
  for (int i = 0; i < 50; ++i) {
    const double alpha = random.Uniform(-kPi, kPi);
    const double turn = random.Uniform(-1.5, 1.5) + (i % 3 - 1) * kPi;
    testing::ExpectJacobiansMatchDifferences(
        *cost, {{random.Uniform(-9, 9), alpha}, {alpha + turn}});
  }
  testing::ExpectJacobiansMatchDifferences(*cost, {{0.0, kPi}, {-kPi}});
}

TEST(LineOrientationTest, UnchangedWhenTheWorldMoves) {
  const std::unique_ptr<ceres::CostFunction> cost(
      LineOrientation::Create(0.25, 4.0));
  for (const Pose2& motion : testing::WorldMotions()) {
    const auto result =
        Evaluate(*cost, {testing::MoveLine(motion, {9.0, 0.5}),
                         testing::MoveOrientation(motion, {1.25})});
    EXPECT_NEAR(result.residual[0], 2.0, 1e-13);
  }
}

// Four walls of four points each, 10 km from the origin: three share an
// orientation (one of them is seen from the other side), one is off by 20
// degrees. The continuous delta takes the odd one out and does not let it
// pull; the lines themselves stay on their points.
TEST(LineOrientationTest, BareProblemWithContinuousDelta) {
  constexpr int kLines = 4;
  const double truth[kLines] = {0.3 + 0.01, 0.3 - 0.01 - kPi, 0.3,
                                0.3 + DegToRad(20.0)};
  const Eigen::Vector2d anchors[kLines] = {{10000.0, 10000.0},
                                           {10005.0, 9990.0},
                                           {9995.0, 10010.0},
                                           {10003.0, 10001.0}};
  double lines[kLines][2];
  double points[kLines][4][2];
  double orientation[1] = {0.25};
  ceres::Problem problem;
  // One loss serves several blocks.
  ContinuousDeltaLoss loss(1);
  const double sqrt_information = 1.0 / DegToRad(2.0);
  for (int i = 0; i < kLines; ++i) {
    lines[i][0] = 0.1;
    lines[i][1] = NormalizeAngle(truth[i] + 0.05);
    for (int j = 0; j < 4; ++j) {
      const double along = 2.0 * j - 3.0;
      points[i][j][0] = anchors[i][0] + along * std::cos(truth[i]);
      points[i][j][1] = anchors[i][1] + along * std::sin(truth[i]);
      problem.AddResidualBlock(
          PointLineDistance::Create(0.0, anchors[i], 200.0), nullptr,
          points[i][j], lines[i]);
      problem.SetParameterBlockConstant(points[i][j]);
    }
    problem.AddResidualBlock(
        LineOrientation::Create(0.0, sqrt_information),
        new ceres::LossFunctionWrapper(&loss, ceres::DO_NOT_TAKE_OWNERSHIP),
        lines[i], orientation);
    problem.SetManifold(lines[i], new LineManifold);
  }
  problem.SetManifold(orientation, new AngleManifold);

  ceres::Solver::Options options;
  options.logging_type = ceres::SILENT;
  options.max_num_iterations = 100;
  options.function_tolerance = 1e-14;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  ASSERT_TRUE(summary.IsSolutionUsable()) << summary.message;
  EXPECT_NEAR(orientation[0], 0.3, 1e-3);
  for (int i = 0; i < kLines; ++i) {
    EXPECT_NEAR(NormalizeAxial(lines[i][1] - truth[i]), 0.0, 2e-3) << i;
    EXPECT_NEAR(lines[i][0], 0.0, 1e-6) << i;
  }
  const auto weight = [&](int i) {
    double residual = 0.0;
    LineOrientation(0.0, sqrt_information)(lines[i], orientation, &residual);
    return ChiSquarePValue(residual * residual, 1);
  };
  EXPECT_GT(weight(0), 0.5);
  EXPECT_GT(weight(1), 0.5);
  EXPECT_GT(weight(2), 0.9);
  EXPECT_LT(weight(3), 1e-10);
}

}  // namespace
}  // namespace plumbline
