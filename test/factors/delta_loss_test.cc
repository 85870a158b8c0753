#include <ceres/crs_matrix.h>
#include <ceres/problem.h>
#include <gtest/gtest.h>
#include <plumbline/factors/delta_loss.h>
#include <plumbline/factors/orientation_orientation.h>
#include <plumbline/factors/point_point_coincidence.h>

#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include "factors/factors_test_util.h"

namespace plumbline {
namespace {

TEST(FrozenDeltaLossTest, ReadsTheWeightWhenEvaluated) {
  double delta = 0.25;
  const FrozenDeltaLoss loss(&delta);
  double rho[3];
  loss.Evaluate(8.0, rho);
  EXPECT_EQ(rho[0], 2.0);
  EXPECT_EQ(rho[1], 0.25);
  EXPECT_EQ(rho[2], 0.0);
  delta = 0.5;
  loss.Evaluate(8.0, rho);
  EXPECT_EQ(rho[0], 4.0);
  EXPECT_EQ(rho[1], 0.5);
  delta = 0.0;
  loss.Evaluate(1e300, rho);
  EXPECT_EQ(rho[0], 0.0);
  EXPECT_EQ(rho[1], 0.0);
  delta = 1.0;
  testing::ExpectRobustLoss(loss);
}

TEST(FrozenDeltaLossTest, RefusesNull) {
  EXPECT_THROW(FrozenDeltaLoss(nullptr), std::invalid_argument);
}

TEST(FrozenDeltaLossTest, WeightsChangeWithoutTouchingTheProblem) {
  double delta = 1.0;
  double o1[1] = {0.1};
  double o2[1] = {0.4};
  ceres::Problem problem;
  problem.AddResidualBlock(OrientationOrientation::Create(0.0, 10.0),
                           new FrozenDeltaLoss(&delta), o1, o2);
  const auto cost = [&problem] {
    double value = 0.0;
    EXPECT_TRUE(problem.Evaluate(ceres::Problem::EvaluateOptions(), &value,
                                 nullptr, nullptr, nullptr));
    return value;
  };
  EXPECT_NEAR(cost(), 4.5, 1e-12);  // 1/2 (10 * 0.3)^2
  delta = 0.5;
  EXPECT_NEAR(cost(), 2.25, 1e-12);
  delta = 0.0;
  EXPECT_EQ(cost(), 0.0);
}

TEST(ContinuousDeltaLossTest, KeepsTheLawsOfALoss) {
  for (int k : {1, 2, 3, 4, 5, 6, 8, 20}) {
    SCOPED_TRACE(k);
    testing::ExpectRobustLoss(ContinuousDeltaLoss(k));
  }
}

TEST(ContinuousDeltaLossTest, ByHand) {
  double rho[3];
  // k = 2: rho = 2 (1 - exp(-s/2)), the Welsch kernel.
  for (double s : {1e-12, 1e-3, 0.5, 1.999999, 2.0, 3.0, 40.0}) {
    ContinuousDeltaLoss(2).Evaluate(s, rho);
    EXPECT_NEAR(rho[0], -2.0 * std::expm1(-0.5 * s), 1e-14 * s) << s;
    EXPECT_NEAR(rho[1], std::exp(-0.5 * s), 1e-15) << s;
    EXPECT_NEAR(rho[2], -0.5 * std::exp(-0.5 * s), 1e-15) << s;
  }
  // k = 1, s = 1: erfc(sqrt(1/2)) + erf(sqrt(1/2)) - 2 exp(-1/2) / sqrt(2 pi).
  ContinuousDeltaLoss(1).Evaluate(1.0, rho);
  EXPECT_NEAR(rho[0], 0.51605855096171330, 1e-14);
  EXPECT_NEAR(rho[1], 0.31731050786291410, 1e-14);
  EXPECT_NEAR(rho[2], -0.24197072451914335, 1e-14);
  // k = 3, s = 3: 3 Q + 3 (1 - Q) - 2 s f = 3 - 6 f.
  ContinuousDeltaLoss(3).Evaluate(3.0, rho);
  EXPECT_NEAR(rho[0], 3.0 - 6.0 * 0.15418032980376928, 1e-13);
  EXPECT_NEAR(rho[1], 0.39162517627108896, 1e-14);
}

TEST(ContinuousDeltaLossTest, QuadraticAtZeroAndBoundedByTheDegreesOfFreedom) {
  double rho[3];
  for (int k : {1, 2, 3, 4, 7}) {
    const ContinuousDeltaLoss loss(k);
    for (double s :
         {std::numeric_limits<double>::denorm_min(), 1e-300, 1e-100, 1e-25}) {
      loss.Evaluate(s, rho);
      EXPECT_NEAR(rho[0], s, 1e-10 * s) << k << " " << s;
      EXPECT_NEAR(rho[1], 1.0, 1e-10) << k << " " << s;
    }
    for (double s : {1e4, 1e300, std::numeric_limits<double>::max(),
                     std::numeric_limits<double>::infinity()}) {
      loss.Evaluate(s, rho);
      EXPECT_EQ(rho[0], k) << s;
      EXPECT_EQ(rho[1], 0.0) << s;
      EXPECT_EQ(rho[2], 0.0) << s;
    }
  }
}

TEST(ContinuousDeltaLossTest, BothFormsOfTheIntegralMeet) {
  for (int k : {1, 2, 3, 4, 5, 10, 60}) {
    const ContinuousDeltaLoss loss(k);
    double at[3];
    double below[3];
    loss.Evaluate(k, at);
    loss.Evaluate(std::nextafter(static_cast<double>(k), 0.0), below);
    EXPECT_NEAR(at[0], below[0], 1e-12 * k) << k;
  }
}

TEST(ContinuousDeltaLossTest, RefusesNoDegreesOfFreedom) {
  EXPECT_THROW(ContinuousDeltaLoss(0), std::invalid_argument);
  EXPECT_THROW(ContinuousDeltaLoss(-1), std::invalid_argument);
}

// Ceres ends the process on a loss that is not one; here it corrects residuals
// of zero, of rounding size, ordinary, and of 1e150.
TEST(ContinuousDeltaLossTest, SurvivesTheCorrector) {
  double origin[2] = {0.0, 0.0};
  for (double offset : {0.0, 1e-160, 1e-150, 0.5, 1e150}) {
    double point[2] = {offset, 0.0};
    ceres::Problem problem;
    for (int k : {1, 2}) {
      problem.AddResidualBlock(
          PointPointCoincidence::Create(Eigen::Vector2d::Zero(),
                                        Eigen::Matrix2d::Identity()),
          new ContinuousDeltaLoss(k), origin, point);
    }
    double cost = -1.0;
    std::vector<double> residuals;
    std::vector<double> gradient;
    ceres::CRSMatrix jacobian;
    ASSERT_TRUE(problem.Evaluate(ceres::Problem::EvaluateOptions(), &cost,
                                 &residuals, &gradient, &jacobian));
    EXPECT_GE(cost, 0.0);
    EXPECT_LE(cost, 1.5);
    for (double value : residuals) EXPECT_TRUE(std::isfinite(value));
    for (double value : gradient) EXPECT_TRUE(std::isfinite(value));
    for (double value : jacobian.values) EXPECT_TRUE(std::isfinite(value));
  }
}

}  // namespace
}  // namespace plumbline
