#include <gtest/gtest.h>
#include <plumbline/core/error.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/contested_ways.h>

#include <algorithm>
#include <cstddef>
#include <vector>

#include "synthetic_world.h"

namespace plumbline {
namespace {

using testing::WallEnds;

struct ContestedDrive {
  std::vector<WallEnds> walls = testing::Corridor();
  // Scans `begin` to `end` (not included) have somebody broad in front of the
  // robot, ...
  int begin = 0;
  int end = 0;
  // ... and in these its wheels turn on the spot.
  int slip_begin = 0;
  int slip_end = 0;
  // Of 0.1 m by odometry.
  double step = 0.1;
};

// Posts along the walls, 1.3 m apart.
std::vector<WallEnds> CorridorWithPosts() {
  std::vector<WallEnds> walls = testing::Corridor();
  for (int i = -2; i <= 18; ++i) {
    const double x = 1.3 * i;
    walls.push_back({{x, 0.7}, {x, 1.0}});
    walls.push_back({{x + 0.6, -1.0}, {x + 0.6, -0.7}});
  }
  return walls;
}

struct ContestedLog {
  std::vector<Scan> scans;
  std::vector<Pose2> truth;
  // In metres of the truth's.
  std::vector<Pose2> by_odometry;
};

ContestedLog LogOf(const ContestedDrive& drive) {
  testing::Noise noise(7);
  testing::Laser laser;
  laser.sigma = 0.01;
  ContestedLog log;
  double x = 0.0;
  for (int i = 0; i < 200; ++i) {
    if (i > 0 && (i < drive.slip_begin || i >= drive.slip_end)) x += drive.step;
    const Pose2 pose(x, 0.0, 0.0);
    std::vector<WallEnds> walls = drive.walls;
    if (i >= drive.begin && i < drive.end) {
      walls.push_back({TransformPoint(pose, {1.5, -0.6}),
                       TransformPoint(pose, {1.5, 0.6})});
    }
    log.scans.push_back(testing::MakeScan(walls, pose, laser, &noise));
    log.scans.back().odometry = Pose2(0.1 * i, 0.0, 0.0);
    log.truth.push_back(pose);
    log.by_odometry.push_back(Pose2(drive.step * i, 0.0, 0.0));
  }
  return log;
}

TEST(ContestedWaysTest, SomebodyInABareCorridorContestsTheWay) {
  ContestedDrive drive;
  drive.begin = 60;
  drive.end = 140;
  const ContestedLog log = LogOf(drive);
  const std::vector<ContestedWay> ways =
      FindContestedWays(log.scans, log.truth, 1.0, ContestedWayOptions());
  ASSERT_EQ(ways.size(), 1u);
  EXPECT_NEAR(ways[0].begin, 60, 6);
  EXPECT_NEAR(ways[0].end, 140, 6);
  EXPECT_NEAR(ways[0].by_odometry, 8.0, 1.0);
  EXPECT_NEAR(ways[0].by_map, 8.0, 1.0);
}

TEST(ContestedWaysTest, SoDoWheelsThatTurnOnTheSpot) {
  ContestedDrive drive;
  drive.walls = CorridorWithPosts();
  drive.slip_begin = 80;
  drive.slip_end = 110;
  const ContestedLog log = LogOf(drive);
  const std::vector<ContestedWay> ways =
      FindContestedWays(log.scans, log.truth, 1.0, ContestedWayOptions());
  ASSERT_EQ(ways.size(), 1u);
  EXPECT_NEAR(ways[0].begin, 80, 6);
  EXPECT_NEAR(ways[0].end, 110, 6);
  EXPECT_LT(ways[0].by_map, 0.5);
  EXPECT_GT(ways[0].by_odometry, 2.0);
}

TEST(ContestedWaysTest, NothingContestsARightWay) {
  ContestedDrive drive;
  for (const bool has_posts : {false, true}) {
    if (has_posts) drive.walls = CorridorWithPosts();
    const ContestedLog log = LogOf(drive);
    EXPECT_TRUE(
        FindContestedWays(log.scans, log.truth, 1.0, ContestedWayOptions())
            .empty());
  }
}

// Somebody for 4 m among posts that are seen to go by, too: told only where the
// map has another length.
TEST(ContestedWaysTest, AShortWayCountsWhereTheMapHasAnotherLength) {
  ContestedDrive drive;
  drive.walls = CorridorWithPosts();
  drive.begin = 60;
  drive.end = 100;
  const ContestedLog log = LogOf(drive);
  ContestedWayOptions options;
  // What stands is in sight, fewer than what goes along.
  options.min_ratio = 0.2;
  options.unopposed = 0.0;
  EXPECT_TRUE(FindContestedWays(log.scans, log.truth, 1.0, options).empty());
  std::vector<Pose2> shorter = log.truth;
  for (std::size_t i = 60; i < shorter.size(); ++i) {
    shorter[i][0] -=
        0.02 * static_cast<double>(std::min<std::size_t>(i, 100) - 60);
  }
  const std::vector<ContestedWay> ways =
      FindContestedWays(log.scans, shorter, 1.0, options);
  ASSERT_EQ(ways.size(), 1u);
  EXPECT_NEAR(ways[0].by_odometry - ways[0].by_map, 0.8, 0.1);
}

// Half a metre of the log's is a quarter of one: posts seem to go along by half
// where that is not known.
TEST(ContestedWaysTest, AMetreOfOdometryIsTheMaps) {
  ContestedDrive drive;
  drive.walls = CorridorWithPosts();
  drive.step = 0.05;
  const ContestedLog log = LogOf(drive);
  EXPECT_TRUE(
      FindContestedWays(log.scans, log.truth, 0.5, ContestedWayOptions())
          .empty());
}

TEST(ContestedWaysTest, AJumpOfOdometryEndsAStretch) {
  ContestedDrive drive;
  drive.begin = 60;
  drive.end = 140;
  ContestedLog log = LogOf(drive);
  for (std::size_t i = 100; i < log.scans.size(); ++i) {
    log.scans[i].odometry[1] += 20.0;
  }
  const std::vector<ContestedWay> ways =
      FindContestedWays(log.scans, log.truth, 1.0, ContestedWayOptions());
  ASSERT_EQ(ways.size(), 2u);
  EXPECT_LT(ways[0].end, 100);
  EXPECT_GE(ways[1].begin, 100);
}

TEST(ContestedWaysTest, TheResultDoesNotDependOnThreads) {
  ContestedDrive drive;
  drive.begin = 60;
  drive.end = 140;
  const ContestedLog log = LogOf(drive);
  ContestedWayOptions options;
  options.num_threads = 1;
  const auto one = FindContestedWays(log.scans, log.truth, 1.0, options);
  options.num_threads = 3;
  const auto three = FindContestedWays(log.scans, log.truth, 1.0, options);
  ASSERT_EQ(one.size(), three.size());
  ASSERT_FALSE(one.empty());
  EXPECT_EQ(one[0].begin, three[0].begin);
  EXPECT_EQ(one[0].end, three[0].end);
  EXPECT_EQ(one[0].by_map, three[0].by_map);
}

TEST(ContestedWaysTest, NumbersThatDifferAreAnError) {
  const ContestedLog log = LogOf(ContestedDrive());
  EXPECT_THROW(FindContestedWays(log.scans, {}, 1.0, ContestedWayOptions()),
               Error);
  EXPECT_TRUE(FindContestedWays({}, {}, 1.0, ContestedWayOptions()).empty());
}

}  // namespace
}  // namespace plumbline
