#include <gtest/gtest.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/sight_lines.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

using Eigen::Vector2d;

Wall AlongX(double y, double begin, double end) {
  return MakeWall(Vector2d(0.0, y), 0.0, begin, end);
}

TEST(SightCrossingTest, WhereAndHowFar) {
  const Wall wall = AlongX(2.0, 0.0, 10.0);
  // Down, 3 along for 4 across.
  const auto crossing = CrossingOf(wall, {3.0, 4.0}, {6.0, 0.0});
  ASSERT_TRUE(crossing.has_value());
  EXPECT_NEAR(crossing->along, 4.5, 1e-12);
  EXPECT_NEAR(crossing->beyond, 2.0, 1e-12);
  EXPECT_EQ(crossing->side, 1.0);
  EXPECT_NEAR(crossing->slant, 0.8, 1e-12);
  const auto back = CrossingOf(wall, {6.0, 0.0}, {3.0, 4.0});
  ASSERT_TRUE(back.has_value());
  EXPECT_EQ(back->side, -1.0);
  EXPECT_NEAR(back->along, 4.5, 1e-12);
}

TEST(SightCrossingTest, NoneOnOneSide) {
  const Wall wall = AlongX(2.0, 0.0, 10.0);
  EXPECT_FALSE(CrossingOf(wall, {3.0, 4.0}, {6.0, 2.5}));
  // Along the wall, on it and beside it; and of no length.
  EXPECT_FALSE(CrossingOf(wall, {3.0, 2.0}, {6.0, 2.0}));
  EXPECT_FALSE(CrossingOf(wall, {3.0, 1.0}, {6.0, 1.0}));
  EXPECT_FALSE(CrossingOf(wall, {3.0, 1.0}, {3.0, 1.0}));
  // From on it.
  EXPECT_FALSE(CrossingOf(wall, {3.0, 2.0}, {6.0, 1.0}));
}

TEST(SightCrossingTest, AWallOfNoLengthHasALineAllTheSame) {
  const auto crossing =
      CrossingOf(AlongX(0.0, 0.0, 0.0), {1.0, 1.0}, {1.0, -1.0});
  ASSERT_TRUE(crossing.has_value());
  EXPECT_NEAR(crossing->along, 1.0, 1e-12);
}

class PlacedLooksTest : public ::testing::Test {
 protected:
  PlacedLooksTest() { RegisterBuiltinRelations(&registry_); }

  FeatureId Add(const char* type, const Pose2& pose) {
    Feature feature;
    feature.type = &registry_.GetFeature(type);
    feature.parameters = {pose[0], pose[1], pose[2]};
    Transaction transaction;
    transaction.AddFeature(feature);
    return graph_.Apply(std::move(transaction)).features[0];
  }

  Registry registry_;
  Graph graph_;
};

TEST_F(PlacedLooksTest, MovesWithItsFrame) {
  const FeatureId pose = Add("pose", Pose2(5.0, 1.0, M_PI / 2));
  Looks looks(3);
  looks[0].frame = pose;
  looks[0].sensor = Vector2d(1.0, 0.0);
  looks[1].frame = 17;  // not there
  looks[2].sensor = Vector2d(0.0, 30.0);
  const PlacedLooks placed(looks, graph_);
  ASSERT_EQ(placed.size(), 2u);
  const Wall wall = AlongX(4.0, 0.0, 10.0);
  // The sensor is at (5, 2), the wall 2 in front of it.
  EXPECT_EQ(placed.Near(wall, 2.01), (std::vector<std::size_t>{0}));
  EXPECT_TRUE(placed.Near(wall, 1.99).empty());
  EXPECT_EQ(placed.Near(wall, 30.0).size(), 2u);
  // One whose ends are the wrong way round has no visible part.
  EXPECT_TRUE(placed.Near(AlongX(4.0, 10.0, 0.0), 30.0).empty());
  const Wall seen = placed.Seen(0, wall);
  EXPECT_NEAR(seen.Across(looks[0].sensor), -2.0, 1e-12);
  EXPECT_NEAR(seen.At(5.0).x(), 3.0, 1e-12);
  EXPECT_NEAR(seen.At(5.0).y(), 0.0, 1e-12);

  graph_.GetFeature(pose).parameters[1] = 0.5;
  EXPECT_TRUE(PlacedLooks(looks, graph_).Near(wall, 2.01).empty());
}

