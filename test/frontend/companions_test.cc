#include <gtest/gtest.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/companions.h>

#include <cmath>
#include <cstddef>
#include <vector>

#include "synthetic_world.h"

namespace plumbline {
namespace {

using testing::WallEnds;

// A corridor of 2 m along x with a recess of 0.4 m every 5 m on either side.
std::vector<WallEnds> CorridorWithDoors() {
  std::vector<WallEnds> walls;
  for (const double side : {-1.0, 1.0}) {
    for (int i = -1; i <= 5; ++i) {
      const double x = 5.0 * i;
      walls.push_back({{x, side}, {x + 4.0, side}});
      walls.push_back({{x + 4.0, side}, {x + 4.0, 1.4 * side}});
      walls.push_back({{x + 4.0, 1.4 * side}, {x + 5.0, 1.4 * side}});
      walls.push_back({{x + 5.0, 1.4 * side}, {x + 5.0, side}});
    }
  }
  return walls;
}

// Free of everything, 1.5 m ahead of the robot at `pose`.
WallEnds CartAt(const Pose2& pose, double width) {
  return {TransformPoint(pose, {1.5, -0.5 * width}),
          TransformPoint(pose, {1.5, 0.5 * width})};
}

struct Drive {
  std::vector<WallEnds> walls = CorridorWithDoors();
  // Scans `begin` to `end` (not included) have a cart in front of the robot.
  int begin = 0;
  int end = 0;
  double width = 1.0;
  int scans = 200;
  // How far the robot goes in a step of 0.1 m by odometry, m.
  double step = 0.1;
};

std::vector<Scan> ScansOf(const Drive& drive) {
  testing::Noise noise(5);
  testing::Laser laser;
  laser.sigma = 0.01;
  std::vector<Scan> scans;
  for (int i = 0; i < drive.scans; ++i) {
    const Pose2 pose(drive.step * i, 0.0, 0.0);
    std::vector<WallEnds> walls = drive.walls;
    if (i >= drive.begin && i < drive.end) {
      walls.push_back(CartAt(pose, drive.width));
    }
    scans.push_back(testing::MakeScan(walls, pose, laser, &noise));
    scans.back().odometry = Pose2(0.1 * i, 0.0, 0.0);
    scans.back().timestamp = 0.2 * i;
  }
  return scans;
}

std::size_t Changed(const std::vector<Scan>& before,
                    const std::vector<Scan>& after, int begin, int end) {
  std::size_t changed = 0;
  for (int i = begin; i < end; ++i) {
    const auto& a = before[static_cast<std::size_t>(i)].ranges;
    const auto& b = after[static_cast<std::size_t>(i)].ranges;
    for (std::size_t k = 0; k < a.size(); ++k) changed += a[k] != b[k];
  }
  return changed;
}

TEST(CompanionsTest, ACartInFrontOfTheRobotIsTakenOut) {
  Drive drive;
  drive.begin = 60;
  drive.end = 140;
  const std::vector<Scan> before = ScansOf(drive);
  std::vector<Scan> scans = before;
  const std::vector<Companion> found =
      TakeOutCompanions(CompanionOptions(), &scans);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_NEAR(found[0].begin, 60, 10);
  EXPECT_NEAR(found[0].end, 140, 10);
  EXPECT_NEAR(found[0].way, 8.0, 1.5);
  // 37 beams hit it: those within atan(0.5 / 1.5) of straight ahead.
  for (std::size_t i = 70; i < 130; ++i) {
    EXPECT_EQ(scans[i].ranges[90], 0.0f);
    EXPECT_EQ(scans[i].ranges[75], 0.0f);
    EXPECT_EQ(scans[i].ranges[105], 0.0f);
    EXPECT_EQ(scans[i].ranges[30], before[i].ranges[30]);
    EXPECT_EQ(scans[i].ranges[150], before[i].ranges[150]);
  }
  EXPECT_EQ(Changed(before, scans, 0, 50), 0u);
  EXPECT_EQ(Changed(before, scans, 150, 200), 0u);
  EXPECT_EQ(static_cast<std::size_t>(found[0].returns),
            Changed(before, scans, 0, 200));
}

TEST(CompanionsTest, IsThereFromWhereTheRobotStoodAtTheBeginning) {
  Drive drive;
  drive.end = 200;
  std::vector<Scan> moving = ScansOf(drive);
  std::vector<Scan> scans(5, moving.front());
  scans.insert(scans.end(), moving.begin(), moving.end());
  const std::vector<Companion> found =
      TakeOutCompanions(CompanionOptions(), &scans);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].begin, 0);
  EXPECT_EQ(scans[0].ranges[90], 0.0f);
}

// Two people side by side have more returns than the doors that go by.
TEST(CompanionsTest, SeveralThingsMayGoAlong) {
  Drive drive;
  std::vector<Scan> scans = ScansOf(drive);
  for (std::size_t i = 0; i < scans.size(); ++i) {
    const Pose2 pose(0.1 * static_cast<double>(i), 0.0, 0.0);
    std::vector<WallEnds> walls = drive.walls;
    for (const double side : {-0.4, 0.4}) {
      walls.push_back({TransformPoint(pose, {1.2, side - 0.2}),
                       TransformPoint(pose, {1.2, side + 0.2})});
    }
    scans[i].ranges = testing::MakeScan(walls, pose, testing::Laser()).ranges;
  }
  const std::vector<Companion> found =
      TakeOutCompanions(CompanionOptions(), &scans);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_NEAR(found[0].way, 19.9, 1.0);
  // atan(0.4 / 1.2) is 18.4 degrees.
  for (std::size_t i = 0; i < scans.size(); ++i) {
    EXPECT_EQ(scans[i].ranges[90 - 18], 0.0f);
    EXPECT_EQ(scans[i].ranges[90 + 18], 0.0f);
  }
}

