#include <gtest/gtest.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/odometry_scale.h>

#include <Eigen/Core>
#include <cmath>

namespace plumbline {
namespace {

// Odometry's, and that of returns which show the way, in m^2 and rad^2.
const Eigen::Matrix3d kWheels =
    Eigen::Vector3d(0.0016, 0.0016, 0.001).asDiagonal();
const Eigen::Matrix3d kClear = Eigen::Vector3d(1e4, 1e4, 1e5).asDiagonal();

// `count` motions by 0.3 m in direction `angle`, matched as `ratio` times that.
void Drive(int count, double ratio, double angle,
           const Eigen::Matrix3d& information, OdometryScale* scale) {
  const Pose2 motion(0.3 * std::cos(angle), 0.3 * std::sin(angle), 0.01);
  const Pose2 matched(ratio * motion[0], ratio * motion[1], 0.02);
  for (int i = 0; i < count; ++i) {
    scale->Compare(motion, kWheels, matched, information);
  }
}

TEST(OdometryScaleTest, IsOneAtFirst) {
  const OdometryScale scale;
  EXPECT_EQ(scale.scale(), 1.0);
  EXPECT_EQ(scale.Scaled(Pose2(1.0, -2.0, 0.5)), Pose2(1.0, -2.0, 0.5));
}

TEST(OdometryScaleTest, IsLearntInAnyDirection) {
  for (const double angle : {0.0, 0.7, kPi, -2.0}) {
    OdometryScale scale;
    Drive(100, 0.95, angle, kClear, &scale);
    EXPECT_NEAR(scale.scale(), 0.95, 0.002) << angle;
    const Pose2 scaled = scale.Scaled(Pose2(1.0, -2.0, 0.5));
    EXPECT_NEAR(scaled[0], 0.95, 0.002);
    EXPECT_NEAR(scaled[1], -1.9, 0.004);
    EXPECT_EQ(scaled[2], 0.5);
  }
}

TEST(OdometryScaleTest, FewMotionsSayLittle) {
  OdometryScale scale;
  Drive(4, 0.9, 0.0, kClear, &scale);
  EXPECT_LT(scale.scale(), 1.0);
  EXPECT_GT(scale.scale(), 0.94);
}

TEST(OdometryScaleTest, ACorridorSaysNothing) {
  // The returns show what is across only: the ratio repeats odometry.
  for (const double angle : {0.0, 0.7}) {
    const Eigen::Vector3d across(-std::sin(angle), std::cos(angle), 0.0);
    Eigen::Matrix3d information = 1e4 * across * across.transpose();
    information(2, 2) = 1e5;
    OdometryScale scale;
    Drive(100, 0.95, angle, information, &scale);
    EXPECT_EQ(scale.scale(), 1.0);
  }
}

TEST(OdometryScaleTest, BothEndsMustBeClear) {
  // The robot slipped in a corridor: the first clear scan shows it at once.
  OdometryScale scale;
  for (int i = 0; i < 50; ++i) {
    Drive(1, 1.0, 0.0, Eigen::Matrix3d::Zero(), &scale);
    Drive(1, 0.9, 0.0, kClear, &scale);
  }
  EXPECT_EQ(scale.scale(), 1.0);
  for (int i = 0; i < 50; ++i) {
    scale.Break();
    Drive(1, 0.9, 0.0, kClear, &scale);
  }
  EXPECT_EQ(scale.scale(), 1.0);
}

TEST(OdometryScaleTest, SlipsAndNoiseDoNotCount) {
  OdometryScale scale;
  for (int i = 0; i < 50; ++i) {
    Drive(2, 1.0, 0.0, kClear, &scale);
    Drive(1, -1.0, 0.0, kClear, &scale);
    Drive(1, 0.2, 0.0, kClear, &scale);
    const Pose2 small(0.02, 0.0, 0.3);
    scale.Compare(small, kWheels, Pose2(0.018, 0.0, 0.3), kClear);
  }
  EXPECT_EQ(scale.scale(), 1.0);
}

TEST(OdometryScaleTest, AnotherFloorIsFollowed) {
  OdometryScale scale;
  Drive(1000, 0.97, 0.0, kClear, &scale);
  Drive(1000, 1.02, 0.0, kClear, &scale);
  EXPECT_NEAR(scale.scale(), 1.02, 0.005);
}

}  // namespace
}  // namespace plumbline
