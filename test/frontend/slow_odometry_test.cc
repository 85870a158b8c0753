#include <gtest/gtest.h>
#include <plumbline/factors/angle.h>
#include <plumbline/frontend/slow_odometry.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

namespace plumbline {
namespace {

constexpr int kScans = 400;
constexpr double kInterval = 0.1;

// A robot that drives on a circle at 0.5 m/s, stands from the 200th scan to the
// 260th, and goes on.
Pose2 TruthAt(int scan) {
  const double way = 0.5 * kInterval * (scan - std::clamp(scan - 200, 0, 60));
  const double angle = way / 5.0;
  return Pose2(5.0 * std::sin(angle), 5.0 - 5.0 * std::cos(angle),
               NormalizeAngle(angle));
}

// What it logs when odometry comes with every so many scans.
std::vector<Scan> Drive(int scans_per_reading) {
  std::vector<Scan> scans(kScans);
  for (int i = 0; i < kScans; ++i) {
    scans[i].timestamp = 1000.0 + kInterval * i;
    scans[i].odometry = TruthAt(i - i % scans_per_reading);
  }
  return scans;
}

double WorstPosition(const std::vector<Scan>& scans) {
  double worst = 0.0;
  for (std::size_t i = 0; i < scans.size(); ++i) {
    worst = std::max(
        worst,
        (scans[i].odometry - TruthAt(static_cast<int>(i))).head<2>().norm());
  }
  return worst;
}

TEST(SlowOdometryTest, ScansBetweenTwoReadingsAreOnTheWay) {
  for (const int scans_per_reading : {2, 5, 10}) {
    std::vector<Scan> scans = Drive(scans_per_reading);
    EXPECT_GT(WorstPosition(scans), 0.04 * (scans_per_reading - 1));
    EXPECT_EQ(SpreadSlowOdometry(&scans), scans_per_reading);
    // After the last reading nothing is known.
    scans.resize(kScans - scans_per_reading);
    EXPECT_LT(WorstPosition(scans), 0.008);
  }
}

TEST(SlowOdometryTest, HeadingsGoTheShortWayRound) {
  std::vector<Scan> scans = Drive(5);
  const Pose2 turned(1.0, 2.0, kPi - 0.5);
  for (Scan& scan : scans) scan.odometry = Compose(turned, scan.odometry);
  EXPECT_EQ(SpreadSlowOdometry(&scans), 5);
  scans.resize(kScans - 5);
  for (std::size_t i = 0; i < scans.size(); ++i) {
    const Pose2 truth = Compose(turned, TruthAt(static_cast<int>(i)));
    EXPECT_LT(std::abs(NormalizeAngle(scans[i].odometry[2] - truth[2])), 1e-3);
  }
}

// Here one scan in ten came twice; odometry of a robot that stands is the same
// for long.
TEST(SlowOdometryTest, ReadingsOfOneScanStay) {
  std::vector<Scan> scans = Drive(1);
  for (int i = 10; i < kScans; i += 10) {
    scans[i].odometry = scans[i - 1].odometry;
  }
  const std::vector<Scan> before = scans;
  EXPECT_EQ(SpreadSlowOdometry(&scans), 1);
  for (int i = 0; i < kScans; ++i) {
    EXPECT_EQ(scans[i].odometry, before[i].odometry);
  }
  scans.clear();
  EXPECT_EQ(SpreadSlowOdometry(&scans), 1);
  // A few readings say nothing.
  scans = Drive(5);
  scans.resize(80);
  EXPECT_EQ(SpreadSlowOdometry(&scans), 1);
}

// Neither a leap of odometry nor time stamps that jump are spread.
TEST(SlowOdometryTest, LeapsStay) {
  std::vector<Scan> scans = Drive(5);
  for (int i = 100; i < kScans; ++i) scans[i].odometry.x() += 30.0;
  scans[52].timestamp = 0.0;
  const std::vector<Scan> before = scans;
  EXPECT_EQ(SpreadSlowOdometry(&scans), 5);
  for (int i = 96; i < 100; ++i) {
    EXPECT_EQ(scans[i].odometry, before[i].odometry);
  }
  EXPECT_EQ(scans[52].odometry, before[52].odometry);
}

TEST(SlowOdometryTest, IsSaid) {
  Log log;
  log.scans = Drive(1);
  SpreadSlowOdometry(&log);
  EXPECT_TRUE(log.notes.empty());
  log.scans = Drive(4);
  SpreadSlowOdometry(&log);
  ASSERT_EQ(log.notes.size(), 1u);
  EXPECT_NE(log.notes[0].find("one reading for 4 scans"), std::string::npos);
}

}  // namespace
}  // namespace plumbline
