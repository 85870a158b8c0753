#include <gtest/gtest.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/graph_json.h>
#include <plumbline/core/transaction.h>
#include <plumbline/core/wall.h>
#include <plumbline/factors/angle.h>
#include <plumbline/pipeline/second_map.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "frontend/synthetic_world.h"

namespace plumbline {
namespace {

// A room of 10 m by 6 m with a pillar, driven round twice. Every scan is a key
// scan; the first map has one wall of 4 m, and the second round half off.
class SecondMapTest : public ::testing::Test {
 protected:
  SecondMapTest()
      : map_(Registered(&registry_), {}, {}),
        run_(scans_, control_),
        second_(registry_, options_, &run_, &map_) {
    std::vector<testing::WallEnds> world = testing::Room(10.0, 6.0);
    Add(testing::Moved(testing::Room(0.8, 0.8), Pose2(1.0, 0.3, 0.0)), &world);
    See(world, Pose2(0.1, -0.08, DegToRad(1.0)));
    Transaction transaction;
    Feature wall;
    wall.type = &registry_.GetFeature("segment");
    wall.parameters = {0.0, -3.0, 0.0};
    wall.extent_begin = -2.0;
    wall.extent_end = 2.0;
    transaction.AddFeature(wall);
    map_.graph().Apply(std::move(transaction));
    first_ = Json();
    control_.stop = [this] { return is_stopped_; };
  }

  static void Add(const std::vector<testing::WallEnds>& walls,
                  std::vector<testing::WallEnds>* world) {
    world->insert(world->end(), walls.begin(), walls.end());
  }

  // Two rounds on an ellipse in this world, of 60 scans each; the first map is
  // `off` from one of them on, the first of the second round by default.
  void See(const std::vector<testing::WallEnds>& world, const Pose2& off,
           double half_length = 3.2, double half_width = 1.9,
           int first_off = 60) {
    truth_.clear();
    scans_.clear();
    run_.result.refined.clear();
    run_.result.records.clear();
    run_.keys.clear();
    testing::Laser laser;
    laser.sigma = 0.01;
    testing::Noise noise(11);
    for (int i = 0; i < 120; ++i) {
      const double angle = 2.0 * kPi * i / 60.0;
      truth_.emplace_back(half_length * std::cos(angle),
                          half_width * std::sin(angle),
                          NormalizeAngle(angle + 0.5 * kPi));
      scans_.push_back(testing::MakeScan(world, truth_.back(), laser, &noise));
      RefinedScan refined;
      KeyScanRecord record;
      record.scan = i;
      if (i > 0) {
        record.motion.mean = Compose(Between(truth_[i - 1], truth_[i]),
                                     Pose2(0.0005, 0.0, DegToRad(0.01)));
        record.motion.covariance =
            Eigen::Vector3d(1e-4, 1e-4, 1e-5).asDiagonal();
        refined.since_key = record.motion;
      }
      refined.is_key = true;
      run_.result.refined.push_back(refined);
      run_.result.records.push_back(record);
      run_.keys.push_back(i < first_off ? truth_[i] : Compose(off, truth_[i]));
    }
    run_.result.trajectory = run_.keys;
  }

  static const Registry& Registered(Registry* registry) {
    RegisterBuiltinRelations(registry);
    return *registry;
  }

  std::string Json() const {
    std::ostringstream text;
    WriteGraphJson(map_.graph(), text);
    return text.str();
  }

  double WorstPosition(const LogRun& run) const {
    double worst = 0.0;
    for (std::size_t i = 0; i < truth_.size(); ++i) {
      worst = std::max(worst,
                       (run.result.trajectory[i] - truth_[i]).head<2>().norm());
    }
    return worst;
  }

  void ExpectFirst() const {
    EXPECT_FALSE(second_.is_begun());
    EXPECT_EQ(Json(), first_);
    EXPECT_EQ(run_.result.trajectory, run_.keys);
    EXPECT_TRUE(run_.places.empty());
    EXPECT_EQ(run_.result.scan_relations, 0);
  }

