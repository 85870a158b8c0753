#include <gtest/gtest.h>
#include <plumbline/detectors/tie_forecast.h>
#include <plumbline/factors/angle.h>

#include <cmath>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

// Walls whose directions are known to 0.05 degrees against a first one, which
// is tied to a direction.
class TieForecastTest : public ::testing::Test {
 protected:
  // Degrees; the first is wall 0.
  void AddWalls(const std::vector<double>& angles) {
    for (const double angle : angles) {
      DirectionWall wall;
      wall.node = network_.AddNode(DegToRad(angle));
      wall.length = 3.0;
      if (!walls_.empty()) {
        network_.AddLink(walls_[0].node, wall.node,
                         DegToRad(angle - angles.front()), Square(0.05), false);
      }
      walls_.push_back(wall);
    }
  }

  DirectionTies Ties() {
    DirectionTies ties(std::move(network_), walls_, options_);
    ties.Tie(0, ties.Add(0.0));
    ties.Solve();
    return ties;
  }

  TieForecast Predict(const DirectionTies& ties) {
    innovations_.resize(walls_.size());
    return PredictTies(ties, walls_, options_, &innovations_);
  }

  static double Square(double degrees) {
    return DegToRad(degrees) * DegToRad(degrees);
  }

  DirectionNetwork network_;
  std::vector<DirectionWall> walls_;
  DirectionAssignmentOptions options_;
  std::vector<DirectionInnovation> innovations_;
};

TEST_F(TieForecastTest, AlongAcrossAndNeither) {
  AddWalls({0.0, 0.1, 90.05, 20.0});
  const DirectionTies ties = Ties();
  const TieForecast forecast = Predict(ties);
  ASSERT_EQ(forecast.candidates.size(), 2u);
  EXPECT_EQ(forecast.candidates[0].wall, 1u);
  EXPECT_FALSE(forecast.candidates[0].is_across);
  EXPECT_EQ(forecast.candidates[1].wall, 2u);
  EXPECT_TRUE(forecast.candidates[1].is_across);
  EXPECT_FALSE(forecast.candidates[1].is_relation);
  EXPECT_EQ(forecast.is_rejected,
            (std::vector<bool>{false, false, false, true}));
  // What the network predicts, without the tie.
  EXPECT_NEAR(std::abs(RadToDeg(innovations_[1].difference)), 0.1, 1e-6);
  EXPECT_GT(innovations_[3].chi_square, options_.gate);
}

TEST_F(TieForecastTest, WhatIsNotClearWaits) {
  // Between two directions 1 degree apart.
  AddWalls({0.0, 0.5, 1.0});
  options_.sigma = DegToRad(0.3);
  options_.relation_sigma = DegToRad(0.01);
  DirectionTies ties = Ties();
  ties.Tie(2, ties.Add(DegToRad(1.0)));
  ties.Solve();
  const TieForecast forecast = Predict(ties);
  // It fits both; what may be is that the two are one.
  EXPECT_LT(innovations_[1].chi_square, options_.gate);
  ASSERT_EQ(forecast.candidates.size(), 1u);
  EXPECT_TRUE(forecast.candidates[0].is_relation);
  EXPECT_EQ(forecast.is_rejected, std::vector<bool>(3, false));
}

// It is in another part of the map: others there may agree with it.
TEST_F(TieForecastTest, AWallOfWhichTooLittleIsKnownMayFoundOne) {
  AddWalls({0.0});
  DirectionWall wall;
  wall.node = network_.AddNode(1.0);
  wall.length = 3.0;
  walls_.push_back(wall);
  const TieForecast forecast = Predict(Ties());
  EXPECT_TRUE(forecast.candidates.empty());
  EXPECT_TRUE(forecast.is_rejected[1]);
}

TEST_F(TieForecastTest, TwoDirectionsThatAreOne) {
  AddWalls({0.0, 0.1, 90.0});
  DirectionTies ties = Ties();
  ties.Tie(1, ties.Add(DegToRad(0.1)));
  ties.Tie(2, ties.Add(DegToRad(90.0)));
  ties.Solve();
  const TieForecast forecast = Predict(ties);
  // 0 and 1 are one, 2 is at a right angle to either.
  ASSERT_EQ(forecast.candidates.size(), 3u);
  for (const TieCandidate& candidate : forecast.candidates) {
    EXPECT_TRUE(candidate.is_relation);
    EXPECT_EQ(candidate.is_across, candidate.other == 2);
    EXPECT_LT(candidate.direction, candidate.other);
  }
}

TEST_F(TieForecastTest, WithoutADirectionAllMayFoundOne) {
  AddWalls({0.0, 0.1});
  DirectionTies ties(std::move(network_), walls_, options_);
  ties.Solve();
  const TieForecast forecast = Predict(ties);
  EXPECT_TRUE(forecast.candidates.empty());
  EXPECT_EQ(forecast.is_rejected, std::vector<bool>(2, true));
}

}  // namespace
}  // namespace plumbline
