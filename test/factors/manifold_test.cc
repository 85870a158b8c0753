#include <ceres/manifold.h>
#include <ceres/manifold_test_utils.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/factors/angle_manifold.h>
#include <plumbline/factors/line_manifold.h>
#include <plumbline/factors/pose_manifold.h>

#include <cmath>

#include "factors/factors_test_util.h"

// The macros of Ceres' header name its types without their namespace.
using ceres::HasCorrectMinusJacobianAt;
using ceres::HasCorrectPlusJacobianAt;
using ceres::HasCorrectRightMultiplyByPlusJacobianAt;
using ceres::MinusPlusIsIdentityAt;
using ceres::MinusPlusJacobianIsIdentityAt;
using ceres::PlusMinusIsIdentityAt;
using ceres::Vector;
using ceres::XMinusXIsZeroAt;
using ceres::XPlusZeroIsXAt;

namespace plumbline {
namespace {

using testing::Random;

// Random states, steps up to half a turn and second states anywhere, so about
// half of all steps and differences go across +-pi. Near the cut Ceres'
// numerical derivatives of Plus would straddle it: those states are tested by
// hand below.
template <typename Manifold>
void ExpectInvariants(int angle_index, std::uint64_t seed) {
  const Manifold manifold;
  const int size = manifold.AmbientSize();
  ASSERT_EQ(manifold.TangentSize(), size);
  Random random(seed);
  for (int i = 0; i < 100; ++i) {
    Vector x(size);
    Vector delta(size);
    Vector y(size);
    for (int p = 0; p < size; ++p) {
      x[p] = random.Uniform(-20.0, 20.0);
      delta[p] = random.Uniform(-20.0, 20.0);
      y[p] = random.Uniform(-20.0, 20.0);
    }
    x[angle_index] = random.Uniform(-kPi + 0.05, kPi - 0.05);
    delta[angle_index] = random.Uniform(-kPi, kPi);
    y[angle_index] = random.Uniform(-kPi, kPi);
    EXPECT_THAT_MANIFOLD_INVARIANTS_HOLD(manifold, x, delta, y, 1e-8);
  }
}

// Small steps from and to states on the cut itself.
template <typename Manifold>
void ExpectInvariantsAtTheCut(int angle_index) {
  const Manifold manifold;
  const int size = manifold.AmbientSize();
  for (double angle : {kPi, -kPi, 3.141592, -3.141592}) {
    for (double step : {0.0, 1e-9, -1e-9, 0.1, -0.1, 3.0, -3.0}) {
      Vector x = Vector::Constant(size, 2.0);
      Vector delta = Vector::Constant(size, 0.5);
      x[angle_index] = angle;
      delta[angle_index] = step;
      Vector y(size);
      ASSERT_TRUE(manifold.Plus(x.data(), delta.data(), y.data()));
      EXPECT_GT(y[angle_index], -kPi);
      EXPECT_LE(y[angle_index], kPi);
      EXPECT_NEAR(std::cos(y[angle_index]), std::cos(angle + step), 1e-14);
      EXPECT_NEAR(std::sin(y[angle_index]), std::sin(angle + step), 1e-14);
      EXPECT_THAT(manifold, MinusPlusIsIdentityAt(x, delta, 1e-6));
      EXPECT_THAT(manifold, XMinusXIsZeroAt(x, 0.0));
      EXPECT_THAT(manifold, HasCorrectMinusJacobianAt(x, 1e-8));
      EXPECT_THAT(manifold, MinusPlusJacobianIsIdentityAt(x, 0.0));
      EXPECT_THAT(manifold, HasCorrectRightMultiplyByPlusJacobianAt(x, 0.0));
    }
  }
}

TEST(AngleManifoldTest, Invariants) { ExpectInvariants<AngleManifold>(0, 21); }

TEST(AngleManifoldTest, InvariantsAtTheCut) {
  ExpectInvariantsAtTheCut<AngleManifold>(0);
}

TEST(AngleManifoldTest, MinusWraps) {
  const AngleManifold manifold;
  const double x = 3.0;
  const double y = -3.0;
  double difference = 0.0;
  ASSERT_TRUE(manifold.Minus(&y, &x, &difference));
  EXPECT_NEAR(difference, 0.28318530717958623, 1e-15);  // 2 pi - 6
  double sum = 0.0;
  ASSERT_TRUE(manifold.Plus(&x, &difference, &sum));
  EXPECT_NEAR(sum, -3.0, 1e-15);
}

TEST(PoseManifoldTest, Invariants) { ExpectInvariants<PoseManifold>(2, 22); }

TEST(PoseManifoldTest, InvariantsAtTheCut) {
  ExpectInvariantsAtTheCut<PoseManifold>(2);
}

TEST(PoseManifoldTest, PositionsAreNotWrapped) {
  const PoseManifold manifold;
  const double x[3] = {-10.0, 20.0, -3.0};
  const double y[3] = {10.0, -20.0, 3.0};
  double difference[3];
  ASSERT_TRUE(manifold.Minus(y, x, difference));
  EXPECT_EQ(difference[0], 20.0);
  EXPECT_EQ(difference[1], -40.0);
  EXPECT_NEAR(difference[2], -0.28318530717958623, 1e-15);
}

TEST(LineManifoldTest, Invariants) { ExpectInvariants<LineManifold>(1, 23); }

TEST(LineManifoldTest, InvariantsAtTheCut) {
  ExpectInvariantsAtTheCut<LineManifold>(1);
}

TEST(LineManifoldTest, DistanceIsNotWrapped) {
  const LineManifold manifold;
  const double x[2] = {-10.0, 3.0};
  const double delta[2] = {30.0, 0.5};
  double sum[2];
  ASSERT_TRUE(manifold.Plus(x, delta, sum));
  EXPECT_EQ(sum[0], 20.0);
  EXPECT_NEAR(sum[1], -2.7831853071795862, 1e-15);  // 3.5 - 2 pi
}

}  // namespace
}  // namespace plumbline
