#include <gtest/gtest.h>
#include <plumbline/core/builtins.h>
#include <plumbline/factors/angle.h>
#include <plumbline/frontend/wall_completion.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "frontend/synthetic_world.h"

namespace plumbline {
namespace {

using testing::MakeScan;
using testing::Noise;
using testing::WallEnds;

class WallCompletionTest : public ::testing::Test {
 protected:
  WallCompletionTest() {
    RegisterBuiltinRelations(&registry_);
    // A corridor wall at y = 1 with a door 1 m wide at the origin, and a wall
    // of the room behind it at y = 4.
    world_ = {{{-10.0, 1.0}, {-0.5, 1.0}},
              {{0.5, 1.0}, {10.0, 1.0}},
              {{-3.0, 4.0}, {3.0, 4.0}}};
    // The robot passes along the corridor. Five beams a scan go sideways: too
    // few for a segment in any scan.
    laser_.start_angle = DegToRad(80.0);
    laser_.angle_step = DegToRad(5.0);
    laser_.beams = 5;
    laser_.sigma = 0.005;
    Noise noise(3);
    for (int i = 0; i <= 160; ++i) {
      poses_.emplace_back(-4.0 + 0.05 * i, 0.0, 0.0);
      scans_.push_back(MakeScan(world_, poses_.back(), laser_, &noise));
    }
    AddSegment({-5.0, 1.0, kPi}, 4.5);
    AddSegment({5.0, 1.0, kPi}, 4.5);
  }

  void AddSegment(const Pose2& pose, double half_length) {
    Transaction transaction;
    Feature feature;
    feature.type = &registry_.GetFeature("segment");
    feature.parameters = {pose[0], pose[1], pose[2]};
    feature.extent_begin = -half_length;
    feature.extent_end = half_length;
    transaction.AddFeature(feature);
    graph_.Apply(std::move(transaction));
  }

