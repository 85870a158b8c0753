#include <gtest/gtest.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/error.h>
#include <plumbline/core/registry.h>
#include <plumbline/frontend/wall_votes.h>

#include <cmath>
#include <vector>

namespace plumbline {
namespace {

class WallVotesTest : public ::testing::Test {
 protected:
  WallVotesTest() {
    RegisterBuiltinRelations(&registry_);
    options_.point_sigma = 0.1;
    options_.independence = 0.5;
    options_.loss_scale = 1e6;  // every weight is 1
    options_.max_offset = 0.2;
    options_.max_gap = 0.3;
  }

  // A wall along y = `y` from x = -1 to 1, seen from above (from below when
  // turned).
  FeatureId AddWall(double y, bool turned = false) {
    Transaction transaction;
    Feature feature;
    feature.type = &registry_.GetFeature("segment");
    feature.parameters = {0.0, y, turned ? kPi : 0.0};
    feature.extent_begin = -1.0;
    feature.extent_end = 1.0;
    transaction.AddFeature(feature);
    return graph_.Apply(std::move(transaction)).features[0];
  }

  // Kept in single precision: figures below hold to that.
  static SurfaceReturn Return(double x, double y, double normal_x,
                              double normal_y) {
    return {Eigen::Vector2d(x, y).cast<float>(),
            Eigen::Vector2d(normal_x, normal_y).cast<float>()};
  }

  std::vector<std::vector<WallVote>> Collect(const Place& place,
                                             const Pose2& pose) const {
    return CollectWallVotes(graph_, {place}, {pose}, options_);
  }

