#include <gtest/gtest.h>
#include <plumbline/core/error.h>
#include <plumbline/frontend/open_ways.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "frontend/synthetic_world.h"

namespace plumbline {
namespace {

using testing::Corridor;
using testing::Laser;
using testing::MakeScan;
using testing::Noise;
using testing::WallEnds;

// A way through a building as it is, with odometry that errs.
struct SeenDrive {
  std::vector<Scan> scans;
  std::vector<int> keys;
  std::vector<Pose2> poses;
  std::vector<bool> follows;
};

// `sigma`: error of odometry after a metre, m.
SeenDrive DriveAlong(const std::vector<WallEnds>& walls,
                     const std::vector<Pose2>& poses, double sigma) {
  Laser laser;
  laser.sigma = 0.01;
  laser.maximum_range = 12.0;
  Noise noise(5);
  SeenDrive drive;
  drive.poses = poses;
  Pose2 odometry = poses.front();
  for (std::size_t k = 0; k < poses.size(); ++k) {
    drive.keys.push_back(static_cast<int>(k));
    drive.scans.push_back(MakeScan(walls, poses[k], laser, &noise));
    if (k > 0) {
      Pose2 motion = Between(poses[k - 1], poses[k]);
      motion[0] += noise.Normal(sigma * std::sqrt(motion.head<2>().norm()));
      odometry = Compose(odometry, motion);
    }
    drive.scans.back().odometry = odometry;
  }
  drive.follows.assign(poses.size(), true);
  return drive;
}

// From x = begin to x = end, 0.3 m a key scan.
std::vector<Pose2> Straight(double begin, double end) {
  std::vector<Pose2> poses;
  for (int k = 0; k <= std::lround(std::abs(end - begin) / 0.3); ++k) {
    const double sign = end > begin ? 1.0 : -1.0;
    poses.emplace_back(begin + sign * 0.3 * k, 0.0, end > begin ? 0.0 : kPi);
  }
  return poses;
}

// A corridor with a room at its beginning, in which odometry is learnt.
std::vector<WallEnds> RoomAndCorridor() {
  return {{{0.0, -1.0}, {200.0, -1.0}}, {{0.0, 1.0}, {200.0, 1.0}},
          {{0.0, 1.0}, {0.0, 4.0}},     {{0.0, -1.0}, {0.0, -4.0}},
          {{0.0, 4.0}, {-10.0, 4.0}},   {{0.0, -4.0}, {-10.0, -4.0}},
          {{-10.0, -4.0}, {-10.0, 4.0}}};
}

// The same with a door frame on either side every 5 m.
std::vector<WallEnds> WithNiches(std::vector<WallEnds> walls) {
  for (double x = 5.0; x < 100.0; x += 5.0) {
    for (const double side : {-1.0, 1.0}) {
      walls.push_back({{x, side}, {x, 0.6 * side}});
      walls.push_back({{x, 0.6 * side}, {x + 0.4, 0.6 * side}});
      walls.push_back({{x + 0.4, 0.6 * side}, {x + 0.4, side}});
    }
  }
  return walls;
}

TEST(FindOpenWaysTest, ACorridorWithNothingInSightHangsOnOdometry) {
  const SeenDrive drive =
      DriveAlong(RoomAndCorridor(), Straight(-8.0, 70.0), 0.05);
  const std::vector<OpenWay> ways =
      FindOpenWays(drive.scans, drive.keys, drive.poses, drive.follows, {});
  ASSERT_EQ(ways.size(), 1u);
  // The room is in sight for 8 m or so.
  EXPECT_GT(ways[0].length, 50.0);
  EXPECT_LT(ways[0].length, 75.0);
  // 0.05 m after a metre is 0.4 m after 60 m, and the scale is learnt from 10
  // m.
  EXPECT_GT(ways[0].sigma, 0.3);
  EXPECT_LT(ways[0].sigma, 2.5);
  // The same for any number of threads.
  OpenWayOptions one;
  one.num_threads = 1;
  const std::vector<OpenWay> again =
      FindOpenWays(drive.scans, drive.keys, drive.poses, drive.follows, one);
  ASSERT_EQ(again.size(), 1u);
  EXPECT_EQ(again[0].begin, ways[0].begin);
  EXPECT_EQ(again[0].end, ways[0].end);
  EXPECT_EQ(again[0].sigma, ways[0].sigma);
}

TEST(FindOpenWaysTest, ACorridorWithNichesDoesNot) {
  const SeenDrive drive =
      DriveAlong(WithNiches(RoomAndCorridor()), Straight(-8.0, 70.0), 0.05);
  EXPECT_TRUE(
      FindOpenWays(drive.scans, drive.keys, drive.poses, drive.follows, {})
          .empty());
}

// As where another log begins next to where the last one ended.
TEST(FindOpenWaysTest, OdometryThatBeginsAnewSaysNothingOfTheRest) {
  SeenDrive drive =
      DriveAlong(WithNiches(RoomAndCorridor()), Straight(-8.0, 70.0), 0.05);
  for (std::size_t k = 10; k < drive.scans.size(); ++k) {
    drive.scans[k].odometry[0] += 100.0;
  }
  const auto find = [&drive] {
    return FindOpenWays(drive.scans, drive.keys, drive.poses, drive.follows,
                        {});
  };
  EXPECT_FALSE(find().empty());
  drive.follows[10] = false;
  EXPECT_TRUE(find().empty());
}

TEST(FindOpenWaysTest, AShortCorridorDoesNot) {
  const SeenDrive drive =
      DriveAlong(RoomAndCorridor(), Straight(-8.0, 5.0), 0.01);
  EXPECT_TRUE(
      FindOpenWays(drive.scans, drive.keys, drive.poses, drive.follows, {})
          .empty());
}

// Nothing in sight shows it, but odometry does.
TEST(FindOpenWaysTest, AMapThatIsShorterThanOdometryIsLessCertain) {
  const SeenDrive drive =
      DriveAlong(RoomAndCorridor(), Straight(-8.0, 8.0), 0.005);
  OpenWayOptions options;
  options.told_sigma = 0.3;
  EXPECT_TRUE(
      FindOpenWays(drive.scans, drive.keys, drive.poses, drive.follows, options)
          .empty());
  std::vector<Pose2> shorter = drive.poses;
  // By 0.5 m, from where the room is out of sight.
  for (Pose2& pose : shorter) pose[0] -= 0.1 * std::max(0.0, pose[0] - 3.0);
  const std::vector<OpenWay> ways =
      FindOpenWays(drive.scans, drive.keys, shorter, drive.follows, options);
  ASSERT_EQ(ways.size(), 1u);
  EXPECT_GT(ways[0].sigma, 0.4);
}

// A round corridor looks the same from everywhere, but each of its scans has
// normals in all directions.
TEST(FindOpenWaysTest, ARoundCorridorHangsOnOdometry) {
  constexpr int kSides = 90;
  constexpr double kRadius = 15.0;
  std::vector<WallEnds> walls;
  std::vector<Pose2> poses;
  const auto at = [](double radius, double angle) {
    return Eigen::Vector2d(radius * std::cos(angle), radius * std::sin(angle));
  };
  for (int side = 0; side < kSides; ++side) {
    for (const double radius : {kRadius - 1.0, kRadius + 1.0}) {
      walls.push_back({at(radius, 2.0 * kPi * side / kSides),
                       at(radius, 2.0 * kPi * (side + 1) / kSides)});
    }
  }
  for (int k = 0; k < 400; ++k) {
    const double angle = 0.3 * k / kRadius;
    const Eigen::Vector2d position = at(kRadius, angle);
    poses.emplace_back(position.x(), position.y(),
                       NormalizeAngle(angle + 0.5 * kPi));
  }
  const SeenDrive drive = DriveAlong(walls, poses, 0.05);
  const std::vector<OpenWay> ways =
      FindOpenWays(drive.scans, drive.keys, drive.poses, drive.follows, {});
  ASSERT_FALSE(ways.empty());
  double longest = 0.0;
  for (const OpenWay& way : ways) longest = std::max(longest, way.length);
  EXPECT_GT(longest, 60.0);
}

// A door frame every 8 m, seen 3 m far: odometry carries the place from one to
// the next.
TEST(FindUncertainLengthsTest, ShortWaysAddUp) {
  const auto lengths = [](double pitch, double sigma, double range) {
    std::vector<WallEnds> walls = RoomAndCorridor();
    for (double x = 8.0; x < 100.0; x += pitch) {
      for (const double side : {-1.0, 1.0}) {
        walls.push_back({{x, side}, {x, 0.6 * side}});
        walls.push_back({{x, 0.6 * side}, {x + 0.4, 0.6 * side}});
        walls.push_back({{x + 0.4, 0.6 * side}, {x + 0.4, side}});
      }
    }
    SeenDrive drive = DriveAlong(walls, Straight(-8.0, 45.0), sigma);
    for (Scan& scan : drive.scans) {
      for (float& one : scan.ranges) {
        if (one > range) one = 0.0f;
      }
    }
    OpenWayOptions options;
    // Each way by itself is known well enough.
    options.told_sigma = 1.0;
    return FindUncertainLengths(drive.scans, drive.keys, drive.poses,
                                drive.follows, options);
  };
  const UncertainLengths poor = lengths(8.0, 0.1, 3.0);
  EXPECT_TRUE(poor.ways.empty());
  EXPECT_GT(poor.distance_sigma, 0.3);
  EXPECT_LT(poor.distance_sigma, 1.5);
  EXPECT_GT(poor.distance, 20.0);
  EXPECT_LE(poor.distance, OpenWayOptions().most_way);
  // Good odometry is known to be good.
  EXPECT_LT(lengths(8.0, 0.01, 3.0).distance_sigma, 0.6 * poor.distance_sigma);
  // From afar the frames are in sight all the time.
  EXPECT_LT(lengths(8.0, 0.1, 12.0).distance_sigma, 0.6 * poor.distance_sigma);
  // Many of them tell the place everywhere.
  EXPECT_EQ(lengths(2.0, 0.02, 12.0).distance_sigma, 0.0);
}

TEST(FindOpenWaysTest, EndsWhenItIsTold) {
  const SeenDrive drive =
      DriveAlong(RoomAndCorridor(), Straight(-8.0, 70.0), 0.05);
  int asked = 0;
  EXPECT_TRUE(FindOpenWays(drive.scans, drive.keys, drive.poses, drive.follows,
                           {}, [&asked] { return ++asked > 0; })
                  .empty());
  EXPECT_EQ(asked, 1);
}

TEST(FindOpenWaysTest, NumbersMustAgree) {
  EXPECT_THROW(FindOpenWays({}, {0}, {}, {}, {}), Error);
  EXPECT_THROW(FindOpenWays({}, {}, {}, {true}, {}), Error);
  EXPECT_TRUE(FindOpenWays({}, {}, {}, {}, {}).empty());
}

}  // namespace
}  // namespace plumbline