  Registry registry_;
  Graph graph_;
  std::vector<WallEnds> world_;
  testing::Laser laser_;
  std::vector<Scan> scans_;
  std::vector<Pose2> poses_;
  WallCompletionOptions options_;
};

// Of a direction to the nearest axis, rad.
double AxisDistance(double direction) {
  return std::abs(std::remainder(direction, 0.5 * kPi));
}

// A door that was shut in the wall of the room when it was seen, and that the
// robot went through later: no wall stands there.
TEST_F(WallCompletionTest, NoWallStandsWhereTheRobotWentThrough) {
  const Scan empty = [this] {
    Scan scan = scans_.back();
    for (float& range : scan.ranges) range = 0.0f;
    return scan;
  }();
  for (int i = 1; i <= 300; ++i) {
    // Through the door to the room, and through its wall.
    poses_.emplace_back(i <= 80 ? 4.0 - 0.05 * i : 0.0,
                        i <= 80 ? 0.0 : 0.03 * (i - 80), 0.0);
    scans_.push_back(empty);
  }
  const Transaction walls =
      FindGlimpsedWalls(graph_, registry_, scans_, poses_, options_);
  double length = 0.0;
  for (const Feature& wall : walls.added_features()) {
    if (std::abs(wall.parameters[1] - 4.0) > 0.1) continue;
    length += wall.extent_end - wall.extent_begin;
    const double half = 0.5 * (wall.extent_end - wall.extent_begin);
    EXPECT_GT(std::abs(wall.parameters[0]) - half, 0.1);
  }
  EXPECT_GT(length, 1.5);
}

// What is seen through the door lies on no wall of the map.
TEST_F(WallCompletionTest, ExplainedShareIsThatOfReturnsOnWalls) {
  const double share = ExplainedShare(graph_, scans_, poses_, options_);
  EXPECT_GT(share, 0.8);
  EXPECT_LT(share, 0.95);
  AddSegment({0.0, 4.0, kPi}, 3.0);
  EXPECT_GT(ExplainedShare(graph_, scans_, poses_, options_), 0.99);
  EXPECT_EQ(ExplainedShare(Graph(), scans_, poses_, options_), 0.0);
  EXPECT_EQ(ExplainedShare(graph_, {}, {}, options_), 1.0);
}

// Two walls that meet at 2 degrees, 4 and 6 m long, lie within the scatter of
// one line: they are two all the same. A straight one stays one.
TEST(WallCompletionKinkTest, AWallIsCutAtAKink) {
  Registry registry;
  RegisterBuiltinRelations(&registry);
  for (const double bend : {0.0, DegToRad(2.0)}) {
    const std::vector<WallEnds> world = {
        {{-4.0, 2.0}, {0.0, 2.0}},
        {{0.0, 2.0}, {6.0 * std::cos(bend), 2.0 + 6.0 * std::sin(bend)}}};
    testing::Laser laser;
    laser.start_angle = DegToRad(30.0);
    laser.angle_step = DegToRad(1.0);
    laser.beams = 121;
    laser.sigma = 0.01;
    Noise noise(4);
    std::vector<Scan> scans;
    std::vector<Pose2> poses;
    for (int i = 0; i <= 60; ++i) {
      poses.emplace_back(-4.0 + 0.16 * i, 0.0, 0.0);
      scans.push_back(MakeScan(world, poses.back(), laser, &noise));
    }
    const Transaction walls =
        FindGlimpsedWalls(Graph(), registry, scans, poses, {});
    std::vector<double> directions;
    for (const Feature& wall : walls.added_features()) {
      if (wall.extent_end - wall.extent_begin < 2.0) continue;
      directions.push_back(NormalizeAxial(wall.parameters[2]));
    }
    std::sort(directions.begin(), directions.end());
    if (bend == 0.0) {
      ASSERT_EQ(directions.size(), 1u);
      EXPECT_NEAR(RadToDeg(directions[0]), 0.0, 0.1);
    } else {
      ASSERT_EQ(directions.size(), 2u);
      EXPECT_NEAR(RadToDeg(directions[0]), 0.0, 0.2);
      EXPECT_NEAR(RadToDeg(directions[1]), 2.0, 0.2);
    }
  }
}

// A piece of 1.7 m between two walls, turned by 5 degrees against each. The
// headings of a robot that comes near drift by 0.02 degrees a metre, which
// smears the piece by 10 cm: what was seen from near says where it is, and that
// neither wall goes on over it.
TEST(WallCompletionKinkTest, APieceBetweenWallsSmearedFromFarAway) {
  Registry registry;
  RegisterBuiltinRelations(&registry);
  const auto behind = [](const Eigen::Vector2d& begin, double direction,
                         double length) -> Eigen::Vector2d {
    return begin +
           length * Eigen::Vector2d(std::cos(direction), std::sin(direction));
  };
  const double turn = DegToRad(5.0);
  for (const double drift : {DegToRad(0.02), DegToRad(-0.02)}) {
    const Eigen::Vector2d a(-20.0, -1.0), b(0.0, -1.0);
    const Eigen::Vector2d c = behind(b, turn, 1.7);
    const Eigen::Vector2d d = behind(c, 2.0 * turn, 5.0);
    const std::vector<WallEnds> world = {{a, b}, {b, c}, {c, d}};
    testing::Laser laser;
    laser.start_angle = DegToRad(-90.0);
    laser.angle_step = DegToRad(1.0);
    laser.beams = 181;
    laser.sigma = 0.01;
    Noise noise(6);
    std::vector<Scan> scans;
    std::vector<Pose2> poses;
    for (int i = 0; i <= 160; ++i) {
      const double x = -18.0 + 0.13 * i;
      poses.emplace_back(x, 0.0, 0.0);
      scans.push_back(MakeScan(world, poses.back(), laser, &noise));
      poses.back()[2] -= drift * std::min(x, 0.0);
    }
    const Transaction walls =
        FindGlimpsedWalls(Graph(), registry, scans, poses, {});
    double length = 0.0;
    for (const Feature& wall : walls.added_features()) {
      const double off =
          std::abs(RadToDeg(NormalizeAxial(wall.parameters[2])) - 5.0);
      if (off < 1.0) length += wall.extent_end - wall.extent_begin;
    }
    EXPECT_GT(length, 0.8) << drift;
    EXPECT_LT(length, 2.2) << drift;
  }
}

// A wall of 0.9 m and the door beside it, set back by 5.5 cm, scatter about one
// line like one wall: it would be tilted by 3 degrees.
TEST(WallCompletionKinkTest, AWallAndADoorSetBackInItAreTwo) {
  Registry registry;
  RegisterBuiltinRelations(&registry);
  const std::vector<WallEnds> world = {{{-0.9, 2.0}, {0.0, 2.0}},
                                       {{0.0, 2.045}, {0.9, 2.045}}};
  testing::Laser laser;
  laser.start_angle = DegToRad(30.0);
  laser.angle_step = DegToRad(1.0);
  laser.beams = 121;
  laser.sigma = 0.02;
  Noise noise(4);
  std::vector<Scan> scans;
  std::vector<Pose2> poses;
  for (int i = 0; i <= 30; ++i) {
    poses.emplace_back(-3.0 + 0.2 * i, 0.0, 0.0);
    scans.push_back(MakeScan(world, poses.back(), laser, &noise));
  }
  WallCompletionOptions options;
  options.points.usable_range = 10.0;
  const auto worst = [&] {
    double tilt = 0.0;
    const Transaction walls =
        FindGlimpsedWalls(Graph(), registry, scans, poses, options);
    EXPECT_FALSE(walls.added_features().empty());
    for (const Feature& wall : walls.added_features()) {
      tilt = std::max(tilt, AxisDistance(wall.parameters[2]));
    }
    return RadToDeg(tilt);
  };
  EXPECT_LT(worst(), 0.8);
  options.min_step = 0.0;
  EXPECT_GT(worst(), 1.5);
}

// Of a wall that turns by 3 degrees 0.7 m before its end the end is too short
// for a direction of its own, and too little of the wall to tilt it by much: it
// is cut off all the same.
TEST(WallCompletionKinkTest, AnEndThatTurnsAwayIsCutOff) {
  Registry registry;
  RegisterBuiltinRelations(&registry);
  const double bend = DegToRad(3.0);
  const std::vector<WallEnds> world = {
      {{-4.0, 2.0}, {0.0, 2.0}},
      {{0.0, 2.0}, {0.7 * std::cos(bend), 2.0 + 0.7 * std::sin(bend)}}};
  testing::Laser laser;
  laser.start_angle = DegToRad(30.0);
  laser.angle_step = DegToRad(1.0);
  laser.beams = 121;
  laser.sigma = 0.01;
  for (const int seed : {1, 2, 3, 4, 5}) {
    Noise noise(seed);
    std::vector<Scan> scans;
    std::vector<Pose2> poses;
    for (int i = 0; i <= 60; ++i) {
      poses.emplace_back(-4.0 + 0.08 * i, 0.0, 0.0);
      scans.push_back(MakeScan(world, poses.back(), laser, &noise));
    }
    const Transaction walls =
        FindGlimpsedWalls(Graph(), registry, scans, poses, {});
    int found = 0;
    for (const Feature& wall : walls.added_features()) {
      if (wall.extent_end - wall.extent_begin < 2.0) continue;
      ++found;
      EXPECT_NEAR(RadToDeg(NormalizeAxial(wall.parameters[2])), 0.0, 0.05);
      // Seen from below: x runs from right to left.
      EXPECT_NEAR(wall.parameters[0] + wall.extent_end, 0.0, 0.35) << seed;
    }
    EXPECT_EQ(found, 1);
  }
}

// A cheap laser returns one range in twenty wrong, anywhere on its way: strays
// all around the walls of a room that was seen 400 times.
TEST(WallCompletionStrayTest, StraysHideNoWalls) {
  Registry registry;
  RegisterBuiltinRelations(&registry);
  const std::vector<WallEnds> world = {{{-2.0, -1.5}, {2.0, -1.5}},
                                       {{2.0, -1.5}, {2.0, 1.5}},
                                       {{2.0, 1.5}, {-2.0, 1.5}},
                                       {{-2.0, 1.5}, {-2.0, -1.5}}};
  testing::Laser laser;
  laser.start_angle = 0.0;
  laser.angle_step = DegToRad(1.0);
  laser.beams = 360;
  laser.sigma = 0.005;
  Noise noise(5);
  std::mt19937 random(6);
  std::uniform_real_distribution<float> share(0.0f, 1.0f);
  std::vector<Scan> scans;
  std::vector<Pose2> poses;
  for (int i = 0; i < 400; ++i) {
    poses.emplace_back(-1.0 + 0.005 * i, 0.1, 0.0);
    scans.push_back(MakeScan(world, poses.back(), laser, &noise));
    for (float& range : scans.back().ranges) {
      if (share(random) < 0.05f) range *= 1.3f * share(random);
    }
  }
  WallCompletionOptions options;
  const auto length = [&] {
    double sum = 0.0;
    const Transaction found =
        FindGlimpsedWalls(Graph(), registry, scans, poses, options);
    for (const Feature& wall : found.added_features()) {
      EXPECT_LT(AxisDistance(wall.parameters[2]), DegToRad(0.5));
      sum += wall.extent_end - wall.extent_begin;
    }
    return sum;
  };
  EXPECT_GT(length(), 12.0);
  options.least_explained = 0.0;
  EXPECT_LT(length(), 4.0);
}

// Seeds are tried many at a time, and most of them come to nothing.
TEST(WallCompletionThreadsTest, TheSameWallsWithAnyNumberOfThreads) {
  Registry registry;
  RegisterBuiltinRelations(&registry);
  std::vector<WallEnds> world;
  for (int i = 0; i < 12; ++i) {
    const Eigen::Vector2d corner(-6.0 + i, 2.0 + 0.3 * (i % 3));
    world.push_back({corner, corner + Eigen::Vector2d(0.9, 0.02 * i)});
    world.push_back({corner, corner + Eigen::Vector2d(0.1, 0.8)});
  }
  testing::Laser laser;
  laser.start_angle = DegToRad(20.0);
  laser.angle_step = DegToRad(1.0);
  laser.beams = 141;
  laser.sigma = 0.02;
  Noise noise(11);
  std::vector<Scan> scans;
  std::vector<Pose2> poses;
  for (int i = 0; i <= 300; ++i) {
    poses.emplace_back(-6.0 + 0.04 * i, 0.0, 0.0);
    scans.push_back(MakeScan(world, poses.back(), laser, &noise));
  }
  std::vector<std::vector<double>> first;
  for (const int threads : {1, 2, 5}) {
    WallCompletionOptions options;
    options.num_threads = threads;
    std::vector<std::vector<double>> walls;
    const Transaction found =
        FindGlimpsedWalls(Graph(), registry, scans, poses, options);
    for (const Feature& wall : found.added_features()) {
      walls.emplace_back(wall.parameters.begin(), wall.parameters.end());
      walls.back().push_back(wall.extent_end);
      walls.back().push_back(static_cast<double>(wall.observations));
    }
    if (threads == 1) first = walls;
    EXPECT_GT(walls.size(), 5u);
    EXPECT_EQ(walls, first) << threads;
  }
}

TEST_F(WallCompletionTest, FindsTheWallSeenThroughTheDoor) {
  const Transaction walls =
      FindGlimpsedWalls(graph_, registry_, scans_, poses_, options_);
  ASSERT_EQ(walls.added_features().size(), 1u);
  const Feature& wall = walls.added_features().front();
  EXPECT_EQ(wall.type->name, "segment");
  EXPECT_EQ(wall.level, 0);
  EXPECT_EQ(wall.source, "wall_completion");
  EXPECT_NEAR(wall.parameters[1], 4.0, 0.01);
  // Seen from below: the laser is on the left of its direction.
  EXPECT_NEAR(RadToDeg(NormalizeAngle(wall.parameters[2] - kPi)), 0.0, 0.5);
  EXPECT_GT(wall.extent_end - wall.extent_begin, 0.9);
  EXPECT_LT(wall.extent_end - wall.extent_begin, 2.5);
  // Bound to both walls of the map, by relations that hold as they stand.
  ASSERT_EQ(walls.added_constraints().size(), 2u);
  for (const Constraint& constraint : walls.added_constraints()) {
    EXPECT_EQ(constraint.kind, ConstraintClass::kMeasurement);
    const Feature& other = graph_.GetFeature(constraint.features[0]);
    const Pose2 expected = Between(
        Pose2(other.parameters[0], other.parameters[1], other.parameters[2]),
        Pose2(wall.parameters[0], wall.parameters[1], wall.parameters[2]));
    EXPECT_NEAR((constraint.expected - expected).norm(), 0.0, 1e-12);
  }
}

TEST_F(WallCompletionTest, ObservationsAreScansAndNotReturns) {
  const Transaction walls =
      FindGlimpsedWalls(graph_, registry_, scans_, poses_, options_);
  ASSERT_EQ(walls.added_features().size(), 1u);
  int scans = 0;
  int returns = 0;
  for (const Scan& scan : scans_) {
    int hits = 0;
    for (const float range : scan.ranges) hits += range > 3.5f ? 1 : 0;
    scans += hits > 0 ? 1 : 0;
    returns += hits;
  }
  ASSERT_GT(returns, 2 * scans);
  const int observations = walls.added_features().front().observations;
  EXPECT_LE(observations, scans);
  EXPECT_GE(observations, 0.8 * scans);
}

TEST_F(WallCompletionTest, FindsNothingTwice) {
  graph_.Apply(FindGlimpsedWalls(graph_, registry_, scans_, poses_, options_));
  EXPECT_TRUE(
      FindGlimpsedWalls(graph_, registry_, scans_, poses_, options_).empty());
}

TEST_F(WallCompletionTest, AWallFromTwoVisitsThatDisagreeIsFoundOnce) {
  // The second visit's poses are 10 cm off: its returns make another line, but
  // so near that the first explains it.
  const std::size_t n = scans_.size();
  for (std::size_t i = 0; i < n; ++i) {
    scans_.push_back(scans_[i]);
    poses_.push_back(poses_[i] + Pose2(0.0, 0.1, 0.0));
  }
  const Transaction walls =
      FindGlimpsedWalls(graph_, registry_, scans_, poses_, options_);
  EXPECT_EQ(walls.added_features().size(), 1u);
}

TEST_F(WallCompletionTest, ScatteredReturnsAreNoWall) {
  Noise noise(5);
  std::vector<Scan> scans;
  for (const Pose2& pose : poses_) {
    Scan scan = MakeScan(world_, pose, laser_);
    for (float& range : scan.ranges) {
      range = static_cast<float>(std::abs(4.0 + noise.Normal(1.0)));
    }
    scans.push_back(scan);
  }
  EXPECT_TRUE(
      FindGlimpsedWalls(graph_, registry_, scans, poses_, options_).empty());
}

TEST_F(WallCompletionTest, NothingComesOfNothing) {
  EXPECT_TRUE(FindGlimpsedWalls(graph_, registry_, {}, {}, options_).empty());
  Graph empty;
  // Without a wall in the map there is nothing to bind one to.
  EXPECT_TRUE(FindGlimpsedWalls(empty, registry_, scans_, poses_, options_)
                  .added_constraints()
                  .empty());
}

TEST_F(WallCompletionTest, SameFarFromTheOrigin) {
  const Pose2 far(10000.0, -10000.0, 0.0);
  Graph graph;
  for (const Feature* feature : graph_.Features()) {
    Transaction transaction;
    Feature moved = *feature;
    moved.parameters[0] += far[0];
    moved.parameters[1] += far[1];
    transaction.AddFeature(moved);
    graph.Apply(std::move(transaction));
  }
  std::vector<Pose2> poses;
  for (const Pose2& pose : poses_) poses.push_back(pose + far);
  const Transaction walls =
      FindGlimpsedWalls(graph, registry_, scans_, poses, options_);
  ASSERT_EQ(walls.added_features().size(), 1u);
  EXPECT_NEAR(walls.added_features().front().parameters[1], -9996.0, 0.01);
}

}  // namespace
}  // namespace plumbline
