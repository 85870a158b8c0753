#include <ceres/problem.h>
#include <ceres/solver.h>
#include <gtest/gtest.h>
#include <plumbline/factors/segment_corridor.h>

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

constexpr double kRight = 0.0;
constexpr double kLeft = kPi;

Eigen::Vector2d CorridorError(const Block& segment, const Block& corridor,
                              double phi, const Eigen::Vector2d& anchor) {
  Eigen::Vector2d residual;
  SegmentCorridor(Eigen::Vector2d(0.0, phi), anchor,
                  Eigen::Matrix2d::Identity())(segment.data(), corridor.data(),
                                               residual.data());
  return residual;
}

Block MoveCorridor(const Pose2& motion, const Block& corridor) {
  return {corridor[0], NormalizeAngle(corridor[1] + motion[2]), corridor[2]};
}

TEST(SegmentCorridorTest, ByHand) {
  // The axis is y = 5 + 1, along x; the right side is y = 4.75. The segment is
  // 0.5 past it. Error (0.5 - 0.25, 0.1), the axis being turned by -0.1.
  const std::unique_ptr<ceres::CostFunction> cost(SegmentCorridor::Create(
      Eigen::Vector2d(0.25, kRight), Eigen::Vector2d(100.0, 5.0), Weight2()));
  const auto result = Evaluate(*cost, {{97.0, 4.25, 0.0}, {1.0, -0.1, 1.25}});
  EXPECT_NEAR(result.residual[0], 0.6, 1e-14);  // 2 * 0.25 + 0.1
  EXPECT_NEAR(result.residual[1], 0.3, 1e-14);
  // Row 0 of the error: (0, -1, -3), as turning the segment by a little lifts
  // its line 3 m before it, at the anchor, and (1, 0, -1); row 1: (0, 0, 1) and
  // (0, -1, 0).
  Eigen::MatrixXd segment(2, 3);
  segment << 0, -2, -6 + 1, 0, 0, 3;
  Eigen::MatrixXd corridor(2, 3);
  corridor << 2, -1, -2, 0, -3, 0;
  EXPECT_LT((result.jacobians[0] - segment).norm(), 1e-13);
  EXPECT_LT((result.jacobians[1] - corridor).norm(), 1e-13);
}

TEST(SegmentCorridorTest, BothSides) {
  // The axis is x = 2, upwards; the sides are x = 3 and x = 1.
  const Block corridor = {-2.0, kPi / 2, 1.0};
  const auto expect = [&](const Block& segment, double phi, double past,
                          double turn) {
    const Eigen::Vector2d error =
        CorridorError(segment, corridor, phi, Eigen::Vector2d::Zero());
    EXPECT_NEAR(error[0], past, 1e-13) << phi;
    EXPECT_NEAR(error[1], turn, 1e-14) << phi;
  };
  expect({3.5, 7.0, kPi / 2}, kRight, 0.5, 0.0);
  expect({0.75, -9.0, -kPi / 2}, kLeft, 0.25, 0.0);
  expect({1.5, 0.0, -kPi / 2}, kLeft, -0.5, 0.0);
  // Turned about the point beside the anchor, which then lies nearer to the
  // line by the cosine.
  expect({3.5, 0.0, kPi / 2 + 0.1}, kRight, 3.5 * std::cos(0.1) - 3.0, 0.1);
  expect({-0.5, 0.0, -kPi / 2 - 0.2}, kLeft, 0.5 * std::cos(0.2) + 1.0, -0.2);
  // Seen from outside it is no side of the corridor.
  expect({3.0, 0.0, -kPi / 2 + 0.1}, kRight, -3.0 * std::cos(0.1) - 3.0,
         -kPi + 0.1);
}

