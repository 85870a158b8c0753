#include <gtest/gtest.h>
#include <plumbline/frontend/track_search.h>

#include <cmath>
#include <numeric>
#include <string>
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

// A room with a corner cut off by a cupboard and something that stands free:
// it looks like itself from one place alone.
std::vector<WallEnds> OneRoom(const Pose2& at) {
  std::vector<WallEnds> walls = Room(8.0, 6.0);
  for (const WallEnds& side : testing::Moved(Room(1.5, 0.8), {3.2, 2.6, 0.0})) {
    walls.push_back(side);
  }
  for (const WallEnds& side :
       testing::Moved(Room(0.6, 1.2), {-1.0, 0.8, 0.4})) {
    walls.push_back(side);
  }
  return testing::Moved(walls, at);
}

// Key scans on a way of 3 m through a room at `at`, as seen in a frame in which
// its first pose is `start`.
std::vector<TrackKey> Keys(const std::vector<WallEnds>& walls, const Pose2& at,
                           const Pose2& start, double y) {
  std::vector<TrackKey> keys;
  const Pose2 first = Compose(at, Pose2(-2.0, y, 0.0));
  for (int k = 0; k < 10; ++k) {
    const Pose2 truth = Compose(first, Pose2(0.3 * k, 0.0, 0.05 * k));
    const Scan scan = MakeScan(walls, truth, FullCircle());
    keys.push_back({k, Compose(start, Between(first, truth)),
                    PointsOf(scan, ScanPointsOptions()),
                    Eigen::Vector2d::Zero()});
  }
  return keys;
}

std::vector<std::size_t> All(const TrackSearch& search) {
  std::vector<std::size_t> where(search.seen().size());
  std::iota(where.begin(), where.end(), std::size_t{0});
  return where;
}

// Where the middle one of the keys is found in what was seen in the rooms.
bool Find(const std::vector<Pose2>& rooms, const std::vector<TrackKey>& keys,
          FoundTrack* found) {
  TrackSearch search{TrackingOptions(), ScanMatcherOptions()};
  for (const Pose2& room : rooms) {
    const Pose2 first = Compose(room, Pose2(-2.0, -0.8, 0.0));
    for (const TrackKey& key : Keys(OneRoom(room), room, first, -0.8)) {
      search.Add(key, 0);
    }
  }
  const std::vector<std::size_t> where = All(search);
  return search.FindAnywhere(keys, search.AreaOf(where), 0, keys.size(), 0.0,
                             nullptr, found);
}

TEST(TrackSearchTest, FindsARoomFromAnotherWay) {
  const Pose2 room(20.0, -7.0, 1.1);
  const Pose2 elsewhere(3.0, 4.0, -2.0);
  const std::vector<TrackKey> keys = Keys(OneRoom(room), room, elsewhere, -1.3);
  FoundTrack found;
  ASSERT_TRUE(Find({room}, keys, &found));
  const Pose2 truth = Compose(room, Pose2(-2.0 + 1.5, -1.3, 0.25));
  EXPECT_LT(PositionError(found.pose, truth), 0.05);
  EXPECT_LT(HeadingError(found.pose, truth), DegToRad(1.0));
  EXPECT_TRUE(found.holds);
  EXPECT_GT(found.support, 0.96);
}

TEST(TrackSearchTest, TwoRoomsAlikeAreNoPlace) {
  const Pose2 room(20.0, -7.0, 1.1);
  const std::vector<TrackKey> keys =
      Keys(OneRoom(room), room, Pose2::Zero(), -1.3);
  FoundTrack found;
  EXPECT_FALSE(Find({room, Pose2(40.0, 3.0, 0.0)}, keys, &found));
}

TEST(TrackSearchTest, AnotherRoomIsNotFound) {
  const std::vector<WallEnds> walls = Room(7.0, 7.5);
  const std::vector<TrackKey> keys =
      Keys(walls, Pose2::Zero(), Pose2::Zero(), 0.5);
  FoundTrack found;
  EXPECT_FALSE(Find({Pose2(20.0, -7.0, 1.1)}, keys, &found));
}

TEST(TrackSearchTest, StopsWhenItIsAsked) {
  TrackSearch search{TrackingOptions(), ScanMatcherOptions()};
  const std::vector<TrackKey> keys =
      Keys(OneRoom(Pose2::Zero()), Pose2::Zero(), Pose2(-2.0, -0.8, 0.0), -0.8);
  for (const TrackKey& key : keys) search.Add(key, 0);
  const std::vector<std::size_t> where = All(search);
  const TrackSearch::SearchArea area = search.AreaOf(where);
  FoundTrack found;
  EXPECT_FALSE(search.Stops());
  EXPECT_TRUE(search.FindAnywhere(keys, area, 0, 10, 0.0, nullptr, &found));
  search.set_stop([] { return true; });
  EXPECT_TRUE(search.Stops());
  EXPECT_FALSE(search.FindAnywhere(keys, area, 0, 10, 0.0, nullptr, &found));
}

TEST(TrackSearchTest, KeepsKeyScansThinnedOut) {
  TrackSearch search{TrackingOptions(), ScanMatcherOptions()};
  const std::vector<TrackKey> keys =
      Keys(OneRoom(Pose2::Zero()), Pose2::Zero(), Pose2::Zero(), 0.0);
  for (const TrackKey& key : keys) search.Add(key, 3);
  ASSERT_EQ(search.seen().size(), 10u);
  const std::vector<TrackKey> kept = search.Unpacked({2, 7});
  ASSERT_EQ(kept.size(), 2u);
  EXPECT_EQ(kept[1].scan, 7);
  EXPECT_EQ(kept[1].pose, keys[7].pose);
  EXPECT_EQ(search.seen()[7].part, 3);
  EXPECT_LT(kept[1].points.size(), keys[7].points.size());
  EXPECT_GT(kept[1].points.size(), 50u);
  for (std::size_t i = 1; i < kept[1].points.size(); ++i) {
    EXPECT_GE(
        (kept[1].points[i].position - kept[1].points[i - 1].position).norm(),
        0.1 - 1e-5);
  }
  search.Clear();
  EXPECT_TRUE(search.seen().empty());
}

TEST(TrackSearchTest, CovarianceOfATie) {
  FoundTrack found;
  // 1e4 across y of the map, nothing along x; the tie begins at a pose that
  // looks along y.
  found.information = Eigen::Vector3d(0.0, 1e4, 1e6).asDiagonal();
  const Eigen::Matrix3d covariance =
      TieCovariance(found, Pose2(5.0, 6.0, 0.5 * kPi));
  // 1 / (1e4 + 1 / 2^2) + 0.03^2, 2^2 + 0.03^2.
  EXPECT_NEAR(covariance(0, 0), 1.0 / 10000.25 + 0.0009, 1e-12);
  EXPECT_NEAR(covariance(1, 1), 4.0009, 1e-9);
  EXPECT_NEAR(covariance(0, 1), 0.0, 1e-9);
  EXPECT_NEAR(covariance(2, 2),
              1.0 / (1e6 + 1.0 / (kPi * kPi)) + DegToRad(0.5) * DegToRad(0.5),
              1e-12);
}

}  // namespace
}  // namespace plumbline
