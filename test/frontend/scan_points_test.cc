#include <gtest/gtest.h>
#include <plumbline/frontend/scan_points.h>

#include <cmath>
#include <limits>
#include <vector>

#include "frontend/synthetic_world.h"

namespace plumbline {
namespace {

using testing::FullCircle;
using testing::Laser;
using testing::MakeScan;
using testing::PointsOf;
using testing::Room;

// A scan of beams 0.1 rad apart from straight ahead on.
Scan Beams(const std::vector<float>& ranges) {
  Scan scan;
  scan.start_angle = 0.0;
  scan.angle_step = 0.1;
  scan.maximum_range = 80.0;
  scan.ranges = ranges;
  return scan;
}

ScanPointsOptions PointOptions() {
  ScanPointsOptions options;
  options.usable_range = 50.0;
  options.minimum_range = 0.1;
  options.gap = 0.15;
  options.gap_factor = 3.0;
  options.normal_radius = 0.25;
  options.normal_tolerance = 0.03;
  // Returns alone.
  options.max_beam_step = 1.0;
  return options;
}

TEST(ScanPointsTest, PointsAndNormalsOfARoomWithLaserOffset) {
  // Neither robot nor laser has a special place.
  const Pose2 robot(0.3, -0.2, 0.4);
  Laser laser = FullCircle();
  laser.offset = Pose2(0.2, 0.1, 0.3);
  const std::vector<ScanPoint> points =
      PointsOf(MakeScan(Room(6.0, 4.0), robot, laser), PointOptions());
  ASSERT_EQ(points.size(), 720u);
  int with_normal = 0;
  for (const ScanPoint& point : points) {
    const Eigen::Vector2d p = TransformPoint(robot, point.position);
    const Eigen::Vector2d n =
        TransformPoint(Pose2(0.0, 0.0, robot[2]), point.normal);
    const double to_x = 3.0 - std::abs(p.x());
    const double to_y = 2.0 - std::abs(p.y());
    ASSERT_NEAR(std::min(to_x, to_y), 0.0, 1e-6);
    EXPECT_NEAR((point.position - Eigen::Vector2d(0.2, 0.1)).norm(),
                point.range, 1e-9);
    if (std::max(to_x, to_y) < 0.3) continue;  // a corner
    Eigen::Vector2d expected(0.0, 0.0);
    if (to_x < to_y) {
      expected.x() = p.x() > 0.0 ? -1.0 : 1.0;
    } else {
      expected.y() = p.y() > 0.0 ? -1.0 : 1.0;
    }
    EXPECT_NEAR((n - expected).norm(), 0.0, 1e-5) << p.transpose();
    ++with_normal;
  }
  EXPECT_GT(with_normal, 600);
}

// Doors are set back by some centimetres to a few decimetres. Along a corridor
// that is seen a few metres far their jambs are all that tells the place.
TEST(ScanPointsTest, JambsSeenByAShortLaserHaveNormalsOfTheirOwn) {
  const std::vector<testing::WallEnds> walls = {
      {{-5.0, -1.0}, {5.0, -1.0}}, {{-5.0, 1.0}, {0.6, 1.0}},
      {{0.6, 1.0}, {0.6, 1.2}},    {{0.6, 1.2}, {1.5, 1.2}},
      {{1.5, 1.2}, {1.5, 1.0}},    {{1.5, 1.0}, {5.0, 1.0}}};
  // Returns on the farther jamb whose normals look along the corridor.
  const auto count = [&](double range, double noise) {
    Laser laser = FullCircle();
    laser.maximum_range = range;
    ScanPointsOptions options;
    options.ScaleToNoise(noise);
    int along = 0;
    for (const ScanPoint& point :
         PointsOf(MakeScan(walls, Pose2::Zero(), laser), options)) {
      if (std::abs(point.position.x() - 1.5) < 1e-6 &&
          point.position.y() > 1.03 && point.position.y() < 1.17 &&
          point.normal.x() < -0.95) {
        ++along;
      }
    }
    return along;
  };
  EXPECT_GE(count(4.0, 1.0), 3);
  EXPECT_EQ(count(30.0, 1.0), 0);
  // Over a decimetre the noise of a poor laser would turn normals anywhere.
  EXPECT_EQ(count(4.0, 2.5), 0);
}

TEST(ScanPointsTest, HandWorkedPositionAndBeam) {
  Scan scan = Beams({0.0f, 2.0f});
  scan.start_angle = 0.0;
  scan.angle_step = 0.5 * kPi;
  scan.laser_offset = Pose2(1.0, 0.5, 0.5 * kPi);
  const std::vector<ScanPoint> points = PointsOf(scan, PointOptions());
  ASSERT_EQ(points.size(), 1u);
  // Beam 1 points to the laser's left, which is the robot's back.
  EXPECT_NEAR(points[0].position.x(), -1.0, 1e-12);
  EXPECT_NEAR(points[0].position.y(), 0.5, 1e-12);
  EXPECT_DOUBLE_EQ(points[0].range, 2.0);
  EXPECT_EQ(points[0].beam, 1);
  EXPECT_EQ(points[0].normal, Eigen::Vector2d::Zero());
}

TEST(ScanPointsTest, SkipsWhatIsNoReturnTooNearOrTooFar) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const std::vector<ScanPoint> points = PointsOf(
      Beams({0.0f, 1.0f, nan, 0.09f, 0.11f, 49.0f, 51.0f, -1.0f, 3.0f}),
      PointOptions());
  ASSERT_EQ(points.size(), 4u);
  EXPECT_EQ(points[0].beam, 1);
  EXPECT_EQ(points[1].beam, 4);
  EXPECT_EQ(points[2].beam, 5);
  EXPECT_EQ(points[3].beam, 8);
}

TEST(ScanPointsTest, EmptyScanEmptiesTheVector) {
  std::vector<ScanPoint> points(3);
  ExtractScanPoints(Scan(), PointOptions(), &points);
  EXPECT_TRUE(points.empty());
  points.resize(2);
  ExtractScanPoints(Beams({0.0f, 0.0f, 0.0f}), PointOptions(), &points);
  EXPECT_TRUE(points.empty());
}

// A wall 1.1 m to the left, which beams meet at every angle down to none.
TEST(ScanPointsTest, GrazedWallHasNormals) {
  const std::vector<testing::WallEnds> wall = {{{-1.0, 1.1}, {60.0, 1.1}}};
  int far = 0;
  for (const ScanPoint& point :
       PointsOf(MakeScan(wall, Pose2::Zero(), Laser()))) {
    const double incidence = std::asin(1.1 / point.range);
    if (incidence < DegToRad(8.2)) continue;
    EXPECT_NEAR((point.normal - Eigen::Vector2d(0.0, -1.0)).norm(), 0.0, 1e-4)
        << RadToDeg(incidence);
    if (point.position.x() > 5.0) ++far;
  }
  EXPECT_GE(far, 4);
}

TEST(ScanPointsTest, NoNormalAtACorner) {
  const std::vector<ScanPoint> points = PointsOf(
      MakeScan(Room(4.0, 4.0), Pose2::Zero(), FullCircle()), PointOptions());
  int corners = 0;
  for (const ScanPoint& point : points) {
    const Eigen::Vector2d to_wall =
        Eigen::Vector2d(2.0, 2.0) - point.position.cwiseAbs();
    if (to_wall.maxCoeff() > 0.03) continue;
    EXPECT_EQ(point.normal, Eigen::Vector2d::Zero())
        << point.position.transpose();
    ++corners;
  }
  EXPECT_GE(corners, 4);
}

TEST(ScanPointsTest, NoNormalOnClutter) {
  // Ranges jump by half a metre from beam to beam.
  std::vector<float> ranges;
  for (int i = 0; i < 60; ++i) ranges.push_back(i % 2 == 0 ? 1.0f : 1.6f);
  Scan scan = Beams(ranges);
  scan.angle_step = DegToRad(1.0);
  for (const ScanPoint& point : PointsOf(scan, PointOptions())) {
    EXPECT_EQ(point.normal, Eigen::Vector2d::Zero());
  }
}

TEST(ScanPointsTest, NoNormalFromOneOrTwoReturns) {
  Scan scan = Beams({2.0f, 2.0f});
  scan.angle_step = DegToRad(1.0);
  for (const ScanPoint& point : PointsOf(scan, PointOptions())) {
    EXPECT_EQ(point.normal, Eigen::Vector2d::Zero());
  }
  scan.ranges = {2.0f, 2.0f, 2.0f};
  for (const ScanPoint& point : PointsOf(scan, PointOptions())) {
    EXPECT_NEAR(point.normal.norm(), 1.0, 1e-12);
  }
}

TEST(ScanPointsTest, NormalsOfOneSurfaceDoNotBendAtAStep) {
  // Two walls across the view at x = 2 (left) and x = 2.6 (right).
  const std::vector<testing::WallEnds> walls = {{{2.0, 0.0}, {2.0, 3.0}},
                                                {{2.6, -3.0}, {2.6, 0.0}}};
  int seen = 0;
  for (const ScanPoint& point :
       PointsOf(MakeScan(walls, Pose2(0.0, 0.01, 0.0), FullCircle()),
                PointOptions())) {
    ASSERT_NEAR((point.normal - Eigen::Vector2d(-1.0, 0.0)).norm(), 0.0, 1e-4);
    ++seen;
  }
  EXPECT_GT(seen, 100);
}

TEST(ScanPointsTest, NormalTurnsTowardsTheLaserAndNotTheRobot) {
  // The wall at x = 0.5 stands between the robot and the laser at x = 1.
  Laser laser = FullCircle();
  laser.offset = Pose2(1.0, 0.0, 0.0);
  const std::vector<ScanPoint> points =
      PointsOf(MakeScan({{{0.5, -1.0}, {0.5, 1.0}}}, Pose2::Zero(), laser),
               PointOptions());
  ASSERT_GT(points.size(), 50u);
  for (const ScanPoint& point : points) {
    EXPECT_NEAR((point.normal - Eigen::Vector2d(1.0, 0.0)).norm(), 0.0, 1e-5);
  }
}

TEST(ScanPointsTest, LaserUpsideDownSeesTheSameNormals) {
  Laser laser = FullCircle();
  laser.start_angle = kPi;
  laser.angle_step = -laser.angle_step;
  const std::vector<ScanPoint> points =
      PointsOf(MakeScan({{{-3.0, 2.0}, {3.0, 2.0}}}, Pose2::Zero(), laser),
               PointOptions());
  ASSERT_GT(points.size(), 100u);
  for (const ScanPoint& point : points) {
    EXPECT_NEAR(point.position.y(), 2.0, 1e-6);
    EXPECT_NEAR((point.normal - Eigen::Vector2d(0.0, -1.0)).norm(), 0.0, 1e-5);
  }
}

TEST(ScanPointsTest, OneLostBeamDoesNotCostItsNeighboursTheirNormals) {
  Scan scan =
      MakeScan({{{2.0, -2.0}, {2.0, 2.0}}}, Pose2::Zero(), FullCircle());
  // Straight ahead.
  ASSERT_GT(scan.ranges[360], 0.0f);
  scan.ranges[360] = 0.0f;
  for (const ScanPoint& point : PointsOf(scan, PointOptions())) {
    EXPECT_NEAR(point.normal.norm(), 1.0, 1e-12) << point.beam;
  }
}

std::vector<int> Clutter(const std::vector<float>& ranges) {
  Scan scan = Beams(ranges);
  scan.angle_step = DegToRad(2.0);
  std::vector<ScanPoint> points;
  ExtractScanPoints(scan, PointOptions(), &points);
  std::vector<bool> clutter;
  const int marked = MarkClutter(scan, points, ClutterOptions(), &clutter);
  EXPECT_EQ(clutter.size(), points.size());
  std::vector<int> beams;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (clutter[i]) beams.push_back(points[i].beam);
  }
  EXPECT_EQ(marked, static_cast<int>(beams.size()));
  return beams;
}