TEST(SegmentCorridorTest, WhereTheSegmentHasItsPositionDoesNotMatter) {
  Random random(52);
  for (int i = 0; i < 50; ++i) {
    const double angle = random.Uniform(-kPi, kPi);
    const Block segment = {random.Uniform(-9, 9), random.Uniform(-9, 9), angle};
    const double step = random.Uniform(-50, 50);
    const Block elsewhere = {segment[0] + step * std::cos(angle),
                             segment[1] + step * std::sin(angle), angle};
    const Block corridor = {random.Uniform(-2, 2), random.Uniform(-kPi, kPi),
                            random.Uniform(0.5, 2)};
    for (const double phi : {kRight, kLeft}) {
      EXPECT_LT((CorridorError(segment, corridor, phi, {1.0, 2.0}) -
                 CorridorError(elsewhere, corridor, phi, {1.0, 2.0}))
                    .norm(),
                1e-12);
    }
  }
}

TEST(SegmentCorridorTest, TheAxisMayRunEitherWay) {
  Random random(50);
  for (int i = 0; i < 50; ++i) {
    const Eigen::Vector2d anchor(random.Uniform(-9, 9), random.Uniform(-9, 9));
    const Block corridor = {random.Uniform(-2, 2), random.Uniform(-kPi, kPi),
                            random.Uniform(0.5, 2)};
    const Block turned = {-corridor[0], NormalizeAngle(corridor[1] + kPi),
                          corridor[2]};
    for (const double phi : {kRight, kLeft}) {
      // Either way the segment is seen from within.
      const Block segment = {
          random.Uniform(-9, 9), random.Uniform(-9, 9),
          NormalizeAngle(corridor[1] + phi + random.Uniform(-0.3, 0.3))};
      const Eigen::Vector2d error =
          CorridorError(segment, corridor, phi, anchor);
      EXPECT_LT(
          (CorridorError(segment, turned, kPi - phi, anchor) - error).norm(),
          1e-13);
    }
  }
}

TEST(SegmentCorridorTest, TurnIsWrapped) {
  // -3 - 3 + 2 pi.
  const auto turn = [](double segment, double alpha, double phi) {
    return CorridorError({0.0, 0.0, segment}, {0.0, alpha, 1.0}, phi,
                         Eigen::Vector2d::Zero())[1];
  };
  EXPECT_NEAR(turn(-3.0, 3.0, kRight), 0.28318530717958648, 1e-14);
  EXPECT_NEAR(turn(-3.0 + kPi, 3.0, kLeft), 0.28318530717958648, 1e-14);
  // Past the cut the turn comes from the other side.
  EXPECT_NEAR(turn(kPi, 0.1, kRight), kPi - 0.1, 1e-14);
  EXPECT_NEAR(turn(kPi, -0.1, kRight), -kPi + 0.1, 1e-14);
}

TEST(SegmentCorridorTest, JacobiansMatchDifferences) {
  Random random(51);
  for (int i = 0; i < 100; ++i) {
    const double phi = i % 2 == 0 ? kRight : kLeft;
    const Eigen::Vector2d anchor(random.Uniform(-9, 9), random.Uniform(-9, 9));
    const std::unique_ptr<ceres::CostFunction> cost(
        SegmentCorridor::Create(Eigen::Vector2d(0.5, phi), anchor, Weight2()));
    const double alpha = random.Uniform(-kPi, kPi);
    testing::ExpectJacobiansMatchDifferences(
        *cost, {{random.Uniform(-9, 9), random.Uniform(-9, 9),
                 NormalizeAngle(alpha + phi + random.Uniform(-3, 3))},
                {random.Uniform(-9, 9), alpha, random.Uniform(0, 5)}});
    // No width, the segment at the anchor; directions at the cut.
    testing::ExpectJacobiansMatchDifferences(
        *cost, {{anchor[0], anchor[1], kPi}, {0.0, -kPi - phi, 0.0}});
    testing::ExpectJacobiansMatchDifferences(
        *cost, {{anchor[0], anchor[1], -kPi}, {-1.0, kPi - phi, -1.0}});
  }
}

