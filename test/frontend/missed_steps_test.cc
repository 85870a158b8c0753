#include <gtest/gtest.h>
#include <plumbline/core/error.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/missed_steps.h>

#include <cstddef>
#include <vector>

#include "synthetic_world.h"

namespace plumbline {
namespace {

using testing::WallEnds;

struct StepDrive {
  std::vector<WallEnds> walls = testing::Corridor();
  // What stands there only before this scan, and only from it on.
  std::vector<WallEnds> walls_before;
  std::vector<WallEnds> walls_after;
  // Before scan `at` the robot is pushed by so much, m.
  int at = 60;
  double push = 0.0;
  testing::Laser laser;
};

struct StepLog {
  std::vector<Scan> scans;
  std::vector<RefinedScan> refined;
};

// A drive of 15 m along x, of which the track misses the push.
StepLog LogOf(const StepDrive& drive) {
  testing::Noise noise(5);
  testing::Laser laser = drive.laser;
  laser.sigma = 0.01;
  StepLog log;
  std::size_t key = 0;
  for (int i = 0; i < 150; ++i) {
    const Pose2 track(0.1 * i, 0.0, 0.0);
    const bool is_after = i >= drive.at;
    const Pose2 robot(track[0] + (is_after ? drive.push : 0.0), 0.0, 0.0);
    std::vector<WallEnds> walls = drive.walls;
    const std::vector<WallEnds>& more =
        is_after ? drive.walls_after : drive.walls_before;
    walls.insert(walls.end(), more.begin(), more.end());
    log.scans.push_back(testing::MakeScan(walls, robot, laser, &noise));
    log.scans.back().odometry = track;
    RefinedScan refined;
    refined.pose = track;
    refined.is_key = i % 3 == 0;
    refined.since_key.mean = i == 0
                                 ? Pose2(Pose2::Zero())
                                 : Between(log.refined[key].pose, refined.pose);
    if (refined.is_key) key = log.refined.size();
    log.refined.push_back(refined);
  }
  return log;
}

std::vector<MissedStep> StepsOf(const StepLog& log) {
  return FindMissedSteps(log.scans, log.refined, MissedStepOptions());
}

// An end of the corridor and a door in its wall.
std::vector<WallEnds> Ends() {
  std::vector<WallEnds> walls = testing::Corridor();
  walls.push_back({{22.0, -1.0}, {22.0, 1.0}});
  walls.push_back({{14.0, 0.7}, {14.0, 1.0}});
  return walls;
}

TEST(MissedStepsTest, APushInACorridorIsFoundByItsEnd) {
  for (const double push : {0.5, 1.0, -0.6}) {
    StepDrive drive;
    drive.walls = Ends();
    drive.push = push;
    StepLog log = LogOf(drive);
    const std::vector<MissedStep> steps = StepsOf(log);
    ASSERT_EQ(steps.size(), 1u) << push;
    EXPECT_TRUE(steps[0].is_sure);
    EXPECT_NEAR(steps[0].length, push, 0.06);
    EXPECT_LE(steps[0].begin, drive.at + 6);
    EXPECT_GE(steps[0].end, drive.at - 6);
    EXPECT_LT(steps[0].begin, steps[0].end);
    EXPECT_NEAR(steps[0].correction.change[0], steps[0].length, 1e-9);
    EXPECT_NEAR(steps[0].correction.change[1], 0.0, 1e-9);
    EXPECT_EQ(steps[0].correction.scan, steps[0].end);

    CorrectMotions({steps[0].correction}, &log.refined);
    EXPECT_NEAR(log.refined.back().pose[0], 14.9 + push, 0.06);
    EXPECT_TRUE(StepsOf(log).empty());
  }
}

TEST(MissedStepsTest, WhatIsRightStays) {
  StepDrive drive;
  drive.walls = Ends();
  EXPECT_TRUE(StepsOf(LogOf(drive)).empty());
}

// The two sides of a gap between racks are seen one after the other.
TEST(MissedStepsTest, SidesOfAGapAreNotOne) {
  StepDrive drive;
  drive.laser = testing::FullCircle();
  drive.laser.maximum_range = 12.0;
  drive.walls.clear();
  for (const double side : {-1.0, 1.0}) {
    for (int i = -4; i <= 6; ++i) {
      const double begin = 5.0 * i;
      const double end = begin + 4.6;
      const double near = 2.4 * side;
      const double far = 3.6 * side;
      drive.walls.push_back({{begin, near}, {end, near}});
      drive.walls.push_back({{end, near}, {end, far}});
      drive.walls.push_back({{end, far}, {begin, far}});
      drive.walls.push_back({{begin, far}, {begin, near}});
    }
  }
  EXPECT_TRUE(StepsOf(LogOf(drive)).empty());
}

TEST(MissedStepsTest, WhatGoesAlongIsNone) {
  StepLog log = LogOf(StepDrive());
  // No return is said to be one at 8 m.
  for (Scan& scan : log.scans) {
    for (float& range : scan.ranges) {
      if (range == 0.0f || range > 8.0f) range = 8.0f;
    }
  }
  EXPECT_TRUE(StepsOf(log).empty());
}

TEST(MissedStepsTest, NothingIsSaidWhereNothingTells) {
  StepDrive drive;
  drive.push = 0.5;
  EXPECT_TRUE(StepsOf(LogOf(drive)).empty());
}

TEST(MissedStepsTest, OneThingThatMovesIsNotSureToBeAStep) {
  StepDrive drive;
  drive.walls_before = {{{18.0, -0.4}, {18.0, 0.4}}};
  drive.walls_after = {{{18.6, -0.4}, {18.6, 0.4}}};
  const std::vector<MissedStep> steps = StepsOf(LogOf(drive));
  ASSERT_EQ(steps.size(), 1u);
  EXPECT_FALSE(steps[0].is_sure);
  EXPECT_NEAR(steps[0].length, -0.6, 0.06);
}

TEST(MissedStepsTest, ATrackThatBeginsAnewIsNotCompared) {
  StepDrive drive;
  drive.walls = Ends();
  drive.push = 0.5;
  StepLog log = LogOf(drive);
  log.refined[60].tie = TrackTie::kOdometry;
  EXPECT_TRUE(StepsOf(log).empty());
}

TEST(MissedStepsTest, ThreadsDoNotMatterAndStopIsAsked) {
  StepDrive drive;
  drive.walls = Ends();
  drive.push = 0.5;
  const StepLog log = LogOf(drive);
  MissedStepOptions options;
  options.num_threads = 1;
  const std::vector<MissedStep> one =
      FindMissedSteps(log.scans, log.refined, options);
  options.num_threads = 3;
  const std::vector<MissedStep> three =
      FindMissedSteps(log.scans, log.refined, options);
  ASSERT_EQ(one.size(), 1u);
  ASSERT_EQ(three.size(), 1u);
  EXPECT_EQ(one[0].length, three[0].length);
  EXPECT_TRUE(FindMissedSteps(log.scans, log.refined, options, [] {
                return true;
              }).empty());
}

TEST(MissedStepsTest, NumbersHaveToAgree) {
  StepLog log = LogOf(StepDrive());
  log.refined.pop_back();
  EXPECT_THROW(StepsOf(log), Error);
}

}  // namespace
}  // namespace plumbline
