#include <gtest/gtest.h>
#include <plumbline/detectors/normality_test.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <vector>

namespace plumbline {
namespace {

// Published by D'Agostino, Belanger and D'Agostino 1990 for the cholesterol
// values of 62 people (Framingham): skewness 1.02, kurtosis 4.58, Z 3.14 and
// 2.21, K^2 14.75. The moments are rounded to two digits there.
TEST(NormalityTest, CholesterolExample) {
  EXPECT_NEAR(SkewnessZ(62, 1.02), 3.14, 0.02);
  EXPECT_NEAR(KurtosisZ(62, 4.58), 2.21, 0.01);
}

// The example of SciPy's skewtest with seven values of 100 and one of 101: the
// skewness of a Bernoulli variable with p = 1/8 is (1 - 2p) / sqrt(p (1 - p)).
TEST(NormalityTest, SkewnessOfOneOutlier) {
  EXPECT_NEAR(SkewnessZ(8, 0.75 / std::sqrt(7.0 / 64.0)), 3.5717766638478072,
              1e-12);
  EXPECT_NEAR(SkewnessZ(8, -0.75 / std::sqrt(7.0 / 64.0)), -3.5717766638478072,
              1e-12);
  EXPECT_EQ(SkewnessZ(50, 0.0), 0.0);
}

// 0, 1, ..., 19, the example of SciPy's kurtosistest: skewness 0; kurtosis of a
// discrete uniform distribution 3 - 6/5 (n^2 + 1) / (n^2 - 1) = 1.79398496.
TEST(NormalityTest, TwentyEquallySpacedValues) {
  std::vector<double> samples;
  for (int i = 0; i < 20; ++i) samples.push_back(i);
  const NormalityResult result = TestNormality(samples);
  ASSERT_TRUE(result.applicable);
  EXPECT_NEAR(result.skewness_z, 0.0, 1e-12);
  EXPECT_NEAR(result.kurtosis_z, -1.7058104152122062, 1e-12);
  EXPECT_NEAR(result.k_squared, 2.90978917265, 1e-9);
  EXPECT_NEAR(result.p_value, 0.23342497, 1e-7);
}

TEST(NormalityTest, ScaleAndOffsetDoNotMatter) {
  std::vector<double> samples, moved, tiny;
  for (int i = 0; i < 40; ++i) {
    const double x = std::sin(i * i * 0.7) + 0.1 * i;
    samples.push_back(x);
    moved.push_back(4.0 * x + 100.0);
    tiny.push_back(1e-90 * x);
  }
  const NormalityResult a = TestNormality(samples);
  ASSERT_TRUE(a.applicable);
  EXPECT_NEAR(TestNormality(moved).k_squared, a.k_squared, 1e-9);
  EXPECT_NEAR(TestNormality(tiny).k_squared, a.k_squared, 1e-9);
}

TEST(NormalityTest, NotApplicable) {
  EXPECT_FALSE(TestNormality({}).applicable);
  std::vector<double> samples;
  for (int i = 0; i < 19; ++i) samples.push_back(i);
  EXPECT_FALSE(TestNormality(samples).applicable);
  EXPECT_FALSE(TestNormality(std::vector<double>(30, 0.1)).applicable);
  samples.push_back(std::numeric_limits<double>::quiet_NaN());
  EXPECT_FALSE(TestNormality(samples).applicable);
}

// Two distant modes have a kurtosis near 1, past the pole of the approximation
// for n = 1000: the answer must be "far too flat", not "peaked".
TEST(NormalityTest, TwoModesAreFarFromNormal) {
  EXPECT_LT(KurtosisZ(1000, 1.0), -10.0);
  EXPECT_LT(KurtosisZ(1000, 1.0), KurtosisZ(1000, 1.8));
  std::vector<double> samples;
  for (int i = 0; i < 1000; ++i) samples.push_back(i % 2 + 1e-4 * i);
  const NormalityResult result = TestNormality(samples);
  ASSERT_TRUE(result.applicable);
  EXPECT_LT(result.kurtosis_z, -10.0);
  EXPECT_LT(result.p_value, 1e-10);
}

// The p-value of normal samples is uniform: one in ten is below 0.1.
TEST(NormalityTest, NormalSamplesArePassed) {
  std::mt19937_64 engine(7);
  const auto uniform = [&] {
    return (static_cast<double>(engine() >> 11) + 0.5) / 9007199254740992.0;
  };
  int below = 0;
  for (int trial = 0; trial < 400; ++trial) {
    std::vector<double> samples;
    for (int i = 0; i < 50; ++i) {
      samples.push_back(std::sqrt(-2.0 * std::log(uniform())) *
                        std::cos(6.283185307179586 * uniform()));
    }
    if (TestNormality(samples).p_value < 0.1) ++below;
  }
  EXPECT_GT(below, 22);
  EXPECT_LT(below, 58);
}

}  // namespace
}  // namespace plumbline
