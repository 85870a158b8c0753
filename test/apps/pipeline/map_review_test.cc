#include <gtest/gtest.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/transaction.h>
#include <plumbline/factors/angle.h>
#include <plumbline/pipeline/map_review.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "frontend/synthetic_world.h"

namespace plumbline {
namespace {

// A drive, with what a map made of it says.
struct ReviewedDrive {
  std::vector<Scan> scans;
  std::vector<KeyScanRecord> records;
  std::vector<Pose2> trajectory;

  void Take(const std::vector<testing::WallEnds>& walls, const Pose2& pose,
            testing::Noise* noise, double maximum_range) {
    testing::Laser laser;
    laser.sigma = 0.01;
    laser.maximum_range = maximum_range;
    KeyScanRecord record;
    record.scan = static_cast<int>(scans.size());
    records.push_back(record);
    scans.push_back(testing::MakeScan(walls, pose, laser, noise));
    trajectory.push_back(pose);
  }

  MapReview Review(std::function<bool()> stop = nullptr) const {
    return MapReview(scans, records, trajectory, check, way_check,
                     std::move(stop));
  }

  MapCheckOptions check;
  WayCheckOptions way_check;
};

// Two rounds of 63 scans through a hall with pillars.
ReviewedDrive RoundsOfAHall() {
  std::vector<testing::WallEnds> walls = testing::Room(12.0, 9.0);
  for (const Pose2& place : {Pose2(0.5, 0.3, 0.4), Pose2(-5.2, 1.0, 0.0),
                             Pose2(3.5, -3.9, 0.0), Pose2(1.0, 4.0, 0.2)}) {
    for (const testing::WallEnds& side :
         testing::Moved(testing::Room(1.2, 0.8), place)) {
      walls.push_back(side);
    }
  }
  testing::Noise noise(3);
  ReviewedDrive drive;
  for (int i = 0; i < 126; ++i) {
    const double angle = 2.0 * kPi * (i % 63) / 63;
    drive.Take(walls,
               Pose2(3.0 * std::cos(angle), 3.0 * std::sin(angle),
                     NormalizeAngle(angle + 0.5 * kPi)),
               &noise, 30.0);
  }
  return drive;
}

LooseTrack SecondRound() {
  LooseTrack track;
  track.begin = 62;
  track.end = 63;
  track.found = true;
  track.why = "one match";
  return track;
}

TEST(MapReviewTest, WhatIsRightIsNoLongerReported) {
  std::vector<std::string> notes;
  const ReviewedDrive drive = RoundsOfAHall();
  const MapReview review = drive.Review();
  EXPECT_FALSE(review.HasContradictions());
  EXPECT_GT(review.Agreement().agreeing, 20);
  std::vector<LooseTrack> loose = {SecondRound()};
  review.Revise(Graph(), {}, true, &loose, &notes);
  EXPECT_TRUE(loose.empty());
  // No match says where a guess lies, whatever agrees.
  loose = {SecondRound()};
  loose[0].found = false;
  review.Revise(Graph(), {}, true, &loose, &notes);
  EXPECT_EQ(loose.size(), 1u);
}

// Scans that odometry alone placed, unless that is told already.
TEST(MapReviewTest, TellsWhatOdometryMissed) {
  std::vector<std::string> notes;
  const ReviewedDrive drive = RoundsOfAHall();
  const MapReview review = drive.Review();
  std::vector<RefinedScan> refined(drive.trajectory.size());
  refined[40].missed_since = 29;
  refined[40].missed = Pose2(0.3, 0.3, 0.1);
  std::vector<LooseTrack> loose;
  review.Revise(Graph(), refined, true, &loose, &notes);
  EXPECT_TRUE(loose.empty());
  refined[40].missed = Pose2(0.6, -0.8, 0.1);
  review.Revise(Graph(), refined, true, &loose, &notes);
  ASSERT_EQ(loose.size(), 1u);
  EXPECT_EQ(loose[0].begin, 29);
  EXPECT_EQ(loose[0].end, 40);
  EXPECT_TRUE(loose[0].found);
  EXPECT_EQ(
      loose[0].why,
      "odometry alone says how far the robot went here, and missed 1.0 m");
  LooseTrack guess;
  guess.begin = 20;
  guess.end = 50;
  loose = {guess};
  review.Revise(Graph(), refined, true, &loose, &notes);
  EXPECT_EQ(loose.size(), 1u);
}

TEST(MapReviewTest, TellsWaysThatOdometryHasLongerByFar) {
  std::vector<std::string> notes;
  ReviewedDrive drive = RoundsOfAHall();
  Pose2 odometry = Pose2::Zero();
  Pose2 before = drive.scans.front().odometry;
  for (std::size_t i = 0; i < drive.scans.size(); ++i) {
    Pose2 motion = Between(before, drive.scans[i].odometry);
    before = drive.scans[i].odometry;
    if (i >= 20 && i < 50) motion.head<2>() *= 2.0;
    odometry = Compose(odometry, motion);
    drive.scans[i].odometry = odometry;
  }
  std::vector<LooseTrack> loose;
  drive.Review().Revise(Graph(), {}, true, &loose, &notes);
  ASSERT_EQ(loose.size(), 1u);
  EXPECT_NEAR(loose[0].begin, 19, 2);
  EXPECT_NEAR(loose[0].end, 50, 3);
  EXPECT_TRUE(loose[0].found);
  EXPECT_EQ(loose[0].why.find("odometry has 1"), 0u) << loose[0].why;
  EXPECT_FALSE(drive.Review().Odometry().is_scale_disputed);
}

TEST(MapReviewTest, WhereSomethingIsWrongNothingIsTakenForSure) {
  std::vector<std::string> notes;
  ReviewedDrive drive = RoundsOfAHall();
  for (std::size_t i = 80; i < drive.trajectory.size(); ++i) {
    drive.trajectory[i] =
        Compose(Pose2(0.5, -0.8, DegToRad(35.0)), drive.trajectory[i]);
  }
  EXPECT_TRUE(drive.Review().HasContradictions());
  std::vector<LooseTrack> loose = {SecondRound()};
  drive.Review().Revise(Graph(), {}, true, &loose, &notes);
  ASSERT_GE(loose.size(), 2u);
  EXPECT_TRUE(std::is_sorted(loose.begin(), loose.end(),
                             [](const LooseTrack& a, const LooseTrack& b) {
                               return a.begin < b.begin;
                             }));
  EXPECT_EQ(std::count_if(loose.begin(), loose.end(),
                          [](const LooseTrack& track) {
                            return track.why == "one match";
                          }),
            1);
  EXPECT_EQ(std::count_if(loose.begin(), loose.end(),
                          [](const LooseTrack& track) {
                            return track.why.find("contradicts") !=
                                   std::string::npos;
                          }),
            static_cast<std::ptrdiff_t>(loose.size()) - 1);
}

TEST(MapReviewTest, NothingOnceItIsToldToStop) {
  std::vector<std::string> notes;
  const ReviewedDrive drive = RoundsOfAHall();
  const MapReview review = drive.Review([] { return true; });
  EXPECT_FALSE(review.HasContradictions());
  EXPECT_EQ(review.Agreement().agreeing, 0);
  std::vector<LooseTrack> loose = {SecondRound()};
  review.Revise(Graph(), {}, true, &loose, &notes);
  EXPECT_EQ(loose.size(), 1u);
}

// Along a corridor up to a wall, back, and through where it was.
ReviewedDrive ThroughAWall() {
  const std::vector<testing::WallEnds> corridor = {{{0.0, -1.0}, {30.0, -1.0}},
                                                   {{30.0, -1.0}, {30.0, 1.0}},
                                                   {{30.0, 1.0}, {0.0, 1.0}},
                                                   {{0.0, 1.0}, {0.0, -1.0}}};
  std::vector<testing::WallEnds> closed = corridor;
  closed.push_back({{15.0, -1.0}, {15.0, 1.0}});
  testing::Noise noise(5);
  ReviewedDrive drive;
  for (int i = 0; i < 24; ++i) {
    drive.Take(closed, Pose2(5.0 + 0.3 * i, 0.0, 0.0), &noise, 30.0);
  }
  for (int i = 0; i < 24; ++i) {
    drive.Take(closed, Pose2(12.0 - 0.3 * i, 0.0, kPi), &noise, 30.0);
  }
  for (int i = 0; i < 66; ++i) {
    drive.Take(corridor, Pose2(5.0 + 0.3 * i, 0.0, 0.0), &noise, 30.0);
  }
  return drive;
}

TEST(MapReviewTest, AWayThroughAWallOfTheMap) {
  std::vector<std::string> notes;
  const ReviewedDrive drive = ThroughAWall();
  Registry registry;
  RegisterBuiltinRelations(&registry);
  Graph graph;
  Transaction transaction;
  Feature wall;
  wall.type = &registry.GetFeature("segment");
  wall.parameters = {15.0, 0.0, 0.5 * kPi};
  wall.extent_begin = -0.95;
  wall.extent_end = 0.95;
  transaction.AddFeature(wall);
  graph.Apply(std::move(transaction));
  const auto through = [](const LooseTrack& track) {
    return track.why.find("went through") != std::string::npos;
  };
  std::vector<LooseTrack> loose;
  drive.Review().Revise(graph, {}, false, &loose, &notes);
  const auto found = std::find_if(loose.begin(), loose.end(), through);
  ASSERT_NE(found, loose.end());
  EXPECT_LT(found->begin, 24);
  EXPECT_GT(found->end, 60);
  EXPECT_EQ(std::count_if(loose.begin(), loose.end(), through), 1);

  // A loose part in between is why already.
  LooseTrack between = SecondRound();
  between.begin = 50;
  between.end = 51;
  loose = {between};
  drive.Review().Revise(graph, {}, false, &loose, &notes);
  EXPECT_EQ(std::count_if(loose.begin(), loose.end(), through), 0);

  // A map without that wall.
  loose.clear();
  drive.Review().Revise(Graph(), {}, false, &loose, &notes);
  EXPECT_EQ(std::count_if(loose.begin(), loose.end(), through), 0);
}

// Nothing but the two walls is in sight on 40 m.
TEST(MapReviewTest, OpenWaysAreToldWhenAskedFor) {
  std::vector<std::string> notes;
  const std::vector<testing::WallEnds> walls = testing::Room(120.0, 2.0);
  testing::Noise noise(4);
  ReviewedDrive drive;
  for (int i = 0; i < 140; ++i) {
    drive.Take(walls, Pose2(0.3 * i - 20.0, 0.1, 0.0), &noise, 8.0);
  }
  EXPECT_GT(drive.Review().LargestOpenSigma(), 0.2);
  std::vector<LooseTrack> loose;
  drive.Review().Revise(Graph(), {}, false, &loose, &notes);
  EXPECT_TRUE(loose.empty());
  EXPECT_TRUE(notes.empty());
  drive.Review().Revise(Graph(), {}, true, &loose, &notes);
  ASSERT_FALSE(loose.empty());
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_EQ(notes[0].find("little in sight shows how far the robot went: "
                          "places "),
            0u)
      << notes[0];
  EXPECT_NE(loose[0].why.find("how far the robot went"), std::string::npos);
  EXPECT_EQ(RoundsOfAHall().Review().LargestOpenSigma(), 0.0);
}

}  // namespace
}  // namespace plumbline
