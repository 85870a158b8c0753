#include <gtest/gtest.h>
#include <plumbline/factors/line_rectangle.h>
#include <plumbline/factors/segment_rectangle.h>

#include <cmath>
#include <memory>

#include "factors/factors_test_util.h"

namespace plumbline {
namespace {

using testing::Block;
using testing::Evaluate;
using testing::Random;
using testing::Weight2;

Eigen::Vector2d Error(const Block& line, const Eigen::Vector2d& anchor,
                      const Block& rectangle, double phi) {
  Eigen::Vector2d residual;
  LineRectangle(Eigen::Vector2d(0.0, phi), anchor, Eigen::Matrix2d::Identity())(
      line.data(), rectangle.data(), residual.data());
  return residual;
}

TEST(LineRectangleTest, ByHand) {
  // The side below is at y = 3, its middle at x = 10. The line goes through
  // (10, 2) + 0.5 (-sin(0.1), cos(0.1)) and is turned by 0.1: the middle lies
  // cos(0.1) - 0.5 from it.
  const std::unique_ptr<ceres::CostFunction> cost(LineRectangle::Create(
      Eigen::Vector2d(0.25, 0.0), Eigen::Vector2d(10.0, 2.0), Weight2()));
  const auto result = Evaluate(*cost, {{0.5, 0.1}, {10.0, 5.0, 0.0, 4.0, 2.0}});
  const double past = 0.49500416527802577;
  EXPECT_NEAR(result.residual[0], 2 * (past - 0.25) + 0.1, 1e-14);
  EXPECT_NEAR(result.residual[1], 0.3, 1e-14);
  // Row 0 of the error: -1 and sin(0.1) for the line; l = (-sin(0.1),
  // cos(0.1)) for the centre, -sin(0.1) * 2 for theta, 0, -cos(0.1).
  const double s = 0.099833416646828152;
  const double c = 0.99500416527802577;
  Eigen::MatrixXd line(2, 2);
  line << -2, -2 * s * 1.0 + 1, 0, 3;
  Eigen::MatrixXd rectangle(2, 5);
  rectangle << -2 * s, 2 * c, 2 * -2 * s - 1, 0, -2 * c, 0, 0, -3, 0, 0;
  EXPECT_LT((result.jacobians[0] - line).norm(), 1e-13);
  EXPECT_LT((result.jacobians[1] - rectangle).norm(), 1e-13);
}

TEST(LineRectangleTest, FourSides) {
  const Block rectangle = {10.0, 5.0, 0.0, 4.0, 2.0};
  const Eigen::Vector2d anchor(100.0, -50.0);
  const auto expect = [&](double d, double alpha, double phi, double past) {
    const Eigen::Vector2d error = Error({d, alpha}, anchor, rectangle, phi);
    EXPECT_NEAR(error[0], past, 1e-12) << phi;
    EXPECT_NEAR(error[1], 0.0, 1e-14) << phi;
  };
  expect(53.5, 0.0, 0.0, -0.5);            // y = 3.5
  expect(86.5, kPi / 2, kPi / 2, -0.5);    // x = 13.5
  expect(57.25, 0.0, kPi, 0.25);           // y = 7.25
  expect(-95.0, -kPi / 2, -kPi / 2, 1.0);  // x = 5
}

TEST(LineRectangleTest, NeitherTurningTheLineNorItsAnchorMatters) {
  Random random(42);
  for (int i = 0; i < 100; ++i) {
    const double theta = random.Uniform(-kPi, kPi);
    const double phi = (i % 4) * kPi / 2;
    const double alpha = theta + phi + random.Uniform(-1.4, 1.4);
    const Block rectangle = {random.Uniform(-9, 9), random.Uniform(-9, 9),
                             theta, random.Uniform(1, 5), random.Uniform(1, 5)};
    const Eigen::Vector2d normal(-std::sin(alpha), std::cos(alpha));
    const Eigen::Vector2d anchor(random.Uniform(-9, 9), random.Uniform(-9, 9));
    const Eigen::Vector2d other(random.Uniform(-9, 9), random.Uniform(-9, 9));
    const double d = random.Uniform(-3, 3);
    const Eigen::Vector2d error = Error({d, alpha}, anchor, rectangle, phi);
    EXPECT_LT((Error({-d, alpha + kPi}, anchor, rectangle, phi) - error).norm(),
              1e-12);
    EXPECT_LT(
        (Error({d + normal.dot(anchor - other), alpha}, other, rectangle, phi) -
         error)
            .norm(),
        1e-12);
    // A segment on the line, at the foot of the middle of the side.
    const Eigen::Vector2d outward(std::sin(theta + phi),
                                  -std::cos(theta + phi));
    const double half = i % 2 == 0 ? rectangle[4] : rectangle[3];
    const Eigen::Vector2d middle =
        Eigen::Vector2d(rectangle[0], rectangle[1]) + half * outward;
    const Eigen::Vector2d foot =
        middle + (d - normal.dot(middle - anchor)) * normal;
    Eigen::Vector2d of_segment;
    const Block segment = {foot[0], foot[1], alpha};
    SegmentRectangle(Eigen::Vector2d(0.0, phi), Eigen::Matrix2d::Identity())(
        segment.data(), rectangle.data(), of_segment.data());
    // The distance across the line and across the side.
    EXPECT_NEAR(error[0] * std::cos(error[1]), of_segment[0], 1e-12);
    EXPECT_NEAR(error[1], of_segment[1], 1e-12);
  }
}

TEST(LineRectangleTest, JacobiansMatchDifferences) {
  Random random(43);
  for (int i = 0; i < 100; ++i) {
    const double phi = (i % 4) * kPi / 2;
    const std::unique_ptr<ceres::CostFunction> cost(LineRectangle::Create(
        Eigen::Vector2d(0.5, phi),
        Eigen::Vector2d(random.Uniform(-9, 9), random.Uniform(-9, 9)),
        Weight2()));
    const double theta = random.Uniform(-kPi, kPi);
    testing::ExpectJacobiansMatchDifferences(
        *cost, {{random.Uniform(-9, 9),
                 NormalizeAngle(theta + phi + random.Uniform(-1.5, 1.5) +
                                i % 2 * kPi)},
                {random.Uniform(-9, 9), random.Uniform(-9, 9), theta,
                 random.Uniform(0.5, 5), random.Uniform(0.5, 5)}});
    // No size; headings at the cut.
    testing::ExpectJacobiansMatchDifferences(
        *cost, {{0.0, kPi}, {1.0, 2.0, -kPi - phi, 0.0, 0.0}});
  }
  // Across the side, where the residual jumps, the value is still a number.
  const auto across = Evaluate(
      *std::unique_ptr<ceres::CostFunction>(LineRectangle::Create(
          Eigen::Vector2d::Zero(), Eigen::Vector2d::Zero(), Weight2())),
      {{1.0, kPi / 2}, {0.0, 0.0, 0.0, 1.0, 1.0}});
  EXPECT_TRUE(across.residual.allFinite());
  EXPECT_TRUE(across.jacobians[0].allFinite());
  EXPECT_TRUE(across.jacobians[1].allFinite());
}

TEST(LineRectangleTest, UnchangedWhenTheWorldMoves) {
  const Block line = {0.7, 2.9};
  const Block rectangle = {1.0, 2.0, 1.2, 3.0, 2.0};
  const Block anchor = {4.0, 3.0};
  const auto evaluate = [&](const Pose2& motion) {
    const Block moved = testing::MovePoint(motion, anchor);
    const std::unique_ptr<ceres::CostFunction> cost(
        LineRectangle::Create(Eigen::Vector2d(0.5, kPi / 2),
                              Eigen::Vector2d(moved[0], moved[1]), Weight2()));
    return Evaluate(*cost, {testing::MoveLine(motion, line),
                            testing::MoveRectangle(motion, rectangle)})
        .residual;
  };
  const Eigen::VectorXd reference = evaluate(Pose2(0.0, 0.0, 0.0));
  for (const Pose2& motion : testing::WorldMotions()) {
    EXPECT_LT((evaluate(motion) - reference).norm(), 1e-10);
  }
}

}  // namespace
}  // namespace plumbline
