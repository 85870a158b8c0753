#include <gtest/gtest.h>
#include <plumbline/frontend/part_joining.h>

#include <string>
#include <vector>

#include "frontend/long_hall.h"

namespace plumbline {
namespace {

using testing::HeadingError;
using testing::PositionError;
using testing::SeeHall;

std::vector<LooseTrack> Guessed(int begin, int end) {
  LooseTrack part;
  part.begin = begin;
  part.end = end;
  part.why = "scans are missing; where it went on is a guess";
  return {part};
}

TEST(PartJoiningTest, APartThatWasSeenLaterIsTied) {
  TrackSearch search{TrackingOptions(), ScanMatcherOptions()};
  // A part in the beginning that is lost, then the whole hall.
  SeeHall(-5.0, 30, 0, Pose2::Zero(), 0.2, &search);
  const Pose2 lost(50.0, 20.0, 2.0);
  SeeHall(-15.0, 90, 1, lost, -0.2, &search);
  std::vector<LooseTrack> loose = Guessed(290, 1190);
  const std::vector<LateTie> ties =
      JoinParts(TrackingOptions(), MatchDrift(), {0}, {}, &search, &loose);
  ASSERT_EQ(ties.size(), 1u);
  // The later part begins with key scan 30 and hangs on one of the first part.
  EXPECT_EQ(ties[0].scan, 300);
  EXPECT_LT(ties[0].since, 300);
  const auto since = static_cast<double>(ties[0].since / 10);
  const Pose2 truth(-15.0 - (-5.0 + 0.3 * since), -0.4, 0.0);
  EXPECT_LT(PositionError(ties[0].since_key.mean, truth), 0.1);
  EXPECT_LT(HeadingError(ties[0].since_key.mean, truth), DegToRad(1.0));
  EXPECT_TRUE(loose[0].found);
  EXPECT_EQ(loose[0].why,
            "scans are missing; found again on what was seen later");
  for (const SeenKey& key : search.seen()) EXPECT_EQ(key.part, 0);
}

// From the first of two pieces of a hall to the second.
const Pose2 kBlindMotion(-15.0 - (-5.0 + 0.3 * 29.0), -0.4, 0.0);

// Whether the two pieces are joined where odometry tells of the way from one to
// the other.
bool IsJoinedOver(BlindWay way) {
  TrackSearch search{TrackingOptions(), ScanMatcherOptions()};
  SeeHall(-5.0, 30, 0, Pose2::Zero(), 0.2, &search);
  SeeHall(-15.0, 90, 1, Pose2(50.0, 20.0, 2.0), -0.2, &search);
  std::vector<LooseTrack> loose = Guessed(290, 1190);
  way.from = 290;
  way.to = 300;
  const std::size_t ties =
      JoinParts(TrackingOptions(), MatchDrift(), {0}, {way}, &search, &loose)
          .size();
  EXPECT_EQ(search.seen().back().part, ties == 1 ? 0 : 1);
  return ties == 1;
}

// The right place need not be among those that were seen.
TEST(PartJoiningTest, OdometryOfABlindWayBetweenThemHasToAgree) {
  BlindWay way;
  way.motion.covariance = Eigen::Vector3d(1.0, 1.0, 0.1).asDiagonal();
  way.motion.mean = kBlindMotion;
  EXPECT_TRUE(IsJoinedOver(way));
  way.motion.mean[0] += 9.0;
  EXPECT_FALSE(IsJoinedOver(way));
}

// A turn may be less uncertain than its variance has it.
TEST(PartJoiningTest, OdometryOfABlindWayTurnsNoMoreWronglyThanItCan) {
  BlindWay way;
  way.motion.covariance = Eigen::Vector3d(1.0, 1.0, 1.0).asDiagonal();
  way.motion.mean = kBlindMotion;
  way.motion.mean[2] += 0.75;
  way.most_wrong_turn = 1.0;
  EXPECT_TRUE(IsJoinedOver(way));
  way.most_wrong_turn = 0.5;
  EXPECT_FALSE(IsJoinedOver(way));
}

TEST(PartJoiningTest, APartOfAnotherPlaceIsNot) {
  TrackSearch search{TrackingOptions(), ScanMatcherOptions()};
  SeeHall(-17.0, 30, 0, Pose2::Zero(), 0.2, &search);
  SeeHall(8.0, 30, 1, Pose2(50.0, 20.0, 2.0), 0.2, &search);
  std::vector<LooseTrack> loose = Guessed(290, 590);
  EXPECT_TRUE(
      JoinParts(TrackingOptions(), MatchDrift(), {0}, {}, &search, &loose)
          .empty());
  EXPECT_FALSE(loose[0].found);
  EXPECT_EQ(loose[0].why, Guessed(0, 0)[0].why);
}

// However unclear each window is, together they say where a part lies.
TEST(PartJoiningTest, WhatUnclearWindowsAgreeOnIsTaken) {
  TrackingOptions tracking;
  // Any other place is a rival.
  tracking.rival_share = 0.01;
  for (const bool is_there : {true, false}) {
    TrackSearch search{tracking, ScanMatcherOptions()};
    SeeHall(is_there ? -15.0 : 6.0, is_there ? 90 : 40, 0, Pose2::Zero(), -0.2,
            &search);
    const Pose2 lost(50.0, 20.0, 2.0);
    SeeHall(-14.0, 60, 1, lost, 0.2, &search);
    std::vector<LooseTrack> loose = Guessed(890, 1490);
    int clear = 0;
    search.set_trace([&clear](const std::string& line) {
      if (line == "LATE window found") ++clear;
    });
    const std::vector<LateTie> ties =
        JoinParts(tracking, MatchDrift(), {0}, {}, &search, &loose);
    // Two clear ones would do by themselves.
    EXPECT_LT(clear, 2);
    ASSERT_EQ(ties.size(), is_there ? 1u : 0u);
    if (!is_there) continue;
    EXPECT_TRUE(loose[0].found);
    const Pose2& first = search.seen()[90].pose;
    EXPECT_LT(PositionError(first, Pose2(-14.0, 0.2, 0.0)), 0.1);
    EXPECT_LT(HeadingError(first, Pose2(-14.0, 0.2, 0.0)), DegToRad(1.0));
  }
}

// Where much of it may lie elsewhere as well, the right place may be a third.
TEST(PartJoiningTest, APlaceWithARivalIsNotTaken) {
  TrackingOptions tracking;
  tracking.rival_share = 0.01;
  TrackSearch search{tracking, ScanMatcherOptions()};
  SeeHall(-15.0, 90, 0, Pose2::Zero(), -0.2, &search);
  SeeHall(-15.0, 56, 0, Pose2(0.0, 40.0, 0.0), -0.2, &search);
  SeeHall(-14.0, 84, 1, Pose2(50.0, 20.0, 2.0), 0.2, &search);
  std::vector<LooseTrack> loose = Guessed(1450, 2290);
  EXPECT_TRUE(
      JoinParts(tracking, MatchDrift(), {0}, {}, &search, &loose).empty());
  EXPECT_EQ(search.seen().back().part, 1);
}

// A part that hangs on a doubtful tie has to be less doubtful where it is
// found.
TEST(PartJoiningTest, AnotherPlaceMustBeLessDoubtful) {
  for (const double doubt : {0.9, 0.3}) {
    TrackSearch search{TrackingOptions(), ScanMatcherOptions()};
    SeeHall(-15.0, 90, 0, Pose2::Zero(), -0.2, &search);
    SeeHall(-5.0, 60, 1, Pose2(1.0, 0.0, 0.0), 0.2, &search);
    // Something that it does not see at its right place.
    for (std::size_t k = 128; k < 148; ++k) {
      for (Eigen::Vector4f& point : search.seen()[k].points) {
        point.head<2>() *= 0.5f;
      }
    }
    std::vector<LooseTrack> loose = Guessed(890, 900);
    loose[0].found = true;
    CutTies cut;
    cut.doubts = {{0, doubt}};
    cut.before = {0, 0};
    const std::vector<LateTie> ties = JoinParts(TrackingOptions(), MatchDrift(),
                                                {0}, {}, &search, &loose, cut);
    if (doubt < 0.5) {
      EXPECT_TRUE(ties.empty());
      EXPECT_EQ(search.seen().back().part, 1);
      EXPECT_NEAR(search.seen()[90].pose.x(), -4.0, 1e-9);
      EXPECT_EQ(loose[0].why, Guessed(0, 0)[0].why);
    } else {
      ASSERT_EQ(ties.size(), 1u);
      EXPECT_EQ(ties[0].loose, 0);
      EXPECT_NEAR(search.seen()[90].pose.x(), -5.0, 0.1);
    }
  }
}

// A part that was looked for in all of this before is not once more.
TEST(PartJoiningTest, OtherPartsAreLookedForWhenSomethingHasMoved) {
  TrackSearch search{TrackingOptions(), ScanMatcherOptions()};
  SeeHall(-15.0, 90, 0, Pose2::Zero(), -0.2, &search);
  SeeHall(-5.0, 30, 1, Pose2(1.0, 0.0, 0.0), 0.2, &search);
  std::vector<LooseTrack> loose = Guessed(890, 1190);
  CutTies cut;
  cut.before = {0, 1};
  EXPECT_TRUE(
      JoinParts(TrackingOptions(), MatchDrift(), {0}, {}, &search, &loose, cut)
          .empty());
  cut.before = {0, 0};
  EXPECT_EQ(
      JoinParts(TrackingOptions(), MatchDrift(), {0}, {}, &search, &loose, cut)
          .size(),
      1u);
}

TEST(PartJoiningTest, StoppedItLeavesAllAsItWas) {
  TrackSearch search{TrackingOptions(), ScanMatcherOptions()};
  SeeHall(-5.0, 30, 0, Pose2::Zero(), 0.2, &search);
  SeeHall(-15.0, 60, 1, Pose2(50.0, 20.0, 2.0), -0.2, &search);
  std::vector<LooseTrack> loose = Guessed(290, 890);
  search.set_stop([] { return true; });
  EXPECT_TRUE(
      JoinParts(TrackingOptions(), MatchDrift(), {0}, {}, &search, &loose)
          .empty());
  EXPECT_FALSE(loose[0].found);
  EXPECT_EQ(search.seen().back().part, 1);
}

TEST(PartJoiningTest, OnePartHasNothingToJoin) {
  TrackSearch search{TrackingOptions(), ScanMatcherOptions()};
  SeeHall(-5.0, 30, 0, Pose2::Zero(), 0.2, &search);
  std::vector<LooseTrack> loose;
  EXPECT_TRUE(
      JoinParts(TrackingOptions(), MatchDrift(), {}, {}, &search, &loose)
          .empty());
}

}  // namespace
}  // namespace plumbline
