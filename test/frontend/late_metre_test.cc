#include <gtest/gtest.h>
#include <plumbline/factors/angle.h>
#include <plumbline/frontend/late_metre.h>

#include <vector>

#include "frontend/synthetic_world.h"

namespace plumbline {
namespace {

MetreUse Use(int scan, double used, double learnt, double variance,
             double added_variance, const Eigen::Vector3d& change) {
  MetreUse use;
  use.scan = scan;
  use.way = 1.0;
  use.used = used;
  use.learnt = learnt;
  use.variance = variance;
  use.added_variance = added_variance;
  use.change = change;
  return use;
}

// By hand: the last metre stands; the one before is 1.0 + 3 / (3 + 1) of what
// it lacks to 0.98, and the first 1.0 + 4 / (4 + 1) of what it lacks to that.
TEST(LateMetreTest, TheMetreOfAllTimesIsThatOfAllThatWasLearnt) {
  const Eigen::Vector3d ahead(1.0, 0.0, 0.0);
  const std::vector<MetreUse> uses = {
      Use(3, 1.0, 1.0, 4e-4, 1e-4, ahead), Use(6, 1.0, 1.0, 3e-4, 1e-4, ahead),
      Use(9, 1.0, 0.98, 2e-4, 1e-4, Eigen::Vector3d(0.5, 0.1, 0.01))};
  const LateMetre late = FindLateMetre(uses, {10.0, 0.01});
  const std::vector<MotionCorrection>& corrections = late.corrections;
  ASSERT_EQ(corrections.size(), 3u);
  EXPECT_EQ(corrections[0].scan, 3);
  EXPECT_NEAR(corrections[2].change[0], -0.02 * 0.5, 1e-12);
  EXPECT_NEAR(corrections[2].change[1], -0.02 * 0.1, 1e-12);
  EXPECT_NEAR(corrections[2].change[2], -0.02 * 0.01, 1e-12);
  EXPECT_NEAR(corrections[1].change[0], -0.015, 1e-12);
  EXPECT_NEAR(corrections[0].change[0], -0.012, 1e-12);
  EXPECT_NEAR(late.largest_change,
              0.012 + 0.015 + 0.02 * Eigen::Vector2d(0.5, 0.1).norm(), 1e-12);
  // Of the last two metres alone.
  EXPECT_NEAR(FindLateMetre(uses, {2.0, 0.01}).largest_change, 0.012 + 0.015,
              1e-12);
}

TEST(LateMetreTest, LittleIsLeftAsItIs) {
  const Eigen::Vector3d ahead(1.0, 0.0, 0.0);
  const std::vector<MetreUse> uses = {Use(1, 1.0, 1.0, 4e-4, 1e-4, ahead),
                                      Use(2, 1.0, 0.99, 3e-4, 1e-4, ahead)};
  const LateMetre late = FindLateMetre(uses, {50.0, 0.1});
  EXPECT_TRUE(late.corrections.empty());
  EXPECT_NEAR(late.largest_change, 0.018, 1e-12);
  EXPECT_TRUE(FindLateMetre({}, {}).corrections.empty());
  EXPECT_EQ(FindLateMetre({}, {}).largest_change, 0.0);
}

RefinedScan ScanAt(const Pose2& since_key, const Pose2& pose, bool is_key) {
  RefinedScan scan;
  scan.since_key.mean = since_key;
  scan.pose = pose;
  scan.is_key = is_key;
  return scan;
}

// Two motions of a metre each with a scan in the middle of each, then a track
// of its own.
std::vector<RefinedScan> TwoMotionsAndATrack() {
  std::vector<RefinedScan> scans = {
      ScanAt(Pose2::Zero(), Pose2(0.0, 0.0, 0.0), true),
      ScanAt(Pose2(0.5, 0.0, 0.0), Pose2(0.5, 0.0, 0.0), false),
      ScanAt(Pose2(1.0, 0.0, 0.5 * kPi), Pose2(1.0, 0.0, 0.5 * kPi), true),
      ScanAt(Pose2(0.5, 0.0, 0.0), Pose2(1.0, 0.5, 0.5 * kPi), false),
      ScanAt(Pose2(1.0, 0.0, 0.0), Pose2(1.0, 1.0, 0.5 * kPi), true),
      ScanAt(Pose2(0.2, 0.0, 0.0), Pose2(1.0, 1.2, 0.5 * kPi), false),
      ScanAt(Pose2(2.0, 0.0, 0.0), Pose2(1.0, 3.0, 0.5 * kPi), true)};
  scans[6].tie = TrackTie::kLoose;
  return scans;
}

TEST(LateMetreTest, MotionsChangeByTheirShareAndPosesFollow) {
  std::vector<RefinedScan> scans = TwoMotionsAndATrack();
  CorrectMotions({{2, Pose2(-0.02, 0.0, 0.0)}, {4, Pose2(-0.04, 0.0, 0.0)}},
                 &scans);
  EXPECT_NEAR(scans[1].since_key.mean[0], 0.49, 1e-12);
  EXPECT_NEAR(scans[2].since_key.mean[0], 0.98, 1e-12);
  EXPECT_NEAR(scans[3].since_key.mean[0], 0.48, 1e-12);
  EXPECT_NEAR(scans[4].since_key.mean[0], 0.96, 1e-12);
  EXPECT_EQ(scans[5].since_key.mean[0], 0.2);
  const Pose2 expected[] = {
      Pose2(0.0, 0.0, 0.0),         Pose2(0.49, 0.0, 0.0),
      Pose2(0.98, 0.0, 0.5 * kPi),  Pose2(0.98, 0.48, 0.5 * kPi),
      Pose2(0.98, 0.96, 0.5 * kPi), Pose2(0.98, 1.16, 0.5 * kPi),
      Pose2(0.98, 2.96, 0.5 * kPi)};
  for (std::size_t i = 0; i < scans.size(); ++i) {
    EXPECT_LT((scans[i].pose - expected[i]).norm(), 1e-12) << i;
  }
}

// Both count, as when one is found on what the other has left.
TEST(LateMetreTest, TwoCorrectionsOfOneMotionAddUp) {
  std::vector<RefinedScan> scans = TwoMotionsAndATrack();
  CorrectMotions({{2, Pose2(-0.02, 0.0, 0.0)}, {2, Pose2(-0.04, 0.0, 0.0)}},
                 &scans);
  EXPECT_NEAR(scans[1].since_key.mean[0], 0.47, 1e-12);
  EXPECT_NEAR(scans[2].since_key.mean[0], 0.94, 1e-12);
  EXPECT_NEAR(scans[3].since_key.mean[0], 0.5, 1e-12);
}

// How another track hangs on what was before is not odometry's to say.
TEST(LateMetreTest, TheBeginOfATrackStays) {
  std::vector<RefinedScan> scans = TwoMotionsAndATrack();
  CorrectMotions({{6, Pose2(-0.1, 0.0, 0.0)}, {40, Pose2(-0.1, 0.0, 0.0)}},
                 &scans);
  const std::vector<RefinedScan> before = TwoMotionsAndATrack();
  for (std::size_t i = 0; i < scans.size(); ++i) {
    EXPECT_EQ(scans[i].since_key.mean, before[i].since_key.mean) << i;
    EXPECT_LT((scans[i].pose - before[i].pose).norm(), 1e-12) << i;
  }
  std::vector<RefinedScan> none;
  CorrectMotions({{0, Pose2(1.0, 0.0, 0.0)}}, &none);
  EXPECT_TRUE(none.empty());
}

// A bare corridor whose ends are out of sight, with posts along its walls only
// from 30 m on: odometry's metre is learnt there, and the way before them has
// its length only then.
TEST(LateMetreTest, ABareCorridorHasItsLengthOnceTheMetreIsKnown) {
  constexpr double kMetre = 0.95;
  std::vector<testing::WallEnds> walls = testing::Corridor();
  for (int k = 0; k < 12; ++k) {
    for (const testing::WallEnds& side : testing::Moved(
             testing::Room(0.3, 0.3),
             Pose2(30.0 + 1.7 * k, k % 2 == 0 ? 0.8 : -0.8, 0.2 * k))) {
      walls.push_back(side);
    }
  }
  testing::Laser laser;
  laser.maximum_range = 8.0;
  laser.sigma = 0.01;
  testing::Noise noise(4);
  OdometryRefiner refiner({});
  std::vector<RefinedScan> refined;
  double last = 0.0;
  for (double x = 0.0; x < 45.0; x += 0.15) {
    Scan scan = testing::MakeScan(walls, Pose2(x, 0.0, 0.0), laser, &noise);
    scan.odometry = Pose2(x / kMetre, 0.0, 0.0);
    scan.timestamp = x;
    last = x;
    refined.push_back(refiner.Process(scan));
  }
  const double way_before = refined[160].pose[0];  // After 24 m.
  EXPECT_GT(way_before, 24.0 + 0.5);
  EXPECT_NEAR(refiner.odometry_scale(), kMetre, 0.01);
  const LateMetre late = FindLateMetre(refiner.metre_uses(), {});
  ASSERT_FALSE(late.corrections.empty());
  EXPECT_GT(late.largest_change, 0.5);
  const double end_before = refined.back().pose[0];
  CorrectMotions(late.corrections, &refined);
  EXPECT_NEAR(refined[160].pose[0], 24.0, 0.3);
  EXPECT_NEAR(refined.back().pose[0], last, 0.4);
  EXPECT_LT(refined.back().pose[0], end_before - 0.5);
}

}  // namespace
}  // namespace plumbline
