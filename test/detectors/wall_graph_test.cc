#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/detectors/place_search.h>
#include <plumbline/detectors/wall_graph.h>
#include <plumbline/detectors/wall_ways.h>

#include <cmath>
#include <map>
#include <vector>

#include "detectors/wall_graph_world.h"

namespace plumbline {
namespace {

using ::testing::ElementsAre;
using ::testing::Pair;

TEST_F(WallGraphTest, WallsHaveAVisiblePart) {
  AddWall(1.0, 2.0, 4.0, 6.0);
  const WallGraph walls(graph_);
  ASSERT_EQ(walls.size(), 1);
  EXPECT_EQ(walls.Length(0), 5.0);
  EXPECT_NEAR((walls.Middle(0) - Eigen::Vector2d(2.5, 4.0)).norm(), 0.0, 1e-12);
  // Beside the middle, and past the end.
  EXPECT_NEAR(walls.DistanceTo(0, {2.5 - 0.8, 4.0 + 0.6}), 1.0, 1e-12);
  EXPECT_NEAR(walls.DistanceTo(0, {4.0, 8.0}), 2.0, 1e-12);
}

TEST_F(WallGraphTest, MeasurementsAreLinksAndClosuresMakeOne) {
  for (int i = 0; i < 5; ++i) AddWall(4.0 * i, 0.0, 4.0 * i + 3.0, 0.0);
  AddLink(0, 1);
  AddLink(0, 1);
  AddLink(1, 2);
  Break(AddLink(2, 3));
  AddClosure(0, 2);
  Break(AddClosure(3, 1));
  const WallGraph walls(graph_);
  EXPECT_THAT(walls.LinksOf(1), ElementsAre(Pair(0, 4.0), Pair(2, 4.0)));
  EXPECT_THAT(walls.Within(0, 1), ElementsAre(Pair(0, 0), Pair(1, 1)));
  EXPECT_THAT(walls.Within(0, 5),
              ElementsAre(Pair(0, 0), Pair(1, 1), Pair(2, 2)));
  EXPECT_THAT(walls.closures(), ElementsAre(Pair(0, 2)));
  EXPECT_TRUE(walls.AreOne(0, 2));
  EXPECT_FALSE(walls.AreOne(0, 1));
  EXPECT_EQ(walls.wall(2).group, walls.wall(0).group);
  EXPECT_TRUE(walls.WasBroken({1, 3}));
  EXPECT_FALSE(walls.WasBroken({0, 2}));
  EXPECT_TRUE(walls.AreConnected(0, 2));
  EXPECT_FALSE(walls.AreConnected(0, 3));
}

TEST_F(WallGraphTest, WaysGoAlongMeasurements) {
  for (int i = 0; i < 6; ++i) AddWall(4.0 * i, 0.0, 4.0 * i + 3.0, 0.0);
  for (int i = 0; i + 1 < 5; ++i) AddLink(i, i + 1);
  // Along a corridor a closure says nothing about the way along it.
  AddClosure(0, 4);
  const WallGraph walls(graph_);
  const WallWays ways(walls, 2);
  WallWays::Search search;
  for (int repeat = 0; repeat < 2; ++repeat) {
    EXPECT_THAT(ways.From(1, &search),
                ElementsAre(4.0, 0.0, 4.0, 8.0, 12.0,
                            std::numeric_limits<double>::infinity()));
  }
  EXPECT_THAT(ways.Parts(), ElementsAre(0u, 0u, 0u, 0u, 0u, 5u));
}

TEST_F(WallGraphTest, WaysToSomeWallsAreThoseToAll) {
  // A grid of walls, whose links are as long as they are apart.
  constexpr int kColumns = 9;
  constexpr int kRows = 7;
  for (int row = 0; row < kRows; ++row) {
    for (int column = 0; column < kColumns; ++column) {
      const double x = 3.0 * column + 0.1 * row * row;
      AddWall(x, 2.0 * row, x + 1.0, 2.0 * row);
    }
  }
  for (int i = 0; i < kRows * kColumns; ++i) {
    // Some are left out, so that there are ways round.
    if ((i + 1) % kColumns != 0 && i % 5 != 0) AddLink(i, i + 1);
    if (i + kColumns < kRows * kColumns && i % 7 != 0) AddLink(i, i + kColumns);
  }
  const WallGraph walls(graph_);
  const WallWays ways(walls, 2);
  WallWays::Search search;
  for (int from = 0; from < walls.size(); from += 4) {
    const std::vector<double> all = ways.From(from, &search);
    for (int to = 0; to < walls.size(); to += 3) {
      const std::vector<int> targets = {to, (to + 11) % walls.size()};
      const std::vector<double> some = ways.From(from, targets, &search);
      for (const int target : targets) EXPECT_EQ(some[target], all[target]);
    }
  }
}

// With a wall across in common, nothing is free to move between the visits.
TEST_F(WallGraphTest, AClosureThatHoldsTwoDirectionsIsAWay) {
  const int first = AddWall(0.0, 0.0, 3.0, 0.0);
  const int across = AddWall(0.0, 0.0, 0.0, 3.0);
  const int far = AddWall(50.0, 0.0, 53.0, 0.0);
  const int again = AddWall(0.0, 0.01, 3.0, 0.01);
  const int across_again = AddWall(0.01, 0.0, 0.01, 3.0);
  AddLink(first, across);
  AddLink(first, far);
  AddLink(far, again);
  AddLink(again, across_again);
  AddClosure(first, again);
  WallWays::Search search;
  {
    const WallGraph walls(graph_);
    EXPECT_NEAR(WallWays(walls, 2).From(first, &search)[again], 100.0, 0.1);
  }
  AddClosure(across, across_again);
  const WallGraph walls(graph_);
  EXPECT_NEAR(WallWays(walls, 2).From(first, &search)[again], 0.01, 1e-9);
}

TEST_F(WallGraphTest, PlacesCoverTheWalls) {
  // A corridor of 40 m in pieces of 4 m, and one piece that is too short.
  for (int i = 0; i < 10; ++i) AddWall(4.0 * i, 0.0, 4.0 * i + 3.9, 0.0);
  AddWall(10.0, 2.0, 10.2, 2.0);
  for (int i = 0; i < 10; ++i) AddLink(i, i + 1);
  SameWallOptions options;
  options.place_links = 2;
  options.place_radius = 7.0;
  options.place_spacing = 5.0;
  const WallGraph walls(graph_);
  const std::vector<WallPlace> places = FindPlaces(walls, options);
  ASSERT_EQ(places.size(), 5u);
  // Every other piece is within 5 m of the one before.
  EXPECT_EQ(places[1].anchor, 2);
  EXPECT_THAT(places[1].walls, ElementsAre(0, 1, 2, 3, 4));
  EXPECT_NEAR(places[1].center.x(), 9.95, 1e-12);
  EXPECT_EQ(places[4].anchor, 8);
  EXPECT_THAT(places[4].walls, ElementsAre(6, 7, 8, 9));
}

}  // namespace
}  // namespace plumbline
