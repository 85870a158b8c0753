#include <gtest/gtest.h>
#include <plumbline/frontend/guessed_turns.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "frontend/synthetic_world.h"

namespace plumbline {
namespace {

using testing::Noise;

// Walls that a key scan sees: so many returns at each of these angles (of their
// normals, map frame).
struct SeenWalls {
  std::vector<double> angles;
  int returns = 20;
  // Returns of things that stand at any angle.
  int clutter = 10;
  // Heading of the robot, about which it winds.
  double course = 0.0;
};

// `count` key scans of a robot that winds along, whose poses are turned by
// `askew`.
void See(const SeenWalls& walls, int count, int part, double askew,
         std::vector<SeenKey>* seen) {
  Noise noise(static_cast<std::uint64_t>(100 + seen->size()));
  for (int k = 0; k < count; ++k) {
    SeenKey key;
    key.scan = static_cast<int>(10 * seen->size());
    key.part = part;
    const double heading = walls.course + 0.9 * std::sin(2.0 * kPi * k / 25.0);
    key.pose = Pose2(0.3 * k, 0.0, NormalizeAngle(heading + askew));
    key.laser = Eigen::Vector2d::Zero();
    const auto add = [&](double angle) {
      const double own = angle - heading;
      key.points.emplace_back(1.0f, 2.0f, static_cast<float>(std::cos(own)),
                              static_cast<float>(std::sin(own)));
    };
    for (const double angle : walls.angles) {
      for (int i = 0; i < walls.returns; ++i) {
        add(angle + noise.Normal(DegToRad(2.0)));
      }
    }
    for (int i = 0; i < walls.clutter; ++i) add(noise.Normal(10.0));
    seen->push_back(key);
  }
}

std::vector<GuessedTurn> Turns(const std::vector<SeenKey>& seen,
                               const std::vector<BlindWay>& blind = {}) {
  return FindGuessedTurns(seen, {4, 6}, blind, GuessedTurnOptions());
}

const SeenWalls kRightAngled{{0.0, 0.5 * kPi, kPi}};
// Behind a gap in which it turned by 80 degrees.
const SeenWalls kBehind{{0.0, 0.5 * kPi, kPi}, 20, 10, DegToRad(80.0)};

TEST(GuessedTurnsTest, WallsBeyondTheGapAreParallel) {
  for (const double askew : {-14.0, -3.0, 0.0, 8.0, 19.0}) {
    std::vector<SeenKey> seen;
    See(kRightAngled, 100, 0, 0.0, &seen);
    See(kBehind, 200, 1, DegToRad(askew), &seen);
    const std::vector<GuessedTurn> turns = Turns(seen);
    ASSERT_EQ(turns.size(), 1u) << askew;
    EXPECT_EQ(turns[0].scan, 1000);
    EXPECT_NEAR(RadToDeg(turns[0].turn), -askew, 0.5);
  }
}

// Whichever way the whole building stands, across the seams of angles, too.
TEST(GuessedTurnsTest, TheFrameDoesNotMatter) {
  for (int degrees = -180; degrees < 180; degrees += 7) {
    std::vector<SeenKey> seen;
    See(kRightAngled, 100, 0, DegToRad(degrees), &seen);
    See(kBehind, 100, 1, DegToRad(degrees + 12.0), &seen);
    const std::vector<GuessedTurn> turns = Turns(seen);
    ASSERT_EQ(turns.size(), 1u) << degrees;
    EXPECT_NEAR(RadToDeg(turns[0].turn), -12.0, 0.5) << degrees;
  }
}

TEST(GuessedTurnsTest, OrAtRightAngles) {
  std::vector<SeenKey> seen;
  See({{0.0, kPi}}, 100, 0, 0.0, &seen);
  See({{0.5 * kPi, -0.5 * kPi}, 20, 10, DegToRad(80.0)}, 100, 1, DegToRad(12.0),
      &seen);
  const std::vector<GuessedTurn> turns = Turns(seen);
  ASSERT_EQ(turns.size(), 1u);
  EXPECT_NEAR(RadToDeg(turns[0].turn), -12.0, 0.5);
}

// Each guess hangs on the track before it, askew as that may be.
TEST(GuessedTurnsTest, EachGuessByItself) {
  std::vector<SeenKey> seen;
  See(kRightAngled, 100, 0, 0.0, &seen);
  See(kBehind, 100, 1, DegToRad(12.0), &seen);
  See(kRightAngled, 100, 2, DegToRad(5.0), &seen);
  const std::vector<GuessedTurn> turns = Turns(seen);
  ASSERT_EQ(turns.size(), 2u);
  EXPECT_NEAR(RadToDeg(turns[0].turn), -12.0, 0.5);
  EXPECT_NEAR(RadToDeg(turns[1].turn), 7.0, 0.5);
  EXPECT_EQ(turns[0].loose, 4);
  EXPECT_EQ(turns[1].loose, 6);
}

// A track that was found again is none: it lies where it was found.
TEST(GuessedTurnsTest, WhatWasFoundIsNoGuess) {
  std::vector<SeenKey> seen;
  See(kRightAngled, 100, 0, 0.0, &seen);
  See(kBehind, 100, 1, DegToRad(12.0), &seen);
  See(kRightAngled, 100, 0, DegToRad(2.0), &seen);
  EXPECT_EQ(Turns(seen).size(), 1u);
}

TEST(GuessedTurnsTest, OdometryIsNotOffByHalfARightAngle) {
  std::vector<SeenKey> seen;
  See(kRightAngled, 100, 0, 0.0, &seen);
  See(kBehind, 100, 1, DegToRad(30.0), &seen);
  EXPECT_TRUE(Turns(seen).empty());
}

// After a way straight on of which odometry tells it is off by little: what
// stands at an angle is a wing that does.
TEST(GuessedTurnsTest, OdometryIsOffByAShareOfTheTurn) {
  BlindWay way;
  way.from = 1000;
  way.to = 1010;
  for (const double askew : {2.0, 12.0}) {
    for (const bool is_straight : {true, false}) {
      std::vector<SeenKey> seen;
      See(kRightAngled, 101, 0, 0.0, &seen);
      See(is_straight ? kRightAngled : kBehind, 100, 1, DegToRad(askew), &seen);
      // Where it tells of nothing anything may be.
      EXPECT_EQ(Turns(seen).size(), 1u);
      const bool is_within = !is_straight || askew < 3.0;
      EXPECT_EQ(Turns(seen, {way}).size(), is_within ? 1u : 0u) << askew;
    }
  }
}

// A round hall, a wing with two pairs of directions, a few key scans: on either
// side of the gap.
TEST(GuessedTurnsTest, WithoutOnePairOfDirectionsNothingIsSaid) {
  const SeenWalls round{{}, 0, 60, DegToRad(80.0)};
  const SeenWalls two_pairs{
      {0.0, 0.5 * kPi, 0.4, 0.4 + 0.5 * kPi}, 20, 10, DegToRad(80.0)};
  for (const SeenWalls& unclear : {round, two_pairs}) {
    std::vector<SeenKey> seen;
    See(kRightAngled, 100, 0, 0.0, &seen);
    See(unclear, 100, 1, DegToRad(12.0), &seen);
    See(kRightAngled, 100, 2, DegToRad(10.0), &seen);
    EXPECT_TRUE(Turns(seen).empty());
  }
  std::vector<SeenKey> seen;
  See(kRightAngled, 100, 0, 0.0, &seen);
  See(kBehind, 10, 1, DegToRad(12.0), &seen);
  EXPECT_TRUE(Turns(seen).empty());
}

// In a building with a wing at another angle the gap may have led into such a
// wing.
TEST(GuessedTurnsTest, AWingAtAnotherAngle) {
  const SeenWalls wing{{DegToRad(15.0), DegToRad(105.0), DegToRad(195.0)}};
  for (const bool is_before : {true, false}) {
    std::vector<SeenKey> seen;
    See(kRightAngled, 150, 0, 0.0, &seen);
    if (is_before) See(wing, 150, 0, 0.0, &seen);
    SeenWalls behind = is_before ? wing : kRightAngled;
    behind.course = DegToRad(80.0);
    See(behind, 150, 1, DegToRad(10.0), &seen);
    if (!is_before) See(wing, 150, 1, DegToRad(10.0), &seen);
    EXPECT_TRUE(Turns(seen).empty()) << is_before;
  }
}

// What turns slowly is drift.
TEST(GuessedTurnsTest, DriftIsNoWing) {
  std::vector<SeenKey> seen;
  for (int k = 0; k < 400; ++k) {
    See(kRightAngled, 1, 0, DegToRad(0.03 * k), &seen);
  }
  See(kBehind, 100, 1, DegToRad(24.0), &seen);
  const std::vector<GuessedTurn> turns = Turns(seen);
  ASSERT_EQ(turns.size(), 1u);
  EXPECT_NEAR(RadToDeg(turns[0].turn), -13.2, 0.5);
}

// 2 m ahead and 40 degrees to the left, less 20 degrees: 10 to the right of
// ahead.
TEST(GuessedTurnsTest, TheWayTurnsByHalf) {
  const Pose2 motion =
      WithTurn(Pose2(2.0, 0.0, DegToRad(40.0)), DegToRad(-20.0));
  EXPECT_NEAR(motion[0], 1.969615506, 1e-9);
  EXPECT_NEAR(motion[1], -0.347296355, 1e-9);
  EXPECT_NEAR(motion[2], DegToRad(20.0), 1e-12);
}

TEST(GuessedTurnsTest, NothingSeen) {
  EXPECT_TRUE(Turns({}).empty());
  std::vector<SeenKey> seen;
  See({{}, 0, 0}, 50, 0, 0.0, &seen);
  See({{}, 0, 0}, 50, 1, 0.0, &seen);
  EXPECT_TRUE(Turns(seen).empty());
}

}  // namespace
}  // namespace plumbline
