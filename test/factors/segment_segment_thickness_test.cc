#include <ceres/problem.h>
#include <ceres/solver.h>
#include <gtest/gtest.h>
#include <plumbline/factors/segment_segment_collinearity.h>
#include <plumbline/factors/segment_segment_thickness.h>

#include <cmath>
#include <memory>
#include <utility>

#include "factors/factors_test_util.h"

namespace plumbline {
namespace {

using testing::Block;
using testing::Evaluate;
using testing::Random;
using testing::Weight2;

Eigen::Vector2d ThicknessError(const Block& first, const Block& second,
                               double thickness) {
  Eigen::Vector2d residual;
  SegmentSegmentThickness(Eigen::Vector2d(0.0, kPi),
                          Eigen::Matrix2d::Identity())(
      first.data(), second.data(), &thickness, residual.data());
  return residual;
}

TEST(SegmentSegmentThicknessTest, ByHand) {
  // The first face is y = 2, seen from above; the second one lies 0.4 behind
  // it, turned by 0.1. Error (0.4 - 0.15 - 0.05, 0.1).
  const std::unique_ptr<ceres::CostFunction> cost(
      SegmentSegmentThickness::Create(Eigen::Vector2d(0.05, kPi), Weight2()));
  const auto result =
      Evaluate(*cost, {{1.0, 2.0, 0.0}, {4.0, 1.6, kPi + 0.1}, {0.15}});
  EXPECT_NEAR(result.residual[0], 0.5, 1e-14);  // 2 * 0.2 + 0.1
  EXPECT_NEAR(result.residual[1], 0.3, 1e-14);
  // Row 0 of the error: (0, 1, 3), as turning the first face lifts its line by
  // 3 a radian over the second face, (0, -1, 0) and -1; row 1: (0, 0, -1),
  // (0, 0, 1) and 0.
  Eigen::MatrixXd first(2, 3);
  first << 0, 2, 2 * 3 - 1, 0, 0, -3;
  Eigen::MatrixXd second(2, 3);
  second << 0, -2, 1, 0, 0, 3;
  Eigen::MatrixXd thickness(2, 1);
  thickness << -2, 0;
  EXPECT_LT((result.jacobians[0] - first).norm(), 1e-13);
  EXPECT_LT((result.jacobians[1] - second).norm(), 1e-13);
  EXPECT_LT((result.jacobians[2] - thickness).norm(), 1e-13);
}

TEST(SegmentSegmentThicknessTest, EitherFaceMayBeTheFirst) {
  Random random(60);
  for (int i = 0; i < 50; ++i) {
    const double angle = random.Uniform(-kPi, kPi);
    const double thickness = random.Uniform(0.05, 0.5);
    const double excess = random.Uniform(-0.05, 0.05);
    const double along = random.Uniform(-5, 5);
    const Block first = {random.Uniform(-9, 9), random.Uniform(-9, 9), angle};
    const double behind = thickness + excess;
    const Block second = {
        first[0] + along * std::cos(angle) + behind * std::sin(angle),
        first[1] + along * std::sin(angle) - behind * std::cos(angle),
        NormalizeAngle(angle + kPi)};
    const Eigen::Vector2d expected(excess, 0.0);
    EXPECT_LT((ThicknessError(first, second, thickness) - expected).norm(),
              1e-13);
    EXPECT_LT((ThicknessError(second, first, thickness) - expected).norm(),
              1e-13);
    // Where the first one's position is on its line does not matter.
    const Block elsewhere = {first[0] + 3.0 * std::cos(angle),
                             first[1] + 3.0 * std::sin(angle), angle};
    EXPECT_LT((ThicknessError(elsewhere, second, thickness) - expected).norm(),
              1e-13);
  }
}

TEST(SegmentSegmentThicknessTest, TurnIsWrapped) {
  const auto turn = [](double first, double second) {
    return ThicknessError({0.0, 0.0, first}, {0.0, 0.0, second}, 0.1)[1];
  };
  // 0.2 - 3 + pi and, a turn on, 0.2 + 3 - pi.
  EXPECT_NEAR(turn(3.0, 0.2), 0.34159265358979312, 1e-14);
  EXPECT_NEAR(turn(-3.0, 0.2), 0.05840734641020706, 1e-14);
  // Seen from the same side; past the cut the turn comes from the other side.
  EXPECT_NEAR(turn(0.0, 0.1), -kPi + 0.1, 1e-14);
  EXPECT_NEAR(turn(0.0, -0.1), kPi - 0.1, 1e-14);
}

TEST(SegmentSegmentThicknessTest, JacobiansMatchDifferences) {
  Random random(61);
  const std::unique_ptr<ceres::CostFunction> cost(
      SegmentSegmentThickness::Create(Eigen::Vector2d(0.01, kPi), Weight2()));
  for (int i = 0; i < 100; ++i) {
    const double angle = random.Uniform(-kPi, kPi);
    testing::ExpectJacobiansMatchDifferences(
        *cost, {{random.Uniform(-9, 9), random.Uniform(-9, 9), angle},
                {random.Uniform(-9, 9), random.Uniform(-9, 9),
                 NormalizeAngle(angle + kPi + random.Uniform(-3, 3))},
                {random.Uniform(-1, 1)}});
  }
  // Both in one place, no thickness, directions at the cut.
  testing::ExpectJacobiansMatchDifferences(
      *cost, {{1.0, 2.0, kPi}, {1.0, 2.0, 0.0}, {0.0}});
  testing::ExpectJacobiansMatchDifferences(
      *cost, {{1.0, 2.0, 0.0}, {1.0, 2.0, -kPi}, {0.0}});
}

TEST(SegmentSegmentThicknessTest, UnchangedWhenTheWorldMoves) {
  const std::unique_ptr<ceres::CostFunction> cost(
      SegmentSegmentThickness::Create(Eigen::Vector2d(0.01, kPi), Weight2()));
  const Block first = {3.0, 4.0, 2.9};
  const Block second = {2.0, 4.5, -0.4};
  const auto reference = Evaluate(*cost, {first, second, {0.2}});
  for (const Pose2& motion : testing::WorldMotions()) {
    const auto result = Evaluate(*cost, {testing::MovePose(motion, first),
                                         testing::MovePose(motion, second),
                                         {0.2}});
    EXPECT_LT((result.residual - reference.residual).norm(), 1e-10);
  }
}

// Information that says nothing of the directions.
TEST(SegmentSegmentThicknessTest, WithoutParallelism) {
  const std::unique_ptr<ceres::CostFunction> cost(
      SegmentSegmentThickness::Create(
          Eigen::Vector2d(0.0, kPi),
          Eigen::Vector2d(10.0, 0.0).asDiagonal().toDenseMatrix()));
  const auto result =
      Evaluate(*cost, {{0.0, 0.0, 0.0}, {1.0, -0.3, kPi + 0.2}, {0.1}});
  EXPECT_NEAR(result.residual[0], 2.0, 1e-13);
  EXPECT_EQ(result.residual[1], 0.0);
}

// The lever of CollinearityInformation is where the thickness holds.
TEST(SegmentSegmentThicknessTest, InformationCarriesTheLever) {
  const double lever = -2.5;
  const Eigen::Matrix2d information = CollinearityInformation(0.1, 0.01, lever);
  for (const auto& [excess, turn] :
       {std::pair(0.2, 0.0), std::pair(0.0, 0.01), std::pair(0.1, -0.02)}) {
    const double direction = kPi + turn;
    const Eigen::Vector2d at(7.0, -0.15 - excess);
    const Eigen::Vector2d position =
        at - lever * Eigen::Vector2d(std::cos(direction), std::sin(direction));
    const Eigen::Vector2d error = ThicknessError(
        {0.0, 0.0, 0.0}, {position.x(), position.y(), direction}, 0.15);
    EXPECT_NEAR(error.dot(information * error),
                std::pow(excess / 0.1, 2.0) + std::pow(turn / 0.01, 2.0), 1e-3);
  }
}

// Walls that are held, all but one face, determine the thickness and with it
// the place of that face.
TEST(SegmentSegmentThicknessTest, BareProblem) {
  for (const Pose2& motion : testing::WorldMotions()) {
    Block first = testing::MovePose(motion, {1.0, 2.0, 0.0});
    Block behind_first = testing::MovePose(motion, {3.0, 1.75, kPi});
    Block second = testing::MovePose(motion, {-1.0, 7.0, kPi / 2});
    Block behind_second =
        testing::MovePose(motion, {-0.5, 6.0, -kPi / 2 + 0.2});
    Block thickness = {0.4};
    ceres::Problem problem;
    for (const auto& [a, b] : {std::pair(&first, &behind_first),
                               std::pair(&second, &behind_second)}) {
      problem.AddResidualBlock(
          SegmentSegmentThickness::Create(Eigen::Vector2d(0.0, kPi), Weight2()),
          nullptr, a->data(), b->data(), thickness.data());
      problem.SetParameterBlockConstant(a->data());
    }
    problem.SetParameterBlockConstant(behind_first.data());
    ceres::Solver::Options options;
    options.logging_type = ceres::SILENT;
    options.function_tolerance = 1e-14;
    options.parameter_tolerance = 1e-14;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    ASSERT_TRUE(summary.IsSolutionUsable());
    EXPECT_NEAR(thickness[0], 0.25, 1e-6);
    const Eigen::Vector2d error =
        ThicknessError(second, behind_second, thickness[0]);
    EXPECT_LT(error.norm(), 1e-6);
  }
}

}  // namespace
}  // namespace plumbline
