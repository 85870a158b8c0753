#include <ceres/jet.h>
#include <gtest/gtest.h>
#include <plumbline/factors/angle.h>

#include <cmath>
#include <limits>

namespace plumbline {
namespace {

TEST(AngleTest, DegreesAndRadians) {
  EXPECT_DOUBLE_EQ(DegToRad(180.0), 3.141592653589793);
  EXPECT_DOUBLE_EQ(RadToDeg(1.5707963267948966), 90.0);
}

TEST(AngleTest, WrapsDirectedAngles) {
  EXPECT_EQ(NormalizeAngle(0.0), 0.0);
  EXPECT_EQ(NormalizeAngle(1.25), 1.25);
  EXPECT_EQ(NormalizeAngle(-3.0), -3.0);
  EXPECT_DOUBLE_EQ(NormalizeAngle(4.0), 4.0 - 2.0 * kPi);
  EXPECT_DOUBLE_EQ(NormalizeAngle(-4.0), 2.0 * kPi - 4.0);
  EXPECT_NEAR(NormalizeAngle(7.0 * kPi + 0.5), -kPi + 0.5, 1e-14);
}

TEST(AngleTest, UpperEndBelongsToTheInterval) {
  EXPECT_EQ(NormalizeAngle(kPi), kPi);
  EXPECT_EQ(NormalizeAngle(-kPi), kPi);
  EXPECT_EQ(NormalizeAngle(3.0 * kPi), kPi);
  const double above = std::nextafter(kPi, 4.0);
  EXPECT_LT(NormalizeAngle(above), 0.0);
  EXPECT_GT(NormalizeAngle(above), -kPi);
  EXPECT_EQ(NormalizeAxial(kPi / 2), kPi / 2);
  EXPECT_EQ(NormalizeAxial(-kPi / 2), kPi / 2);
}

TEST(AngleTest, WrapsUndirectedAngles) {
  EXPECT_DOUBLE_EQ(NormalizeAxial(3.0), 3.0 - kPi);
  EXPECT_DOUBLE_EQ(NormalizeAxial(-3.0), kPi - 3.0);
  EXPECT_EQ(NormalizeAxial(1.5), 1.5);
  EXPECT_EQ(NormalizeAxial(kPi), 0.0);
}

TEST(AngleTest, HugeAnglesStayInTheInterval) {
  for (double angle : {1e6, -1e6, 1e16, -1e22, 1e300, -1e300,
                       std::numeric_limits<double>::max()}) {
    EXPECT_GT(NormalizeAngle(angle), -kPi) << angle;
    EXPECT_LE(NormalizeAngle(angle), kPi) << angle;
    EXPECT_GT(NormalizeAxial(angle), -kPi / 2) << angle;
    EXPECT_LE(NormalizeAxial(angle), kPi / 2) << angle;
  }
  EXPECT_EQ(NormalizeAngle(std::numeric_limits<double>::denorm_min()),
            std::numeric_limits<double>::denorm_min());
}

TEST(AngleTest, NonFiniteAnglesGiveNan) {
  EXPECT_TRUE(std::isnan(NormalizeAngle(std::nan(""))));
  EXPECT_TRUE(
      std::isnan(NormalizeAngle(std::numeric_limits<double>::infinity())));
  EXPECT_TRUE(
      std::isnan(NormalizeAxial(-std::numeric_limits<double>::infinity())));
}

TEST(AngleTest, DerivativeIsOneOnBothSidesOfTheCut) {
  using Jet = ceres::Jet<double, 2>;
  for (double angle : {0.3, kPi, -kPi, 3.2, -40.0}) {
    const Jet wrapped = NormalizeAngle(Jet(angle, 1));
    EXPECT_EQ(wrapped.a, NormalizeAngle(angle));
    EXPECT_EQ(wrapped.v[0], 0.0);
    EXPECT_EQ(wrapped.v[1], 1.0);
    const Jet axial = NormalizeAxial(Jet(angle, 0));
    EXPECT_EQ(axial.a, NormalizeAxial(angle));
    EXPECT_EQ(axial.v[0], 1.0);
  }
}

}  // namespace
}  // namespace plumbline
