#include <gtest/gtest.h>
#include <plumbline/factors/dcs_loss.h>

#include <cmath>
#include <limits>
#include <stdexcept>

#include "factors/factors_test_util.h"

namespace plumbline {
namespace {

TEST(DcsLossTest, ByHand) {
  const DcsLoss loss(2.0);
  double rho[3];
  loss.Evaluate(1.5, rho);
  EXPECT_EQ(rho[0], 1.5);
  EXPECT_EQ(rho[1], 1.0);
  EXPECT_EQ(rho[2], 0.0);
  loss.Evaluate(6.0, rho);
  EXPECT_DOUBLE_EQ(rho[0], 4.0);      // 2 (18 - 2) / 8
  EXPECT_DOUBLE_EQ(rho[1], 0.25);     // (4 / 8)^2
  EXPECT_DOUBLE_EQ(rho[2], -0.0625);  // -8 * 4 / 512
}

TEST(DcsLossTest, SmoothWhereTheBranchesMeet) {
  const DcsLoss loss(2.0);
  double at[3];
  double above[3];
  loss.Evaluate(2.0, at);
  loss.Evaluate(std::nextafter(2.0, 3.0), above);
  EXPECT_NEAR(above[0], at[0], 1e-14);
  EXPECT_NEAR(above[1], at[1], 1e-14);
}

TEST(DcsLossTest, KeepsTheLawsOfALoss) {
  for (double phi : {0.5, 1.0, 5.0}) {
    SCOPED_TRACE(phi);
    testing::ExpectRobustLoss(DcsLoss(phi), phi);
  }
  double rho[3];
  DcsLoss(2.0).Evaluate(std::numeric_limits<double>::infinity(), rho);
  EXPECT_EQ(rho[0], 6.0);
  EXPECT_EQ(rho[1], 0.0);
  EXPECT_EQ(rho[2], 0.0);
}

TEST(DcsLossTest, RefusesBadParameters) {
  for (double phi :
       {0.0, -1.0, std::nan(""), std::numeric_limits<double>::infinity()}) {
    EXPECT_THROW(DcsLoss{phi}, std::invalid_argument) << phi;
  }
}

// Ceres' own kernels are offered beside these as they are: the same laws.
TEST(CeresLossTest, KeepsTheLawsOfALoss) {
  testing::ExpectRobustLoss(ceres::HuberLoss(1.2), 1.44);
  testing::ExpectRobustLoss(ceres::CauchyLoss(1.5));
  testing::ExpectRobustLoss(ceres::TukeyLoss(2.2), 4.84);
}

}  // namespace
}  // namespace plumbline