TEST(ClutterTest, StandsFreeOnBothSides) {
  EXPECT_EQ(Clutter({3, 3, 3, 1, 1, 1, 3, 3, 3}), (std::vector<int>{3, 4, 5}));
  // The end of the field of view, and beams without a return, hide nothing.
  EXPECT_EQ(Clutter({1, 1, 3, 3, 3, 3}), (std::vector<int>{0, 1}));
  EXPECT_EQ(Clutter({3, 3, 3, 3, 3, 3, 3, 3, 0, 0, 0, 0, 1, 1, 3, 3}),
            (std::vector<int>{12, 13}));
  // A corner that stands out, a niche, a step of a wall.
  EXPECT_TRUE(Clutter({3, 3, 3, 3, 2, 2, 2, 1, 1, 1}).size() == 3);
  EXPECT_TRUE(
      Clutter({1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 3, 3,
               3, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1})
          .empty());
}

TEST(ClutterTest, OneBehindTheOther) {
  // The one in front hides nothing of the other's being free.
  EXPECT_EQ(Clutter({3, 3, 2, 2, 1, 1, 3, 3}), (std::vector<int>{2, 3, 4, 5}));
}

TEST(ClutterTest, NeitherWideNorFar) {
  // 0.1 m a beam at 3 m.
  EXPECT_TRUE(Clutter({9, 9, 3, 3, 3, 3, 3, 3, 3, 9, 9}).empty());
  EXPECT_TRUE(Clutter({9, 9, 5, 5, 9, 9}).empty());
  EXPECT_TRUE(Clutter({}).empty());
}

