#include <gtest/gtest.h>
#include <plumbline/frontend/segment_extraction.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <vector>

#include "frontend/synthetic_world.h"

namespace plumbline {
namespace {

using testing::FullCircle;
using testing::Laser;
using testing::MakeScan;
using testing::Noise;
using testing::PointsOf;
using testing::Room;
using testing::WallEnds;

SegmentExtractionOptions SegmentOptions() {
  SegmentExtractionOptions options;
  options.min_points = 6;
  options.min_length = 0.4;
  options.split_distance = 0.06;
  options.bend_distance = 0.01;
  options.bend_window = 5;
  options.bend_sigmas = 2.0;
  options.max_end_sigma = 0.013;
  options.gap = 0.25;
  options.gap_factor = 3.0;
  options.point_sigma = 0.015;
  return options;
}

std::vector<SegmentObservation> Extract(
    const Scan& scan,
    const SegmentExtractionOptions& options = SegmentOptions()) {
  // Returns alone.
  ScanPointsOptions points;
  points.max_beam_step = 1.0;
  return ExtractSegments(PointsOf(scan, points), scan.laser_offset.head<2>(),
                         scan.angle_step, options);
}

// The first beam looks into the corner (-x, -y), so that no wall is cut in two
// by the start of the scan.
Laser FromCorner(const Pose2& robot, const Eigen::Vector2d& corner) {
  Laser laser = FullCircle();
  const Eigen::Vector2d to = corner - robot.head<2>();
  laser.start_angle = std::atan2(to.y(), to.x()) - robot[2] + 1e-4;
  return laser;
}

TEST(SegmentExtractionTest, RoomGivesItsFourWalls) {
  const Pose2 robot(0.5, -0.3, 0.7);
  const Scan scan =
      MakeScan(Room(6.0, 4.0), robot, FromCorner(robot, {-3.0, -2.0}));
  const std::vector<SegmentObservation> segments = Extract(scan);
  ASSERT_EQ(segments.size(), 4u);
  // Counter-clockwise around a robot inside: the laser is on the left.
  const double headings[] = {0.0, 0.5 * kPi, kPi, -0.5 * kPi};
  const double lengths[] = {6.0, 4.0, 6.0, 4.0};
  const double offsets[] = {2.0, 3.0, 2.0, 3.0};
  for (int i = 0; i < 4; ++i) {
    SCOPED_TRACE(i);
    const Pose2 pose = Compose(robot, segments[i].pose);
    EXPECT_NEAR(NormalizeAngle(pose[2] - headings[i]), 0.0, DegToRad(0.2));
    // The origin is to the left of each wall at its distance.
    EXPECT_NEAR(Inverse(pose)[1], offsets[i], 0.02);
    // The middle of the wall, less what the corners take off.
    EXPECT_NEAR(Inverse(pose)[0], 0.0, 0.15);
    EXPECT_GT(segments[i].length, lengths[i] - 0.3);
    EXPECT_LE(segments[i].length, lengths[i] + 1e-3);
    EXPECT_GT(segments[i].points, 50);
  }
}

TEST(SegmentExtractionTest, NoisyRoomGivesFourWalls) {
  const Pose2 robot(0.5, -0.3, 0.7);
  Laser laser = FromCorner(robot, {-3.0, -2.0});
  laser.sigma = 0.005;
  int whole = 0;
  for (int seed = 0; seed < 40; ++seed) {
    SCOPED_TRACE(seed);
    Noise noise(seed);
    const std::vector<SegmentObservation> segments =
        Extract(MakeScan(Room(6.0, 4.0), robot, laser, &noise));
    // Noise at a corner may cut a piece off the end of a wall, rarely.
    if (segments.size() == 4u) ++whole;
    double seen = 0.0;
    for (const SegmentObservation& segment : segments) {
      const double heading = robot[2] + segment.pose[2];
      seen += segment.length;
      if (segment.length < 1.5) continue;
      EXPECT_NEAR(std::remainder(heading, 0.5 * kPi), 0.0, DegToRad(0.5));
    }
    EXPECT_GT(seen, 18.5);
    EXPECT_LT(seen, 20.0);
  }
  EXPECT_GE(whole, 38);
}

TEST(SegmentExtractionTest, LaserOnTheLeftAlsoWhenTheRobotIsOnTheRight) {
  // The wall at x = 0.5 stands between the robot and the laser at x = 1.
  Laser laser = FullCircle();
  laser.offset = Pose2(1.0, 0.0, 0.0);
  const std::vector<SegmentObservation> segments =
      Extract(MakeScan({{{0.5, -1.0}, {0.5, 1.0}}}, Pose2::Zero(), laser));
  // Cut where the scan begins and ends, straight behind the laser.
  ASSERT_EQ(segments.size(), 2u);
  for (const SegmentObservation& segment : segments) {
    EXPECT_NEAR(segment.pose[0], 0.5, 1e-5);
    EXPECT_NEAR(segment.pose[2], -0.5 * kPi, 1e-4);
  }
}

TEST(SegmentExtractionTest, FacesOfAThinWallHaveOppositeDirections) {
  const std::vector<WallEnds> faces = {{{-1.0, 0.05}, {1.0, 0.05}},
                                       {{-1.0, -0.05}, {1.0, -0.05}}};
  const Laser laser = FullCircle();
  const Pose2 above(0.0, 2.0, 0.0);
  const Pose2 below(0.0, -2.0, 0.0);
  const auto from_above = Extract(MakeScan(faces, above, laser));
  const auto from_below = Extract(MakeScan(faces, below, laser));
  ASSERT_EQ(from_above.size(), 1u);
  ASSERT_EQ(from_below.size(), 1u);
  EXPECT_NEAR(from_above[0].pose[2], 0.0, 1e-4);
  EXPECT_NEAR(std::abs(from_below[0].pose[2]), kPi, 1e-4);
  EXPECT_NEAR(Compose(above, from_above[0].pose)[1], 0.05, 1e-5);
  EXPECT_NEAR(Compose(below, from_below[0].pose)[1], -0.05, 1e-5);
}

TEST(SegmentExtractionTest, DoorSplitsAWall) {
  // Open to a room whose far wall is out of range.
  const std::vector<WallEnds> walls = {{{-3.0, 2.0}, {0.0, 2.0}},
                                       {{1.0, 2.0}, {3.0, 2.0}}};
  const std::vector<SegmentObservation> segments =
      Extract(MakeScan(walls, Pose2::Zero(), FullCircle()));
  ASSERT_EQ(segments.size(), 2u);
  // Beams run counter-clockwise: right part first.
  EXPECT_NEAR(segments[0].pose[0], 2.0, 0.1);
  EXPECT_NEAR(segments[0].length, 2.0, 0.2);
  EXPECT_NEAR(segments[1].pose[0], -1.5, 0.1);
  EXPECT_NEAR(segments[1].length, 3.0, 0.2);
  for (const SegmentObservation& segment : segments) {
    EXPECT_NEAR(segment.pose[1], 2.0, 1e-4);
    EXPECT_NEAR(std::abs(segment.pose[2]), kPi, 1e-4);
  }
}

TEST(SegmentExtractionTest, StepInAWallGivesTwoOffsets) {
  const std::vector<WallEnds> walls = {{{2.0, 0.0}, {2.0, 2.0}},
                                       {{2.2, -2.0}, {2.2, 0.0}}};
  const std::vector<SegmentObservation> segments =
      Extract(MakeScan(walls, Pose2::Zero(), FullCircle()));
  ASSERT_EQ(segments.size(), 2u);
  EXPECT_NEAR(segments[0].pose[0], 2.2, 0.01);
  EXPECT_NEAR(segments[1].pose[0], 2.0, 0.01);
}

// A line through a wall and its door would be turned by up to a degree.
TEST(SegmentExtractionTest, DoorSetBackByCentimetresIsAPieceOfItsOwn) {
  const std::vector<WallEnds> walls = {{{-2.0, 2.0}, {1.0, 2.0}},
                                       {{1.0, 2.0}, {1.0, 2.05}},
                                       {{1.0, 2.05}, {1.9, 2.05}}};
  Laser laser = FullCircle();
  for (const double sigma : {0.0, 0.005, 0.01}) {
    laser.sigma = sigma;
    int split = 0;
    for (int seed = 0; seed < 40; ++seed) {
      SCOPED_TRACE(::testing::Message() << sigma << " " << seed);
      Noise noise(seed);
      const std::vector<SegmentObservation> segments =
          Extract(MakeScan(walls, Pose2::Zero(), laser, &noise),
                  SegmentExtractionOptions());
      bool door = false;
      bool wall = false;
      for (const SegmentObservation& segment : segments) {
        // None spans both.
        EXPECT_LT(segment.length, 3.2);
        if (segment.pose[0] > 1.0 && std::abs(segment.pose[1] - 2.05) < 0.015) {
          door = true;
        }
        if (segment.pose[0] < 1.0 && segment.length > 1.0 &&
            std::abs(segment.pose[1] - 2.0) < 0.015) {
          wall = true;
          EXPECT_LT(std::abs(std::remainder(segment.pose[2], kPi)),
                    DegToRad(0.7));
        }
      }
      if (door && wall) ++split;
    }
    EXPECT_GE(split, sigma == 0.0 ? 40 : 36) << sigma;
  }
}

// The bound on bends follows the noise. By default it is tight: a wall seen
// with 1 cm of noise is often cut, but the pieces stay in line, so the map
// takes them for one wall again.
TEST(SegmentExtractionTest, NoiseAloneSeldomSplitsAWall) {
  const std::vector<WallEnds> wall = {{{-2.0, 2.0}, {2.0, 2.0}}};
  Laser laser = FullCircle();
  const auto whole = [&](double sigma,
                         const SegmentExtractionOptions& options) {
    laser.sigma = sigma;
    int count = 0;
    for (int seed = 0; seed < 100; ++seed) {
      Noise noise(seed);
      const std::vector<SegmentObservation> segments =
          Extract(MakeScan(wall, Pose2::Zero(), laser, &noise), options);
      if (segments.size() == 1u) ++count;
      double seen = 0.0;
      for (const SegmentObservation& segment : segments) {
        seen += segment.length;
        EXPECT_NEAR(segment.pose[1], 2.0, 0.025);
        const double angle = std::remainder(segment.pose[2], kPi);
        EXPECT_LT(angle * angle, 16.0 * segment.covariance(1, 1));
      }
      EXPECT_LT(seen, 4.05);
      EXPECT_GT(seen, 2.0);
    }
    return count;
  };
  SegmentExtractionOptions options;
  EXPECT_EQ(whole(0.002, options), 100);
  EXPECT_GE(whole(0.005, options), 80);
  options.bend_sigmas = 3.5;
  EXPECT_GE(whole(0.01, options), 80);
  // Without the noise it would be cut to pieces.
  options.bend_sigmas = 0.0;
  EXPECT_LE(whole(0.01, options), 30);
}

TEST(SegmentExtractionTest, CovarianceIsHonestWithoutBias) {
  // A wall 2 m ahead, seen in a fan of 60 degrees.
  Laser laser;
  laser.start_angle = DegToRad(-30.0);
  laser.angle_step = DegToRad(1.0);
  laser.beams = 61;
  laser.sigma = 0.005;
  SegmentExtractionOptions options = SegmentOptions();
  options.point_sigma = 0.005;
  options.bias_sigma = 0.0;
  options.angle_bias_sigma = 0.0;
  Noise noise(11);
  double sum = 0.0;
  double sum_offset = 0.0;
  double sum_angle = 0.0;
  constexpr int kScans = 200;
  for (int i = 0; i < kScans; ++i) {
    const auto segments = Extract(
        MakeScan({{{2.0, -5.0}, {2.0, 5.0}}}, Pose2::Zero(), laser, &noise),
        options);
    ASSERT_EQ(segments.size(), 1u);
    // The laser is on the left of +y.
    const Eigen::Vector2d error(
        2.0 - segments[0].pose[0],
        NormalizeAngle(segments[0].pose[2] - 0.5 * kPi));
    ASSERT_LT(std::abs(error[1]), DegToRad(5.0));
    const Eigen::Matrix2d& covariance = segments[0].covariance;
    sum += error.dot(covariance.inverse() * error);
    sum_offset += error[0] * error[0] / covariance(0, 0);
    sum_angle += error[1] * error[1] / covariance(1, 1);
  }
  // Mean of chi^2 with 2 and 1 degrees of freedom; 200 draws scatter by 0.14
  // and 0.1. A beam that meets the wall askew scatters less across it than
  // along the beam, so a little less is right.
  EXPECT_GT(sum / kScans, 1.2);
  EXPECT_LT(sum / kScans, 2.5);
  EXPECT_GT(sum_offset / kScans, 0.55);
  EXPECT_LT(sum_offset / kScans, 1.35);
  EXPECT_GT(sum_angle / kScans, 0.55);
  EXPECT_LT(sum_angle / kScans, 1.35);
}

TEST(SegmentExtractionTest, PointsBetweenReturnsAreLeftOut) {
  const Pose2 robot(0.5, -0.3, 0.7);
  Laser laser = FromCorner(robot, {-3.0, -2.0});
  laser.angle_step = DegToRad(2.0);
  laser.beams = 180;
  const Scan scan = MakeScan(Room(6.0, 4.0), robot, laser);
  const std::vector<ScanPoint> filled = PointsOf(scan);
  ASSERT_GT(filled.size(), scan.ranges.size());
  const std::vector<SegmentObservation> segments = ExtractSegments(
      filled, scan.laser_offset.head<2>(), scan.angle_step, SegmentOptions());
  const std::vector<SegmentObservation> expected = Extract(scan);
  ASSERT_EQ(segments.size(), 4u);
  ASSERT_EQ(expected.size(), 4u);
  for (std::size_t i = 0; i < segments.size(); ++i) {
    EXPECT_EQ(segments[i].pose, expected[i].pose);
    EXPECT_EQ(segments[i].points, expected[i].points);
    EXPECT_EQ(segments[i].covariance, expected[i].covariance);
  }
}

TEST(SegmentExtractionTest, BiasBoundsTheCovarianceFromBelow) {
  SegmentExtractionOptions options = SegmentOptions();
  options.bias_sigma = 0.01;
  options.angle_bias_sigma = DegToRad(0.2);
  Laser laser = FullCircle();
  laser.angle_step = DegToRad(0.1);
  laser.beams = 3600;
  const auto segments = Extract(
      MakeScan({{{2.0, -2.0}, {2.0, 2.0}}}, Pose2::Zero(), laser), options);
  ASSERT_EQ(segments.size(), 1u);
  const Eigen::Matrix2d& covariance = segments[0].covariance;
  EXPECT_GE(covariance(0, 0), 1e-4);
  EXPECT_LT(covariance(0, 0), 1.2e-4);
  EXPECT_GE(covariance(1, 1), DegToRad(0.2) * DegToRad(0.2));
  EXPECT_EQ(covariance(0, 1), 0.0);
  EXPECT_EQ(covariance(1, 0), 0.0);
}

TEST(SegmentExtractionTest, RougherWallHasLargerCovariance) {
  Laser smooth;
  smooth.sigma = 0.001;
  Laser rough = smooth;
  rough.sigma = 0.006;
  SegmentExtractionOptions options = SegmentOptions();
  options.point_sigma = 0.001;
  options.bias_sigma = 0.0;
  options.angle_bias_sigma = 0.0;
  const std::vector<WallEnds> wall = {{{2.0, -2.0}, {2.0, 2.0}}};
  Noise noise(3);
  const auto a =
      Extract(MakeScan(wall, Pose2::Zero(), smooth, &noise), options);
  const auto b = Extract(MakeScan(wall, Pose2::Zero(), rough, &noise), options);
  ASSERT_EQ(a.size(), 1u);
  ASSERT_EQ(b.size(), 1u);
  // Six times the noise, less what meets the wall askew.
  EXPECT_GT(b[0].covariance(0, 0), 15.0 * a[0].covariance(0, 0));
  EXPECT_GT(b[0].covariance(1, 1), 15.0 * a[0].covariance(1, 1));
}

TEST(SegmentExtractionTest, NothingFromNothing) {
  EXPECT_TRUE(
      ExtractSegments({}, Eigen::Vector2d::Zero(), 0.01, SegmentOptions())
          .empty());
  EXPECT_TRUE(Extract(MakeScan({}, Pose2::Zero(), FullCircle())).empty());
}

TEST(SegmentExtractionTest, TooFewReturnsAndTooShortGiveNothing) {
  Laser laser;
  laser.start_angle = 0.0;
  laser.angle_step = DegToRad(5.0);
  const std::vector<WallEnds> wall = {{{2.0, -5.0}, {2.0, 5.0}}};
  laser.beams = 5;
  EXPECT_TRUE(Extract(MakeScan(wall, Pose2::Zero(), laser)).empty());
  laser.beams = 7;
  // So few returns leave the ends unsure by 1.3 to 2 cm.
  EXPECT_TRUE(Extract(MakeScan(wall, Pose2::Zero(), laser)).empty());
  SegmentExtractionOptions options = SegmentOptions();
  options.max_end_sigma = 0.02;
  EXPECT_EQ(Extract(MakeScan(wall, Pose2::Zero(), laser), options).size(), 1u);
  options.min_points = 8;
  EXPECT_TRUE(Extract(MakeScan(wall, Pose2::Zero(), laser), options).empty());

  const std::vector<WallEnds> stub = {{{2.0, -0.3}, {2.0, 0.3}}};
  options = SegmentOptions();
  options.min_length = 0.7;
  const Scan scan = MakeScan(stub, Pose2::Zero(), FullCircle());
  EXPECT_TRUE(Extract(scan, options).empty());
  options.min_length = 0.4;
  EXPECT_EQ(Extract(scan, options).size(), 1u);
}

TEST(SegmentExtractionTest, ClutterGivesNothing) {
  Scan scan = MakeScan({}, Pose2::Zero(), FullCircle());
  for (std::size_t i = 0; i < scan.ranges.size(); ++i) {
    scan.ranges[i] = i % 2 == 0 ? 2.0f : 3.0f;
  }
  EXPECT_TRUE(Extract(scan).empty());
}

TEST(SegmentExtractionTest, PointsOnOneSpotAreNoSegment) {
  ScanPoint point;
  point.position = {1.0, 1.0};
  point.normal.setZero();
  point.range = std::sqrt(2.0);
  std::vector<ScanPoint> points;
  for (int i = 0; i < 20; ++i) {
    point.beam = i;
    points.push_back(point);
  }
  EXPECT_TRUE(
      ExtractSegments(points, Eigen::Vector2d::Zero(), 0.01, SegmentOptions())
          .empty());
}

TEST(SegmentExtractionTest, SameResultFarFromTheOrigin) {
  const Pose2 robot(0.5, -0.3, 0.7);
  Laser laser = FromCorner(robot, {-3.0, -2.0});
  laser.sigma = 0.01;
  Noise noise(5);
  const std::vector<ScanPoint> points =
      PointsOf(MakeScan(Room(6.0, 4.0), robot, laser, &noise));
  const Pose2 shift(10000.0, -10000.0, 0.0);
  SegmentExtractionOptions options = SegmentOptions();
  options.bend_sigmas = 5.0;
  const auto here = ExtractSegments(points, Eigen::Vector2d::Zero(),
                                    laser.angle_step, options);
  const auto there =
      ExtractSegments(testing::Transformed(points, shift), shift.head<2>(),
                      laser.angle_step, options);
  ASSERT_EQ(here.size(), 4u);
  ASSERT_EQ(there.size(), 4u);
  for (int i = 0; i < 4; ++i) {
    EXPECT_NEAR((there[i].pose - shift - here[i].pose).norm(), 0.0, 1e-7);
    EXPECT_NEAR(there[i].length, here[i].length, 1e-7);
    EXPECT_NEAR(there[i].covariance(0, 0), here[i].covariance(0, 0), 1e-10);
  }
}

}  // namespace
}  // namespace plumbline
