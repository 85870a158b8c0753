#include <gtest/gtest.h>
#include <plumbline/frontend/part_joining.h>

#include <cmath>
#include <vector>

#include "frontend/synthetic_world.h"

namespace plumbline {
namespace {

using testing::FullCircle;
using testing::HeadingError;
using testing::MakeScan;
using testing::PointsOf;
using testing::PositionError;
using testing::Room;
using testing::WallEnds;

// A hall in which something else stands every 2 m.
std::vector<WallEnds> LongHall() {
  std::vector<WallEnds> walls = Room(40.0, 6.0);
  testing::Noise layout(7);
  for (double x = -18.0; x < 19.0; x += 2.0) {
    const Pose2 place(x + 0.3 * layout.Normal(1.0),
                      layout.Normal(1.0) > 0.0 ? 1.8 : -1.8,
                      0.5 * layout.Normal(1.0));
    for (const WallEnds& side : testing::Moved(
             Room(0.5 + 0.2 * std::abs(layout.Normal(1.0)), 0.8), place)) {
      walls.push_back(side);
    }
  }
  return walls;
}

// `count` key scans along the hall from `x` on, as part `part`; their poses are
// off by `shift`.
void SeeHall(double x, int count, int part, const Pose2& shift, double y,
             TrackSearch* search) {
  static const std::vector<WallEnds> hall = LongHall();
  for (int k = 0; k < count; ++k) {
    const Pose2 truth(x + 0.3 * k, y, 0.0);
    search->Add(
        {static_cast<int>(10 * search->seen().size()), Compose(shift, truth),
         PointsOf(MakeScan(hall, truth, FullCircle()), ScanPointsOptions()),
         Eigen::Vector2d::Zero()},
        part);
  }
}

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
      JoinParts(TrackingOptions(), MatchDrift(), {0}, &search, &loose);
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

TEST(PartJoiningTest, APartOfAnotherPlaceIsNot) {
  TrackSearch search{TrackingOptions(), ScanMatcherOptions()};
  SeeHall(-17.0, 30, 0, Pose2::Zero(), 0.2, &search);
  SeeHall(8.0, 30, 1, Pose2(50.0, 20.0, 2.0), 0.2, &search);
  std::vector<LooseTrack> loose = Guessed(290, 590);
  EXPECT_TRUE(
      JoinParts(TrackingOptions(), MatchDrift(), {0}, &search, &loose).empty());
  EXPECT_FALSE(loose[0].found);
  EXPECT_EQ(loose[0].why, Guessed(0, 0)[0].why);
}

TEST(PartJoiningTest, StoppedItLeavesAllAsItWas) {
  TrackSearch search{TrackingOptions(), ScanMatcherOptions()};
  SeeHall(-5.0, 30, 0, Pose2::Zero(), 0.2, &search);
  SeeHall(-15.0, 60, 1, Pose2(50.0, 20.0, 2.0), -0.2, &search);
  std::vector<LooseTrack> loose = Guessed(290, 890);
  search.set_stop([] { return true; });
  EXPECT_TRUE(
      JoinParts(TrackingOptions(), MatchDrift(), {0}, &search, &loose).empty());
  EXPECT_FALSE(loose[0].found);
  EXPECT_EQ(search.seen().back().part, 1);
}

TEST(PartJoiningTest, OnePartHasNothingToJoin) {
  TrackSearch search{TrackingOptions(), ScanMatcherOptions()};
  SeeHall(-5.0, 30, 0, Pose2::Zero(), 0.2, &search);
  std::vector<LooseTrack> loose;
  EXPECT_TRUE(
      JoinParts(TrackingOptions(), MatchDrift(), {}, &search, &loose).empty());
}

}  // namespace
}  // namespace plumbline
