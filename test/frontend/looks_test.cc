#include <gtest/gtest.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/error.h>
#include <plumbline/frontend/looks.h>

#include <cmath>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

using Eigen::Vector2d;

// Beams to the right, ahead, to the left, 1 degree and half a degree apart.
Scan OneScan() {
  Scan scan;
  scan.laser_offset = Pose2(0.2, 0.0, 0.0);
  scan.maximum_range = 80.0;
  scan.ranges = {2.0f, 3.0f, 0.0f, 40.0f, 4.0f};
  scan.bearings = {static_cast<float>(-kPi / 2), 0.0f, 0.3f,
                   static_cast<float>(kPi / 2),
                   static_cast<float>(kPi / 2 + DegToRad(0.5))};
  return scan;
}

TEST(LooksTest, SightLinesOfAScan) {
  const Looks looks = CollectLooks(
      {OneScan(), OneScan()},
      {{1, 7, Pose2(1.0, 2.0, kPi / 2)}, {0, kNoId, Pose2::Zero()}},
      LookOptions());
  ASSERT_EQ(looks.size(), 2u);
  EXPECT_EQ(looks[0].frame, 7);
  EXPECT_EQ(looks[1].frame, kNoId);
  EXPECT_LT((looks[0].sensor - Vector2d(1.0, 2.2)).norm(), 1e-9);
  // Without the beam that has no return and the one next to another; the long
  // one is cut.
  ASSERT_EQ(looks[0].ends.size(), 3u);
  EXPECT_LT((looks[0].ends[0] - Vector2d(3.0, 2.2)).norm(), 1e-5);
  EXPECT_LT((looks[0].ends[1] - Vector2d(1.0, 5.2)).norm(), 1e-5);
  EXPECT_LT((looks[0].ends[2] - Vector2d(-19.0, 2.2)).norm(), 1e-5);
  EXPECT_LT((looks[1].ends[0] - Vector2d(0.2, -2.0)).norm(), 1e-5);
}

class LooksOfAGraphTest : public ::testing::Test {
 protected:
  LooksOfAGraphTest() {
    RegisterBuiltinRelations(&registry_);
    Transaction transaction;
    for (const double y : {3.0, -1.0}) {
      Feature wall;
      wall.type = &registry_.GetFeature("segment");
      wall.parameters = {0.0, y, 0.0};
      wall.extent_end = 4.0;
      transaction.AddFeature(wall);
    }
    graph_.Apply(std::move(transaction));
    for (int k = 0; k < 5; ++k) {
      KeyScanRecord record;
      record.scan = 10 * k;
      record.pose = Pose2(k, 0.0, 0.0);
      if (k != 2) {
        // The second one was seen over more metres.
        for (const FeatureId id : {0, 1, 5}) {
          FeatureMatch match;
          match.feature = id;
          match.observation.length = 1.0 + static_cast<double>(id);
          record.matches.push_back(match);
        }
      }
      records_.push_back(record);
      poses_.push_back(record.pose);
    }
  }

  Registry registry_;
  Graph graph_;
  std::vector<KeyScanRecord> records_;
  std::vector<Pose2> poses_;
};

TEST_F(LooksOfAGraphTest, MovesWithTheWallSeenOverMostMetres) {
  const std::vector<LookPlace> looks =
      LooksFromWalls(records_, poses_, graph_, 2);
  // That of record 2 saw none.
  ASSERT_EQ(looks.size(), 2u);
  EXPECT_EQ(looks[1].scan, 40);
  EXPECT_EQ(looks[1].frame, 1);
  EXPECT_LT((looks[1].pose - Pose2(4.0, 1.0, 0.0)).norm(), 1e-12);
  poses_.pop_back();
  EXPECT_THROW(LooksFromWalls(records_, poses_, graph_, 2), Error);
}

TEST_F(LooksOfAGraphTest, OnePerPlace) {
  const std::vector<LookPlace> looks =
      LooksFromPlaces(records_, {50, 51, 52}, 2);
  ASSERT_EQ(looks.size(), 3u);
  EXPECT_EQ(looks[1].scan, 20);
  EXPECT_EQ(looks[1].frame, 51);
  EXPECT_EQ(looks[1].pose, Pose2::Zero());
  EXPECT_THROW(LooksFromPlaces(records_, {50, 51}, 2), Error);
}

}  // namespace
}  // namespace plumbline