  Registry registry_;
  Graph graph_;
  WallVoteOptions options_;
};

TEST_F(WallVotesTest, InformationByHand) {
  const FeatureId wall = AddWall(-1.0);
  Place place;
  // From a robot at the origin looking along x; the last is 0.1 off the wall.
  place.returns = {Return(-1.0, -1.0, 0.0, 1.0), Return(0.0, -1.0, 0.0, 1.0),
                   Return(1.0, -0.9, 0.0, 1.0)};
  const auto votes = Collect(place, Pose2::Zero());
  ASSERT_EQ(votes.size(), 1u);
  ASSERT_EQ(votes[0].size(), 1u);
  EXPECT_EQ(votes[0][0].wall, wall);
  EXPECT_EQ(votes[0][0].points, 3);
  // Weight of a return 0.5 / 0.01 = 50; sums of x x, x y, x, y y, y and 1 over
  // the returns: 2, 0.1, 0, 2.81, -2.9, 3.
  Eigen::Matrix3d expected;
  expected << 100.0, 5.0, 0.0, 5.0, 140.5, -145.0, 0.0, -145.0, 150.0;
  EXPECT_LT((votes[0][0].information - expected).norm(), 1e-4);

  // As many scans count as one; seen from elsewhere, in that frame.
  place.num_scans = 2;
  const auto half = Collect(place, Pose2::Zero());
  EXPECT_LT((half[0][0].information - 0.5 * expected).norm(), 1e-4);
  Place moved = place;
  moved.num_scans = 1;
  for (SurfaceReturn& point : moved.returns) {
    point.position = {point.position.y() - 3.0, -point.position.x()};
    point.normal = {point.normal.y(), -point.normal.x()};
  }
  const auto from_elsewhere = Collect(moved, Pose2(0.0, 3.0, 0.5 * kPi));
  ASSERT_EQ(from_elsewhere[0].size(), 1u);
  // x and y of these returns in that frame: (-4, 1), (-4, 0), (-3.9, -1).
  Eigen::Matrix3d there;
  there << 2360.5, -5.0, -595.0, -5.0, 100.0, 0.0, -595.0, 0.0, 150.0;
  EXPECT_LT((from_elsewhere[0][0].information - there).norm(), 1e-3);
}

TEST_F(WallVotesTest, WeightsAreRobust) {
  AddWall(-1.0);
  options_.loss_scale = 1.0;
  Place place;
  // One standard deviation off: half the weight.
  place.returns = {Return(0.0, -0.9, 0.0, 1.0), Return(0.0, -0.9, 0.0, 1.0),
                   Return(0.0, -0.9, 0.0, 1.0)};
  const auto votes = Collect(place, Pose2::Zero());
  ASSERT_EQ(votes[0].size(), 1u);
  EXPECT_NEAR(votes[0][0].information(2, 2), 75.0, 1e-4);
}

TEST_F(WallVotesTest, OnlyWhatLiesOnTheWallAndIsSeenFromItsSide) {
  AddWall(-1.0);
  options_.min_points = 1;
  const auto number = [&](const SurfaceReturn& point) {
    Place place;
    place.returns = {point};
    return Collect(place, Pose2::Zero())[0].size();
  };
  EXPECT_EQ(number(Return(0.5, -1.0, 0.0, 1.0)), 1u);
  EXPECT_EQ(number(Return(0.5, -1.19, 0.0, 1.0)), 1u);
  EXPECT_EQ(number(Return(0.5, -1.21, 0.0, 1.0)), 0u);
  EXPECT_EQ(number(Return(1.29, -1.0, 0.0, 1.0)), 1u);
  EXPECT_EQ(number(Return(1.31, -1.0, 0.0, 1.0)), 0u);
  EXPECT_EQ(number(Return(-1.29, -1.0, 0.0, 1.0)), 1u);
  // The other face, a surface across, none at all.
  EXPECT_EQ(number(Return(0.5, -1.0, 0.0, -1.0)), 0u);
  EXPECT_EQ(number(Return(0.5, -1.0, 1.0, 0.0)), 0u);
  EXPECT_EQ(number(Return(0.5, -1.0, 0.0, 0.0)), 0u);
  const double turn = DegToRad(24.0);
  EXPECT_EQ(number(Return(0.5, -1.0, std::sin(turn), std::cos(turn))), 1u);
  options_.min_points = 2;
  EXPECT_EQ(number(Return(0.5, -1.0, 0.0, 1.0)), 0u);
}

TEST_F(WallVotesTest, TheNearestWallGetsTheVote) {
  const FeatureId lower = AddWall(-1.0);
  const FeatureId upper = AddWall(-0.9);
  AddWall(-0.95, true);  // the other face
  options_.min_points = 1;
  Place place;
  place.returns = {Return(0.0, -0.96, 0.0, 1.0), Return(0.0, -0.94, 0.0, 1.0),
                   Return(0.2, -0.75, 0.0, 1.0)};
  const auto votes = Collect(place, Pose2::Zero());
  ASSERT_EQ(votes[0].size(), 2u);
  EXPECT_EQ(votes[0][0].wall, lower);
  EXPECT_EQ(votes[0][0].points, 1);
  EXPECT_EQ(votes[0][1].wall, upper);
  EXPECT_EQ(votes[0][1].points, 2);
}

// A shut door 5.5 cm behind its wall: by default neither has the other's
// returns, also where a piece of the one is missing in the map.
TEST_F(WallVotesTest, ADoorSetBackDoesNotVoteForItsWall) {
  options_ = WallVoteOptions();
  AddWall(-1.0);
  Place wall;
  Place door;
  for (int i = -5; i <= 5; ++i) {
    wall.returns.push_back(Return(0.1 * i, -1.0, 0.0, 1.0));
    door.returns.push_back(Return(0.1 * i, -1.055, 0.0, 1.0));
  }
  EXPECT_EQ(Collect(wall, Pose2::Zero())[0].size(), 1u);
  EXPECT_EQ(Collect(door, Pose2::Zero())[0].size(), 0u);
}

TEST_F(WallVotesTest, SameForAnyNumberOfThreads) {
  AddWall(-1.0);
  AddWall(-0.9);
  std::vector<Place> places(7);
  std::vector<Pose2> poses;
  for (int k = 0; k < 7; ++k) {
    for (int i = 0; i < 40; ++i) {
      places[k].returns.push_back(
          Return(-1.0 + 0.05 * i, -1.0 + 0.01 * ((i * 7 + k) % 13), 0.0, 1.0));
    }
    poses.emplace_back(0.01 * k, -0.01 * k, 0.02 * k);
  }
  const auto one = CollectWallVotes(graph_, places, poses, options_);
  options_.num_threads = 4;
  const auto four = CollectWallVotes(graph_, places, poses, options_);
  for (int k = 0; k < 7; ++k) {
    ASSERT_EQ(one[k].size(), four[k].size());
    ASSERT_FALSE(one[k].empty());
    for (std::size_t i = 0; i < one[k].size(); ++i) {
      EXPECT_EQ(one[k][i].wall, four[k][i].wall);
      EXPECT_EQ(one[k][i].information, four[k][i].information);
    }
  }
}

TEST_F(WallVotesTest, NothingThere) {
  Place place;
  place.returns = {Return(0.5, -1.0, 0.0, 1.0)};
  EXPECT_TRUE(Collect(place, Pose2::Zero())[0].empty());
  AddWall(-1.0);
  EXPECT_TRUE(Collect(Place(), Pose2::Zero())[0].empty());
  EXPECT_THROW(CollectWallVotes(graph_, {place}, {}, options_), Error);
}

}  // namespace
}  // namespace plumbline
