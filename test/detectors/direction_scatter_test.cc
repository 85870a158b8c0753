#include <gtest/gtest.h>
#include <plumbline/detectors/direction_scatter.h>

#include <cmath>
#include <random>
#include <vector>

namespace plumbline {
namespace {

struct Walls {
  DirectionNetwork network;
  std::vector<DirectionWall> walls;
};

// Walls in a row, known to each other to within 0.05 degrees, whose directions
// scatter by `scatter` around 0 and, after the middle, `bend` (degrees). Every
// third is across.
Walls MakeWalls(int count, double scatter_deg, double bend_deg,
                std::uint64_t seed) {
  std::mt19937_64 engine(seed);
  std::normal_distribution<double> normal;
  const double link = DegToRad(0.05);
  Walls result;
  std::vector<double> truth;
  for (int i = 0; i < count; ++i) {
    truth.push_back(DegToRad(scatter_deg) * normal(engine) +
                    DegToRad(i < count / 2 ? 0.0 : bend_deg) +
                    (i % 3 == 2 ? 0.5 * kPi : 0.0));
    DirectionWall wall;
    wall.node = result.network.AddNode(truth.back());
    wall.length = 3.0 + 0.1 * (i % 5);
    result.walls.push_back(wall);
    for (int j = std::max(0, i - 2); j < i; ++j) {
      result.network.AddLink(j, i, truth[i] - truth[j] + link * normal(engine),
                             link * link, false);
    }
  }
  result.network.Solve();
  return result;
}

TEST(DirectionScatterTest, FindsTheScatter) {
  for (const double scatter : {0.1, 0.3, 0.5}) {
    for (const double bend : {0.0, 2.0}) {
      double sum = 0.0;
      for (std::uint64_t seed = 1; seed <= 10; ++seed) {
        const Walls row = MakeWalls(40, scatter, bend, seed);
        sum += RadToDeg(EstimateDirectionScatter(row.network, row.walls, {}));
      }
      // Where half of the pairs are of two directions, the quarter that speaks
      // is half of the others: their median, at most twice and a half too wide.
      EXPECT_GT(0.1 * sum, 0.75 * scatter) << bend;
      EXPECT_LT(0.1 * sum, (bend == 0.0 ? 1.25 : 2.5) * scatter) << bend;
    }
  }
}

TEST(DirectionScatterTest, WhatTheLengthExplainsIsNotCountedTwice) {
  Walls row = MakeWalls(40, 0.3, 0.0, 1);
  for (DirectionWall& wall : row.walls) wall.own_sigma = DegToRad(0.6);
  EXPECT_LT(EstimateDirectionScatter(row.network, row.walls, {}),
            DegToRad(0.03));
}

TEST(DirectionScatterTest, FewOrShortWallsSayNothing) {
  const DirectionScatterOptions options;
  const Walls few = MakeWalls(3, 0.5, 0.0, 1);
  EXPECT_EQ(EstimateDirectionScatter(few.network, few.walls, options),
            options.prior);
  Walls brief = MakeWalls(40, 0.5, 0.0, 1);
  for (DirectionWall& wall : brief.walls) wall.length = 1.0;
  EXPECT_EQ(EstimateDirectionScatter(brief.network, brief.walls, options),
            options.prior);
  EXPECT_EQ(EstimateDirectionScatter(DirectionNetwork(), {}, options),
            options.prior);
}

TEST(DirectionScatterTest, StaysWithinItsBounds) {
  const DirectionScatterOptions options;
  const Walls exact = MakeWalls(40, 0.0, 0.0, 1);
  const double sigma =
      EstimateDirectionScatter(exact.network, exact.walls, options);
  EXPECT_GE(sigma, options.min_sigma);
  EXPECT_LT(sigma, DegToRad(0.1));
  const Walls wild = MakeWalls(40, 2.0, 0.0, 1);
  EXPECT_LE(EstimateDirectionScatter(wild.network, wild.walls, options),
            options.max_sigma);
}

}  // namespace
}  // namespace plumbline
