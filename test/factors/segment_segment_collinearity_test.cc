#include <ceres/problem.h>
#include <ceres/solver.h>
#include <gtest/gtest.h>
#include <plumbline/factors/segment_segment_collinearity.h>

#include <cmath>
#include <memory>

#include "factors/factors_test_util.h"

namespace plumbline {
namespace {

using testing::Block;
using testing::Evaluate;
using testing::Random;

TEST(SegmentSegmentCollinearityTest, ByHand) {
  // The first points up at x = 2; the second's reference point is 0.5 to its
  // left and 7 further up, and it is turned by 0.1.
  Eigen::Matrix2d weight;
  weight << 2.0, 1.0, 0.0, 3.0;
  const std::unique_ptr<ceres::CostFunction> cost(
      SegmentSegmentCollinearity::Create(Eigen::Vector2d(0.25, 0.0), weight));
  const auto result =
      Evaluate(*cost, {{2.0, 1.0, kPi / 2}, {1.5, 8.0, kPi / 2 + 0.1}});
  EXPECT_NEAR(result.residual[0], 2.0 * 0.25 + 0.1, 1e-14);
  EXPECT_NEAR(result.residual[1], 0.3, 1e-14);
  // The first segment's turn moves its line by 7 m per rad to the left there.
  EXPECT_NEAR(result.jacobians[0](0, 2), 2.0 * -7.0 - 1.0, 1e-14);
  EXPECT_NEAR(result.jacobians[1](0, 0), -2.0, 1e-14);
  // Nothing is said about the way along.
  EXPECT_NEAR(result.jacobians[0](0, 1), 0.0, 1e-14);
  EXPECT_NEAR(result.jacobians[1](0, 1), 0.0, 1e-14);
}

TEST(SegmentSegmentCollinearityTest, TwoFacesAreNotCollinear) {
  const SegmentSegmentCollinearity relation(Eigen::Vector2d::Zero(),
                                            Eigen::Matrix2d::Identity());
  const double face[3] = {0.0, 0.0, 0.0};
  const double back[3] = {1.0, 0.0, kPi};
  double residual[2];
  relation(face, back, residual);
  EXPECT_NEAR(residual[0], 0.0, 1e-15);
  EXPECT_NEAR(std::abs(residual[1]), kPi, 1e-15);
}

TEST(SegmentSegmentCollinearityTest, JacobiansMatchDifferences) {
  Random random(21);
  const std::unique_ptr<ceres::CostFunction> cost(
      SegmentSegmentCollinearity::Create(
          Eigen::Vector2d::Zero(),
          Eigen::Matrix2d(Eigen::Vector2d(2.0, 3.0).asDiagonal())));
  for (int i = 0; i < 50; ++i) {
    const double heading = random.Uniform(-kPi, kPi);
    testing::ExpectJacobiansMatchDifferences(
        *cost, {{random.Uniform(-9, 9), random.Uniform(-9, 9), heading},
                {random.Uniform(-9, 9), random.Uniform(-9, 9),
                 NormalizeAngle(heading + random.Uniform(-3.0, 3.0))}});
  }
}

TEST(SegmentSegmentOffsetTest, HasTheResidualButDoesNotMakeOneWall) {
  const Eigen::Vector2d expected(12.5, kPi);
  const Eigen::Matrix2d weight = Eigen::Vector2d(2.0, 3.0).asDiagonal();
  const double first[3] = {1.0, 2.0, 0.5};
  const double second[3] = {4.0, 9.0, -2.5};
  double offset[2];
  double collinearity[2];
  SegmentSegmentOffset(expected, weight)(first, second, offset);
  SegmentSegmentCollinearity(expected, weight)(first, second, collinearity);
  EXPECT_EQ(offset[0], collinearity[0]);
  EXPECT_EQ(offset[1], collinearity[1]);
  EXPECT_NE(SegmentSegmentOffset::kRole, RelationRole::kSameWall);
}

TEST(SegmentSegmentCollinearityTest, SameFarFromTheOrigin) {
  const std::unique_ptr<ceres::CostFunction> cost(
      SegmentSegmentCollinearity::Create(Eigen::Vector2d::Zero(),
                                         Eigen::Matrix2d::Identity()));
  // Powers of two, so that moving is exact.
  const Block first = {1.0, 2.0, 0.5};
  const Block second = {4.0, 3.5, 0.625};
  const Block far_first = {1.0 + 16777216.0, 2.0 - 8388608.0, 0.5};
  const Block far_second = {4.0 + 16777216.0, 3.5 - 8388608.0, 0.625};
  const auto near = Evaluate(*cost, {first, second});
  const auto far = Evaluate(*cost, {far_first, far_second});
  EXPECT_EQ(near.residual, far.residual);
  EXPECT_EQ(near.jacobians[0], far.jacobians[0]);
}

TEST(SegmentSegmentCollinearityTest, InformationWithALever) {
  // At the point 10 m along, offset 0.02 m and direction 0.01 rad are
  // independent there: (f0 + 10 f1) / 0.02 and f1 / 0.01.
  const Eigen::Matrix2d information = CollinearityInformation(0.02, 0.01, 10.0);
  const Eigen::Vector2d error(0.05, -0.003);
  const double offset = (0.05 - 0.03) / 0.02;
  const double angle = 0.003 / 0.01;
  EXPECT_NEAR(error.dot(information * error), offset * offset + angle * angle,
              1e-10);
}

TEST(SegmentSegmentCollinearityTest, OneWallInTwoPieces) {
  // The second piece turns and moves across onto the first, not along it.
  double first[3] = {0.0, 0.0, kPi / 4};
  double second[3] = {3.0, 3.3, kPi / 4 + 0.05};
  const double along = std::sqrt(0.5) * (second[0] + second[1]);
  ceres::Problem problem;
  problem.AddResidualBlock(
      SegmentSegmentCollinearity::Create(Eigen::Vector2d::Zero(),
                                         10.0 * Eigen::Matrix2d::Identity()),
      nullptr, first, second);
  problem.SetParameterBlockConstant(first);
  ceres::Solver::Options options;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  ASSERT_TRUE(summary.IsSolutionUsable());
  EXPECT_NEAR(second[0], second[1], 1e-8);
  EXPECT_NEAR(second[2], kPi / 4, 1e-8);
  EXPECT_NEAR(std::sqrt(0.5) * (second[0] + second[1]), along, 1e-6);
}

}  // namespace
}  // namespace plumbline
