#include <gtest/gtest.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/range_offset.h>
#include <plumbline/frontend/scan.h>

#include <cmath>
#include <cstddef>
#include <vector>

#include "synthetic_world.h"

namespace plumbline {
namespace {

using testing::Noise;
using testing::WallEnds;

// A corridor of 2.2 m about x = 0 with recesses of 0.3 m every 4 m on either
// side.
std::vector<WallEnds> CorridorWithRecesses() {
  std::vector<WallEnds> walls;
  for (const double side : {-0.9, 1.3}) {
    const double back = side + (side > 0.0 ? 0.3 : -0.3);
    for (int i = -4; i <= 4; ++i) {
      const double x = 4.0 * i;
      walls.push_back({{x, side}, {x + 3.0, side}});
      walls.push_back({{x + 3.0, side}, {x + 3.0, back}});
      walls.push_back({{x + 3.0, back}, {x + 4.0, back}});
      walls.push_back({{x + 4.0, back}, {x + 4.0, side}});
    }
  }
  return walls;
}

// The robot drives nearer to the right wall, and back: what a laser of one
// degree that is mounted 0.2 m ahead sees every 0.2 m, with odometry that turns
// a degree a metre.
std::vector<Scan> MakeDrive() {
  constexpr int kCount = 400;
  const std::vector<WallEnds> walls = CorridorWithRecesses();
  testing::Laser laser;
  laser.offset = Pose2(0.2, 0.0, 0.0);
  laser.sigma = 0.01;
  Noise random(7);
  std::vector<Scan> scans;
  Pose2 pose = Pose2::Zero();
  Pose2 odometry(3.0, -1.0, 0.7);
  for (int i = 0; i < kCount; ++i) {
    // It looks the same every 4 m.
    const Pose2 seen(std::fmod(pose[0], 4.0), pose[1], pose[2]);
    scans.push_back(testing::MakeScan(walls, seen, laser, &random));
    scans.back().odometry = odometry;
    const bool turns = i == kCount / 2;
    const Pose2 step(turns ? 0.0 : 0.2, 0.0, turns ? kPi : 0.0);
    pose = Compose(pose, step);
    odometry = Compose(odometry, step + Pose2(0.0, 0.0, DegToRad(0.2)));
  }
  return scans;
}

// The first `count` of them, their ranges too long by `offset`.
std::vector<Scan> ScansOfDrive(double offset, std::size_t count = 400) {
  static const std::vector<Scan>* const kDrive =
      new std::vector<Scan>(MakeDrive());
  std::vector<Scan> scans(kDrive->begin(),
                          kDrive->begin() + static_cast<std::ptrdiff_t>(count));
  for (Scan& scan : scans) {
    for (float& range : scan.ranges) {
      if (range > 0.0f) range += static_cast<float>(offset);
    }
  }
  return scans;
}

TEST(RangeOffsetTest, OfALaserThatIsRightIsZero) {
  const RangeOffset found = FindRangeOffset(ScansOfDrive(0.0));
  EXPECT_GT(found.pairs, 60);
  EXPECT_EQ(found.offset, 0.0);
  EXPECT_NEAR(found.first, 0.0, 0.003);
}

TEST(RangeOffsetTest, IsFoundOnEitherSideOfZero) {
  for (const double offset : {-0.08, -0.03, 0.03, 0.08}) {
    EXPECT_NEAR(FindRangeOffset(ScansOfDrive(offset)).offset, offset, 0.004)
        << offset;
  }
}

TEST(RangeOffsetTest, IsTheMeanOfWhatRoundingTakesAway) {
  // A laser that gives whole steps of 5 cm below the range.
  std::vector<Scan> scans = ScansOfDrive(0.0);
  for (Scan& scan : scans) {
    for (float& range : scan.ranges) {
      range = 0.05f * std::floor(range / 0.05f);
    }
  }
  EXPECT_NEAR(FindRangeOffset(scans).offset, -0.025, 0.006);
}

TEST(RangeOffsetTest, BelowTheLeastIsLeftAlone) {
  const RangeOffset found = FindRangeOffset(ScansOfDrive(0.008));
  EXPECT_EQ(found.offset, 0.0);
  EXPECT_NEAR(found.first, 0.008, 0.004);
}

TEST(RangeOffsetTest, FewPairsAndNoOdometrySayNothing) {
  EXPECT_EQ(FindRangeOffset({}).pairs, 0);
  EXPECT_EQ(FindRangeOffset(ScansOfDrive(0.05, 100)).offset, 0.0);
  std::vector<Scan> scans = ScansOfDrive(0.05);
  for (Scan& scan : scans) scan.odometry = Pose2::Zero();
  EXPECT_EQ(FindRangeOffset(scans).pairs, 0);
}

TEST(RangeOffsetTest, ScansWithoutReturnsArePassedOver) {
  std::vector<Scan> scans = ScansOfDrive(0.05);
  for (std::size_t i = 0; i < scans.size(); i += 9) scans[i].ranges.clear();
  for (std::size_t i = 3; i < scans.size(); i += 9) {
    scans[i].ranges.assign(scans[i].ranges.size(), 0.0f);
  }
  EXPECT_NEAR(FindRangeOffset(scans).offset, 0.05, 0.006);
}

// What a camera that sees 87 degrees and 4 m sees of a hall in which it winds
// its way around racks, there and back.
TEST(RangeOffsetTest, WhatDoesNotSettleIsNone) {
  std::vector<WallEnds> walls =
      testing::Moved(testing::Room(40.0, 4.0), Pose2(20.0, 0.0, 0.0));
  for (int i = 0; i < 12; ++i) {
    const std::vector<WallEnds> rack =
        testing::Moved(testing::Room(0.3, 1.8),
                       Pose2(4.0 + 3.0 * i, i % 2 == 0 ? -1.0 : 1.0, 0.0));
    walls.insert(walls.end(), rack.begin(), rack.end());
  }
  testing::Laser laser;
  laser.start_angle = DegToRad(-43.5);
  laser.angle_step = DegToRad(0.5);
  laser.beams = 175;
  laser.maximum_range = 4.0;
  laser.sigma = 0.015;
  Noise random(3);
  std::vector<Scan> scans;
  for (int i = 0; i < 740; ++i) {
    const bool is_back = i >= 370;
    const double x = 1.5 + 0.1 * (is_back ? 739 - i : i);
    const double phase = kPi * (x - 4.0) / 3.0;
    const double slope = -kPi / 3.0 * std::sin(phase);
    scans.push_back(testing::MakeScan(
        walls,
        Pose2(x, std::cos(phase), std::atan(slope) + (is_back ? kPi : 0.0)),
        laser, &random));
  }
  const RangeOffset found = FindRangeOffset(scans);
  EXPECT_GT(found.pairs, 40);
  EXPECT_GT(std::abs(found.first), 0.02);
  EXPECT_EQ(found.offset, 0.0);
}

TEST(RangeOffsetTest, TakenOutOfReturnsOnly) {
  Scan scan;
  scan.ranges = {1.0f, 0.0f, 0.02f, 7.5f};
  TakeOutRangeOffset(0.05, &scan);
  EXPECT_EQ(scan.ranges, (std::vector<float>{0.95f, 0.0f, 0.0f, 7.45f}));
  TakeOutRangeOffset(-0.05, &scan);
  EXPECT_FLOAT_EQ(scan.ranges[0], 1.0f);
  EXPECT_EQ(scan.ranges[1], 0.0f);
  EXPECT_EQ(scan.ranges[2], 0.0f);
}

}  // namespace
}  // namespace plumbline