  bool is_stopped_ = false;
  Registry registry_;
  LogSolverOptions options_;
  std::vector<Scan> scans_;
  std::vector<Pose2> truth_;
  RunControl control_;
  SolvedMap map_;
  LogRun run_;
  SecondMap second_;
  std::string first_;
};

TEST_F(SecondMapTest, TakesTheFirstOnesPlace) {
  EXPECT_FALSE(second_.is_begun());
  second_.AdjustPoses();
  EXPECT_TRUE(second_.is_begun());
  EXPECT_EQ(run_.places.size(), 40u);
  EXPECT_EQ(map_.graph().num_features(), 40u);
  EXPECT_GT(WorstPosition(run_), 0.0);
  EXPECT_LT(WorstPosition(run_), 0.02);
  second_.MakeWalls();
  EXPECT_GE(map_.graph().num_features(), 44u);
  second_.AdjustWalls();
  EXPECT_FALSE(second_.is_begun());
  EXPECT_FALSE(run_.result.second_map_refused);
  EXPECT_GT(LengthOfWalls(map_.graph()), 20.0);
  EXPECT_LT(WorstPosition(run_), 0.02);
  EXPECT_GT(run_.result.scan_relations, 10);
  EXPECT_GT(run_.result.wall_votes, 40);
  EXPECT_GE(second_.vote_excess(), 1.0);
}

// Posts stand every metre along two walls, and the first map has the second
// round one post too far: matches fit there as well, what was seen between does
// not. Poses are adjusted from refined odometry then.
TEST_F(SecondMapTest, PosesAreAdjustedFromWhereLessContradicts) {
  std::vector<testing::WallEnds> world = testing::Room(10.0, 6.0);
  for (int i = -4; i <= 4; ++i) {
    for (const double y : {-2.8, 2.8}) {
      Add(testing::Moved(testing::Room(0.4, 0.4), Pose2(i, y, 0.0)), &world);
    }
  }
  See(world, Pose2(1.0, 0.0, 0.0));
  // Without looking it does not notice.
  LogSolverOptions unchecked = options_;
  unchecked.check_map = false;
  SolvedMap map(registry_, {}, {});
  LogRun run(scans_, control_);
  run.result = run_.result;
  run.keys = run_.keys;
  SecondMap(registry_, unchecked, &run, &map).AdjustPoses();
  EXPECT_GT(WorstPosition(run), 0.5);

  second_.AdjustPoses();
  EXPECT_LT(WorstPosition(run_), 0.02);
}

// A round room of twelve equal walls, which the first map has turned by one of
// them in the end: all scans agree there, but the robot did not turn.
TEST_F(SecondMapTest, PosesAreAdjustedFromOdometryWhereTheyHaveAKink) {
  std::vector<testing::WallEnds> world;
  for (int i = 0; i < 12; ++i) {
    const auto corner = [](int k) {
      const double angle = DegToRad(30.0 * k);
      return Eigen::Vector2d(5.0 * std::cos(angle), 5.0 * std::sin(angle));
    };
    world.push_back({corner(i), corner(i + 1)});
  }
  See(world, Pose2(0.0, 0.0, DegToRad(30.0)), 3.0, 3.0, 102);
  second_.AdjustPoses();
  EXPECT_LT(WorstPosition(run_), 0.05);
}

TEST_F(SecondMapTest, TheFirstOneComesBackWhenItIsStopped) {
  second_.AdjustPoses();
  second_.MakeWalls();
  is_stopped_ = true;
  second_.AdjustWalls();
  ExpectFirst();
  EXPECT_FALSE(run_.result.second_map_refused);
  EXPECT_TRUE(run_.result.interrupted);
}

TEST_F(SecondMapTest, TheFirstOneComesBackBeforeThereAreWalls) {
  second_.AdjustPoses();
  is_stopped_ = true;
  second_.MakeWalls();
  ExpectFirst();
}

TEST_F(SecondMapTest, IsRefusedWhereItHasHardlyAnyOfTheWalls) {
  LogSolverOptions options = options_;
  options.completion.min_returns = 1 << 30;
  SecondMap second(registry_, options, &run_, &map_);
  second.SetFirstLength(500.0);
  second.AdjustPoses();
  second.MakeWalls();
  second.AdjustWalls();
  EXPECT_TRUE(run_.result.second_map_refused);
  EXPECT_FALSE(second.is_begun());
  EXPECT_EQ(Json(), first_);
}

// A noisy laser puts walls beside walls into the first map, many times as long
// as all that stand there.
TEST_F(SecondMapTest, IsNotRefusedWhereItsWallsHaveTheReturns) {
  second_.SetFirstLength(500.0);
  second_.AdjustPoses();
  second_.MakeWalls();
  second_.AdjustWalls();
  EXPECT_FALSE(run_.result.second_map_refused);
  EXPECT_LT(WorstPosition(run_), 0.02);
}

// A mirror 2 m wide hangs in the wall at y = 3: behind it lies the image of the
// room, in which no wall is drawn; the mirror is one.
TEST_F(SecondMapTest, WhatIsSeenInAMirrorIsLeftOut) {
  std::vector<testing::WallEnds> world = {{{-5.0, 3.0}, {-1.0, 3.0}},
                                          {{1.0, 3.0}, {5.0, 3.0}},
                                          {{5.0, 3.0}, {5.0, -3.0}},
                                          {{5.0, -3.0}, {-5.0, -3.0}},
                                          {{-5.0, -3.0}, {-5.0, 3.0}}};
  Add(testing::Moved(testing::Room(0.8, 0.8), Pose2(1.0, 0.3, 0.0)), &world);
  Add(testing::Moved(testing::Room(0.6, 1.2), Pose2(-2.0, -2.4, 0.0)), &world);
  const std::vector<testing::WallEnds> room = world;
  for (const testing::WallEnds& wall : room) {
    world.push_back(
        {{wall.a.x(), 6.0 - wall.a.y()}, {wall.b.x(), 6.0 - wall.b.y()}});
  }
  See(world, Pose2::Zero());
  LogSolverOptions options = options_;
  for (const bool find_mirrors : {true, false}) {
    options.find_mirrors = find_mirrors;
    run_.result.trajectory = run_.keys;
    SecondMap second(registry_, options, &run_, &map_);
    second.AdjustPoses();
    second.MakeWalls();
    second.AdjustWalls();
    double behind = 0.0;
    bool has_mirror = false;
    for (const Feature* feature : std::as_const(map_.graph()).Features()) {
      const std::optional<Wall> wall = WallOf(*feature);
      if (!wall) continue;
      if (wall->Middle().y() > 3.2) behind += wall->length();
      has_mirror |= std::abs(wall->Across({0.0, 3.0})) < 0.03 &&
                    wall->begin < wall->Along({0.9, 3.0}) &&
                    wall->end > wall->Along({-0.9, 3.0}) &&
                    wall->Across({0.0, 0.0}) > 2.9;
    }
    EXPECT_EQ(has_mirror, find_mirrors);
    if (find_mirrors) {
      EXPECT_LT(behind, 0.5);
      ASSERT_EQ(run_.result.mirrors.size(), 1u);
      EXPECT_NEAR(run_.result.mirrors[0].wall.length(), 2.0, 0.1);
    } else {
      EXPECT_GT(behind, 5.0);
    }
    run_.result.mirrors.clear();
  }
}

}  // namespace
}  // namespace plumbline
