#include <gtest/gtest.h>
#include <plumbline/apps/evaluation/confidence.h>
#include <plumbline/core/error.h>

#include <cmath>
#include <vector>

namespace plumbline {
namespace {

TEST(ConfidenceTest, ShareByWilson) {
  const Estimate share = ShareEstimate(18, 20);
  EXPECT_DOUBLE_EQ(share.value, 0.9);
  // center = (0.9 + 0.096037) / 1.192073, half = 0.136583.
  EXPECT_NEAR(share.low, 0.698968, 1e-5);
  EXPECT_NEAR(share.high, 0.972134, 1e-5);
  const Estimate all = ShareEstimate(20, 20);
  EXPECT_NEAR(all.low, 1.0 / (1.0 + 3.841459 / 20), 1e-6);
  EXPECT_DOUBLE_EQ(all.high, 1.0);
  EXPECT_DOUBLE_EQ(ShareEstimate(0, 5).low, 0.0);
  EXPECT_TRUE(std::isnan(ShareEstimate(0, 0).value));
}

TEST(ConfidenceTest, MeanHasAnIntervalAsWideAsTheTheorySays) {
  // 100 values, half 0 and half 1: standard error 0.05.
  std::vector<double> values(100, 0.0);
  for (std::size_t i = 0; i < 50; ++i) values[2 * i] = 1.0;
  const Estimate mean = MeanEstimate(values);
  EXPECT_DOUBLE_EQ(mean.value, 0.5);
  EXPECT_NEAR(mean.low, 0.5 - 1.96 * 0.05, 0.011);
  EXPECT_NEAR(mean.high, 0.5 + 1.96 * 0.05, 0.011);
  const Estimate again = MeanEstimate(values);
  EXPECT_EQ(mean.low, again.low);
  EXPECT_EQ(mean.high, again.high);
}

TEST(ConfidenceTest, FewTrials) {
  EXPECT_TRUE(std::isnan(MeanEstimate({}).value));
  const Estimate one = MeanEstimate({3.0});
  EXPECT_EQ(one.value, 3.0);
  EXPECT_EQ(one.low, 3.0);
  EXPECT_EQ(one.high, 3.0);
}

TEST(ConfidenceTest, RatioKeepsThePairing) {
  // Each numerator is twice its denominator: there is no doubt.
  const Estimate ratio = RatioEstimate({2.0, 20.0, 6.0}, {1.0, 10.0, 3.0});
  EXPECT_DOUBLE_EQ(ratio.value, 2.0);
  EXPECT_DOUBLE_EQ(ratio.low, 2.0);
  EXPECT_DOUBLE_EQ(ratio.high, 2.0);
  EXPECT_DOUBLE_EQ(RatioEstimate({1.0, 2.0}, {1.0, 5.0}).value, 0.5);
  EXPECT_THROW(RatioEstimate({1.0}, {1.0, 2.0}), Error);
}

TEST(ConfidenceTest, RatioOfNothing) {
  EXPECT_TRUE(std::isnan(RatioEstimate({0.0, 0.0}, {0.0, 0.0}).value));
  EXPECT_TRUE(std::isnan(RatioEstimate({0.0, 0.0}, {0.0, 0.0}).high));
}

}  // namespace
}  // namespace plumbline
