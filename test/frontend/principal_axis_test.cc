#include <gtest/gtest.h>
#include <plumbline/frontend/principal_axis.h>

#include <Eigen/Core>
#include <cmath>

namespace plumbline {
namespace {

// Moments of points that scatter so along an angle and across it.
PrincipalAxis AxisOfScatter(double angle, double along, double across) {
  const double c = std::cos(angle);
  const double s = std::sin(angle);
  return PrincipalAxisOf(along * c * c + across * s * s,
                         (along - across) * c * s,
                         along * s * s + across * c * c);
}

TEST(PrincipalAxisTest, AllAnglesAreFoundToRounding) {
  const double pi = std::acos(-1.0);
  for (int degrees = -89; degrees <= 90; ++degrees) {
    const double angle = degrees * pi / 180.0;
    const PrincipalAxis axis = AxisOfScatter(angle, 3e-2, 2e-4);
    EXPECT_NEAR(axis.direction.x(), std::cos(angle), 1e-14) << degrees;
    EXPECT_NEAR(std::abs(axis.direction.y()), std::abs(std::sin(angle)), 1e-14)
        << degrees;
    EXPECT_GE(axis.direction.x() * std::cos(angle) +
                  axis.direction.y() * std::sin(angle),
              degrees == 90 ? -1.0 : 1.0 - 1e-14)
        << degrees;
    EXPECT_NEAR(axis.along, 3e-2, 1e-16) << degrees;
    EXPECT_NEAR(axis.across, 2e-4, 1e-16) << degrees;
  }
}

TEST(PrincipalAxisTest, SmallAnglesKeepTheirDigits) {
  for (const double angle : {1e-3, 1e-6, -1e-9}) {
    const PrincipalAxis axis = AxisOfScatter(angle, 1.0, 0.0);
    EXPECT_NEAR(axis.direction.y() / std::sin(angle), 1.0, 1e-12);
    EXPECT_EQ(axis.direction.x(), std::cos(angle));
  }
}

TEST(PrincipalAxisTest, AlongTheAxesItIsExact) {
  EXPECT_EQ(PrincipalAxisOf(2.0, 0.0, 1.0).direction, Eigen::Vector2d::UnitX());
  EXPECT_EQ(PrincipalAxisOf(1.0, 0.0, 2.0).direction, Eigen::Vector2d::UnitY());
}

TEST(PrincipalAxisTest, WithoutADirectionItIsX) {
  const PrincipalAxis round = PrincipalAxisOf(0.5, 0.0, 0.5);
  EXPECT_EQ(round.direction, Eigen::Vector2d::UnitX());
  EXPECT_EQ(round.along, 0.5);
  EXPECT_EQ(round.across, 0.5);
  EXPECT_EQ(PrincipalAxisOf(0.0, 0.0, 0.0).direction, Eigen::Vector2d::UnitX());
}

}  // namespace
}  // namespace plumbline
