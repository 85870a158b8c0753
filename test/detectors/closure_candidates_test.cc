#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/marginals.h>
#include <plumbline/detectors/closure_candidates.h>
#include <plumbline/detectors/wall_overlaps.h>

#include <vector>

#include "detectors/wall_graph_world.h"

namespace plumbline {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::UnorderedElementsAreArray;

class ClosureCandidatesTest : public WallGraphTest {
 protected:
  static std::vector<WallPair> Pairs(
      const std::vector<ClosureCandidate>& candidates) {
    std::vector<WallPair> pairs;
    for (const ClosureCandidate& candidate : candidates) {
      pairs.push_back(candidate.pair);
    }
    return pairs;
  }
};

TEST_F(ClosureCandidatesTest, TheNarrowestSearchesComeFirst) {
  for (int i = 0; i < 8; ++i) AddWall(0.0, i, 3.0, i);
  const WallGraph walls(graph_);
  ClosureCandidates candidates(&walls);
  EXPECT_TRUE(candidates.Add(0, 1, WallMatch(), 2.0, 5.0));
  EXPECT_TRUE(candidates.Add(2, 3, WallMatch(), 3.9, 9.0));
  EXPECT_TRUE(candidates.Add(4, 5, WallMatch(), 4.1, 20.0));
  DetectionCounts counts;
  DetectionScope scope;
  scope.counts = &counts;
  // Up to twice as wide is the same; the larger evidence first.
  EXPECT_THAT(Pairs(candidates.Choose(0.7, scope)),
              ElementsAre(WallPair{2, 3}, WallPair{0, 1}));
  EXPECT_EQ(counts["candidates"], 3);
  EXPECT_EQ(counts["candidates refused: wider search than the narrowest"], 1);
  EXPECT_THAT(Pairs(candidates.Choose(4.5, scope)),
              ElementsAre(WallPair{4, 5}, WallPair{2, 3}, WallPair{0, 1}));
}

TEST_F(ClosureCandidatesTest, TheBetterOfTwoStays) {
  for (int i = 0; i < 2; ++i) AddWall(0.0, i, 3.0, i);
  const WallGraph walls(graph_);
  ClosureCandidates candidates(&walls);
  candidates.Add(0, 1, WallMatch(), 2.0, 5.0);
  candidates.Add(1, 0, WallMatch(), 2.0, 6.0);
  candidates.Add(0, 1, WallMatch(), 2.5, 9.0);
  const auto chosen = candidates.Choose(3.0, DetectionScope());
  ASSERT_EQ(chosen.size(), 1u);
  EXPECT_EQ(chosen[0].evidence, 6.0);
}

TEST_F(ClosureCandidatesTest, WhatOthersMakeOneIsLeftOut) {
  for (int i = 0; i < 4; ++i) AddWall(0.0, i, 3.0, i);
  AddClosure(2, 3);
  const WallGraph walls(graph_);
  ClosureCandidates candidates(&walls);
  EXPECT_FALSE(candidates.Add(2, 3, WallMatch(), 0.0, 5.0));
  EXPECT_FALSE(candidates.Add(1, 1, WallMatch(), 0.0, 5.0));
  candidates.Add(0, 2, WallMatch(), 0.0, 3.0);
  candidates.Add(0, 3, WallMatch(), 0.0, 2.0);
  candidates.Add(0, 1, WallMatch(), 0.0, 1.0);
  EXPECT_THAT(Pairs(candidates.Choose(0.7, DetectionScope())),
              ElementsAre(WallPair{0, 2}, WallPair{0, 1}));
}

TEST_F(ClosureCandidatesTest, BrokenOnesMakeNobodyWait) {
  for (int i = 0; i < 4; ++i) AddWall(0.0, i, 3.0, i);
  Break(AddClosure(0, 1));
  const WallGraph walls(graph_);
  ClosureCandidates candidates(&walls);
  candidates.Add(0, 1, WallMatch(), 0.5, 5.0);
  candidates.Add(2, 3, WallMatch(), 4.0, 5.0);
  EXPECT_EQ(candidates.Choose(0.1, DetectionScope()).size(), 2u);
}

TEST_F(ClosureCandidatesTest, ThePointAlongIsOnTheSecondOfThePair) {
  AddWall(0.0, 0.0, 5.0, 0.0);
  AddWall(2.0, 0.01, 7.0, 0.01);
  const WallGraph walls(graph_);
  ClosureCandidates candidates(&walls);
  WallMatch match;
  // 3 m along the first wall, which is 1 m along the second.
  match.along = 3.0;
  candidates.Add(1, 0, match, 0.0, 1.0);
  EXPECT_NEAR(candidates.Choose(0.1, DetectionScope())[0].along, 1.0, 1e-12);
}

TEST_F(ClosureCandidatesTest, LieOnEachOtherNeedsOverlapDirectionAndOffset) {
  AddWall(0.0, 0.0, 5.0, 0.0);
  AddWall(3.0, 0.02, 8.0, 0.02);
  AddWall(3.0, 0.04, 8.0, 0.04);
  AddWall(6.0, 0.02, 8.0, 0.02);
  AddWall(3.0, 0.0, 8.0, 0.5);
  AddWall(8.0, 0.02, 3.0, 0.02);
  const WallGraph walls(graph_);
  const SameWallOptions options;
  const auto match = LieOnEachOther(walls.wall(0), walls.wall(1), options);
  ASSERT_TRUE(match);
  EXPECT_NEAR(match->overlap, 2.0, 1e-12);
  EXPECT_NEAR(match->along, 1.0, 1e-12);
  EXPECT_NEAR(match->offset, 0.02, 1e-12);
  for (int i = 2; i < walls.size(); ++i) {
    EXPECT_FALSE(LieOnEachOther(walls.wall(0), walls.wall(i), options)) << i;
  }
}

TEST_F(ClosureCandidatesTest, OverlapsCountWhenThePlaceIsKnown) {
  AddWall(0.0, 0.0, 5.0, 0.0);
  AddWall(2.0, 0.01, 7.0, 0.01);
  AddWall(2.0, -0.01, 7.0, -0.01);
  AddWall(2.0, 9.0, 7.0, 9.0);
  AddLink(0, 1, 0.01);
  // To a metre: it may be another wall.
  AddLink(0, 2, 1.0);
  AddLink(0, 3, 0.01);
  const WallGraph walls(graph_);
  Marginals marginals(graph_);
  ClosureCandidates candidates(&walls);
  DetectionCounts counts;
  DetectionScope scope;
  scope.counts = &counts;
  FindOverlaps(walls, SameWallOptions(), scope, &marginals, &candidates);
  EXPECT_THAT(Pairs(candidates.Choose(0.1, scope)),
              ElementsAre(WallPair{0, 1}));
  EXPECT_EQ(counts["wall pairs"], 3);
  EXPECT_EQ(counts["wall pairs refused: relative place not known"], 2);
  EXPECT_EQ(counts["wall pairs refused: not on each other"], 0);
  ClosureCandidates none(&walls);
  scope.stop = [] { return true; };
  FindOverlaps(walls, SameWallOptions(), scope, &marginals, &none);
  EXPECT_THAT(none.Choose(0.1, scope), IsEmpty());
}

// Wherever walls lie on each other, also where two cells of a grid meet.
TEST_F(ClosureCandidatesTest, OverlapsAreFoundEverywhere) {
  AddWall(0.0, 0.0, 5.0, 0.0);
  std::vector<WallPair> expected;
  for (int k = 0; k < 80; ++k) {
    const double y = 0.1 * k + 20.0;
    const int first = AddWall(0.0, y - 0.005, 5.0, y - 0.005);
    const int second = AddWall(2.0, y + 0.005, 7.0, y + 0.005);
    AddLink(0, first, 0.01);
    AddLink(first, second, 0.01);
    expected.push_back({first, second});
  }
  const WallGraph walls(graph_);
  Marginals marginals(graph_);
  ClosureCandidates candidates(&walls);
  FindOverlaps(walls, SameWallOptions(), DetectionScope(), &marginals,
               &candidates);
  EXPECT_THAT(Pairs(candidates.Choose(0.1, DetectionScope())),
              UnorderedElementsAreArray(expected));
}

}  // namespace
}  // namespace plumbline
