#include <gtest/gtest.h>
#include <plumbline/core/error.h>
#include <plumbline/factors/angle.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/odometry_check.h>

#include <cstddef>
#include <vector>

namespace plumbline {
namespace {

// Squares of 10 m, in steps of 0.1 m and turns of 0.1 rad.
std::vector<Pose2> Squares(int sides) {
  std::vector<Pose2> poses = {Pose2(2.0, 1.0, 0.5)};
  for (int side = 0; side < sides; ++side) {
    for (int i = 0; i < 100; ++i) {
      poses.push_back(Compose(poses.back(), Pose2(0.1, 0.0, 0.0)));
    }
    for (int i = 0; i < 16; ++i) {
      poses.push_back(Compose(poses.back(), Pose2(0.0, 0.0, 0.5 * kPi / 16.0)));
    }
  }
  return poses;
}

// Scans whose odometry is the motions of `poses`, those from `begin` to `end`
// times `factors`, to begin elsewhere.
std::vector<Scan> ScansWithOdometry(const std::vector<Pose2>& poses,
                                    const Pose2& factors, std::size_t begin = 0,
                                    std::size_t end = 1000000) {
  std::vector<Scan> scans(poses.size());
  for (std::size_t i = 1; i < poses.size(); ++i) {
    Pose2 motion = Between(poses[i - 1], poses[i]);
    if (i >= begin && i < end) motion = motion.cwiseProduct(factors);
    scans[i].odometry = Compose(scans[i - 1].odometry, motion);
  }
  return scans;
}

OdometryAgreement Compare(const std::vector<Scan>& scans,
                          const std::vector<Pose2>& poses) {
  return CompareWithOdometry(scans, poses, OdometryCheckOptions());
}

TEST(OdometryCheckTest, OdometryThatIsRightIsNotDisputed) {
  const std::vector<Pose2> poses = Squares(6);
  const OdometryAgreement agreement =
      Compare(ScansWithOdometry(poses, Pose2(1.05, 1.0, 0.9)), poses);
  EXPECT_TRUE(agreement.disputed.empty());
  EXPECT_NEAR(agreement.scale, 1.0 / 1.05, 1e-6);
  EXPECT_FALSE(agreement.is_scale_disputed);
  EXPECT_FALSE(agreement.turns_are_opposite);
}

TEST(OdometryCheckTest, AStretchOfWhichTheMapHasLessIsTold) {
  const std::vector<Pose2> poses = Squares(6);
  // Along the second side: 8 m of the map are 16 m of odometry.
  const OdometryAgreement agreement =
      Compare(ScansWithOdometry(poses, Pose2(2.0, 1.0, 1.0), 120, 200), poses);
  ASSERT_EQ(agreement.disputed.size(), 1u);
  const DisputedWay& way = agreement.disputed[0];
  EXPECT_NEAR(way.begin, 120, 6);
  EXPECT_NEAR(way.end, 200, 6);
  EXPECT_NEAR(way.by_odometry - way.by_map, 8.0, 0.6);
  EXPECT_FALSE(agreement.is_scale_disputed);
}

TEST(OdometryCheckTest, WheelsThatSlipForTwoMetresAreNot) {
  const std::vector<Pose2> poses = Squares(6);
  EXPECT_TRUE(
      Compare(ScansWithOdometry(poses, Pose2(2.0, 1.0, 1.0), 120, 135), poses)
          .disputed.empty());
}

TEST(OdometryCheckTest, AMetreThatIsFarFromTheMapsIsTold) {
  const std::vector<Pose2> poses = Squares(6);
  const OdometryAgreement agreement =
      Compare(ScansWithOdometry(poses, Pose2(0.7, 1.0, 1.0)), poses);
  EXPECT_NEAR(agreement.scale, 1.0 / 0.7, 1e-6);
  EXPECT_TRUE(agreement.is_scale_disputed);
  EXPECT_TRUE(agreement.disputed.empty());
  // A map that stands still.
  const std::vector<Pose2> still(poses.size(), Pose2::Zero());
  const OdometryAgreement other =
      Compare(ScansWithOdometry(poses, Pose2(1.0, 1.0, 1.0)), still);
  EXPECT_TRUE(other.is_scale_disputed);
  ASSERT_EQ(other.disputed.size(), 1u);
  EXPECT_NEAR(other.disputed[0].by_odometry, 60.0, 1.0);
}

TEST(OdometryCheckTest, TurnsTheOtherWayAreTold) {
  const std::vector<Pose2> poses = Squares(6);
  const OdometryAgreement agreement =
      Compare(ScansWithOdometry(poses, Pose2(1.0, 1.0, -0.95)), poses);
  EXPECT_TRUE(agreement.turns_are_opposite);
  EXPECT_FALSE(agreement.is_scale_disputed);
}

// A laser that looks to the left while the log says that it looks ahead.
TEST(OdometryCheckTest, AWayToTheSideIsTold) {
  const std::vector<Pose2> poses = Squares(6);
  std::vector<Pose2> map = poses;
  for (Pose2& pose : map) pose[2] = NormalizeAngle(pose[2] + 0.5 * kPi);
  const std::vector<Scan> scans =
      ScansWithOdometry(poses, Pose2(1.0, 1.0, 1.0));
  const OdometryAgreement agreement = Compare(scans, map);
  EXPECT_NEAR(agreement.course, -0.5 * kPi, 0.01);
  EXPECT_TRUE(agreement.is_course_disputed);
  EXPECT_FALSE(agreement.turns_are_opposite);
  EXPECT_NEAR(Compare(scans, poses).course, 0.0, 1e-9);
  EXPECT_FALSE(Compare(scans, poses).is_course_disputed);
}

// By as little as a bracket may be bent, and not where the robot is carried
// once while odometry has it going on.
TEST(OdometryCheckTest, AWayALittleToTheSideIsTold) {
  const std::vector<Pose2> poses = Squares(6);
  const std::vector<Scan> scans =
      ScansWithOdometry(poses, Pose2(1.0, 1.0, 1.0));
  for (const double askew : {0.17, -0.17}) {
    std::vector<Pose2> map = poses;
    for (Pose2& pose : map) pose[2] = NormalizeAngle(pose[2] + askew);
    const OdometryAgreement agreement = Compare(scans, map);
    EXPECT_NEAR(agreement.course, -askew, 0.01);
    EXPECT_TRUE(agreement.is_course_disputed);
  }
  std::vector<Pose2> map = poses;
  for (std::size_t i = map.size() / 2; i < map.size(); ++i) {
    map[i].head<2>() += Eigen::Vector2d(30.0, 100.0);
  }
  EXPECT_FALSE(Compare(scans, map).is_course_disputed);
}

TEST(OdometryCheckTest, JumpsOfOdometrySayNothing) {
  const std::vector<Pose2> poses = Squares(6);
  std::vector<Scan> scans = ScansWithOdometry(poses, Pose2(1.0, 1.0, 1.0));
  for (std::size_t i = 150; i < scans.size(); ++i) {
    scans[i].odometry[0] += 30.0;
  }
  EXPECT_TRUE(Compare(scans, poses).disputed.empty());
}

TEST(OdometryCheckTest, OfAStandingRobotNothingIsTold) {
  const std::vector<Pose2> poses(50, Pose2(1.0, 2.0, 0.3));
  const OdometryAgreement agreement =
      Compare(ScansWithOdometry(poses, Pose2(1.0, 1.0, 1.0)), poses);
  EXPECT_EQ(agreement.scale, 1.0);
  EXPECT_FALSE(agreement.is_scale_disputed);
  EXPECT_FALSE(agreement.turns_are_opposite);
  EXPECT_TRUE(agreement.disputed.empty());
  EXPECT_TRUE(Compare({}, {}).disputed.empty());
}

TEST(OdometryCheckTest, RefusesOtherNumbers) {
  EXPECT_THROW(Compare(std::vector<Scan>(3), std::vector<Pose2>(2)), Error);
}

}  // namespace
}  // namespace plumbline
