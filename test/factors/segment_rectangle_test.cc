#include <ceres/problem.h>
#include <ceres/solver.h>
#include <gtest/gtest.h>
#include <plumbline/factors/segment_rectangle.h>

#include <array>
#include <cmath>
#include <memory>

#include "factors/factors_test_util.h"

namespace plumbline {
namespace {

using testing::Block;
using testing::Evaluate;
using testing::Random;
using testing::Weight2;

Eigen::Vector2d Error(const Block& segment, const Block& rectangle,
                      double phi) {
  Eigen::Vector2d residual;
  SegmentRectangle(Eigen::Vector2d(0.0, phi), Eigen::Matrix2d::Identity())(
      segment.data(), rectangle.data(), residual.data());
  return residual;
}

TEST(SegmentRectangleTest, ByHand) {
  // The side below is at y = 3; the segment 0.5 past it, turned by 0.1. Error
  // (0.5 - 0.25, 0.1).
  const std::unique_ptr<ceres::CostFunction> cost(
      SegmentRectangle::Create(Eigen::Vector2d(0.25, 0.0), Weight2()));
  const auto result =
      Evaluate(*cost, {{11.0, 2.5, 0.1}, {10.0, 5.0, 0.0, 4.0, 2.0}});
  EXPECT_NEAR(result.residual[0], 0.6, 1e-14);  // 2 * 0.25 + 0.1
  EXPECT_NEAR(result.residual[1], 0.3, 1e-14);
  // Row 0 of the error: (0, -1, 0) and (0, 1, 1, 0, -1); row 1: (0, 0, 1) and
  // (0, 0, -1, 0, 0).
  Eigen::MatrixXd segment(2, 3);
  segment << 0, -2, 1, 0, 0, 3;
  Eigen::MatrixXd rectangle(2, 5);
  rectangle << 0, 2, 2 - 1, 0, -2, 0, 0, -3, 0, 0;
  EXPECT_LT((result.jacobians[0] - segment).norm(), 1e-13);
  EXPECT_LT((result.jacobians[1] - rectangle).norm(), 1e-13);
}

TEST(SegmentRectangleTest, FourSides) {
  const Block rectangle = {10.0, 5.0, 0.0, 4.0, 2.0};
  const auto expect = [&](double x, double y, double theta, double phi,
                          double past, double turn) {
    const Eigen::Vector2d error = Error({x, y, theta}, rectangle, phi);
    EXPECT_NEAR(error[0], past, 1e-14) << phi;
    EXPECT_NEAR(error[1], turn, 1e-14) << phi;
  };
  expect(9.0, 3.5, 0.1, 0.0, -0.5, 0.1);
  expect(13.5, 6.0, kPi / 2 + 0.1, kPi / 2, -0.5, 0.1);
  expect(9.0, 7.25, kPi - 0.3, kPi, 0.25, -0.3);
  expect(5.0, 5.0, -kPi / 2 - 0.2, -kPi / 2, 1.0, -0.2);
}

TEST(SegmentRectangleTest, OtherDirectionsTouchTheRectangle) {
  // The corner (4, 2) of a rectangle about the origin is the farthest in the
  // direction (1, 1) / sqrt(2); the touching line runs at 135 degrees.
  const Eigen::Vector2d error =
      Error({4.0, 2.0, 3 * kPi / 4}, {0.0, 0.0, 0.0, 4.0, 2.0}, 3 * kPi / 4);
  EXPECT_LT(error.norm(), 1e-14);
}

TEST(SegmentRectangleTest, BothSidesOfAWallAgree) {
  Random random(40);
  for (int i = 0; i < 50; ++i) {
    const Block segment = {random.Uniform(-9, 9), random.Uniform(-9, 9),
                           random.Uniform(-kPi, kPi)};
    const Block turned = {segment[0], segment[1],
                          NormalizeAngle(segment[2] + kPi)};
    const Block rectangle = {random.Uniform(-9, 9), random.Uniform(-9, 9),
                             random.Uniform(-kPi, kPi), random.Uniform(1, 5),
                             random.Uniform(1, 5)};
    // The same rectangle by its other side.
    const Block other = {rectangle[0], rectangle[1], rectangle[2] + kPi / 2,
                         rectangle[4], rectangle[3]};
    for (const double phi : {0.0, kPi / 2, kPi, -kPi / 2}) {
      const Eigen::Vector2d error = Error(segment, rectangle, phi);
      EXPECT_LT((Error(turned, rectangle, phi) - error).norm(), 1e-13);
      EXPECT_LT((Error(segment, other, phi - kPi / 2) - error).norm(), 1e-13);
    }
  }
}

TEST(SegmentRectangleTest, TurnIsWrappedModuloPi) {
  const Block rectangle = {0.0, 0.0, 3.0, 4.0, 2.0};
  // -3 - 3 + 2 pi.
  EXPECT_NEAR(Error({0.0, 0.0, -3.0}, rectangle, 0.0)[1], 0.28318530717958648,
              1e-14);
  EXPECT_NEAR(Error({0.0, 0.0, -3.0 + kPi}, rectangle, 0.0)[1],
              0.28318530717958648, 1e-14);
  // Past the cut at a right angle the turn comes from the other side.
  EXPECT_NEAR(Error({0.0, 0.0, 3.0 + kPi / 2 - 0.1}, rectangle, 0.0)[1],
              kPi / 2 - 0.1, 1e-14);
  EXPECT_NEAR(Error({0.0, 0.0, 3.0 + kPi / 2 + 0.1}, rectangle, 0.0)[1],
              -kPi / 2 + 0.1, 1e-14);
}

TEST(SegmentRectangleTest, JacobiansMatchDifferences) {
  Random random(41);
  for (int i = 0; i < 100; ++i) {
    const double phi = (i % 4) * kPi / 2;
    const std::unique_ptr<ceres::CostFunction> cost(
        SegmentRectangle::Create(Eigen::Vector2d(0.5, phi), Weight2()));
    const double theta = random.Uniform(-kPi, kPi);
    testing::ExpectJacobiansMatchDifferences(
        *cost, {{random.Uniform(-9, 9), random.Uniform(-9, 9),
                 NormalizeAngle(theta + phi + random.Uniform(-1.5, 1.5) +
                                i % 2 * kPi)},
                {random.Uniform(-9, 9), random.Uniform(-9, 9), theta,
                 random.Uniform(0.5, 5), random.Uniform(0.5, 5)}});
    // No size, segment in the centre; headings at the cut.
    testing::ExpectJacobiansMatchDifferences(
        *cost, {{1.0, 2.0, kPi}, {1.0, 2.0, -kPi - phi, 0.0, 0.0}});
  }
}

TEST(SegmentRectangleTest, UnchangedWhenTheWorldMoves) {
  const std::unique_ptr<ceres::CostFunction> cost(
      SegmentRectangle::Create(Eigen::Vector2d(0.5, kPi / 2), Weight2()));
  const Block segment = {3.0, 4.0, 2.9};
  const Block rectangle = {1.0, 2.0, 1.2, 3.0, 2.0};
  const auto reference = Evaluate(*cost, {segment, rectangle});
  for (const Pose2& motion : testing::WorldMotions()) {
    const auto result =
        Evaluate(*cost, {testing::MovePose(motion, segment),
                         testing::MoveRectangle(motion, rectangle)});
    EXPECT_LT((result.residual - reference.residual).norm(), 1e-10);
  }
}

// Four walls that are held determine their rectangle, also 10 km away.
TEST(SegmentRectangleTest, BareProblem) {
  for (const Pose2& motion : testing::WorldMotions()) {
    std::array<Block, 4> walls = {
        Block{1.0, -2.0, 0.0}, Block{3.0, 1.0, -kPi / 2}, Block{-2.0, 2.0, kPi},
        Block{-3.0, 0.5, -kPi / 2}};
    Block rectangle = testing::MoveRectangle(motion, {0.3, -0.2, 0.2, 2, 3});
    ceres::Problem problem;
    for (int k = 0; k < 4; ++k) {
      walls[k] = testing::MovePose(motion, walls[k]);
      problem.AddResidualBlock(
          SegmentRectangle::Create(Eigen::Vector2d(0.0, k * kPi / 2),
                                   Weight2()),
          nullptr, walls[k].data(), rectangle.data());
      problem.SetParameterBlockConstant(walls[k].data());
    }
    ceres::Solver::Options options;
    options.logging_type = ceres::SILENT;
    options.function_tolerance = 1e-14;
    options.parameter_tolerance = 1e-14;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    ASSERT_TRUE(summary.IsSolutionUsable());
    const Block truth = testing::MoveRectangle(motion, {0, 0, 0, 3, 2});
    EXPECT_NEAR(rectangle[0], truth[0], 1e-6);
    EXPECT_NEAR(rectangle[1], truth[1], 1e-6);
    EXPECT_NEAR(NormalizeAngle(rectangle[2] - truth[2]), 0.0, 1e-6);
    EXPECT_NEAR(rectangle[3], 3.0, 1e-6);
    EXPECT_NEAR(rectangle[4], 2.0, 1e-6);
  }
}

}  // namespace
}  // namespace plumbline
