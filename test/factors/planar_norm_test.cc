#include <ceres/jet.h>
#include <gtest/gtest.h>
#include <plumbline/factors/planar_norm.h>

#include <cmath>

namespace plumbline {
namespace {

using Jet = ceres::Jet<double, 2>;

TEST(PlanarNormTest, ValueAndGradient) {
  const Jet norm = PlanarNorm(Jet(-3.0, 0), Jet(4.0, 1));
  EXPECT_DOUBLE_EQ(norm.a, 5.0);
  EXPECT_DOUBLE_EQ(norm.v[0], -0.6);
  EXPECT_DOUBLE_EQ(norm.v[1], 0.8);
}

TEST(PlanarNormTest, GradientIsAUnitVectorDownToZero) {
  for (double length : {1.0, 1e-8, 1e-100, 1e-153, 1e-160, 1e-300, 0.0}) {
    const Jet norm = PlanarNorm(Jet(length, 0), Jet(0.0, 1));
    EXPECT_NEAR(norm.a, length, 1e-15 * length);
    EXPECT_NEAR(norm.v[0], 1.0, 1e-14) << length;
    EXPECT_EQ(norm.v[1], 0.0) << length;
  }
}

TEST(PlanarNormTest, KeepsNan) {
  EXPECT_TRUE(std::isnan(PlanarNorm(std::nan(""), 0.0)));
}

}  // namespace
}  // namespace plumbline
