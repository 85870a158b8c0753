#include <gtest/gtest.h>
#include <plumbline/frontend/scan_odometry.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "frontend/synthetic_world.h"

namespace plumbline {
namespace {

using testing::CastRay;
using testing::Noise;
using testing::PositionError;
using testing::WallEnds;

constexpr double kPeriod = 0.2;
constexpr int kBeams = 360;
constexpr double kStart = 100.0;

// A robot that swings to and fro on its way through a room.
Pose2 PoseAt(double time) {
  return {-1.5 + 0.15 * time, 0.3 * std::sin(0.5 * time),
          1.2 * std::sin(0.8 * time)};
}

std::vector<WallEnds> Room() {
  return {{{-4.0, -3.0}, {4.0, -3.0}}, {{4.0, -3.0}, {4.0, 2.5}},
          {{4.0, 2.5}, {1.0, 2.5}},    {{1.0, 2.5}, {1.0, 3.5}},
          {{1.0, 3.5}, {-4.0, 3.5}},   {{-4.0, 3.5}, {-4.0, -3.0}}};
}

// What a laser sees that takes `sweep` s for its beams, in their order (1) or
// against it (-1), from the time stamp on.
Log Drive(double sweep, int direction, bool has_odometry) {
  const std::vector<WallEnds> world = Room();
  Noise noise(3);
  Log log;
  for (int i = 0; i < 120; ++i) {
    Scan scan;
    scan.timestamp = kStart + i * kPeriod;
    scan.laser_offset = Pose2(0.1, 0.0, 0.0);
    scan.angle_step = 2.0 * kPi / kBeams;
    scan.maximum_range = 12.0;
    for (int k = 0; k < kBeams; ++k) {
      const int turn = direction > 0 ? k : kBeams - 1 - k;
      const Pose2 laser = Compose(PoseAt(i * kPeriod + sweep * turn / kBeams),
                                  scan.laser_offset);
      scan.ranges.push_back(static_cast<float>(
          CastRay(world, laser.head<2>(), laser[2] + k * scan.angle_step) +
          noise.Normal(0.01)));
    }
    if (has_odometry) scan.odometry = PoseAt(i * kPeriod);
    log.scans.push_back(std::move(scan));
  }
  log.has_odometry = has_odometry;
  return log;
}

// By how much ranges are not what the room gives where the robot was at the
// time stamp, m: the ninth decile, since corners count for more.
double RangeError(const Log& log) {
  const std::vector<WallEnds> world = Room();
  std::vector<double> errors;
  for (std::size_t i = 1; i + 1 < log.scans.size(); ++i) {
    const Scan& scan = log.scans[i];
    const Pose2 laser =
        Compose(PoseAt(static_cast<double>(i) * kPeriod), scan.laser_offset);
    for (std::size_t k = 0; k < scan.ranges.size(); ++k) {
      errors.push_back(
          std::abs(scan.ranges[k] - CastRay(world, laser.head<2>(),
                                            laser[2] + scan.Bearing(k))));
    }
  }
  std::sort(errors.begin(), errors.end());
  return errors[errors.size() * 9 / 10];
}

TEST(ScanOdometryTest, SweepsAreUndoneByOdometryWhereScansFitBetterSo) {
  const Log still = Drive(0.0, 1, true);
  for (const int direction : {1, -1}) {
    Log log = Drive(kPeriod, direction, true);
    EXPECT_GT(RangeError(log), 0.15);
    EXPECT_EQ(UndoSweepsByOdometry({}, &log), direction);
    EXPECT_LT(RangeError(log), 0.05);
    for (std::size_t i = 0; i < log.scans.size(); ++i) {
      EXPECT_EQ(log.scans[i].odometry, still.scans[i].odometry);
    }
    // What is undone is left as it is.
    EXPECT_EQ(UndoSweepsByOdometry({}, &log), 0);
  }
}

TEST(ScanOdometryTest, ScansTakenAtOnceAreLeftAsTheyAre) {
  Log log = Drive(0.0, 1, true);
  const Log before = log;
  EXPECT_EQ(UndoSweepsByOdometry({}, &log), 0);
  for (std::size_t i = 0; i < log.scans.size(); ++i) {
    EXPECT_EQ(log.scans[i].ranges, before.scans[i].ranges);
    EXPECT_TRUE(log.scans[i].bearings.empty());
  }
}

// The robot may be lost where scans are missing, in one run and not in another:
// that says nothing of the laser.
TEST(ScanOdometryTest, ScansTakenAtOnceOfWhichSomeAreMissingAreLeft) {
  for (int first = 10; first < 80; first += 5) {
    for (const int missing : {10, 20}) {
      Log log = Drive(0.0, 1, true);
      log.scans.erase(log.scans.begin() + first,
                      log.scans.begin() + first + missing);
      EXPECT_EQ(UndoSweepsByOdometry({}, &log), 0)
          << missing << " scans from " << first << " on";
    }
  }
}

TEST(ScanOdometryTest, ANarrowViewIsNoSweep) {
  Log log = Drive(kPeriod, 1, true);
  for (Scan& scan : log.scans) scan.ranges.resize(180);
  EXPECT_EQ(UndoSweepsByOdometry({}, &log), 0);
}

// A log may say anything about times; the robot stays somewhere.
// A drive along a corridor whose ends are out of sight for the most part, and
// one through a room.
TEST(ScanOdometryTest, AWayThatScansLeaveOpenIsMeasured) {
  Log room = Drive(0.0, 1, false);
  const ScanOdometryReport seen = AddScanOdometry({}, &room);
  EXPECT_GT(seen.way, 1.0);
  EXPECT_LT(seen.open_way, 0.01 * seen.way);

  const std::vector<WallEnds> walls = {{{-15.0, -1.0}, {15.0, -1.0}},
                                       {{15.0, -1.0}, {15.0, 1.0}},
                                       {{15.0, 1.0}, {-15.0, 1.0}},
                                       {{-15.0, 1.0}, {-15.0, -1.0}}};
  Noise noise(4);
  Log corridor;
  for (int i = 0; i < 150; ++i) {
    Scan scan;
    scan.timestamp = kStart + i * kPeriod;
    scan.angle_step = 2.0 * kPi / kBeams;
    scan.maximum_range = 6.0;
    for (int k = 0; k < kBeams; ++k) {
      const double range =
          CastRay(walls, Eigen::Vector2d(-14.0 + 0.15 * i, 0.0),
                  k * scan.angle_step) +
          noise.Normal(0.01);
      scan.ranges.push_back(range < 6.0
                                ? static_cast<float>(range)
                                : std::numeric_limits<float>::infinity());
    }
    corridor.scans.push_back(std::move(scan));
  }
  const ScanOdometryReport open = AddScanOdometry({}, &corridor);
  EXPECT_GT(open.open_way, 0.5 * open.way);
}

// The robot turns while scans are missing.
TEST(ScanOdometryTest, AGyroscopeMeasuresATurnThatScansMiss) {
  const std::vector<WallEnds> world = Room();
  for (const double gap : {1.0, 1.5, 2.0}) {
    Noise noise(3);
    Log log;
    double time = kStart;
    double heading = 0.0;
    std::vector<Pose2> truths;
    for (int i = 0; i < 120; ++i) {
      const bool is_gap = i == 80;
      const double rate = is_gap ? DegToRad(60.0) : 0.6 * std::sin(0.3 * i);
      const double step = is_gap ? gap : 0.1;
      for (int k = 0; i > 0 && k < 10 * step / 0.1; ++k) {
        log.yaw_rates.push_back({time + 0.01 * k, rate});
      }
      if (i > 0) {
        time += step;
        heading += rate * step;
      }
      truths.push_back({-1.0 + 0.01 * i, 0.0, heading});
      Scan scan = testing::MakeScan(world, truths.back(), testing::FullCircle(),
                                    &noise);
      scan.timestamp = time;
      scan.odometry = Pose2::Zero();
      log.scans.push_back(std::move(scan));
    }
    log.yaw_rates.push_back({time, 0.0});
    AddScanOdometry({}, &log);
    for (std::size_t i = 0; i < truths.size(); ++i) {
      const Pose2 moved = Between(truths.front(), truths[i]);
      const Pose2 found =
          Between(log.scans.front().odometry, log.scans[i].odometry);
      ASSERT_LT(testing::HeadingError(found, moved), DegToRad(3.0))
          << gap << " s, scan " << i;
    }
  }
}

TEST(ScanOdometryTest, TimesThatCannotBe) {
  const double times[] = {5.0, 6.0, 0.0, 5e-324, 1e308, -1e308, 1e-310};
  for (const bool has_gyroscope : {false, true}) {
    Log log = Drive(0.0, 1, false);
    log.scans.resize(40);
    for (std::size_t i = 0; i < log.scans.size(); ++i) {
      log.scans[i].timestamp = times[i % 7];
      if (has_gyroscope) log.yaw_rates.push_back({times[i % 7], 1.0});
    }
    AddScanOdometry({}, &log);
    for (const Scan& scan : log.scans) {
      EXPECT_TRUE(scan.odometry.allFinite());
      EXPECT_LT(scan.odometry.head<2>().norm(), 100.0);
    }
  }
}

// Poses are those of the time stamps, at which sweeps begin.
TEST(ScanOdometryTest, SweepsAreStampedWhenTheyBegin) {
  for (const int direction : {1, -1}) {
    Log log = Drive(kPeriod, direction, false);
    const ScanOdometryReport report = AddScanOdometry({}, &log);
    EXPECT_EQ(report.sweep, direction);
    EXPECT_EQ(report.unmatched, 0u);
    // The first scans, which nothing is known before, fix the frame.
    const Pose2 frame =
        Compose(PoseAt(2 * kPeriod), Inverse(log.scans[2].odometry));
    for (std::size_t i = 2; i + 1 < log.scans.size(); ++i) {
      const Pose2 pose = Compose(frame, log.scans[i].odometry);
      const Pose2 truth = PoseAt(static_cast<double>(i) * kPeriod);
      EXPECT_LT(PositionError(pose, truth), 0.06) << i;
      EXPECT_LT(std::abs(NormalizeAngle(pose[2] - truth[2])), DegToRad(2.0))
          << i;
    }
  }
}

}  // namespace
}  // namespace plumbline
