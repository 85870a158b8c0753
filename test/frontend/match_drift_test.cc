#include <gtest/gtest.h>
#include <plumbline/frontend/match_drift.h>

namespace plumbline {
namespace {

MatchDrift Drift() {
  MatchDrift drift;
  drift.translation_per_root_metre = 0.02;
  drift.rotation_per_root_metre = 0.01;
  drift.rotation_per_root_radian = 0.03;
  return drift;
}

TEST(MatchDriftTest, HandWorked) {
  const Eigen::Matrix3d covariance =
      DriftCovariance(Pose2(3.0, -4.0, -0.5), Drift());
  // 0.0004 x 5 m; 0.0001 x 5 m + 0.0009 x 0.5 rad.
  const Eigen::Matrix3d expected =
      Eigen::Vector3d(0.002, 0.002, 0.00095).asDiagonal();
  EXPECT_NEAR((covariance - expected).norm(), 0.0, 1e-15);
  EXPECT_EQ(DriftCovariance(Pose2::Zero(), Drift()), Eigen::Matrix3d::Zero());
}

TEST(MatchDriftTest, AddsUpAlongAWay) {
  // Two steps of a metre along x: the first one's heading moves the end aside.
  const UncertainPose2 way =
      DriftAlong({{2.0, 1.0, 0.0}, {3.0, 1.0, 0.0}, {4.0, 1.0, 0.0}}, Drift());
  EXPECT_NEAR((way.mean - Pose2(2.0, 0.0, 0.0)).norm(), 0.0, 1e-15);
  EXPECT_NEAR(way.covariance(0, 0), 0.0008, 1e-15);
  EXPECT_NEAR(way.covariance(1, 1), 0.0008 + 0.0001, 1e-15);
  EXPECT_NEAR(way.covariance(2, 2), 0.0002, 1e-15);
  EXPECT_NEAR(way.covariance(1, 2), 0.0001, 1e-15);
  EXPECT_EQ(DriftAlong({{2.0, 1.0, 0.3}}, Drift()).mean, Pose2::Zero());
}

}  // namespace
}  // namespace plumbline