// A laser of so many degrees a beam, all around.
Laser Coarse(int degrees) {
  Laser laser = FullCircle();
  laser.angle_step = DegToRad(degrees);
  laser.beams = 360 / degrees;
  return laser;
}

TEST(ScanPointsTest, FewBeamsHavePointsBetweenThem) {
  const Pose2 robot(0.3, -0.2, 0.4);
  for (const int degrees : {2, 3, 4}) {
    Laser laser = Coarse(degrees);
    laser.offset = Pose2(0.2, 0.1, 0.3);
    const Scan scan = MakeScan(Room(6.0, 4.0), robot, laser);
    const std::vector<ScanPoint> points = PointsOf(scan, {});
    std::vector<ScanPoint> returns;
    int between = 0;
    for (const ScanPoint& point : points) {
      if (!point.is_between) {
        returns.push_back(point);
        continue;
      }
      ++between;
      const Eigen::Vector2d p = TransformPoint(robot, point.position);
      // On a wall, or cutting a corner by less than two beams have between
      // them.
      EXPECT_LT(std::min(3.0 - std::abs(p.x()), 2.0 - std::abs(p.y())),
                0.5 * DegToRad(degrees) * point.range);
      EXPECT_NEAR((point.position - Eigen::Vector2d(0.2, 0.1)).norm(),
                  point.range, 1e-9);
    }
    // The returns are what they are without, but for normals.
    const std::vector<ScanPoint> alone = PointsOf(scan, PointOptions());
    ASSERT_EQ(returns.size(), alone.size());
    for (std::size_t i = 0; i < alone.size(); ++i) {
      EXPECT_EQ(returns[i].position, alone[i].position);
      EXPECT_EQ(returns[i].beam, alone[i].beam);
      if (i > 0) {
        EXPECT_EQ(returns[i].beam, returns[i - 1].beam + 1);
      }
    }
    // As many between each two as a laser of a degree would have.
    EXPECT_EQ(between, (laser.beams - 1) * (degrees - 1)) << degrees;
  }
}

