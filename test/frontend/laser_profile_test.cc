#include <gtest/gtest.h>
#include <plumbline/frontend/laser_profile.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace plumbline {
namespace {

TEST(LaserProfileTest, FansOfWellKnownNumbersOfBeams) {
  for (const int beams : {180, 181, 360, 361}) {
    // The resolution of a log does not count.
    const BeamFan fan = FanOfBeams(beams, 0.1);
    EXPECT_DOUBLE_EQ(fan.start_angle, -0.5 * kPi) << beams;
    EXPECT_DOUBLE_EQ(RadToDeg(fan.angle_step), beams < 200 ? 1.0 : 0.5);
  }
}

TEST(LaserProfileTest, OtherFansAreSpacedByTheResolution) {
  const BeamFan fan = FanOfBeams(271, DegToRad(1.0));
  EXPECT_NEAR(RadToDeg(fan.start_angle), -135.0, 1e-9);
  EXPECT_NEAR(RadToDeg(fan.angle_step), 1.0, 1e-9);
  const BeamFan unknown = FanOfBeams(91, 0.0);
  EXPECT_NEAR(RadToDeg(unknown.start_angle), -90.0, 1e-9);
  EXPECT_NEAR(RadToDeg(unknown.angle_step), 2.0, 1e-9);
  EXPECT_EQ(FanOfBeams(1, 0.0).angle_step, 0.0);
}

// Scans of 100 beams with `share` of the beams at `pile`, m, the others at 2 to
// 4 m.
std::vector<Scan> ScansWithPile(double pile, int share) {
  std::vector<Scan> scans(20);
  for (Scan& scan : scans) {
    for (int i = 0; i < 100; ++i) {
      scan.ranges.push_back(
          static_cast<float>(i < share ? pile : 2.0 + 0.02 * i));
    }
  }
  return scans;
}

TEST(LaserProfileTest, ReadingsThatPileUpAreSaturated) {
  const double range = SaturatedRange(ScansWithPile(51.0, 30), 80.0);
  EXPECT_LT(range, 51.0);
  EXPECT_GT(range, 50.98);
}

TEST(LaserProfileTest, FewOrNearReadingsAreNot) {
  EXPECT_EQ(SaturatedRange(ScansWithPile(51.0, 0), 80.0), 0.0);
  EXPECT_EQ(SaturatedRange(ScansWithPile(7.0, 30), 80.0), 0.0);
  // They are at the limit already.
  EXPECT_EQ(SaturatedRange(ScansWithPile(51.0, 30), 50.0), 0.0);
}

// The same, seen by a laser that turns by `turn` beams from scan to scan.
std::vector<Scan> TurningScansWithPile(double pile, int share, int turn) {
  std::vector<Scan> scans = ScansWithPile(pile, share);
  std::ptrdiff_t turned = 0;
  for (Scan& scan : scans) {
    std::rotate(scan.ranges.begin(), scan.ranges.begin() + turned % 100,
                scan.ranges.end());
    turned += turn;
  }
  return scans;
}

TEST(LaserProfileTest, TheLargestReadingIsNoneWhereItRepeats) {
  EXPECT_NEAR(RepeatedRange(TurningScansWithPile(4.3, 30, 7)), 4.3, 1e-6);
  EXPECT_NEAR(RepeatedRange(TurningScansWithPile(5.6, 12, 1)), 5.6, 1e-6);
  // Of few beams, of nearly all, or of the same ones it may be a wall.
  EXPECT_EQ(RepeatedRange(TurningScansWithPile(5.6, 0, 7)), 0.0);
  EXPECT_EQ(RepeatedRange(TurningScansWithPile(5.6, 95, 7)), 0.0);
  EXPECT_EQ(RepeatedRange(ScansWithPile(5.6, 30)), 0.0);
  EXPECT_EQ(RepeatedRange({}), 0.0);
}

TEST(LaserProfileTest, TheLargestReadingsOfAWallDoNotRepeat) {
  // Rounded to a centimetre, before a wall across that fills all of the view.
  std::vector<Scan> scans = ScansWithPile(0.0, 0);
  int k = 0;
  for (Scan& scan : scans) {
    for (float& range : scan.ranges) {
      range = 4.0f + 0.01f * static_cast<float>(std::min(k % 3, k % 4));
      k += 7;
    }
  }
  EXPECT_EQ(RepeatedRange(scans), 0.0);
}

TEST(LaserProfileTest, TheMountIsTheMedian) {
  const Pose2 mount(0.25, 0.0, 0.0);
  std::vector<Scan> scans(21);
  std::vector<Pose2> lasers;
  for (std::size_t i = 0; i < scans.size(); ++i) {
    scans[i].odometry = Pose2(0.3 * static_cast<double>(i), 1.0, 3.1);
    lasers.push_back(Compose(scans[i].odometry, mount));
  }
  lasers[7] = Pose2(50.0, 50.0, 0.0);
  const LaserMount found = FindLaserMount(scans, lasers);
  EXPECT_TRUE(found.is_fixed);
  EXPECT_TRUE(found.is_on_robot);
  EXPECT_EQ(found.pose, mount);
  EXPECT_EQ(found.apart, std::vector<int>({7}));
}

TEST(LaserProfileTest, AMountThatMovesIsNotFixed) {
  std::vector<Scan> scans(20);
  std::vector<Pose2> lasers;
  for (std::size_t i = 0; i < scans.size(); ++i) {
    scans[i].odometry = Pose2::Zero();
    lasers.push_back(Pose2(static_cast<double>(i), 0.0, 0.0));
  }
  EXPECT_FALSE(FindLaserMount(scans, lasers).is_fixed);
}

TEST(LaserProfileTest, AMountMayBeFixedAndFarAway) {
  const std::vector<Scan> scans(20);
  const std::vector<Pose2> lasers(20, Pose2(-1000.0, 0.0, 0.0));
  const LaserMount found = FindLaserMount(scans, lasers);
  EXPECT_TRUE(found.is_fixed);
  EXPECT_FALSE(found.is_on_robot);
  EXPECT_TRUE(found.apart.empty());
}

TEST(LaserProfileTest, DenseScansAreThinned) {
  Scan scan;
  scan.angle_step = 0.01;
  for (int i = 0; i < 10; ++i) scan.ranges.push_back(static_cast<float>(i));
  EXPECT_EQ(ThinScan(10, &scan), 1);
  EXPECT_EQ(scan.ranges.size(), 10u);
  EXPECT_EQ(ThinScan(4, &scan), 3);
  EXPECT_EQ(scan.ranges, std::vector<float>({0.0f, 3.0f, 6.0f, 9.0f}));
  EXPECT_DOUBLE_EQ(scan.angle_step, 0.03);
}

}  // namespace
}  // namespace plumbline
