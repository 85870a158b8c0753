#include <gtest/gtest.h>
#include <plumbline/factors/geman_mcclure_loss.h>

#include <cmath>
#include <limits>
#include <stdexcept>

#include "factors/factors_test_util.h"

namespace plumbline {
namespace {

TEST(GemanMcClureLossTest, ByHand) {
  const GemanMcClureLoss loss(2.0);
  double rho[3];
  loss.Evaluate(4.0, rho);
  EXPECT_DOUBLE_EQ(rho[0], 2.0);
  EXPECT_DOUBLE_EQ(rho[1], 0.25);
  EXPECT_DOUBLE_EQ(rho[2], -0.0625);  // -2 * 16 / 8^3
  loss.Evaluate(12.0, rho);
  EXPECT_DOUBLE_EQ(rho[0], 3.0);
  EXPECT_DOUBLE_EQ(rho[1], 0.0625);
}

TEST(GemanMcClureLossTest, KeepsTheLawsOfALoss) {
  for (double a : {0.5, 1.0, 2.0, 10.0}) {
    SCOPED_TRACE(a);
    testing::ExpectRobustLoss(GemanMcClureLoss(a));
  }
  double rho[3];
  GemanMcClureLoss(3.0).Evaluate(std::numeric_limits<double>::infinity(), rho);
  EXPECT_EQ(rho[0], 9.0);
  EXPECT_EQ(rho[1], 0.0);
  EXPECT_EQ(rho[2], 0.0);
}

TEST(GemanMcClureLossTest, RefusesBadScales) {
  for (double a : {0.0, -1.0, std::nan(""), 1e200, 1e-200,
                   std::numeric_limits<double>::infinity()}) {
    EXPECT_THROW(GemanMcClureLoss{a}, std::invalid_argument) << a;
  }
}

}  // namespace
}  // namespace plumbline
