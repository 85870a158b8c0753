#include <gtest/gtest.h>
#include <plumbline/frontend/carmen_reader.h>
#include <plumbline/frontend/odometry_refinement.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include "frontend/synthetic_world.h"

namespace plumbline {
namespace {

using testing::Corridor;
using testing::FullCircle;
using testing::HeadingError;
using testing::Laser;
using testing::MakeScan;
using testing::Noise;
using testing::PositionError;
using testing::Room;
using testing::WallEnds;

OdometryRefinementOptions RefinerOptions() {
  OdometryRefinementOptions options;
  options.key_distance = 0.3;
  options.key_rotation = 0.15;
  options.window = 12;
  return options;
}

// A room of 10 m x 8 m with a pillar.
std::vector<WallEnds> Hall() {
  std::vector<WallEnds> walls = Room(10.0, 8.0);
  for (const WallEnds& side : testing::Moved(Room(0.8, 0.8), {1.0, 0.5, 0.0})) {
    walls.push_back(side);
  }
  return walls;
}

// Walls of pillars, none like another, on both sides of the x axis in a hall of
// 20 m by 6 m with its middle at the origin: those with their middles beyond
// `least_x`.
std::vector<WallEnds> Pillars(double least_x) {
  std::vector<WallEnds> walls;
  Noise layout(3);
  for (double x = -8.5; x < 9.0;
       x += 1.8 + 0.6 * std::abs(layout.Normal(1.0))) {
    const double y = layout.Normal(1.0) > 0.0 ? 1.7 : -1.7;
    const Pose2 place(x, y + 0.2 * layout.Normal(1.0),
                      0.5 * layout.Normal(1.0));
    const double width = 0.4 + 0.3 * std::abs(layout.Normal(1.0));
    const double depth = 0.4 + 0.3 * std::abs(layout.Normal(1.0));
    if (x <= least_x) continue;
    for (const WallEnds& side : testing::Moved(Room(width, depth), place)) {
      walls.push_back(side);
    }
  }
  return walls;
}

// The hall with two niches, so that it looks like itself from one place alone.
std::vector<WallEnds> PlainHall() {
  std::vector<WallEnds> walls = Hall();
  for (const WallEnds& side :
       testing::Moved(Room(1.0, 2.0), {-4.5, 3.0, 0.0})) {
    walls.push_back(side);
  }
  for (const WallEnds& side :
       testing::Moved(Room(2.5, 0.6), {3.0, -3.7, 0.0})) {
    walls.push_back(side);
  }
  return walls;
}

// Drives along relative motions; odometry reports `reported` in their place.
struct Drive {
  std::vector<Pose2> truth;
  std::vector<Pose2> odometry;
};

Drive Along(const Pose2& start, const std::vector<Pose2>& motions,
            const std::vector<Pose2>& reported) {
  Drive drive;
  drive.truth.push_back(start);
  drive.odometry.push_back(start);
  for (std::size_t i = 0; i < motions.size(); ++i) {
    drive.truth.push_back(Compose(drive.truth.back(), motions[i]));
    drive.odometry.push_back(Compose(drive.odometry.back(), reported[i]));
  }
  return drive;
}

std::vector<RefinedScan> Refine(const std::vector<WallEnds>& walls,
                                const Drive& drive, const Laser& laser,
                                const OdometryRefinementOptions& options,
                                Noise* noise = nullptr) {
  OdometryRefiner refiner(options);
  std::vector<RefinedScan> refined;
  for (std::size_t i = 0; i < drive.truth.size(); ++i) {
    Scan scan = MakeScan(walls, drive.truth[i], laser, noise);
    scan.odometry = drive.odometry[i];
    refined.push_back(refiner.Process(scan));
  }
  return refined;
}

TEST(OdometryCovarianceTest, HandWorked) {
  OdometryNoise noise;
  noise.translation = 0.01;
  noise.translation_per_metre = 0.1;
  noise.translation_per_radian = 0.05;
  noise.rotation = 0.02;
  noise.rotation_per_metre = 0.03;
  noise.rotation_per_radian = 0.4;
  const Eigen::Matrix3d covariance =
      OdometryCovariance(Pose2(3.0, -4.0, -0.5), noise);
  // 0.01 + 5 x 0.1 + 0.5 x 0.05 and 0.02 + 5 x 0.03 + 0.5 x 0.4.
  const Eigen::Vector3d sigmas(0.535, 0.535, 0.37);
  EXPECT_NEAR((covariance -
               Eigen::Matrix3d(sigmas.array().square().matrix().asDiagonal()))
                  .norm(),
              0.0, 1e-12);
  // A turn by more than a half turn is one the other way.
  EXPECT_NEAR(std::sqrt(OdometryCovariance(Pose2(0.0, 0.0, 2.0 * kPi - 0.5),
                                           noise)(2, 2)),
              0.22, 1e-12);
}

TEST(OdometryRefinerTest, FirstScanIsAKeyWhereOdometryStarts) {
  OdometryRefiner refiner(RefinerOptions());
  Scan scan = MakeScan(Hall(), Pose2::Zero(), FullCircle());
  scan.odometry = Pose2(5.0, -3.0, 2.0);
  const RefinedScan refined = refiner.Process(scan);
  EXPECT_TRUE(refined.is_key);
  EXPECT_EQ(refined.pose, Pose2(5.0, -3.0, 2.0));
  EXPECT_EQ(refined.since_key.mean, Pose2::Zero());
  EXPECT_EQ(refined.since_key.covariance, Eigen::Matrix3d::Zero());
  EXPECT_EQ(refiner.points().size(), 720u);
}

TEST(OdometryRefinerTest, CorrectsWrongTurns) {
  // Around in a square of 3 m; in each corner odometry turns 30 degrees too
  // far, spread over nine scans.
  std::vector<Pose2> motions;
  std::vector<Pose2> reported;
  for (int side = 0; side < 4; ++side) {
    for (int i = 0; i < 15; ++i) {
      motions.emplace_back(0.2, 0.0, 0.0);
      reported.emplace_back(0.21, 0.0, DegToRad(0.4));
    }
    for (int i = 0; i < 9; ++i) {
      motions.emplace_back(0.0, 0.0, DegToRad(10.0));
      reported.emplace_back(0.0, 0.0, DegToRad(10.0 + 30.0 / 9.0));
    }
  }
  const Drive drive = Along(Pose2(-3.0, -2.5, 0.0), motions, reported);
  Laser laser = FullCircle();
  laser.sigma = 0.01;
  Noise noise(1);
  const std::vector<RefinedScan> refined =
      Refine(Hall(), drive, laser, RefinerOptions(), &noise);
  ASSERT_GT(HeadingError(drive.odometry.back(), drive.truth.back()),
            DegToRad(90.0));
  for (std::size_t i = 0; i < refined.size(); ++i) {
    ASSERT_LT(PositionError(refined[i].pose, drive.truth[i]), 0.08) << i;
    ASSERT_LT(HeadingError(refined[i].pose, drive.truth[i]), DegToRad(1.0))
        << i;
    EXPECT_FALSE(refined[i].odometry_only) << i;
  }
}

TEST(OdometryRefinerTest, CorrectsOneWrongTurnBetweenTwoScans) {
  for (double wrong : {30.0, -30.0}) {
    SCOPED_TRACE(wrong);
    std::vector<Pose2> motions(10, Pose2(0.1, 0.0, 0.0));
    std::vector<Pose2> reported = motions;
    motions[5] = Pose2(0.1, 0.0, DegToRad(40.0));
    reported[5] = Pose2(0.1, 0.0, DegToRad(40.0 + wrong));
    const Drive drive = Along(Pose2(-3.0, -2.5, 0.0), motions, reported);
    OdometryRefiner refiner(RefinerOptions());
    RefinedScan refined;
    for (std::size_t i = 0; i < drive.truth.size(); ++i) {
      Scan scan = MakeScan(Hall(), drive.truth[i], FullCircle());
      scan.odometry = drive.odometry[i];
      refined = refiner.Process(scan);
    }
    EXPECT_LT(PositionError(refined.pose, drive.truth.back()), 0.03);
    EXPECT_LT(HeadingError(refined.pose, drive.truth.back()), DegToRad(0.5));
    EXPECT_GE(refiner.wide_searches(), 1);
    EXPECT_EQ(refiner.refusals(), 0);
  }
}

TEST(OdometryRefinerTest, KeepsOdometryAlongAFeaturelessCorridor) {
  // Odometry bends by 2 degrees a metre but measures the way right.
  const std::vector<Pose2> motions(100, Pose2(0.1, 0.0, 0.0));
  const std::vector<Pose2> reported(100, Pose2(0.1, 0.0, DegToRad(0.2)));
  const Drive drive = Along(Pose2::Zero(), motions, reported);
  Laser laser = FullCircle();
  laser.maximum_range = 8.0;
  laser.sigma = 0.01;
  Noise noise(2);
  const std::vector<RefinedScan> refined =
      Refine(Corridor(), drive, laser, RefinerOptions(), &noise);
  EXPECT_GT(HeadingError(drive.odometry.back(), drive.truth.back()),
            DegToRad(19.0));
  EXPECT_NEAR(refined.back().pose[0], 10.0, 0.3);
  EXPECT_NEAR(refined.back().pose[1], 0.0, 0.05);
  EXPECT_LT(HeadingError(refined.back().pose, drive.truth.back()),
            DegToRad(1.0));
  for (std::size_t i = 1; i < refined.size(); ++i) {
    const Eigen::Matrix3d& covariance = refined[i].since_key.covariance;
    EXPECT_GT(covariance(0, 0), 4.0 * covariance(1, 1)) << i;
  }
}

TEST(OdometryRefinerTest, WhatAHallTellsOfOdometryHoldsInACorridor) {
  // Odometry has every metre 4 % too long. Two rounds in a hall show it; the
  // corridor that follows does not.
  std::vector<WallEnds> walls = {
      {{-5.0, -4.0}, {5.0, -4.0}}, {{-5.0, 4.0}, {5.0, 4.0}},
      {{-5.0, -4.0}, {-5.0, 4.0}}, {{5.0, -4.0}, {5.0, -1.0}},
      {{5.0, 1.0}, {5.0, 4.0}},    {{5.0, -1.0}, {200.0, -1.0}},
      {{5.0, 1.0}, {200.0, 1.0}}};
  std::vector<Pose2> motions;
  for (int side = 0; side < 8; ++side) {
    for (int i = 0; i < 30; ++i) motions.emplace_back(0.1, 0.0, 0.0);
    for (int i = 0; i < 9; ++i) motions.emplace_back(0.0, 0.0, DegToRad(10.0));
  }
  for (int i = 0; i < 200; ++i) motions.emplace_back(0.1, 0.0, 0.0);
  std::vector<Pose2> reported;
  for (const Pose2& motion : motions) {
    reported.emplace_back(1.04 * motion[0], 0.0, motion[2]);
  }
  const Drive drive = Along(Pose2::Zero(), motions, reported);
  Laser laser = FullCircle();
  laser.maximum_range = 6.0;
  laser.sigma = 0.01;
  Noise noise(3);
  const std::vector<RefinedScan> refined =
      Refine(walls, drive, laser, RefinerOptions(), &noise);
  EXPECT_GT(PositionError(drive.odometry.back(), drive.truth.back()), 0.75);
  EXPECT_LT(PositionError(refined.back().pose, drive.truth.back()), 0.15);
}

TEST(OdometryRefinerTest, CovarianceIsInTheAxesOfTheKeyScan) {
  // The corridor runs along +y of the map, the robot looks along it: what is
  // unknown is still its own x.
  const Pose2 turn(3.0, 5.0, 0.5 * kPi);
  const std::vector<Pose2> motions(10, Pose2(0.1, 0.0, 0.0));
  Laser laser = FullCircle();
  laser.maximum_range = 8.0;
  const std::vector<RefinedScan> refined =
      Refine(testing::Moved(Corridor(), turn), Along(turn, motions, motions),
             laser, RefinerOptions());
  for (std::size_t i = 1; i < refined.size(); ++i) {
    const Eigen::Matrix3d& covariance = refined[i].since_key.covariance;
    EXPECT_GT(covariance(0, 0), 4.0 * covariance(1, 1)) << i;
  }
}

TEST(OdometryRefinerTest, CovarianceGrowsAlongACorridor) {
  // What the walls leave open is as uncertain as all the odometry since the
  // key scan together, however many scans have been matched on the way.
  const Pose2 step(0.03, 0.0, 0.0);
  const std::vector<Pose2> motions(9, step);
  Laser laser = FullCircle();
  laser.maximum_range = 8.0;
  const OdometryRefinementOptions options = RefinerOptions();
  const std::vector<RefinedScan> refined = Refine(
      Corridor(), Along(Pose2::Zero(), motions, motions), laser, options);
  UncertainPose2 odometry;
  double before = 0.0;
  for (std::size_t i = 1; i < refined.size(); ++i) {
    SCOPED_TRACE(i);
    ASSERT_FALSE(refined[i].is_key);
    ASSERT_FALSE(refined[i].odometry_only);
    odometry =
        Compose(odometry, {step, OdometryCovariance(step, options.noise)});
    const double along = refined[i].since_key.covariance(0, 0);
    EXPECT_GT(along, before);
    EXPECT_GT(along, 0.5 * odometry.covariance(0, 0));
    EXPECT_LT(along, 2.0 * odometry.covariance(0, 0));
    before = along;
  }
  // Across and in heading the walls speak.
  const Eigen::Matrix3d& last = refined.back().since_key.covariance;
  EXPECT_LT(last(1, 1), 0.2 * odometry.covariance(1, 1));
  EXPECT_LT(last(2, 2), 0.2 * odometry.covariance(2, 2));
}

TEST(OdometryRefinerTest, BackwardsGivenAsForwards) {
  // Some robots' odometry has no sign: each step is 0.8 m wrong.
  const std::vector<Pose2> motions(10, Pose2(-0.4, 0.0, 0.0));
  const std::vector<Pose2> reported(10, Pose2(0.4, 0.0, 0.0));
  const Drive drive = Along(Pose2(3.0, -2.0, 0.2), motions, reported);
  OdometryRefinementOptions options = RefinerOptions();
  options.search_translation = 0.1;
  const std::vector<RefinedScan> refined =
      Refine(Hall(), drive, FullCircle(), options);
  for (std::size_t i = 0; i < refined.size(); ++i) {
    EXPECT_LT(PositionError(refined[i].pose, drive.truth[i]), 0.05) << i;
    EXPECT_LT(HeadingError(refined[i].pose, drive.truth[i]), DegToRad(0.5))
        << i;
  }
}

// A search as wide as the jump would not end, and no robot leaps: it goes on
// as it went.
TEST(OdometryRefinerTest, OdometryThatJumps) {
  for (const double jump : {1.0, 50.0, 1e6, 1e9}) {
    SCOPED_TRACE(jump);
    std::vector<Pose2> motions(12, Pose2(0.1, 0.0, 0.0));
    std::vector<Pose2> reported = motions;
    reported[5] = Pose2(jump, -jump, 0.5);
    const Drive drive = Along(Pose2(-2.0, -1.5, 0.2), motions, reported);
    const std::vector<RefinedScan> refined =
        Refine(Hall(), drive, FullCircle(), RefinerOptions());
    for (std::size_t i = 0; i < refined.size(); ++i) {
      EXPECT_FALSE(refined[i].odometry_only) << i;
      EXPECT_LT(PositionError(refined[i].pose, drive.truth[i]), 0.05) << i;
      EXPECT_TRUE(refined[i].since_key.covariance.allFinite());
    }
  }
}

// Where it goes on there is nothing of what it sees: it was carried.
TEST(OdometryRefinerTest, OdometryThatJumpsToAnotherPlace) {
  std::vector<Pose2> motions(12, Pose2(0.1, 0.0, 0.0));
  motions[5] = Pose2(0.0, 60.0, 0.0);
  std::vector<WallEnds> walls = Hall();
  for (const WallEnds& wall :
       testing::Moved(PlainHall(), {-1.0, 58.0, DegToRad(20.0)})) {
    walls.push_back(wall);
  }
  const std::vector<RefinedScan> refined =
      Refine(walls, Along(Pose2(-2.0, -1.5, 0.0), motions, motions),
             FullCircle(), RefinerOptions());
  EXPECT_FALSE(refined[5].odometry_only);
  EXPECT_TRUE(refined[6].odometry_only);
  EXPECT_TRUE(refined[6].is_key);
  EXPECT_FALSE(refined[8].odometry_only);
}

// A corridor with a niche every 6 m.
std::vector<WallEnds> NichedCorridor(double depth = 0.5) {
  std::vector<WallEnds> walls = {{{-200.0, 1.0}, {200.0, 1.0}}};
  for (double x = -60.0; x < 60.0; x += 6.0) {
    walls.push_back({{x, -1.0}, {x + 5.0, -1.0}});
    walls.push_back({{x + 5.0, -1.0}, {x + 5.0, -1.0 - depth}});
    walls.push_back({{x + 5.0, -1.0 - depth}, {x + 6.0, -1.0 - depth}});
    walls.push_back({{x + 6.0, -1.0 - depth}, {x + 6.0, -1.0}});
  }
  return walls;
}

// Drives along the corridor; the errors of all scans, m.
std::vector<double> ErrorsAlong(const std::vector<WallEnds>& walls,
                                const std::vector<Pose2>& motions,
                                const std::vector<Pose2>& reported) {
  Laser laser = FullCircle();
  laser.maximum_range = 5.0;
  laser.sigma = 0.01;
  Noise noise(5);
  const Drive drive = Along(Pose2::Zero(), motions, reported);
  OdometryRefiner refiner(RefinerOptions());
  std::vector<double> errors;
  for (std::size_t i = 0; i < drive.truth.size(); ++i) {
    Scan scan = MakeScan(walls, drive.truth[i], laser, &noise);
    scan.odometry = drive.odometry[i];
    scan.timestamp = 100.0 + 0.2 * static_cast<double>(i);
    errors.push_back(PositionError(refiner.Process(scan).pose, drive.truth[i]));
  }
  return errors;
}

// The wheels' cable is out for 40 scans.
TEST(OdometryRefinerTest, OdometryThatStandsStillWhileTheRobotGoes) {
  const std::vector<Pose2> motions(120, Pose2(0.1, 0.0, 0.0));
  std::vector<Pose2> reported = motions;
  std::fill_n(reported.begin() + 40, 40, Pose2::Zero());
  const std::vector<double> errors =
      ErrorsAlong(NichedCorridor(), motions, reported);
  EXPECT_LT(errors.back(), 0.2);
}

// A slow robot has gone by little more than the noise when odometry stops, and
// shallow niches show little of it in any one scan; deep ones show all.
TEST(OdometryRefinerTest, OdometryThatStandsStillWhileASlowRobotGoes) {
  for (const double depth : {0.08, 0.5}) {
    for (const double step : {0.04, 0.06}) {
      const std::vector<Pose2> motions(120, Pose2(step, 0.0, 0.0));
      std::vector<Pose2> reported = motions;
      std::fill_n(reported.begin() + 60, 40, Pose2::Zero());
      const std::vector<double> errors =
          ErrorsAlong(NichedCorridor(depth), motions, reported);
      EXPECT_LT(errors.back(), 0.1) << depth << " m deep, " << step << " m";
    }
  }
}

// Nothing tells that the robot has stopped but odometry.
TEST(OdometryRefinerTest, ARobotThatStopsAtOnceInABareCorridor) {
  std::vector<Pose2> motions(120, Pose2(0.1, 0.0, 0.0));
  std::fill_n(motions.begin() + 40, 40, Pose2::Zero());
  const std::vector<double> errors = ErrorsAlong(Corridor(), motions, motions);
  EXPECT_LT(*std::max_element(errors.begin(), errors.end()), 0.1);
}

// Or that it has not: how far it may have gone is in the covariance.
TEST(OdometryRefinerTest, InABareCorridorItMayHaveGoneOn) {
  std::vector<Pose2> motions(80, Pose2(0.1, 0.0, 0.0));
  std::fill_n(motions.begin() + 40, 6, Pose2::Zero());
  Laser laser = FullCircle();
  laser.maximum_range = 5.0;
  const std::vector<RefinedScan> refined =
      Refine(Corridor(), Along(Pose2::Zero(), motions, motions), laser,
             RefinerOptions());
  // The next key scan after it went on.
  std::size_t next = 47;
  while (!refined[next].is_key) ++next;
  const Eigen::Matrix3d& covariance = refined[next].since_key.covariance;
  EXPECT_GT(std::sqrt(covariance(0, 0)), 0.4);
  EXPECT_LT(std::sqrt(covariance(0, 0)), 0.8);
  EXPECT_LT(std::sqrt(covariance(1, 1)), 0.1);
  EXPECT_LT(std::sqrt(covariance(2, 2)), DegToRad(2.0));
  // That of the one after it is as usual.
  do ++next;
  while (!refined[next].is_key);
  EXPECT_LT(std::sqrt(refined[next].since_key.covariance(0, 0)), 0.2);
}

// The same message comes again, and the next one has all of the way.
TEST(OdometryRefinerTest, OdometryThatIsLateNowAndThen) {
  const std::vector<Pose2> motions(200, Pose2(0.1, 0.0, 0.0));
  std::vector<Pose2> reported = motions;
  for (std::size_t i = 20; i + 3 < reported.size(); i += 10) {
    const int late = i % 20 == 0 ? 1 : 2;
    std::fill_n(reported.begin() + i, late, Pose2::Zero());
    reported[i + late] = Pose2(0.1 * (late + 1), 0.0, 0.0);
  }
  for (const auto& walls : {NichedCorridor(), Corridor()}) {
    const std::vector<double> errors = ErrorsAlong(walls, motions, reported);
    EXPECT_LT(errors.back(), 0.15);
  }
}

// It begins late, and has all of the way in one step, which is no speed of the
// robot's.
TEST(OdometryRefinerTest, OdometryThatCatchesUpInABareCorridor) {
  for (const int late : {5, 10, 15, 16, 17, 18, 19}) {
    const std::vector<Pose2> motions(60, Pose2(0.2, 0.0, 0.0));
    std::vector<Pose2> reported = motions;
    std::fill_n(reported.begin(), late, Pose2::Zero());
    reported[static_cast<std::size_t>(late)] =
        Pose2(0.2 * (late + 1), 0.0, 0.0);
    const std::vector<double> errors =
        ErrorsAlong(Corridor(), motions, reported);
    EXPECT_LT(errors.back(), 0.5) << late << " scans late";
  }
}

// Odometry need not begin at zero.
TEST(OdometryRefinerTest, StandsAtFirstAwayFromTheOrigin) {
  std::vector<WallEnds> walls = Room(20.0, 6.0);
  for (const WallEnds& side : Pillars(-10.0)) walls.push_back(side);
  const Pose2 start(10.0, 5.0, 0.7);
  Laser laser = FullCircle();
  laser.sigma = 0.01;
  for (std::size_t still = 1; still <= 12; ++still) {
    std::vector<Pose2> motions(still + 30, Pose2(0.1, 0.0, 0.0));
    std::fill_n(motions.begin(), still, Pose2::Zero());
    Drive drive = Along(Pose2(-9.0, 0.0, 0.0), motions, motions);
    for (Pose2& pose : drive.odometry) {
      pose = Compose(start, Between(drive.truth.front(), pose));
    }
    Noise noise(8);
    const std::vector<RefinedScan> refined =
        Refine(walls, drive, laser, OdometryRefinementOptions(), &noise);
    for (std::size_t i = 0; i < refined.size(); ++i) {
      ASSERT_LT(PositionError(refined[i].pose, drive.odometry[i]), 0.1)
          << still << " scans still, scan " << i;
    }
  }
}

// Where no return tells how far it went.
TEST(OdometryRefinerTest, OdometryThatJumpsInABareCorridor) {
  const std::vector<Pose2> motions(60, Pose2(0.1, 0.0, 0.0));
  std::vector<Pose2> reported = motions;
  reported[20] = Pose2(-0.9, 0.4, DegToRad(40.0));
  reported[40] = Pose2(1.0, 0.2, DegToRad(-40.0));
  const std::vector<double> errors = ErrorsAlong(Corridor(), motions, reported);
  EXPECT_LT(*std::max_element(errors.begin(), errors.end()), 0.1);
}

// Two scans of another moment among those of a slow drive: the robot does not
// leap ahead and back.
TEST(OdometryRefinerTest, ScansOfAnotherTimeAreNotFollowed) {
  const Drive drive = Along(Pose2(-3.0, -2.5, 0.3),
                            std::vector<Pose2>(30, Pose2(0.02, 0.0, 0.01)),
                            std::vector<Pose2>(30, Pose2(0.02, 0.0, 0.01)));
  const Pose2 ahead(0.5, 0.1, 0.1);
  const auto largest_error = [&](double gap_speed) {
    OdometryRefinementOptions options = RefinerOptions();
    options.tracking.gap_speed = gap_speed;
    OdometryRefiner refiner(options);
    double largest = 0.0;
    for (std::size_t i = 0; i < drive.truth.size(); ++i) {
      const bool is_stray = i == 20 || i == 21;
      Scan scan = MakeScan(
          Hall(), is_stray ? Compose(drive.truth[i], ahead) : drive.truth[i],
          FullCircle());
      scan.odometry = drive.odometry[i];
      scan.timestamp = 100.0 + 0.1 * static_cast<double>(i);
      largest = std::max(
          largest, PositionError(refiner.Process(scan).pose, drive.truth[i]));
    }
    return largest;
  };
  EXPECT_LT(largest_error(OdometryRefinementOptions().tracking.gap_speed),
            0.05);
  // Of a robot that could, it is believed.
  EXPECT_GT(largest_error(100.0), 0.4);
}

// Odometry that stands still while the robot drives is corrected as before.
TEST(OdometryRefinerTest, WheelsThatSlipAreCorrected) {
  const std::vector<Pose2> motions(40, Pose2(0.12, 0.0, 0.02));
  const Drive drive = Along(Pose2(-3.0, -2.5, 0.0), motions,
                            std::vector<Pose2>(40, Pose2::Zero()));
  OdometryRefiner refiner(RefinerOptions());
  for (std::size_t i = 0; i < drive.truth.size(); ++i) {
    Scan scan = MakeScan(Hall(), drive.truth[i], FullCircle());
    scan.odometry = drive.odometry[i];
    scan.timestamp = 100.0 + 0.1 * static_cast<double>(i);
    ASSERT_LT(PositionError(refiner.Process(scan).pose, drive.truth[i]), 0.05)
        << i;
  }
}

// A robot that sees next to nothing in a turn: a board, in front of the wall
// that it has seen, and something that stands free. The board fits the wall,
// a fifth of a radian from where odometry has it; one board is too little to
// say so.
TEST(OdometryRefinerTest, FewReturnsLeaveOdometryByLittle) {
  const double slant = DegToRad(17.0);
  const Eigen::Vector2d middle(-2.0, 3.85);
  const Eigen::Vector2d half(0.25 * std::cos(slant), 0.25 * std::sin(slant));
  const std::vector<WallEnds> board = {{middle - half, middle + half}};
  constexpr int kTurns = 8;
  const auto heading_error = [&](int min_hits) {
    OdometryRefinementOptions options = RefinerOptions();
    options.tracking.min_hits = min_hits;
    OdometryRefiner refiner(options);
    RefinedScan last;
    for (int i = 0; i < kTurns; ++i) {
      const Pose2 truth(-2.0, 2.5, 0.5 * kPi - DegToRad(15.0) * (7 - i));
      Scan scan =
          MakeScan(i + 1 < kTurns ? Hall() : board, truth, FullCircle());
      if (i + 1 == kTurns) {
        // Behind the robot.
        std::fill_n(scan.ranges.begin() + 40, 20, 0.7f);
      }
      scan.timestamp = 100.0 + 0.2 * i;
      last = refiner.Process(scan);
    }
    return HeadingError(last.pose, Pose2(-2.0, 2.5, 0.5 * kPi));
  };
  EXPECT_LT(heading_error(OdometryRefinementOptions().tracking.min_hits),
            DegToRad(1.0));
  // Where a single return is enough it is believed.
  EXPECT_GT(heading_error(1), DegToRad(8.0));
}

// The same after scans that showed nothing: odometry of three steps leaves so
// much open that a board fits somewhere in it, and says nothing.
TEST(OdometryRefinerTest, FewReturnsSayNothingWhereOdometryLeavesMuchOpen) {
  const Pose2 end(-2.0, 2.5, 0.5 * kPi);
  // A piece of the wall ahead as it would look if the robot had turned less.
  const std::vector<WallEnds> board = testing::Moved(
      {{{1.5, -0.5}, {1.5, 0.5}}}, {end.x(), end.y(), end[2] + DegToRad(25.0)});
  constexpr int kTurns = 8;
  constexpr int kDark = 2;
  OdometryRefiner refiner(RefinerOptions());
  RefinedScan last;
  for (int i = 0; i < kTurns; ++i) {
    const Pose2 truth(end.x(), end.y(),
                      end[2] - DegToRad(12.0) * (kTurns - 1 - i));
    Scan scan = MakeScan(i + 1 < kTurns ? Hall() : board, truth, FullCircle());
    if (i + 1 < kTurns && i + 1 + kDark >= kTurns) {
      std::fill(scan.ranges.begin(), scan.ranges.end(), 0.0f);
    }
    scan.timestamp = 100.0 + 0.2 * i;
    last = refiner.Process(scan);
  }
  EXPECT_LT(HeadingError(last.pose, end), DegToRad(1.0));
}

// Somebody walks ahead of the robot along a bare corridor, where nothing else
// says how far it went: a tenth of the returns and less, and yet they would
// hold the robot back for as long as they are taken for a wall.
TEST(OdometryRefinerTest, OnePersonInACorridorDoesNotHoldTheRobotBack) {
  const std::vector<WallEnds> walls = {{{-20.0, 1.0}, {20.0, 1.0}},
                                       {{-20.0, -1.0}, {20.0, -1.0}}};
  const auto error = [&](double max_clutter, double* share) {
    OdometryRefinementOptions options = RefinerOptions();
    options.max_clutter = max_clutter;
    OdometryRefiner refiner(options);
    Laser laser;
    laser.maximum_range = 8.0;
    Pose2 pose(-5.0, 0.0, 0.0);
    RefinedScan last;
    for (int i = 0; i < 80; ++i) {
      if (i > 0) pose = Compose(pose, Pose2(0.05, 0.0, 0.0));
      std::vector<WallEnds> all = walls;
      for (const WallEnds& side :
           testing::Moved(Room(0.2, 0.3), Compose(pose, {1.5, 0.2, 0.0}))) {
        all.push_back(side);
      }
      Scan scan = MakeScan(all, pose, laser);
      scan.timestamp = 100.0 + 0.2 * i;
      std::vector<bool> clutter;
      const std::vector<ScanPoint> points = testing::PointsOf(scan);
      *share = MarkClutter(scan, points, options.clutter, &clutter) /
               static_cast<double>(points.size());
      last = refiner.Process(scan);
    }
    return PositionError(last.pose, pose);
  };
  const double usual = OdometryRefinementOptions().max_clutter;
  double share = 0.0;
  EXPECT_LT(error(usual, &share), 0.2);
  EXPECT_GT(share, usual);
  EXPECT_LT(share, 0.1);
  // Where a person is too little to be asked about.
  EXPECT_GT(error(0.1, &share), 0.5);
}

// A board as wide as the corridor is carried along before the robot: wheels say
// that it goes on, all that is in sight across the way that it stands.
TEST(OdometryRefinerTest, ABoardAcrossTheCorridorDoesNotHoldTheRobotBack) {
  OdometryRefiner refiner(RefinerOptions());
  Laser laser;
  laser.maximum_range = 8.0;
  Noise noise(3);
  Pose2 pose(-5.0, 0.0, 0.0);
  double largest = 0.0;
  for (int i = 0; i < 100; ++i) {
    if (i > 0) pose = Compose(pose, Pose2(0.05, 0.0, 0.0));
    std::vector<WallEnds> all = {{{-20.0, 1.0}, {20.0, 1.0}},
                                 {{-20.0, -1.0}, {20.0, -1.0}}};
    if (i >= 20 && i < 80) {
      const double x = pose[0] + 5.0;
      all.push_back({{x, -0.95}, {x, 0.95}});
    }
    Scan scan = MakeScan(all, pose, laser, &noise);
    scan.timestamp = 100.0 + 0.2 * i;
    largest =
        std::max(largest, PositionError(refiner.Process(scan).pose, pose));
  }
  EXPECT_LT(largest, 0.3);
}

// Wheels that slip in a corridor whose end is in sight do not count.
TEST(OdometryRefinerTest, WheelsThatSlipBeforeTheEndOfACorridor) {
  std::vector<Pose2> motions(60, Pose2(0.05, 0.0, 0.0));
  std::vector<Pose2> reported = motions;
  for (std::size_t i = 20; i < 30; ++i) reported[i][0] = 0.1;
  const Drive drive = Along({-5.0, 0.0, 0.0}, motions, reported);
  const std::vector<WallEnds> walls = {{{-20.0, 1.0}, {3.0, 1.0}},
                                       {{-20.0, -1.0}, {3.0, -1.0}},
                                       {{3.0, -1.0}, {3.0, 1.0}}};
  Laser laser;
  laser.maximum_range = 9.0;
  Noise noise(3);
  OdometryRefiner refiner(RefinerOptions());
  double largest = 0.0;
  for (std::size_t i = 0; i < drive.truth.size(); ++i) {
    Scan scan = MakeScan(walls, drive.truth[i], laser, &noise);
    scan.odometry = drive.odometry[i];
    scan.timestamp = 100.0 + 0.2 * static_cast<double>(i);
    largest = std::max(
        largest, PositionError(refiner.Process(scan).pose, drive.truth[i]));
  }
  EXPECT_LT(largest, 0.1);
}

TEST(OdometryRefinerTest, NoOdometryAtAll) {
  std::vector<Pose2> motions;
  for (int i = 0; i < 40; ++i) {
    motions.emplace_back(0.1, 0.0, DegToRad(i % 3 == 0 ? 4.0 : 1.0));
  }
  const std::vector<Pose2> reported(motions.size(), Pose2::Zero());
  const Drive drive = Along(Pose2(-3.5, -2.5, 0.0), motions, reported);
  ASSERT_EQ(drive.odometry.back(), drive.odometry.front());
  const std::vector<RefinedScan> refined =
      Refine(Hall(), drive, FullCircle(), RefinerOptions());
  for (std::size_t i = 0; i < refined.size(); ++i) {
    EXPECT_LT(PositionError(refined[i].pose, drive.truth[i]), 0.08) << i;
    EXPECT_LT(HeadingError(refined[i].pose, drive.truth[i]), DegToRad(1.0))
        << i;
  }
}

TEST(OdometryRefinerTest, StandingStillMakesNoKeys) {
  const std::vector<Pose2> motions(60, Pose2::Zero());
  const Drive drive = Along(Pose2(-2.0, -2.0, 0.3), motions, motions);
  Laser laser = FullCircle();
  laser.sigma = 0.015;
  Noise noise(4);
  const std::vector<RefinedScan> refined =
      Refine(Hall(), drive, laser, RefinerOptions(), &noise);
  EXPECT_TRUE(refined[0].is_key);
  for (std::size_t i = 1; i < refined.size(); ++i) {
    EXPECT_FALSE(refined[i].is_key) << i;
    EXPECT_LT(PositionError(refined[i].pose, drive.truth[i]), 0.02);
    EXPECT_LT(HeadingError(refined[i].pose, drive.truth[i]), DegToRad(0.5));
  }
}

TEST(OdometryRefinerTest, KeysComeByDistanceAndByRotation) {
  OdometryRefinementOptions options = RefinerOptions();
  options.key_distance = 0.3;
  options.key_rotation = DegToRad(10.0);
  std::vector<Pose2> motions(10, Pose2(0.11, 0.0, 0.0));
  motions.insert(motions.end(), 9, Pose2(0.0, 0.0, DegToRad(4.0)));
  const Drive drive = Along(Pose2(-3.0, -2.0, 0.0), motions, motions);
  for (bool match : {true, false}) {
    SCOPED_TRACE(match);
    options.match_scans = match;
    const std::vector<RefinedScan> refined =
        Refine(Hall(), drive, FullCircle(), options);
    std::vector<int> keys;
    for (std::size_t i = 0; i < refined.size(); ++i) {
      if (refined[i].is_key) keys.push_back(static_cast<int>(i));
    }
    // Every third scan of 0.11 m; after the tenth, 0.11 m of the way are
    // left, and a turn of 12 degrees is over the limit.
    EXPECT_EQ(keys, (std::vector<int>{0, 3, 6, 9, 13, 16, 19}));
  }
}

TEST(OdometryRefinerTest, SinceKeyIsRelativeToTheKeyBefore) {
  std::vector<Pose2> motions;
  for (int i = 0; i < 30; ++i) {
    motions.emplace_back(0.1, 0.01, DegToRad(3.0));
  }
  const Drive drive = Along(Pose2(-2.0, -2.0, 2.8), motions, motions);
  for (bool match : {true, false}) {
    OdometryRefinementOptions options = RefinerOptions();
    options.match_scans = match;
    const std::vector<RefinedScan> refined =
        Refine(Hall(), drive, FullCircle(), options);
    Pose2 key = refined[0].pose;
    for (std::size_t i = 1; i < refined.size(); ++i) {
      const Pose2 expected = Between(key, refined[i].pose);
      EXPECT_LT((refined[i].since_key.mean - expected).norm(), 1e-9) << i;
      const Eigen::Matrix3d& covariance = refined[i].since_key.covariance;
      EXPECT_LT((covariance - covariance.transpose()).norm(), 1e-12);
      EXPECT_GT(covariance(0, 0), 0.0);
      if (refined[i].is_key) key = refined[i].pose;
    }
  }
}

TEST(OdometryRefinerTest, WithoutMatchingItIsRawOdometry) {
  OdometryRefinementOptions options = RefinerOptions();
  options.match_scans = false;
  options.key_distance = 0.45;
  options.noise.translation = 0.0;
  options.noise.translation_per_metre = 0.1;
  options.noise.translation_per_radian = 0.0;
  options.noise.rotation = 0.001;
  options.noise.rotation_per_metre = 0.0;
  options.noise.rotation_per_radian = 0.0;
  const std::vector<Pose2> motions(9, Pose2(0.1, 0.0, 0.0));
  const std::vector<Pose2> reported(9, Pose2(0.1, 0.0, 0.01));
  const Drive drive = Along(Pose2(-3.0, 1.0, 3.1), motions, reported);
  const std::vector<RefinedScan> refined =
      Refine(Hall(), drive, FullCircle(), options);
  int since = 0;
  double last = 0.0;
  for (std::size_t i = 1; i < refined.size(); ++i) {
    EXPECT_TRUE(refined[i].odometry_only);
    EXPECT_LT(PositionError(refined[i].pose, drive.odometry[i]), 1e-12);
    EXPECT_LT(HeadingError(refined[i].pose, drive.odometry[i]), 1e-12);
    ++since;
    // Independent steps of 0.01 m and 0.001 rad add up.
    const Eigen::Matrix3d& covariance = refined[i].since_key.covariance;
    EXPECT_NEAR(covariance(2, 2), since * 1e-6, 1e-15);
    const double position = covariance(0, 0) + covariance(1, 1);
    EXPECT_GE(position, since * 2e-4 - 1e-12);
    EXPECT_LE(position, since * 2e-4 + 1e-5);
    EXPECT_GT(covariance.trace(), last);
    last = covariance.trace();
    EXPECT_EQ(refined[i].is_key, since == 5) << i;
    if (refined[i].is_key) {
      since = 0;
      last = 0.0;
    }
  }
}

TEST(OdometryRefinerTest, TooFewReturnsLeaveOdometry) {
  // Nothing in sight from the third scan on.
  const std::vector<Pose2> motions(6, Pose2(0.1, 0.0, 0.0));
  const std::vector<Pose2> reported(6, Pose2(0.12, 0.0, 0.0));
  const Drive drive = Along(Pose2(-3.0, -2.0, 0.0), motions, reported);
  OdometryRefiner refiner(RefinerOptions());
  RefinedScan before;
  for (std::size_t i = 0; i < drive.truth.size(); ++i) {
    Scan scan = MakeScan(i < 3 ? Hall() : std::vector<WallEnds>(),
                         drive.truth[i], FullCircle());
    scan.odometry = drive.odometry[i];
    const RefinedScan refined = refiner.Process(scan);
    if (i >= 3) {
      EXPECT_TRUE(refined.odometry_only) << i;
      EXPECT_LT((Between(before.pose, refined.pose) - reported[0]).norm(),
                1e-12);
    }
    before = refined;
  }
}

TEST(OdometryRefinerTest, SightComesBackAfterDarkness) {
  // Blind from the start: there is nothing to match with until walls come.
  const std::vector<Pose2> motions(20, Pose2(0.1, 0.0, 0.0));
  const Drive drive = Along(Pose2(-3.0, -2.0, 0.0), motions, motions);
  OdometryRefiner refiner(RefinerOptions());
  RefinedScan refined;
  for (std::size_t i = 0; i < drive.truth.size(); ++i) {
    Scan scan = MakeScan(i < 8 ? std::vector<WallEnds>() : Hall(),
                         drive.truth[i], FullCircle());
    scan.odometry = drive.odometry[i];
    refined = refiner.Process(scan);
  }
  EXPECT_FALSE(refined.odometry_only);
  EXPECT_LT(PositionError(refined.pose, drive.truth.back()), 0.05);
}

TEST(OdometryRefinerTest, AnotherPlaceIsRefused) {
  // The robot is carried to a place that looks like nothing seen before.
  OdometryRefiner refiner(RefinerOptions());
  refiner.Process(MakeScan(Room(10.0, 8.0), Pose2::Zero(), FullCircle()));
  Scan scan = MakeScan(Room(2.0, 1.5), Pose2::Zero(), FullCircle());
  scan.odometry = Pose2(0.1, 0.0, 0.0);
  const RefinedScan refined = refiner.Process(scan);
  EXPECT_TRUE(refined.odometry_only);
  EXPECT_EQ(refiner.refusals(), 1);
  EXPECT_LT((refined.pose - Pose2(0.1, 0.0, 0.0)).norm(), 1e-12);
}

TEST(OdometryRefinerTest, LaserOffsetIsAccountedFor) {
  // The laser sits 0.4 m before the axle: turning on the spot moves it.
  Laser laser = FullCircle();
  laser.offset = Pose2(0.4, 0.1, 0.2);
  const std::vector<Pose2> motions(30, Pose2(0.0, 0.0, DegToRad(6.0)));
  const std::vector<Pose2> reported(30, Pose2(0.0, 0.0, DegToRad(5.0)));
  const Drive drive = Along(Pose2(-1.0, -1.0, 0.0), motions, reported);
  const std::vector<RefinedScan> refined =
      Refine(Hall(), drive, laser, RefinerOptions());
  for (std::size_t i = 0; i < refined.size(); ++i) {
    EXPECT_LT(PositionError(refined[i].pose, drive.truth[i]), 0.04) << i;
    EXPECT_LT(HeadingError(refined[i].pose, drive.truth[i]), DegToRad(0.5))
        << i;
  }
}

TEST(OdometryRefinerTest, SameResultTenKilometresAway) {
  const std::vector<Pose2> motions(15, Pose2(0.2, 0.0, DegToRad(5.0)));
  const std::vector<Pose2> reported(15, Pose2(0.21, 0.0, DegToRad(7.0)));
  const Pose2 shift(10000.0, -10000.0, 0.0);
  const Drive here = Along(Pose2(-3.0, -2.0, 0.0), motions, reported);
  Drive there = here;
  for (Pose2& pose : there.odometry) pose += shift;
  const auto a = Refine(Hall(), here, FullCircle(), RefinerOptions());
  const auto b = Refine(Hall(), there, FullCircle(), RefinerOptions());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_LT((b[i].pose - shift - a[i].pose).norm(), 1e-5) << i;
    EXPECT_EQ(a[i].is_key, b[i].is_key);
  }
}

// Takes out what is settled, which must come in the order of scans.
std::vector<RefinedScan> TakeAll(OdometryRefiner* refiner,
                                 std::vector<RefinedScan> before = {}) {
  SettledScan settled;
  while (refiner->TakeSettled(&settled)) {
    EXPECT_EQ(settled.index, static_cast<int>(before.size()));
    EXPECT_EQ(settled.refined.is_key, !settled.points.empty());
    before.push_back(settled.refined);
  }
  return before;
}

// Drives through the hall. Before scan 12 the robot moves by `motion` while
// scans are missing for three seconds; the first `stale` ones after that carry
// the odometry of before, which then catches up at once. `is_shut`: from then
// on the robot is in a room that it did not see before.
struct GapDrive {
  std::vector<Pose2> truth;
  std::vector<RefinedScan> refined;
  std::vector<LooseTrack> loose;
};

GapDrive DriveOverAGap(const Pose2& motion, int stale, bool is_shut) {
  Laser laser;
  laser.sigma = 0.01;
  Noise noise(5);
  OdometryRefiner refiner(RefinerOptions());
  GapDrive drive;
  std::vector<WallEnds> walls = PlainHall();
  Pose2 truth(-2.5, -2.0, 0.3);
  Pose2 before = truth;
  double time = 100.0;
  for (int i = 0; i < 30; ++i) {
    time += 0.2;
    if (i == 12) {
      before = truth;
      truth = Compose(truth, motion);
      if (is_shut) walls = testing::Moved(Room(5.5, 3.0), truth);
      time += 3.0;
    } else if (i > 0) {
      truth = Compose(truth, {0.1, 0.0, DegToRad(2.0)});
    }
    Scan scan = MakeScan(walls, truth, laser, &noise);
    scan.timestamp = time;
    scan.odometry = i >= 12 && i < 12 + stale ? before : truth;
    drive.truth.push_back(truth);
    refiner.Process(scan);
    drive.refined = TakeAll(&refiner, std::move(drive.refined));
  }
  refiner.Finish();
  drive.refined = TakeAll(&refiner, std::move(drive.refined));
  drive.loose = refiner.loose();
  return drive;
}

void ExpectNearTruth(const GapDrive& drive, double position, double heading) {
  ASSERT_EQ(drive.refined.size(), drive.truth.size());
  for (std::size_t i = 0; i < drive.refined.size(); ++i) {
    EXPECT_LT(PositionError(drive.refined[i].pose, drive.truth[i]), position)
        << i;
    EXPECT_LT(HeadingError(drive.refined[i].pose, drive.truth[i]), heading)
        << i;
  }
}

// A scan with stale odometry anchors nothing: what follows is tied to what was
// before by what it sees.
TEST(OdometryRefinerTest, StaleOdometryAfterAGap) {
  for (const int stale : {1, 2}) {
    for (const double turn : {70.0, -60.0}) {
      SCOPED_TRACE(turn);
      const GapDrive drive =
          DriveOverAGap({0.5, 0.1, DegToRad(turn)}, stale, false);
      EXPECT_TRUE(drive.loose.empty());
      ExpectNearTruth(drive, 0.1, DegToRad(1.5));
    }
  }
}

// Nothing behind a door that fell shut was seen before. The odometry that
// catches up says where the robot went on, and that it alone says so is told.
TEST(OdometryRefinerTest, OdometryThatCatchesUpAfterAGapTellsOfTheWay) {
  for (const int stale : {1, 2}) {
    SCOPED_TRACE(stale);
    const GapDrive drive =
        DriveOverAGap({0.9, 0.2, DegToRad(65.0)}, stale, true);
    ExpectNearTruth(drive, 0.2, DegToRad(2.0));
    ASSERT_EQ(drive.loose.size(), 1u);
    EXPECT_NE(drive.refined[12].tie, TrackTie::kNone);
    EXPECT_NE(drive.refined[12].tie, TrackTie::kMatched);
  }
}

// Along a corridor of equal pillars the robot turns back while scans are
// missing. One pillar looks like the next; odometry, once it catches up, says
// which.
TEST(OdometryRefinerTest, OdometryTellsLookalikesApartAfterAGap) {
  std::vector<WallEnds> walls = Room(60.0, 2.4);
  for (double x = -28.0; x < 29.0; x += 2.5) {
    for (const WallEnds& side : testing::Moved(Room(0.8, 0.6), {x, 1.2, 0.0})) {
      walls.push_back(side);
    }
  }
  Laser laser;
  laser.sigma = 0.01;
  Noise noise(5);
  OdometryRefiner refiner(RefinerOptions());
  constexpr int kGap = 100;
  Pose2 truth(-8.0, -0.2, 0.0);
  Pose2 before = truth;
  double time = 100.0;
  std::vector<Pose2> poses;
  std::vector<RefinedScan> refined;
  for (int i = 0; i < 190; ++i) {
    time += 0.2;
    if (i == kGap) {
      before = truth;
      truth = Compose(truth, {0.6, 0.2, kPi});
      time += 10.0;
    } else if (i > 0) {
      truth = Compose(truth, {0.1, 0.0, 0.0});
    }
    Scan scan = MakeScan(walls, truth, laser, &noise);
    scan.timestamp = time;
    scan.odometry = i == kGap ? before : truth;
    poses.push_back(truth);
    refiner.Process(scan);
    refined = TakeAll(&refiner, std::move(refined));
  }
  refiner.Finish();
  refined = TakeAll(&refiner, std::move(refined));
  ASSERT_EQ(refined.size(), poses.size());
  EXPECT_EQ(refined[kGap].tie, TrackTie::kMatched);
  EXPECT_GE(refined[kGap].since, 0);
  for (std::size_t i = 0; i < refined.size(); ++i) {
    EXPECT_LT(PositionError(refined[i].pose, poses[i]), 0.15) << i;
    // All that lies in the track's frame moves with it.
    if (i == 0 || i == kGap) continue;
    const Pose2 step = Between(refined[i - 1].pose, refined[i].pose);
    EXPECT_LT(PositionError(step, {0.1, 0.0, 0.0}), 0.05) << i;
  }
}

// The first scan after the gap may fit a little aside, and as odometry stands
// still the robot is then taken to go on as before: odometry has not caught up
// by that.
TEST(OdometryRefinerTest, OdometryHasNotCaughtUpWhileItStands) {
  const std::vector<WallEnds> there =
      testing::Moved(Room(7.8, 3.4), {0.2, 0.1, 0.0});
  Laser laser;
  laser.sigma = 0.01;
  Noise noise(5);
  OdometryRefiner refiner(RefinerOptions());
  constexpr int kGap = 12;
  const Pose2 over(1.5, 0.4, DegToRad(45.0));
  Pose2 place(-2.5, -2.0, 0.0);
  Pose2 odometry = place;
  std::vector<RefinedScan> refined;
  std::vector<Pose2> truth;
  for (int i = 0; i < 30; ++i) {
    if (i > 0)
      place = i == kGap ? Pose2::Zero() : Compose(place, {0.1, 0.0, 0.0});
    if (i > 0)
      odometry = Compose(odometry, i == kGap ? over : Pose2(0.1, 0.0, 0.0));
    truth.push_back(odometry);
    Scan scan = MakeScan(i < kGap ? PlainHall() : there, place, laser, &noise);
    scan.timestamp = 100.0 + 0.2 * i + (i < kGap ? 0.0 : 3.0);
    scan.odometry = i >= kGap && i < kGap + 2 ? truth[kGap - 1] : odometry;
    refiner.Process(scan);
    refined = TakeAll(&refiner, std::move(refined));
  }
  refiner.Finish();
  refined = TakeAll(&refiner, std::move(refined));
  ASSERT_EQ(refined.size(), truth.size());
  for (std::size_t i = 0; i < refined.size(); ++i) {
    EXPECT_LT(PositionError(refined[i].pose, truth[i]), 0.2) << i;
    EXPECT_LT(HeadingError(refined[i].pose, truth[i]), DegToRad(2.0)) << i;
  }
  EXPECT_EQ(refiner.loose().size(), 1u);
}

// A robot that was carried over a gap and drives on is none whose odometry
// catches up.
TEST(OdometryRefinerTest, WheelsThatGoOnAfterAGapTellNothingOfIt) {
  Laser laser;
  laser.sigma = 0.01;
  Noise noise(8);
  OdometryRefiner refiner(RefinerOptions());
  Pose2 truth(-2.5, -2.0, 0.3);
  std::vector<RefinedScan> refined;
  for (int i = 0; i < 40; ++i) {
    if (i > 0 && i != 15) truth = Compose(truth, {0.1, 0.0, DegToRad(5.0)});
    const Pose2 elsewhere(0.3, -2.0 + 0.1 * (i - 15),
                          1.6 + DegToRad(5.0) * (i - 15));
    Scan scan = i < 15 ? MakeScan(PlainHall(), truth, laser, &noise)
                       : MakeScan(Room(3.0, 5.5), elsewhere, laser, &noise);
    scan.timestamp = 100.0 + 0.2 * i + (i < 15 ? 0.0 : 40.0);
    scan.odometry = truth;
    refiner.Process(scan);
    refined = TakeAll(&refiner, std::move(refined));
  }
  refiner.Finish();
  refined = TakeAll(&refiner, std::move(refined));
  ASSERT_EQ(refined.size(), 40u);
  EXPECT_EQ(refined[15].tie, TrackTie::kLoose);
  ASSERT_EQ(refiner.loose().size(), 1u);
  EXPECT_FALSE(refiner.loose()[0].found);
}

// A corridor of 10 m along x from the origin, with a pillar and a niche.
std::vector<WallEnds> ShortCorridor(const Pose2& at) {
  const std::vector<WallEnds> walls = {
      {{0.0, -1.0}, {4.0, -1.0}},  {{4.0, -1.0}, {4.0, -1.8}},
      {{4.0, -1.8}, {5.5, -1.8}},  {{5.5, -1.8}, {5.5, -1.0}},
      {{5.5, -1.0}, {10.0, -1.0}}, {{0.0, 1.0}, {2.5, 1.0}},
      {{2.5, 1.0}, {2.5, 0.6}},    {{2.5, 0.6}, {2.9, 0.6}},
      {{2.9, 0.6}, {2.9, 1.0}},    {{2.9, 1.0}, {7.0, 1.0}},
      {{7.0, 1.0}, {7.0, 1.7}},    {{7.0, 1.7}, {7.8, 1.7}},
      {{7.8, 1.7}, {7.8, 1.0}},    {{7.8, 1.0}, {10.0, 1.0}}};
  return testing::Moved(walls, at);
}

// A camera's view: 60 degrees, 5 m.
Laser NarrowView() {
  Laser laser;
  laser.start_angle = DegToRad(-30.0);
  laser.angle_step = DegToRad(0.5);
  laser.beams = 121;
  laser.maximum_range = 5.0;
  laser.sigma = 0.01;
  return laser;
}

// Along a corridor, through 8 m of an empty hall and along a second corridor
// that looks like the first.
struct DarkHall {
  std::vector<Pose2> truth;
  std::vector<RefinedScan> refined;
  std::vector<LooseTrack> loose;
  std::vector<std::size_t> tied;
};

DarkHall DriveThroughADarkHall(double heading_error, double jump) {
  std::vector<WallEnds> walls = ShortCorridor(Pose2::Zero());
  for (const WallEnds& wall : ShortCorridor({18.0, 0.0, 0.0})) {
    walls.push_back(wall);
  }
  Noise noise(9);
  DarkHall result;
  OdometryRefiner refiner(RefinerOptions());
  Pose2 truth(0.3, 0.0, 0.0);
  Pose2 odometry = truth;
  for (int i = 0; i < 245; ++i) {
    if (i > 0) {
      Pose2 motion(0.1, 0.0, 0.0);
      truth = Compose(truth, motion);
      motion[2] += noise.Normal(heading_error);
      if (truth.x() > 12.5 && truth.x() < 12.6) motion[0] += jump;
      odometry = Compose(odometry, motion);
    }
    Scan scan = MakeScan(walls, truth, NarrowView(), &noise);
    scan.timestamp = 100.0 + 0.2 * i;
    scan.odometry = odometry;
    result.truth.push_back(truth);
    refiner.Process(scan);
    result.refined = TakeAll(&refiner, std::move(result.refined));
  }
  refiner.Finish();
  result.refined = TakeAll(&refiner, std::move(result.refined));
  result.loose = refiner.loose();
  for (std::size_t i = 0; i < result.refined.size(); ++i) {
    if (result.refined[i].tie != TrackTie::kNone) result.tied.push_back(i);
  }
  return result;
}

// The second corridor looks like the first, but odometry was right all the way
// and says that it is another one.
TEST(OdometryRefinerTest, OdometryThatWasGoodCarriesThroughTheDark) {
  const DarkHall drive = DriveThroughADarkHall(DegToRad(0.05), 0.0);
  ASSERT_EQ(drive.refined.size(), drive.truth.size());
  for (std::size_t i = 0; i < drive.refined.size(); ++i) {
    EXPECT_LT(PositionError(drive.refined[i].pose, drive.truth[i]), 0.4) << i;
    EXPECT_LT(HeadingError(drive.refined[i].pose, drive.truth[i]),
              DegToRad(2.0))
        << i;
  }
  ASSERT_EQ(drive.tied.size(), 1u);
  const RefinedScan& first = drive.refined[drive.tied[0]];
  EXPECT_EQ(first.tie, TrackTie::kOdometry);
  // Of a long way it is told, and what is left open is more than what odometry
  // was wrong by.
  ASSERT_EQ(drive.loose.size(), 1u);
  EXPECT_TRUE(drive.loose[0].found);
  EXPECT_NE(drive.loose[0].why.find("odometry alone"), std::string::npos);
  EXPECT_GT(std::sqrt(first.since_key.covariance(2, 2)), DegToRad(0.5));
  EXPECT_LT(std::sqrt(first.since_key.covariance(2, 2)), DegToRad(10.0));
}

// Odometry that turns by a degree in a decimetre says nothing after 5 m, and
// what was found in its place is told of.
TEST(OdometryRefinerTest, OdometryThatWasBadIsNotBelievedInTheDark) {
  const DarkHall drive = DriveThroughADarkHall(DegToRad(1.5), 0.0);
  ASSERT_EQ(drive.refined.size(), drive.truth.size());
  ASSERT_FALSE(drive.tied.empty());
  EXPECT_NE(drive.refined[drive.tied[0]].tie, TrackTie::kOdometry);
  EXPECT_FALSE(drive.loose.empty());
}

// Nor does one that jumped there.
TEST(OdometryRefinerTest, OdometryThatJumpedInTheDarkIsNotBelieved) {
  const DarkHall drive = DriveThroughADarkHall(DegToRad(0.05), 2.0);
  ASSERT_EQ(drive.refined.size(), drive.truth.size());
  ASSERT_FALSE(drive.tied.empty());
  for (const std::size_t i : drive.tied) {
    EXPECT_NE(drive.refined[i].tie, TrackTie::kOdometry) << i;
  }
  EXPECT_FALSE(drive.loose.empty());
}

// Carried into another building: nothing tells where it is, and that is said.
TEST(OdometryRefinerTest, CarriedIntoTheUnknown) {
  const std::vector<WallEnds> there = Room(3.0, 5.5);
  Laser laser;
  laser.sigma = 0.01;
  Noise noise(6);
  OdometryRefiner refiner(RefinerOptions());
  Pose2 truth(-2.5, -2.0, 0.3);
  std::vector<RefinedScan> refined;
  for (int i = 0; i < 40; ++i) {
    if (i > 0) truth = Compose(truth, {0.1, 0.0, DegToRad(2.0)});
    const Pose2 elsewhere(0.3, -2.0 + 0.1 * (i - 15), 1.6);
    Scan scan = i < 15 ? MakeScan(PlainHall(), truth, laser, &noise)
                       : MakeScan(there, elsewhere, laser, &noise);
    scan.timestamp = 100.0 + 0.2 * i + (i < 15 ? 0.0 : 40.0);
    scan.odometry = truth;
    refiner.Process(scan);
    refined = TakeAll(&refiner, std::move(refined));
  }
  // The open track waits.
  EXPECT_EQ(refined.size(), 15u);
  refiner.Finish();
  refined = TakeAll(&refiner, std::move(refined));
  ASSERT_EQ(refined.size(), 40u);
  EXPECT_EQ(refiner.losses(), 1);
  ASSERT_EQ(refiner.loose().size(), 1u);
  EXPECT_EQ(refiner.loose()[0].begin, 14);
  EXPECT_EQ(refiner.loose()[0].end, 39);
  EXPECT_FALSE(refiner.loose()[0].found);
  EXPECT_EQ(refined[15].tie, TrackTie::kLoose);
  EXPECT_TRUE(refined[15].is_key);
  EXPECT_GT(refined[15].since_key.covariance(0, 0), 1.0);
}

// The largest error, m, of a robot that drives along x, by `step` m a scan,
// five scans a second, in place of each `period`th of which scans are missing
// for `missing` m at the same speed. Odometry goes on, 1 % too long.
double LargestErrorOverGaps(const std::vector<WallEnds>& walls,
                            const Laser& laser, double start, double step,
                            double missing, int period, int scans) {
  constexpr double kSeconds = 0.2;
  Noise noise(4);
  OdometryRefiner refiner(RefinerOptions());
  std::vector<Pose2> truths;
  std::vector<RefinedScan> refined;
  Pose2 odometry = Pose2::Zero();
  double time = 100.0;
  double way = 0.0;
  for (int i = 0; i < scans; ++i) {
    const double motion = i == 0 ? 0.0 : (i + 1) % period == 0 ? missing : step;
    way += motion;
    time += motion > step ? kSeconds * motion / step : kSeconds;
    truths.push_back({start + way, 0.0, 0.0});
    odometry = Compose(odometry, Pose2(1.01 * motion, 0.0, 0.0));
    Scan scan = MakeScan(walls, truths.back(), laser, &noise);
    scan.timestamp = time;
    scan.odometry = odometry;
    refiner.Process(scan);
    refined = TakeAll(&refiner, std::move(refined));
  }
  refiner.Finish();
  refined = TakeAll(&refiner, std::move(refined));
  EXPECT_EQ(refined.size(), truths.size());
  double largest = 0.0;
  for (std::size_t i = 0; i < refined.size(); ++i) {
    largest = std::max(
        largest,
        PositionError(refined[i].pose, Between(truths.front(), truths[i])));
  }
  return largest;
}

// A corridor of steps, one like another, in which scans are missing while the
// robot goes on: what it sees then fits a step that it knows already, behind
// it, better than the one that it is at, of which it has seen little.
TEST(OdometryRefinerTest, OdometryOverAGapTellsStepsApart) {
  std::vector<WallEnds> walls;
  for (int i = 0; i < 40; ++i) {
    const double x = 3.6 * i;
    walls.push_back({{x, 1.2}, {x + 1.2, 1.2}});
    walls.push_back({{x + 1.2, 1.2}, {x + 1.2, 2.4}});
    walls.push_back({{x + 1.2, 2.4}, {x + 3.6, 2.4}});
    walls.push_back({{x + 3.6, 2.4}, {x + 3.6, 1.2}});
    walls.push_back({{x, -1.2}, {x + 3.6, -1.2}});
  }
  Laser laser;
  laser.maximum_range = 8.0;
  laser.sigma = 0.01;
  for (const double missing : {2.2, 2.6, 2.9, 3.2}) {
    EXPECT_LT(LargestErrorOverGaps(walls, laser, 4.0, 0.15, missing, 60, 300),
              0.5)
        << missing << " m missing";
  }
}

// Ribs every 0.6 m on both sides, 0.1 m wide and 0.11 m deep: over a gap a scan
// fits the ones before as well, against odometry.
TEST(OdometryRefinerTest, OdometryOverAGapTellsRibsApart) {
  std::vector<WallEnds> walls = {{{0.0, -1.0}, {0.0, 1.0}},
                                 {{30.0, -1.0}, {30.0, 1.0}}};
  for (const double side : {-1.0, 1.0}) {
    walls.push_back({{0.0, side}, {30.0, side}});
    for (int i = 1; i < 50; ++i) {
      const double x = 0.6 * i;
      const double front = 0.89 * side;
      walls.push_back({{x - 0.05, front}, {x + 0.05, front}});
      walls.push_back({{x - 0.05, front}, {x - 0.05, side}});
      walls.push_back({{x + 0.05, front}, {x + 0.05, side}});
    }
  }
  Laser laser;
  laser.maximum_range = 6.5;
  laser.sigma = 0.01;
  for (const double missing : {2.24, 3.64}) {
    EXPECT_LT(LargestErrorOverGaps(walls, laser, 1.0, 0.14, missing, 71, 85),
              0.3)
        << missing << " m missing";
  }
}

// Scans are missing again before it is known where a robot was carried to,
// which is found out then: what odometry says of the second gap counts from
// where the robot is found to have been.
TEST(OdometryRefinerTest, LostAgainWhenItIsFoundWhereItWasCarriedTo) {
  std::vector<WallEnds> hall = Room(20.0, 6.0);
  for (const WallEnds& side : Pillars(-10.0)) hall.push_back(side);
  const std::vector<WallEnds> unknown = Room(3.0, 5.5);
  Laser laser = FullCircle();
  laser.beams = 240;
  laser.angle_step = DegToRad(1.5);
  laser.maximum_range = 5.0;
  laser.sigma = 0.01;
  const Pose2 over_gap(3.0, 0.0, 0.0);
  for (const auto& [after, there] :
       {std::make_pair(48, -4.0), std::make_pair(64, -5.0)}) {
    Noise noise(8);
    OdometryRefiner refiner(RefinerOptions());
    std::vector<RefinedScan> refined;
    Pose2 odometry(-1.0, 0.0, 0.0);
    double time = 100.0;
    const int carried = 80;
    const int again = carried + after;
    for (int i = 0; i < again + 60; ++i) {
      Pose2 truth;
      Pose2 motion(0.1, 0.0, 0.0);
      if (i < carried) {
        truth = Pose2(-1.0 + 0.1 * i, 0.0, 0.0);
      } else if (i < again) {
        truth = Pose2(there + 0.1 * (i - carried), 0.3, 0.0);
      } else {
        truth = Pose2(0.3, -2.0 + 0.05 * (i - again), kPi / 2.0);
        motion = Pose2(0.05, 0.0, 0.0);
      }
      time += i == carried ? 40.2 : i == again ? 10.2 : 0.2;
      if (i == again) motion = over_gap;
      if (i > 0 && i != carried) odometry = Compose(odometry, motion);
      Scan scan = MakeScan(i < again ? hall : unknown, truth, laser, &noise);
      scan.timestamp = time;
      scan.odometry = odometry;
      refiner.Process(scan);
      refined = TakeAll(&refiner, std::move(refined));
    }
    refiner.Finish();
    refined = TakeAll(&refiner, std::move(refined));
    ASSERT_EQ(refined.size(), static_cast<std::size_t>(again + 60));
    // Where it was carried to was found.
    EXPECT_EQ(refined[carried].tie, TrackTie::kMatched);
    EXPECT_LT(PositionError(refined[again - 1].pose,
                            {there + 0.1 * (after - 1), 0.3, 0.0}),
              0.3);
    const Pose2 step = Between(refined[again - 1].pose,
                               refined[static_cast<std::size_t>(again)].pose);
    EXPECT_LT(PositionError(step, over_gap), 0.5) << after << " scans";
  }
}

// Carried along a corridor of equal doors, by 12 m and a little more: nearly
// all that it sees there fits the place that it was taken from, a little ahead
// of where odometry has it, but a cupboard does not. It does not go on from
// there.
TEST(OdometryRefinerTest, CarriedAlongACorridorOfEqualDoors) {
  std::vector<WallEnds> walls;
  const auto add = [&walls](double x1, double y1, double x2, double y2) {
    walls.push_back({{x1, y1}, {x2, y2}});
  };
  for (int k = -12; k < 24; ++k) {
    for (const double side : {-1.0, 1.0}) {
      // A piece of wall and a door that is set back.
      const double x = 2.0 * k + (side > 0.0 ? 0.7 : 0.0);
      add(x, side, x + 1.0, side);
      add(x + 1.0, side, x + 1.0, 1.6 * side);
      add(x + 1.0, 1.6 * side, x + 2.0, 1.6 * side);
      add(x + 2.0, 1.6 * side, x + 2.0, side);
    }
  }
  // Before the wall on the way that it has not seen.
  add(16.9, 1.0, 16.9, 0.6);
  add(16.9, 0.6, 17.5, 0.6);
  add(17.5, 0.6, 17.5, 1.0);
  Laser laser;
  laser.maximum_range = 8.0;
  laser.sigma = 0.01;
  Noise noise(8);
  OdometryRefiner refiner(RefinerOptions());
  constexpr int kCarried = 20;
  Pose2 odometry(0.0, 0.0, 0.0);
  Pose2 last = odometry;
  std::vector<RefinedScan> refined;
  for (int i = 0; i < 34; ++i) {
    const Pose2 truth(0.15 * i + (i < kCarried ? 0.0 : 12.1), 0.05, 0.02);
    if (i > 0 && i != kCarried) {
      odometry = Compose(odometry, Between(last, truth));
    }
    last = truth;
    Scan scan = MakeScan(walls, truth, laser, &noise);
    scan.timestamp = 100.0 + 0.2 * i + (i < kCarried ? 0.0 : 40.0);
    scan.odometry = odometry;
    refiner.Process(scan);
    refined = TakeAll(&refiner, std::move(refined));
  }
  refiner.Finish();
  refined = TakeAll(&refiner, std::move(refined));
  ASSERT_EQ(refined.size(), 34u);
  EXPECT_EQ(refined[kCarried].tie, TrackTie::kLoose);
  ASSERT_EQ(refiner.loose().size(), 1u);
  EXPECT_EQ(refiner.loose()[0].begin, kCarried - 1);
  EXPECT_FALSE(refiner.loose()[0].found);
}

// Sees all around, 5 m far.
Laser NearLaser() {
  Laser laser = FullCircle();
  laser.beams = 240;
  laser.angle_step = DegToRad(1.5);
  laser.maximum_range = 5.0;
  laser.sigma = 0.01;
  return laser;
}

// Drives through `here` until it is carried, for 40 s and unknown to odometry,
// before scan `carried`, and then through `there`, where `truth` says.
void DriveAndBeCarried(const std::vector<WallEnds>& here,
                       const std::vector<WallEnds>& there, int carried,
                       const std::vector<Pose2>& truth, const Laser& laser,
                       Noise* noise, OdometryRefiner* refiner) {
  Pose2 odometry = truth[0];
  for (int i = 0; i < static_cast<int>(truth.size()); ++i) {
    if (i > 0 && i != carried) {
      odometry = Compose(odometry, Between(truth[i - 1], truth[i]));
    }
    Scan scan = MakeScan(i < carried ? here : there, truth[i], laser, noise);
    scan.timestamp = 100.0 + 0.2 * i + (i < carried ? 0.0 : 40.0);
    scan.odometry = odometry;
    refiner->Process(scan);
  }
  refiner->Finish();
}

// Carried to another hall, whose first pillars stand as those in the hall that
// it was taken from. That it was found there is told.
TEST(OdometryRefinerTest, CarriedToAPlaceThatLooksAlikeAtFirst) {
  const std::vector<WallEnds> pillars = Pillars(-10.0);
  std::vector<WallEnds> here = Room(20.0, 6.0);
  std::vector<WallEnds> there = here;
  for (const WallEnds& side : pillars) {
    here.push_back(side);
    // The others stand on the other side.
    const auto moved = [&side](const Eigen::Vector2d& end) {
      return side.a.x() < -4.0 ? end : Eigen::Vector2d(end.x() + 0.9, -end.y());
    };
    there.push_back({moved(side.a), moved(side.b)});
  }
  Laser laser;
  laser.maximum_range = 3.5;
  laser.sigma = 0.01;
  Noise noise(8);
  OdometryRefiner refiner(RefinerOptions());
  constexpr int kCarried = 45;
  std::vector<Pose2> truth;
  for (int i = 0; i < 90; ++i) {
    truth.push_back(i < kCarried
                        ? Pose2(-9.0 + 0.1 * i, 0.0, 0.0)
                        : Pose2(-7.0 + 0.1 * (i - kCarried), 0.3, 0.0));
  }
  DriveAndBeCarried(here, there, kCarried, truth, laser, &noise, &refiner);
  ASSERT_FALSE(refiner.loose().empty());
  EXPECT_EQ(refiner.loose()[0].begin, kCarried - 1);
}

// A hall of the same kind in the frame of the first one.
const Pose2 kSecondHall(3.0, 9.0, kPi / 2);

// Scans are missing while it gets to where it began in the other hall, which
// looks the same; `by_odometry`: what odometry tells of that way.
std::vector<RefinedScan> DriveThroughTwoHalls(const Pose2& by_odometry) {
  std::vector<WallEnds> hall = Room(20.0, 6.0);
  for (const WallEnds& side : Pillars(-10.0)) hall.push_back(side);
  Laser laser;
  laser.sigma = 0.01;
  Noise noise(8);
  OdometryRefiner refiner(RefinerOptions());
  constexpr int kMissing = 45;
  std::vector<RefinedScan> refined;
  Pose2 odometry(-9.0, 0.0, 0.0);
  for (int i = 0; i < 2 * kMissing; ++i) {
    if (i > 0) {
      odometry =
          Compose(odometry, i == kMissing ? by_odometry : Pose2(0.1, 0.0, 0.0));
    }
    const Pose2 seen(-9.0 + 0.1 * (i % kMissing), 0.0, 0.0);
    Scan scan = MakeScan(hall, seen, laser, &noise);
    scan.timestamp = 100.0 + 0.2 * i + (i < kMissing ? 0.0 : 20.0);
    scan.odometry = odometry;
    refiner.Process(scan);
    refined = TakeAll(&refiner, std::move(refined));
  }
  refiner.Finish();
  return TakeAll(&refiner, std::move(refined));
}

TEST(OdometryRefinerTest, OdometryThatGoesOnOverAGapTellsLookalikesApart) {
  const Pose2 begin(-9.0, 0.0, 0.0);
  Pose2 way = Between(Compose(begin, Pose2(4.4, 0.0, 0.0)),
                      Compose(kSecondHall, begin));
  // It is none too good.
  way[2] *= 1.05;
  const std::vector<RefinedScan> driven = DriveThroughTwoHalls(way);
  ASSERT_EQ(driven.size(), 90u);
  EXPECT_EQ(driven[45].tie, TrackTie::kOdometry);
  // Where odometry has it.
  EXPECT_NEAR(driven[45].pose[0], 3.0, 1.0);
  EXPECT_NEAR(driven[45].pose[1], 0.0, 1.0);
}

// Its wheels are rolled a little, or not at all: odometry knows nothing of the
// way.
TEST(OdometryRefinerTest, OdometryOfARobotThatIsCarriedTellsNothing) {
  for (const Pose2& rolled : {Pose2(0.0, 0.0, 0.0), Pose2(0.7, -0.3, 0.8)}) {
    const std::vector<RefinedScan> carried = DriveThroughTwoHalls(rolled);
    ASSERT_EQ(carried.size(), 90u);
    EXPECT_EQ(carried[45].tie, TrackTie::kMatched);
    EXPECT_NEAR(carried[45].pose[0], -9.0, 0.1);
  }
}

// Carried to where it has not been, from where it drives back through what it
// saw at first: when all scans are in its way there is known.
TEST(OdometryRefinerTest, CarriedAndFoundInTheEnd) {
  // A hall of 20 m by 6 m with pillars, none like another, and a corridor of
  // 22 m that begins where the hall ends.
  std::vector<WallEnds> walls = {
      {{-20.0, 3.0}, {-20.0, -3.0}}, {{-20.0, -3.0}, {0.0, -3.0}},
      {{0.0, -3.0}, {0.0, -1.2}},    {{0.0, -1.2}, {22.0, -1.2}},
      {{22.0, -1.2}, {22.0, 1.2}},   {{22.0, 1.2}, {0.0, 1.2}},
      {{0.0, 1.2}, {0.0, 3.0}},      {{0.0, 3.0}, {-20.0, 3.0}}};
  for (const WallEnds& side :
       testing::Moved(Pillars(-20.0), {-10.0, 0.0, 0.0})) {
    walls.push_back(side);
  }
  const Laser laser = NearLaser();
  Noise noise(4);
  OdometryRefinementOptions options = RefinerOptions();
  options.tracking.max_open_keys = 30;
  OdometryRefiner refiner(options);
  // Is interrupted while it looks for the part.
  OdometryRefiner stopped(options);
  // Knows little after the way to where the part was seen.
  options.drift.rotation_per_root_metre = DegToRad(1.5);
  OdometryRefiner drifting(options);
  constexpr int kCarried = 70;
  std::vector<Pose2> truths;
  std::vector<RefinedScan> refined;
  Pose2 odometry(-17.0, 0.0, 0.0);
  for (int i = 0; i < 290; ++i) {
    const Pose2 truth = i < kCarried
                            ? Pose2(-17.0 + 0.15 * i, 0.0, 0.0)
                            : Pose2(19.0 - 0.15 * (i - kCarried), 0.1, kPi);
    if (i > 0 && i != kCarried) {
      odometry = Compose(odometry, Between(truths.back(), truth));
    }
    truths.push_back(truth);
    Scan scan = MakeScan(walls, truth, laser, &noise);
    scan.timestamp = 100.0 + 0.2 * i + (i < kCarried ? 0.0 : 40.0);
    scan.odometry = odometry;
    refiner.Process(scan);
    stopped.Process(scan);
    drifting.Process(scan);
    refined = TakeAll(&refiner, std::move(refined));
  }
  int asked = 0;
  stopped.Finish([&asked] { return ++asked > 3; });
  EXPECT_GT(asked, 3);
  EXPECT_TRUE(stopped.late_ties().empty());
  ASSERT_EQ(stopped.loose().size(), 1u);
  EXPECT_FALSE(stopped.loose()[0].found);
  refiner.Finish();
  refined = TakeAll(&refiner, std::move(refined));
  EXPECT_EQ(refined[kCarried].tie, TrackTie::kLoose);
  ASSERT_EQ(refiner.late_ties().size(), 1u);
  const LateTie& late = refiner.late_ties()[0];
  EXPECT_EQ(late.scan, kCarried);
  ASSERT_LT(late.since, kCarried);
  const Pose2 expected = Between(truths[late.since], truths[kCarried]);
  const Eigen::Vector3d error = Between(expected, late.since_key.mean);
  EXPECT_LT(error.head<2>().norm(), 0.5);
  EXPECT_LT(std::abs(error[2]), DegToRad(2.0));
  // It says how well it knows.
  const Eigen::Matrix3d turned = [&] {
    const double c = std::cos(expected[2]), s = std::sin(expected[2]);
    Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
    rotation.topLeftCorner<2, 2>() << c, -s, s, c;
    return rotation;
  }();
  const Eigen::Vector3d off = turned * error;
  EXPECT_LT(off.dot(late.since_key.covariance.inverse() * off), 25.0);
  ASSERT_EQ(refiner.loose().size(), 1u);
  EXPECT_TRUE(refiner.loose()[0].found);
  EXPECT_EQ(refiner.loose()[0].end, kCarried);

  // A rough tie is taken, and the part stays loose.
  drifting.Finish();
  ASSERT_EQ(drifting.late_ties().size(), 1u);
  const UncertainPose2& rough = drifting.late_ties()[0].since_key;
  EXPECT_GT(rough.covariance(2, 2), DegToRad(5.0) * DegToRad(5.0));
  EXPECT_LT(rough.covariance(2, 2), DegToRad(20.0) * DegToRad(20.0));
  EXPECT_LT((rough.mean - late.since_key.mean).head<2>().norm(), 0.5);
  ASSERT_EQ(drifting.loose().size(), 1u);
  EXPECT_FALSE(drifting.loose()[0].found);
  EXPECT_NE(drifting.loose()[0].why.find("roughly"), std::string::npos);
}

// Carried to where it has not been, into a hall that looks in part like the one
// that it was taken from: there it is found, wrongly. It drives back into the
// first hall through what cannot be there; in the end it is known.
TEST(OdometryRefinerTest, CarriedToAPlaceThatLooksAlikeAndFoundInTheEnd) {
  // A hall of 30 m by 6 m, a corridor of 29 m, a hall like the nearer 13 m of
  // the first one, and a corridor on from there.
  std::vector<WallEnds> walls = {
      {{-30.0, 3.0}, {-30.0, -3.0}}, {{-30.0, -3.0}, {0.0, -3.0}},
      {{0.0, -3.0}, {0.0, -1.2}},    {{0.0, -1.2}, {29.0, -1.2}},
      {{29.0, -1.2}, {29.0, -3.0}},  {{29.0, -3.0}, {42.0, -3.0}},
      {{42.0, -3.0}, {42.0, -1.2}},  {{42.0, -1.2}, {47.0, -1.2}},
      {{47.0, -1.2}, {47.0, 1.2}},   {{47.0, 1.2}, {42.0, 1.2}},
      {{42.0, 1.2}, {42.0, 3.0}},    {{42.0, 3.0}, {29.0, 3.0}},
      {{29.0, 3.0}, {29.0, 1.2}},    {{29.0, 1.2}, {0.0, 1.2}},
      {{0.0, 1.2}, {0.0, 3.0}},      {{0.0, 3.0}, {-30.0, 3.0}}};
  for (const WallEnds& side :
       testing::Moved(Pillars(-20.0), {-10.0, 0.0, 0.0})) {
    walls.push_back(side);
    if (side.a.x() < -12.0) continue;
    walls.push_back({side.a + Eigen::Vector2d(42.0, 0.0),
                     side.b + Eigen::Vector2d(42.0, 0.0)});
  }
  const Laser laser = NearLaser();
  Noise noise(4);
  OdometryRefiner refiner(RefinerOptions());
  constexpr int kCarried = 165;
  std::vector<Pose2> truth;
  for (int i = 0; i < 580; ++i) {
    truth.push_back(i < kCarried
                        ? Pose2(-27.0 + 0.15 * i, 0.0, 0.0)
                        : Pose2(37.5 - 0.15 * (i - kCarried), 0.1, kPi));
  }
  DriveAndBeCarried(walls, walls, kCarried, truth, laser, &noise, &refiner);
  const std::vector<RefinedScan> refined = TakeAll(&refiner, {});
  const auto error = [&](int since, const UncertainPose2& tie) {
    const Pose2 expected = Between(truth[since], truth[kCarried]);
    return Between(expected, tie.mean).head<2>().norm();
  };
  ASSERT_EQ(refined[kCarried].tie, TrackTie::kMatched);
  EXPECT_GT(error(refined[kCarried].since, refined[kCarried].since_key), 30.0);
  ASSERT_EQ(refiner.late_ties().size(), 1u);
  const LateTie& late = refiner.late_ties()[0];
  EXPECT_EQ(late.scan, kCarried);
  EXPECT_LT(error(late.since, late.since_key), 0.5);
  ASSERT_EQ(refiner.loose().size(), 1u);
  EXPECT_NE(refiner.loose()[0].why.find("found again on what was seen later"),
            std::string::npos);
}

// Carried into another building, the end of which looks like a piece of the
// first one: of all that it sees there one window fits, and that is too little
// for a part of many.
TEST(OdometryRefinerTest, OneWindowThatFitsDoesNotPlaceALongPart) {
  std::vector<WallEnds> hall = Room(20.0, 6.0);
  for (const WallEnds& side : Pillars(-10.0)) hall.push_back(side);
  // The right half of the hall, at the end of a jagged corridor.
  std::vector<WallEnds> there = Pillars(0.0);
  there.push_back({{0.0, 3.0}, {10.0, 3.0}});
  there.push_back({{10.0, 3.0}, {10.0, -3.0}});
  there.push_back({{10.0, -3.0}, {0.0, -3.0}});
  for (const double side : {-1.0, 1.0}) {
    Eigen::Vector2d before(0.0, 3.0 * side);
    bool is_near = true;
    for (double x = 0.0; x > -24.0; x -= 0.6) {
      const Eigen::Vector2d next(x, side * (is_near ? 0.7 : 1.9));
      there.push_back({before, next});
      before = next;
      is_near = !is_near;
    }
  }
  const Laser laser = NearLaser();
  Noise noise(4);
  OdometryRefinementOptions options = RefinerOptions();
  options.tracking.max_open_keys = 30;
  // Of the jagged corridor half fits the hall's long walls.
  options.tracking.min_tie_score = 0.65;
  OdometryRefiner refiner(options);
  constexpr int kCarried = 110;
  std::vector<Pose2> truth;
  for (int i = 0; i < 290; ++i) {
    truth.push_back(i < kCarried
                        ? Pose2(-8.5 + 0.15 * i, 0.0, 0.0)
                        : Pose2(-19.0 + 0.15 * (i - kCarried), 0.05, 0.0));
  }
  DriveAndBeCarried(hall, there, kCarried, truth, laser, &noise, &refiner);
  EXPECT_TRUE(refiner.late_ties().empty());
  ASSERT_EQ(refiner.loose().size(), 1u);
  EXPECT_FALSE(refiner.loose()[0].found);
}

// A pause in the log is no reason to be lost.
TEST(OdometryRefinerTest, AGapWithoutMotion) {
  Laser laser;
  laser.sigma = 0.01;
  Noise noise(7);
  OdometryRefiner refiner(RefinerOptions());
  Pose2 truth(-2.5, -2.0, 0.3);
  for (int i = 0; i < 30; ++i) {
    if (i > 0) truth = Compose(truth, {0.1, 0.0, DegToRad(2.0)});
    Scan scan = MakeScan(PlainHall(), truth, laser, &noise);
    scan.timestamp = 100.0 + 0.2 * i + (i < 15 ? 0.0 : 600.0);
    scan.odometry = truth;
    refiner.Process(scan);
  }
  refiner.Finish();
  EXPECT_EQ(refiner.losses(), 0);
  EXPECT_TRUE(refiner.loose().empty());
}

// Three people go along with the robot through a corridor with niches. Near as
// they are they have more returns than all that tells how far the robot went.
TEST(OdometryRefinerTest, PeopleWhoWalkAlong) {
  std::vector<WallEnds> walls;
  for (int k = -4; k < 20; ++k) {
    const double x = 2.0 * k;
    walls.push_back({{x, -1.0}, {x + 1.3, -1.0}});
    walls.push_back({{x + 1.3, -1.0}, {x + 1.3, -1.4}});
    walls.push_back({{x + 1.3, -1.4}, {x + 2.0, -1.4}});
    walls.push_back({{x + 2.0, -1.4}, {x + 2.0, -1.0}});
  }
  walls.push_back({{-8.0, 1.0}, {40.0, 1.0}});
  Laser laser;
  laser.sigma = 0.01;
  Noise noise(9);
  OdometryRefiner refiner(RefinerOptions());
  struct Person {
    int beam;
    double distance;
    double drift;
  };
  const std::vector<Person> people = {
      {70, 0.55, 0.05}, {92, 0.8, 0.02}, {115, 0.6, -0.03}};
  for (int i = 0; i < 120; ++i) {
    const Pose2 truth(0.1 * i, 0.0, 0.0);
    Scan scan = MakeScan(walls, truth, laser, &noise);
    if (i > 20) {
      for (const Person& person : people) {
        const double half = RadToDeg(0.125 / person.distance);
        const double middle = person.beam + person.drift * (i - 20);
        for (int b = static_cast<int>(middle - half); b <= middle + half; ++b) {
          if (scan.ranges[b] > person.distance) {
            scan.ranges[b] =
                static_cast<float>(person.distance + noise.Normal(0.02));
          }
        }
      }
    }
    scan.timestamp = 100.0 + 0.2 * i;
    // Odometry is 2 % short.
    scan.odometry = Pose2(0.098 * i, 0.0, 0.0);
    const RefinedScan refined = refiner.Process(scan);
    EXPECT_LT(PositionError(refined.pose, truth), 0.5) << i;
    EXPECT_LT(HeadingError(refined.pose, truth), DegToRad(3.0)) << i;
  }
  refiner.Finish();
  EXPECT_TRUE(refiner.loose().empty());
}

// A vehicle drives ahead of the robot in an aisle of shelves. It has more
// returns than all corners of shelves in sight, each of which says how far the
// robot went.
TEST(OdometryRefinerTest, AVehicleInAnAisleDoesNotTakeTheRobotAlong) {
  std::vector<WallEnds> shelves = {{{-3.0, -2.4}, {-3.0, 2.4}}};
  for (int k = 0; k < 7; ++k) {
    for (const double y : {-1.8, 1.8}) {
      for (const WallEnds& side :
           testing::Moved(Room(2.5, 1.1), {2.7 * k - 1.5, y, 0.0})) {
        shelves.push_back(side);
      }
    }
  }
  Laser laser;
  laser.sigma = 0.01;
  laser.maximum_range = 12.0;
  Noise noise(3);
  OdometryRefiner refiner(RefinerOptions());
  double largest = 0.0;
  for (int i = 0; i < 100; ++i) {
    const Pose2 truth(0.06 * i, 0.0, 0.0);
    std::vector<WallEnds> all = shelves;
    if (i >= 20) {
      for (const WallEnds& side :
           testing::Moved(Room(2.6, 1.1), {2.5 + 0.1 * i, 0.1, 0.0})) {
        all.push_back(side);
      }
    }
    Scan scan = MakeScan(all, truth, laser, &noise);
    scan.timestamp = 100.0 + 0.1 * i;
    // Odometry is 2 % long.
    scan.odometry = Pose2(0.0612 * i, 0.0, 0.0);
    largest =
        std::max(largest, PositionError(refiner.Process(scan).pose, truth));
  }
  EXPECT_LT(largest, 0.2);
}

// Only what lies within 45 degrees of ahead, up to 8 m.
Scan Narrowed(const Scan& scan) {
  Scan narrow = scan;
  narrow.ranges.clear();
  for (std::size_t i = 0; i < scan.ranges.size(); ++i) {
    const double angle =
        scan.start_angle + static_cast<double>(i) * scan.angle_step;
    if (std::abs(angle) > DegToRad(45.0)) continue;
    if (narrow.ranges.empty()) narrow.start_angle = angle;
    narrow.ranges.push_back(scan.ranges[i] < 8.0f ? scan.ranges[i] : 0.0f);
  }
  return narrow;
}

// A quarter of a view that turns on the spot: after a few scans that match
// nothing, some returns fit at a pose 1.2 m and 37 degrees from odometry's
// better than at the right one. What it sees after 40 degrees is a part of its
// own, until odometry or what it comes back to ties it.
TEST(OdometryRefinerTest, SomeReturnsThatFitDoNotOutweighOdometry) {
  const char* const folder = std::getenv("PLUMBLINE_DATASETS");
  const std::string path =
      std::string(folder == nullptr ? "" : folder) + "/fr079.clf.bz2";
  if (!std::ifstream(path)) GTEST_SKIP() << path << " is not there";
  const Log log = ReadCarmenLog(path, {});
  OdometryRefiner wide(RefinerOptions());
  OdometryRefiner narrow(RefinerOptions());
  std::vector<RefinedScan> all;
  std::vector<RefinedScan> part;
  for (std::size_t i = 1000; i < 1400; ++i) {
    wide.Process(log.scans[i]);
    narrow.Process(Narrowed(log.scans[i]));
    all = TakeAll(&wide, std::move(all));
    part = TakeAll(&narrow, std::move(part));
  }
  narrow.Finish();
  part = TakeAll(&narrow, std::move(part));
  ASSERT_EQ(part.size(), 400u);
  ASSERT_EQ(all.size(), part.size());
  for (std::size_t i = 10; i < part.size(); ++i) {
    const Pose2 right = Between(all[i - 10].pose, all[i].pose);
    const Pose2 seen = Between(part[i - 10].pose, part[i].pose);
    EXPECT_LT(PositionError(seen, right), 0.5) << i;
    EXPECT_LT(HeadingError(seen, right), DegToRad(15.0)) << i;
  }
}

// Motions from scan to scan of a piece of the log of fr079; none without it.
std::vector<Pose2> MotionsOfFr079(std::size_t begin, std::size_t end) {
  const char* const folder = std::getenv("PLUMBLINE_DATASETS");
  const std::string path =
      std::string(folder == nullptr ? "" : folder) + "/fr079.clf.bz2";
  if (!std::ifstream(path)) return {};
  const Log log = ReadCarmenLog(path, {});
  OdometryRefiner refiner(OdometryRefinementOptions{});
  std::vector<Pose2> motions;
  Pose2 last = Pose2::Zero();
  for (std::size_t i = begin; i < end; ++i) {
    const Pose2 pose = refiner.Process(log.scans[i]).pose;
    motions.push_back(Between(last, pose));
    last = pose;
  }
  return motions;
}

// On the way into an office little is seen that was seen before. The returns
// that find a partner slide along it, 0.35 m to the side between two scans.
TEST(OdometryRefinerTest, FewReturnsInCommonDoNotSlide) {
  for (const std::size_t begin : {1200, 1300, 1400, 1450, 1500, 1550}) {
    const std::vector<Pose2> motions = MotionsOfFr079(begin, 1613);
    if (motions.empty()) GTEST_SKIP() << "fr079 is not there";
    for (std::size_t i = 1595; i < 1611; ++i) {
      EXPECT_NEAR(motions[i - begin][0], 0.107, 0.06) << begin << " " << i;
      EXPECT_NEAR(motions[i - begin][1], 0.0, 0.06) << begin << " " << i;
    }
  }
}

// The robot backs while its odometry has it go forwards, which it does for
// some scans before its odometry is not believed any more.
TEST(OdometryRefinerTest, BacksWhileOdometryGoesForwards) {
  for (const std::size_t begin : {1000, 1200, 1250, 1300, 1350}) {
    const std::vector<Pose2> motions = MotionsOfFr079(begin, 1426);
    if (motions.empty()) GTEST_SKIP() << "fr079 is not there";
    for (std::size_t i = 1406; i < 1426; ++i) {
      EXPECT_NEAR(motions[i - begin][0], -0.107, 0.06) << begin << " " << i;
      EXPECT_NEAR(motions[i - begin][1], 0.0, 0.04) << begin << " " << i;
    }
  }
}

}  // namespace
}  // namespace plumbline