// Where it turns around on the spot the walls beside it hide the cart for a
// while.
TEST(CompanionsTest, IsFollowedWhereTheRobotTurnsOnTheSpot) {
  const std::vector<WallEnds> corridor = CorridorWithDoors();
  testing::Noise noise(6);
  testing::Laser laser;
  laser.sigma = 0.01;
  std::vector<Scan> scans;
  Pose2 pose = Pose2::Zero();
  for (int i = 0; i < 150; ++i) {
    std::vector<WallEnds> walls = corridor;
    walls.push_back(CartAt(pose, 0.8));
    scans.push_back(testing::MakeScan(walls, pose, laser, &noise));
    const bool turns = i >= 60 && i < 96;
    pose = Compose(pose,
                   turns ? Pose2(0.0, 0.0, kPi / 36.0) : Pose2(0.1, 0.0, 0.0));
  }
  const std::vector<Scan> before = scans;
  const std::vector<Companion> found =
      TakeOutCompanions(CompanionOptions(), &scans);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].begin, 0);
  EXPECT_EQ(found[0].end, 149);
  EXPECT_NEAR(found[0].way, 11.3, 0.1);
  int seen = 0;
  for (std::size_t i = 0; i < 150; ++i) {
    const float range = before[i].ranges[90];
    const float apart = std::abs(range - 1.5f);
    seen += apart < 0.1f;
    if (apart < 0.1f) {
      EXPECT_EQ(scans[i].ranges[90], 0.0f) << i;
    } else if (apart > 0.3f) {
      EXPECT_EQ(scans[i].ranges[90], range) << i;
    }
  }
  EXPECT_GT(seen, 125);
  EXPECT_LT(seen, 150);
}

TEST(CompanionsTest, WhatStandsStays) {
  const std::vector<Scan> before = ScansOf(Drive());
  std::vector<Scan> scans = before;
  EXPECT_TRUE(TakeOutCompanions(CompanionOptions(), &scans).empty());
  EXPECT_EQ(Changed(before, scans, 0, 200), 0u);
}

// Everything stays where it is: the box in front of the robot as well as the
// corridor.
TEST(CompanionsTest, WheelsThatSpinOnTheSpotMakeNothingGoAlong) {
  Drive drive;
  drive.step = 0.0;
  drive.end = 200;
  drive.walls.push_back({{3.0, 0.4}, {3.0, 0.8}});
  const std::vector<Scan> before = ScansOf(drive);
  std::vector<Scan> scans = before;
  EXPECT_TRUE(TakeOutCompanions(CompanionOptions(), &scans).empty());
  EXPECT_EQ(Changed(before, scans, 0, 200), 0u);
}

// Posts at even distances, that of two scans that are compared among them.
TEST(CompanionsTest, PostsAtEvenDistancesStand) {
  for (const double period : {0.5, 0.8}) {
    Drive drive;
    drive.scans = 100;
    for (double x = 0.0; x < 12.0; x += period) {
      drive.walls.push_back({{x, 0.6}, {x, 0.7}});
      drive.walls.push_back({{x, 0.6}, {x + 0.1, 0.6}});
    }
    std::vector<Scan> scans = ScansOf(drive);
    EXPECT_TRUE(TakeOutCompanions(CompanionOptions(), &scans).empty())
        << period;
  }
}

// What the laser sees of a railing beside it, where each post looks as the one
// before, may be the same in all scans that are compared, ...
TEST(CompanionsTest, WhatScansInBetweenDoNotShowIsNone) {
  Drive drive;
  drive.end = 200;
  const std::vector<Scan> with = ScansOf(drive);
  const std::vector<Scan> without = ScansOf(Drive());
  std::vector<Scan> scans = without;
  for (std::size_t i = 0; i < scans.size(); i += 5) scans[i] = with[i];
  std::vector<Scan> others = scans;
  EXPECT_TRUE(TakeOutCompanions(CompanionOptions(), &scans).empty());
  CompanionOptions compared_alone;
  compared_alone.min_share_between = 0.0;
  EXPECT_FALSE(TakeOutCompanions(compared_alone, &others).empty());
}

// ... or reach the edge of the scan.
TEST(CompanionsTest, WhatDoesNotStandFreeIsNone) {
  Drive drive;
  drive.end = 200;
  std::vector<Scan> scans = ScansOf(drive);
  for (Scan& scan : scans) {
    scan.ranges.erase(scan.ranges.begin(), scan.ranges.begin() + 85);
    scan.start_angle += 85 * scan.angle_step;
  }
  EXPECT_TRUE(TakeOutCompanions(CompanionOptions(), &scans).empty());
}

TEST(CompanionsTest, WithoutWayThereIsNothingToFind) {
  std::vector<Scan> scans;
  EXPECT_TRUE(TakeOutCompanions(CompanionOptions(), &scans).empty());
  Drive drive;
  drive.end = 200;
  scans = ScansOf(drive);
  for (Scan& scan : scans) scan.odometry = Pose2::Zero();
  EXPECT_TRUE(TakeOutCompanions(CompanionOptions(), &scans).empty());
}

}  // namespace
}  // namespace plumbline
