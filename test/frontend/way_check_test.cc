#include <gtest/gtest.h>
#include <plumbline/core/error.h>
#include <plumbline/frontend/way_check.h>

#include <cmath>
#include <vector>

#include "frontend/synthetic_world.h"

namespace plumbline {
namespace {

using testing::Laser;
using testing::MakeScan;
using testing::Noise;

// A corridor of 2 m x 30 m along x that a robot goes along and comes back, and
// what it finds at x = 15 the first time and from then on.
struct WayDrive {
  std::vector<Scan> scans;
  std::vector<int> keys;
  std::vector<Pose2> poses;
};

void GoBetween(double half_width, const Laser& laser,
               const std::vector<testing::WallEnds>& across, double from,
               double to, WayDrive* drive) {
  std::vector<testing::WallEnds> walls = {
      {{0.0, -half_width}, {30.0, -half_width}},
      {{30.0, -half_width}, {30.0, half_width}},
      {{30.0, half_width}, {0.0, half_width}},
      {{0.0, half_width}, {0.0, -half_width}}};
  walls.insert(walls.end(), across.begin(), across.end());
  Noise noise(5 + drive->scans.size());
  const double step = from < to ? 0.3 : -0.3;
  for (double x = from; (to - x) * step > 0.0; x += step) {
    const Pose2 pose(x, 0.0, from < to ? 0.0 : kPi);
    drive->keys.push_back(static_cast<int>(drive->scans.size()));
    drive->scans.push_back(MakeScan(walls, pose, laser, &noise));
    drive->poses.push_back(pose);
  }
}

void Go(const std::vector<testing::WallEnds>& across, double from, double to,
        WayDrive* drive) {
  Laser laser;
  laser.sigma = 0.01;
  GoBetween(1.0, laser, across, from, to, drive);
}

// In a hall of 8 m in place of the corridor, with a finer laser.
void Hall(const std::vector<testing::WallEnds>& across, double from, double to,
          WayDrive* drive) {
  Laser laser;
  laser.angle_step = DegToRad(0.25);
  laser.beams = 721;
  laser.sigma = 0.01;
  GoBetween(4.0, laser, across, from, to, drive);
}

// Up to what stands there, back, and through where it was.
WayDrive Through(const std::vector<testing::WallEnds>& first,
                 const std::vector<testing::WallEnds>& then) {
  WayDrive drive;
  Go(first, 5.0, 12.0, &drive);
  Go(first, 12.0, 5.0, &drive);
  Go(then, 5.0, 25.0, &drive);
  return drive;
}

// What the map has at x = 15.
std::vector<Wall> WallAcross() {
  return {MakeWall({15.0, 0.0}, 0.5 * kPi, -0.95, 0.95)};
}

TEST(FindBlockedWaysTest, ThroughAnEndOfACorridor) {
  const WayDrive drive = Through({{{15.0, -1.0}, {15.0, 1.0}}}, {});
  const std::vector<BlockedWay> found =
      FindBlockedWays(drive.scans, drive.keys, drive.poses, WallAcross(), {});
  ASSERT_EQ(found.size(), 1U);
  const auto crossing = static_cast<std::size_t>(found[0].crossing);
  EXPECT_LT(drive.poses[crossing].x(), 15.0);
  EXPECT_GE(drive.poses[crossing + 1].x(), 15.0);
  // The last ones that saw it were looking from where the robot turned.
  EXPECT_LT(found[0].seen, 24);
  EXPECT_GT(found[0].seen, 0);

  WayCheckOptions threads;
  threads.num_threads = 3;
  EXPECT_EQ(FindBlockedWays(drive.scans, drive.keys, drive.poses, WallAcross(),
                            threads)
                .size(),
            1U);
}

TEST(FindBlockedWaysTest, TurnedAndMoved) {
  WayDrive drive = Through({{{15.0, -1.0}, {15.0, 1.0}}}, {});
  const Pose2 world(-300.0, 1e4, 2.5);
  for (Pose2& pose : drive.poses) pose = Compose(world, pose);
  const std::vector<Wall> walls = {
      MakeWall(Compose(world, Pose2(15.0, 0.0, -0.5 * kPi)), -0.95, 0.95)};
  EXPECT_EQ(
      FindBlockedWays(drive.scans, drive.keys, drive.poses, walls, {}).size(),
      1U);
}

TEST(FindBlockedWaysTest, ADoorThatWasClosed) {
  const std::vector<testing::WallEnds> frame = {{{15.0, -1.0}, {15.0, -0.45}},
                                                {{15.0, 0.45}, {15.0, 1.0}}};
  const WayDrive drive = Through({{{15.0, -1.0}, {15.0, 1.0}}}, frame);
  EXPECT_TRUE(
      FindBlockedWays(drive.scans, drive.keys, drive.poses, WallAcross(), {})
          .empty());
}

// An opening of 1.8 m in the wall of a hall, in which something stood for a
// moment.
TEST(FindBlockedWaysTest, WhatStoodInAnOpeningForAMoment) {
  const std::vector<testing::WallEnds> wall = {{{15.0, -4.0}, {15.0, -0.6}},
                                               {{15.0, 1.2}, {15.0, 4.0}}};
  WayDrive drive;
  Hall(wall, 5.0, 12.0, &drive);
  Hall(wall, 12.0, 5.0, &drive);
  std::vector<testing::WallEnds> leaves = wall;
  leaves.push_back({{15.0, -0.6}, {15.0, 1.2}});
  const auto first = static_cast<std::ptrdiff_t>(drive.scans.size());
  Hall(leaves, 11.7, 11.9, &drive);
  ASSERT_EQ(static_cast<std::ptrdiff_t>(drive.scans.size()) - first, 1);
  for (int visit = 0; visit < 2; ++visit) {
    Hall(wall, 12.0, 5.0, &drive);
    Hall(wall, 5.0, 12.0, &drive);
  }
  Hall(wall, 12.0, 25.0, &drive);
  const std::vector<Wall> map = {MakeWall({15.0, 0.0}, 0.5 * kPi, -4.0, 4.0)};
  EXPECT_TRUE(
      FindBlockedWays(drive.scans, drive.keys, drive.poses, map, {}).empty());
}

TEST(FindBlockedWaysTest, AWallThatIsDrawnAcrossADoorway) {
  const std::vector<testing::WallEnds> frame = {{{15.0, -1.0}, {15.0, -0.7}},
                                                {{15.0, 0.7}, {15.0, 1.0}}};
  const WayDrive drive = Through(frame, frame);
  EXPECT_TRUE(
      FindBlockedWays(drive.scans, drive.keys, drive.poses, WallAcross(), {})
          .empty());
}

TEST(FindBlockedWaysTest, WallsBesideTheWayAndJumps) {
  WayDrive drive = Through({{{15.0, -1.0}, {15.0, 1.0}}}, {});
  const std::vector<Wall> sides = {MakeWall({15.0, -1.0}, 0.0, -15.0, 15.0),
                                   MakeWall({15.0, 1.0}, kPi, -15.0, 15.0),
                                   MakeWall({15.0, 0.0}, 0.5 * kPi, 0.0, 0.0)};
  EXPECT_TRUE(
      FindBlockedWays(drive.scans, drive.keys, drive.poses, sides, {}).empty());
  // Nobody went from one side to the other where 2 m are missing.
  WayDrive jump = Through({{{15.0, -1.0}, {15.0, 1.0}}}, {});
  for (std::size_t k = jump.poses.size(); k-- > 0;) {
    if (std::abs(jump.poses[k].x() - 15.0) < 1.0) {
      jump.poses.erase(jump.poses.begin() + static_cast<std::ptrdiff_t>(k));
      jump.keys.erase(jump.keys.begin() + static_cast<std::ptrdiff_t>(k));
    }
  }
  EXPECT_TRUE(
      FindBlockedWays(jump.scans, jump.keys, jump.poses, WallAcross(), {})
          .empty());
}

TEST(FindBlockedWaysTest, EndsWhenItIsToldAndRefusesPosesThatDoNotFit) {
  const WayDrive drive = Through({{{15.0, -1.0}, {15.0, 1.0}}}, {});
  EXPECT_TRUE(FindBlockedWays(drive.scans, drive.keys, drive.poses,
                              WallAcross(), {}, [] { return true; })
                  .empty());
  EXPECT_THROW(FindBlockedWays(drive.scans, drive.keys, {}, WallAcross(), {}),
               Error);
  EXPECT_TRUE(FindBlockedWays({}, {}, {}, WallAcross(), {}).empty());
}

}  // namespace
}  // namespace plumbline
