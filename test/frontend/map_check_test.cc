#include <gtest/gtest.h>
#include <plumbline/core/error.h>
#include <plumbline/frontend/map_check.h>

#include <cmath>
#include <vector>

#include "frontend/synthetic_world.h"

namespace plumbline {
namespace {

using testing::Laser;
using testing::MakeScan;
using testing::Noise;
using testing::Room;
using testing::WallEnds;

// Two rounds through a hall of 12 m x 9 m with pillars, 0.3 m a key scan.
struct Rounds {
  std::vector<Scan> scans;
  std::vector<int> keys;
  std::vector<Pose2> poses;
  // Of the second round.
  int second = 0;
};

Rounds TwoRounds() {
  std::vector<WallEnds> walls = Room(12.0, 9.0);
  for (const Pose2& place : {Pose2(0.5, 0.3, 0.4), Pose2(-5.2, 1.0, 0.0),
                             Pose2(3.5, -3.9, 0.0), Pose2(1.0, 4.0, 0.2)}) {
    for (const WallEnds& side : testing::Moved(Room(1.2, 0.8), place)) {
      walls.push_back(side);
    }
  }
  Laser laser;
  laser.sigma = 0.01;
  Noise noise(3);
  Rounds rounds;
  for (int round = 0; round < 2; ++round) {
    if (round == 1) rounds.second = static_cast<int>(rounds.scans.size());
    for (int i = 0; i < 63; ++i) {
      const double angle = 2.0 * kPi * i / 63;
      const Pose2 pose(3.0 * std::cos(angle), 3.0 * std::sin(angle),
                       NormalizeAngle(angle + 0.5 * kPi));
      rounds.keys.push_back(static_cast<int>(rounds.scans.size()));
      rounds.scans.push_back(MakeScan(walls, pose, laser, &noise));
      rounds.poses.push_back(pose);
    }
  }
  return rounds;
}

TEST(JudgeScanTest, BySharesOfEnoughReturns) {
  const MapCheckOptions options;
  ScanAgreement seen;
  seen.hits = 14;
  seen.seen = 14;
  EXPECT_EQ(JudgeScan(seen, options), ScanVerdict::kUnknown);
  seen.hits = 70;
  seen.intruders = 30;
  EXPECT_EQ(JudgeScan(seen, options), ScanVerdict::kAgrees);
  seen.hits = 69;
  seen.intruders = 31;
  EXPECT_EQ(JudgeScan(seen, options), ScanVerdict::kContradicts);
  // What the scan looks through, by itself.
  seen.hits = 14;
  seen.intruders = 0;
  seen.seen = 100;
  seen.seen_through = 40;
  EXPECT_EQ(JudgeScan(seen, options), ScanVerdict::kAgrees);
  seen.seen_through = 41;
  EXPECT_EQ(JudgeScan(seen, options), ScanVerdict::kContradicts);
}

TEST(FindContradictionsTest, NoneInATrueMap) {
  const Rounds rounds = TwoRounds();
  EXPECT_TRUE(
      FindContradictions(rounds.scans, rounds.keys, rounds.poses, {}).empty());
}

TEST(FindContradictionsTest, EndsWhenItIsTold) {
  const Rounds rounds = TwoRounds();
  int asked = 0;
  EXPECT_TRUE(
      FindContradictions(rounds.scans, rounds.keys, rounds.poses, {}, [&asked] {
        return ++asked > 0;
      }).empty());
  EXPECT_EQ(asked, 1);
}

TEST(FindContradictionsTest, ARoundThatIsTurned) {
  Rounds rounds = TwoRounds();
  for (std::size_t k = static_cast<std::size_t>(rounds.second);
       k < rounds.poses.size(); ++k) {
    rounds.poses[k] =
        Compose(Pose2(0.5, -0.8, DegToRad(35.0)), rounds.poses[k]);
  }
  const std::vector<MapContradiction> found =
      FindContradictions(rounds.scans, rounds.keys, rounds.poses, {});
  ASSERT_FALSE(found.empty());
  int scans = 0;
  for (const MapContradiction& part : found) {
    EXPECT_LT(part.begin, part.end);
    scans += part.end - part.begin;
  }
  EXPECT_GT(scans, rounds.second / 2);
  // The same for any number of threads.
  MapCheckOptions one;
  one.num_threads = 1;
  const std::vector<MapContradiction> again =
      FindContradictions(rounds.scans, rounds.keys, rounds.poses, one);
  ASSERT_EQ(again.size(), found.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_EQ(again[i].begin, found[i].begin);
    EXPECT_EQ(again[i].end, found[i].end);
  }
}

// Three contradictions outweigh an agreement.
TEST(CountAgreementTest, ALittleLessMayAgree) {
  const auto is_far_less = [](int agreeing, int contradicting) {
    MapAgreement now;
    now.agreeing = agreeing;
    now.contradicting = contradicting;
    MapAgreement before;
    before.agreeing = 100;
    before.contradicting = 40;
    return now.ContradictsFarLessThan(before);
  };
  EXPECT_TRUE(is_far_less(90, 10));
  EXPECT_FALSE(is_far_less(89, 10));
  EXPECT_TRUE(is_far_less(100, 39));
  EXPECT_FALSE(is_far_less(100, 40));
  EXPECT_FALSE(is_far_less(200, 41));
}

// A round that is turned contradicts the other one; one that lies elsewhere
// does not, but then nothing agrees.
TEST(CountAgreementTest, ATrueMapIsBetter) {
  const Rounds rounds = TwoRounds();
  const auto count = [&rounds](const Pose2& shift, int from) {
    std::vector<Pose2> poses = rounds.poses;
    for (auto k = static_cast<std::size_t>(from); k < poses.size(); ++k) {
      poses[k] = Compose(shift, poses[k]);
    }
    return CountAgreement(rounds.scans, rounds.keys, poses, {});
  };
  const MapAgreement right = count(Pose2::Zero(), 0);
  const MapAgreement turned =
      count({0.5, -0.8, DegToRad(35.0)}, rounds.second + 40);
  const MapAgreement apart = count({50.0, 0.0, 0.0}, rounds.second);
  EXPECT_EQ(right.contradicting, 0);
  EXPECT_GT(right.agreeing, 20);
  EXPECT_GT(turned.contradicting, 3);
  EXPECT_EQ(apart.contradicting, 0);
  EXPECT_LT(apart.agreeing, turned.agreeing);
  EXPECT_TRUE(right.IsBetterThan(turned));
  EXPECT_FALSE(turned.IsBetterThan(right));
  EXPECT_FALSE(apart.IsBetterThan(turned));
  EXPECT_FALSE(apart.IsBetterThan(right));
  EXPECT_FALSE(right.IsBetterThan(right));
  EXPECT_TRUE(right.ContradictsFarLessThan(turned));
  EXPECT_FALSE(apart.ContradictsFarLessThan(turned));
  EXPECT_FALSE(apart.ContradictsFarLessThan(right));
  EXPECT_FALSE(right.ContradictsFarLessThan(right));
  const MapAgreement stopped = CountAgreement(
      rounds.scans, rounds.keys, rounds.poses, {}, [] { return true; });
  EXPECT_EQ(stopped.agreeing + stopped.contradicting, 0);
}

// What was seen once only cannot contradict anything.
TEST(FindContradictionsTest, NothingToCompareWith) {
  Rounds rounds = TwoRounds();
  rounds.keys.resize(static_cast<std::size_t>(rounds.second) / 2);
  rounds.poses.resize(rounds.keys.size());
  for (Pose2& pose : rounds.poses) pose[2] += pose[0];
  EXPECT_TRUE(
      FindContradictions(rounds.scans, rounds.keys, rounds.poses, {}).empty());
  EXPECT_TRUE(FindContradictions(rounds.scans, {}, {}, {}).empty());
}

TEST(FindContradictionsTest, RefusesPosesThatDoNotFit) {
  const Rounds rounds = TwoRounds();
  EXPECT_THROW(FindContradictions(rounds.scans, rounds.keys, {}, {}), Error);
}

using Verdicts = std::vector<TieVerdict>;

// The second round hangs on the first by one match.
TEST(JudgeTiesTest, WhatManyScansShowIsSure) {
  Rounds rounds = TwoRounds();
  const std::vector<TrackCut> cuts = {{rounds.second - 1, rounds.second}};
  EXPECT_EQ(JudgeTies(rounds.scans, rounds.keys, rounds.poses, cuts, {}),
            Verdicts{TieVerdict::kConfirmed});
  // One scan on the way, which is off.
  const std::vector<TrackCut> wide = {{rounds.second - 1, rounds.second + 2}};
  EXPECT_EQ(JudgeTies(rounds.scans, rounds.keys, rounds.poses, wide, {}),
            Verdicts{TieVerdict::kConfirmed});
  std::vector<Pose2> off = rounds.poses;
  off[static_cast<std::size_t>(rounds.second)] =
      Compose(off[static_cast<std::size_t>(rounds.second)],
              Pose2(0.6, 0.0, DegToRad(20.0)));
  EXPECT_EQ(JudgeTies(rounds.scans, rounds.keys, off, wide, {}),
            Verdicts{TieVerdict::kUnconfirmed});
}

// A round that lies wrong is not sure, nor is one that saw nothing again.
TEST(JudgeTiesTest, WhatNothingShowsIsNot) {
  Rounds rounds = TwoRounds();
  const std::vector<TrackCut> cuts = {{rounds.second - 1, rounds.second}};
  std::vector<Pose2> turned = rounds.poses;
  std::vector<Pose2> away = rounds.poses;
  for (std::size_t k = static_cast<std::size_t>(rounds.second);
       k < turned.size(); ++k) {
    turned[k] = Compose(Pose2(0.5, -0.8, DegToRad(35.0)), turned[k]);
    away[k] = Compose(Pose2(40.0, 0.0, 0.0), away[k]);
  }
  for (const std::vector<Pose2>& poses : {turned, away}) {
    EXPECT_EQ(JudgeTies(rounds.scans, rounds.keys, poses, cuts, {}),
              Verdicts{TieVerdict::kUnconfirmed});
  }
  EXPECT_EQ(JudgeTies(rounds.scans, rounds.keys, rounds.poses, cuts, {},
                      [] { return true; }),
            Verdicts{TieVerdict::kUnconfirmed});
  EXPECT_TRUE(
      JudgeTies(rounds.scans, rounds.keys, rounds.poses, {}, {}).empty());
  EXPECT_THROW(JudgeTies(rounds.scans, rounds.keys, {}, cuts, {}), Error);
}

// Two rounds through the hall, and between them down a corridor 30 m long, in
// the middle of which the track is cut, and back.
struct CutInACorridor {
  Rounds rounds;
  TrackCut cut;
};

CutInACorridor CutWithNiches(const std::vector<WallEnds>& niches) {
  CutInACorridor result;
  Rounds& rounds = result.rounds;
  const Rounds hall = TwoRounds();
  std::vector<WallEnds> walls =
      testing::Moved(Room(60.0, 2.0), Pose2(60.0, 0.0, 0.0));
  walls.insert(walls.end(), niches.begin(), niches.end());
  Laser laser;
  laser.sigma = 0.01;
  laser.maximum_range = 8.0;
  Noise noise(5);
  const auto add = [&rounds](const Scan& scan, const Pose2& pose) {
    rounds.keys.push_back(static_cast<int>(rounds.scans.size()));
    rounds.scans.push_back(scan);
    rounds.scans.back().odometry = pose;
    rounds.poses.push_back(pose);
  };
  for (int round = 0; round < 2; ++round) {
    for (int i = 0; i < 100; ++i) {
      const Pose2 pose(45.0 + 0.3 * (round == 0 ? i : 99 - i), 0.2,
                       round == 0 ? 0.0 : kPi);
      if (round == 0 && i == 0) {
        for (int k = 0; k < hall.second; ++k) {
          add(hall.scans[static_cast<std::size_t>(k)],
              hall.poses[static_cast<std::size_t>(k)]);
        }
      }
      if (round == 0 && i == 50) {
        result.cut.end = static_cast<int>(rounds.scans.size());
        result.cut.begin = result.cut.end - 1;
      }
      add(MakeScan(walls, pose, laser, &noise), pose);
    }
  }
  for (std::size_t k = static_cast<std::size_t>(hall.second);
       k < hall.scans.size(); ++k) {
    add(hall.scans[k], hall.poses[k]);
  }
  return result;
}

// The halls show that both parts lie right, but not where in the corridor the
// robot was when wheels were not read.
TEST(JudgeTiesTest, NextToACutInACorridorOdometryMayBeRight) {
  CutInACorridor plain = CutWithNiches({});
  const auto verdicts = [](const CutInACorridor& world) {
    return JudgeTies(world.rounds.scans, world.rounds.keys, world.rounds.poses,
                     {world.cut}, {});
  };
  EXPECT_EQ(verdicts(plain), Verdicts{TieVerdict::kConfirmed});
  const auto stop_wheels = [](CutInACorridor* world) {
    for (std::size_t k = static_cast<std::size_t>(world->cut.end);
         k < world->rounds.scans.size(); ++k) {
      Pose2& odometry = world->rounds.scans[k].odometry;
      odometry = Compose(Pose2(-1.5, 0.0, 0.0), odometry);
    }
  };
  stop_wheels(&plain);
  EXPECT_EQ(verdicts(plain), Verdicts{TieVerdict::kOpen});
  // Where something is in sight it shows where the robot was.
  std::vector<WallEnds> niches;
  for (const double x : {57.0, 60.5, 64.0}) {
    for (const WallEnds& side :
         testing::Moved(Room(0.8, 0.5), Pose2(x, -0.8, 0.0))) {
      niches.push_back(side);
    }
  }
  CutInACorridor with_niches = CutWithNiches(niches);
  stop_wheels(&with_niches);
  EXPECT_EQ(verdicts(with_niches), Verdicts{TieVerdict::kConfirmed});
}

// Along a corridor all agrees wherever it lies.
TEST(JudgeTiesTest, ACorridorSaysNothingAlongItself) {
  const std::vector<WallEnds> walls = Room(80.0, 2.0);
  Laser laser;
  laser.sigma = 0.01;
  laser.maximum_range = 8.0;
  Noise noise(4);
  Rounds rounds;
  for (int round = 0; round < 2; ++round) {
    if (round == 1) rounds.second = static_cast<int>(rounds.scans.size());
    for (int i = 0; i < 100; ++i) {
      const Pose2 pose(0.3 * i - 15.0, 0.2, 0.0);
      rounds.keys.push_back(static_cast<int>(rounds.scans.size()));
      rounds.scans.push_back(MakeScan(walls, pose, laser, &noise));
      // Five metres off along the corridor.
      rounds.poses.push_back(
          Compose(pose, Pose2(round == 1 ? 5.0 : 0.0, 0.0, 0.0)));
    }
  }
  const std::vector<TrackCut> cuts = {{rounds.second - 1, rounds.second}};
  EXPECT_EQ(JudgeTies(rounds.scans, rounds.keys, rounds.poses, cuts, {}),
            Verdicts{TieVerdict::kUnconfirmed});
}

}  // namespace
}  // namespace plumbline