TEST_F(PlacedLooksTest, NearIsWhatIsWithinRange) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> place(-25.0, 25.0);
  Looks looks(400);
  for (Look& look : looks) {
    look.frame = Add("pose", Pose2(place(random), place(random), 1.0));
    look.sensor = Vector2d(0.3, -0.1);
  }
  const PlacedLooks placed(looks, graph_);
  ASSERT_EQ(placed.size(), looks.size());
  std::size_t found = 0;
  for (int k = 0; k < 200; ++k) {
    const Wall wall = MakeWall(Vector2d(place(random), place(random)), 0.13 * k,
                               -0.1 * k, 0.05 * k);
    const double range = 0.1 + 0.03 * k;
    std::vector<std::size_t> near = placed.Near(wall, range);
    std::sort(near.begin(), near.end());
    std::vector<std::size_t> expected;
    for (std::size_t i = 0; i < placed.size(); ++i) {
      const Vector2d sensor =
          TransformPoint(placed.frame(i), placed.look(i).sensor);
      EXPECT_NEAR((placed.sensor(i) - sensor).norm(), 0.0, 1e-12);
      const double along = std::clamp(wall.Along(sensor), wall.begin, wall.end);
      if ((sensor - wall.At(along)).norm() <= range) expected.push_back(i);
    }
    EXPECT_EQ(near, expected) << k;
    found += near.size();
  }
  EXPECT_GT(found, 2000u);
}

// Looks from y = 2 straight down at the wall y = 0, 0.05 apart: to y = 0 where
// there is wall, far behind it where there is none.
Look LookDown(double begin, double end, double hole_begin, double hole_end) {
  Look look;
  look.sensor = Vector2d(0.5 * (begin + end), 2.0);
  for (double x = begin; x < end; x += 0.05) {
    Vector2d line = Vector2d(x, 0.0) - look.sensor;
    if (x > hole_begin && x < hole_end) line *= 2.0;
    look.ends.push_back(look.sensor + line);
  }
  return look;
}

TEST(SeenPiecesTest, FindsTheOpening) {
  const Wall wall = AlongX(0.0, 0.0, 4.0);
  SeenPieces pieces(0.0, 4.0, SeenThroughOptions());
  // Two looks are not enough for lines twice as dense as pieces are to be
  // three each.
  const Look look = LookDown(0.0, 4.0, 1.0, 2.0);
  pieces.Add(wall, look);
  EXPECT_TRUE(pieces.Through(0.5).empty());
  pieces.Add(wall, look);
  const std::vector<Interval> through = pieces.Through(0.5);
  ASSERT_EQ(through.size(), 1u);
  EXPECT_NEAR(through[0].first, 1.0, 0.11);
  EXPECT_NEAR(through[0].second, 2.0, 0.11);
  // Wider than that it is not.
  EXPECT_TRUE(pieces.Through(1.2).empty());
}

TEST(SeenPiecesTest, WhatWasSeenAsWallIsNoOpening) {
  const Wall wall = AlongX(0.0, 0.0, 4.0);
  SeenPieces pieces(0.0, 4.0, SeenThroughOptions());
  for (int i = 0; i < 3; ++i) {
    pieces.Add(wall, LookDown(0.0, 4.0, 1.0, 2.0));
    pieces.Add(wall, LookDown(0.0, 4.0, 9.0, 9.0));
  }
  EXPECT_TRUE(pieces.Through(0.1).empty());
}

TEST(SeenPiecesTest, GrazingLinesAndShortOnesSayNothing) {
  const Wall wall = AlongX(0.0, 0.0, 4.0);
  Look grazing;
  grazing.sensor = Vector2d(-8.0, 2.0);
  Look near_behind = LookDown(0.0, 4.0, 9.0, 9.0);
  for (double x = 0.0; x < 4.0; x += 0.02) {
    grazing.ends.push_back(grazing.sensor +
                           1.5 * (Vector2d(x, 0.0) - grazing.sensor));
  }
  for (Vector2d& end : near_behind.ends) end.y() -= 0.2;
  SeenPieces pieces(0.0, 4.0, SeenThroughOptions());
  for (int i = 0; i < 3; ++i) {
    pieces.Add(wall, grazing);
    pieces.Add(wall, near_behind);
  }
  EXPECT_TRUE(pieces.Through(0.1).empty());
}

TEST(SeenPiecesTest, AWallOfNoLengthHasNoPieces) {
  for (const double end : {0.0, -1.0, HUGE_VAL}) {
    SeenPieces pieces(0.0, end, SeenThroughOptions());
    pieces.Add(AlongX(0.0, 0.0, end), LookDown(0.0, 4.0, 0.0, 4.0));
    EXPECT_TRUE(pieces.Through(0.0).empty());
  }
}

}  // namespace
}  // namespace plumbline