TEST(SegmentCorridorTest, UnchangedWhenTheWorldMoves) {
  const Eigen::Vector2d anchor(2.0, 1.0);
  const Block segment = {3.0, 4.0, 2.9};
  const Block corridor = {1.0, 1.2, 0.9};
  const auto residual = [&](const Pose2& motion) {
    const std::unique_ptr<ceres::CostFunction> cost(
        SegmentCorridor::Create(Eigen::Vector2d(0.5, kLeft),
                                TransformPoint(motion, anchor), Weight2()));
    return Eigen::Vector2d(Evaluate(*cost, {testing::MovePose(motion, segment),
                                            MoveCorridor(motion, corridor)})
                               .residual);
  };
  const Eigen::Vector2d reference = residual(Pose2::Zero());
  for (const Pose2& motion : testing::WorldMotions()) {
    EXPECT_LT((residual(motion) - reference).norm(), 1e-10);
  }
}

// What the information says of the point so far along: an error of the offset
// there of so many standard deviations costs the square of that, and so does
// one of the direction, on either side. Where the anchor is does not matter.
TEST(SegmentCorridorTest, InformationCarriesTheLever) {
  const double angle = 0.3;
  const Eigen::Vector2d axis(std::cos(angle), std::sin(angle));
  for (const double along : {3.0, -4.0}) {
    const Block corridor = {0.0, angle, 1.0};
    for (const double phi : {kRight, kLeft}) {
      const Eigen::Matrix2d information =
          CorridorInformation(0.1, 0.01, phi, along);
      for (const auto& [past, turn] :
           {std::pair(0.2, 0.0), std::pair(0.0, 0.01), std::pair(0.1, -0.02)}) {
        const double q = phi == kRight ? 1.0 : -1.0;
        const Eigen::Vector2d outward(q * std::sin(angle),
                                      -q * std::cos(angle));
        const Eigen::Vector2d at = along * axis + (1.0 + past) * outward;
        const Eigen::Vector2d error =
            CorridorError({at.x(), at.y(), NormalizeAngle(angle + phi + turn)},
                          corridor, phi, Eigen::Vector2d::Zero());
        const double expected =
            std::pow(past / 0.1, 2.0) + std::pow(turn / 0.01, 2.0);
        EXPECT_NEAR(error.dot(information * error), expected,
                    2e-3 * (1.0 + expected));
      }
    }
  }
}

// Walls that are held determine their corridor, also 10 km away.
TEST(SegmentCorridorTest, BareProblem) {
  for (const Pose2& motion : testing::WorldMotions()) {
    std::array<Block, 3> walls = {
        Block{-4.0, -1.25, 0.0}, Block{6.0, -1.25, 0.0}, Block{1.0, 1.25, kPi}};
    const std::array<double, 3> sides = {kRight, kRight, kLeft};
    const Eigen::Vector2d anchor =
        TransformPoint(motion, Eigen::Vector2d(0.5, 0.0));
    Block corridor = MoveCorridor(motion, {0.3, 0.2, 2.0});
    ceres::Problem problem;
    for (std::size_t k = 0; k < walls.size(); ++k) {
      walls[k] = testing::MovePose(motion, walls[k]);
      problem.AddResidualBlock(
          SegmentCorridor::Create(Eigen::Vector2d(0.0, sides[k]), anchor,
                                  Weight2()),
          nullptr, walls[k].data(), corridor.data());
      problem.SetParameterBlockConstant(walls[k].data());
    }
    problem.SetManifold(corridor.data(), new CorridorManifold);
    ceres::Solver::Options options;
    options.logging_type = ceres::SILENT;
    options.function_tolerance = 1e-14;
    options.parameter_tolerance = 1e-14;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    ASSERT_TRUE(summary.IsSolutionUsable());
    EXPECT_NEAR(corridor[0], 0.0, 1e-6);
    EXPECT_NEAR(NormalizeAngle(corridor[1] - motion[2]), 0.0, 1e-6);
    EXPECT_NEAR(corridor[2], 1.25, 1e-6);
  }
}

}  // namespace
}  // namespace plumbline