TEST(ScanPointsTest, FineBeamsHaveNone) {
  Laser laser = FullCircle();
  laser.angle_step = DegToRad(1.0);
  laser.beams = 360;
  for (const ScanPoint& point :
       PointsOf(MakeScan(Room(6.0, 4.0), Pose2(0.0, 0.0, 0.0), laser), {})) {
    EXPECT_FALSE(point.is_between);
  }
}

TEST(ScanPointsTest, NothingBetweenSurfacesOrWhereABeamHasNoReturn) {
  // Two surfaces of three beams each, the second with a hole.
  Scan scan = Beams({2.0f, 2.0f, 2.0f, 5.0f, 5.0f, 0.0f, 5.0f});
  scan.angle_step = DegToRad(2.0);
  const std::vector<ScanPoint> points = PointsOf(scan, {});
  std::vector<int> before;
  for (const ScanPoint& point : points) {
    if (point.is_between) before.push_back(point.beam);
  }
  EXPECT_EQ(before, std::vector<int>({0, 1, 3}));
}

TEST(ScanPointsTest, WhatIsBetweenInBeamsThatGoClockwise) {
  Laser laser = Coarse(2);
  laser.start_angle = kPi;
  laser.angle_step = -laser.angle_step;
  const std::vector<ScanPoint> points =
      PointsOf(MakeScan(Room(6.0, 4.0), Pose2(0.5, 0.5, 0.1), laser), {});
  EXPECT_EQ(points.size(), 359u);
  for (std::size_t i = 1; i + 1 < points.size(); ++i) {
    if (!points[i].is_between) continue;
    // Between its neighbours.
    EXPECT_LT((points[i - 1].position - points[i].position)
                  .dot(points[i + 1].position - points[i].position),
              0.0);
  }
}

}  // namespace
}  // namespace plumbline
