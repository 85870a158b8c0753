#include <gtest/gtest.h>
#include <plumbline/apps/experiments/building_trial.h>
#include <plumbline/apps/simulation/bent_world.h>
#include <plumbline/apps/simulation/building.h>
#include <plumbline/apps/simulation/world_file.h>
#include <plumbline/detectors/builtins.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <set>
#include <sstream>
#include <string>
#include <vector>

namespace plumbline {
namespace {

TEST(BuildingTrialTest, EveryShapeHasABuilding) {
  std::set<std::size_t> walls;
  for (const std::string& shape : BuildingShapes()) {
    const World world = MakeWorld(shape, 3, 1.0);
    EXPECT_GT(world.walls.size(), 10u) << shape;
    EXPECT_GT(world.path.size(), 4u) << shape;
    walls.insert(world.walls.size());
    // Another seed, another building.
    EXPECT_NE(MakeWorld(shape, 4, 1.0).walls[0].end.x(), world.walls[0].end.x())
        << shape;
  }
  EXPECT_EQ(walls.size(), BuildingShapes().size());
}

TEST(BuildingTrialTest, ObliqueWingsDiffer) {
  const WorldSurfaces a = MakeSurfaces(MakeWorld("oblique", 1, 1.0));
  const WorldSurfaces b = MakeSurfaces(MakeWorld("oblique", 2, 1.0));
  ASSERT_EQ(a.orientations_deg.size(), 4u);
  ASSERT_EQ(b.orientations_deg.size(), 4u);
  EXPECT_NE(a.orientations_deg, b.orientations_deg);
}

// A round corridor 2 m wide of walls that turn by 4 degrees each, with a niche
// to its side every third of the way, driven round once and a quarter.
World RoundCorridor(double radius) {
  constexpr int kSides = 90;
  World world;
  const auto at = [](double distance, int side) {
    const double angle = 2.0 * kPi * side / kSides;
    return Eigen::Vector2d(distance * std::cos(angle),
                           distance * std::sin(angle));
  };
  for (int k = 0; k < kSides; ++k) {
    world.walls.push_back({at(radius - 1.0, k), at(radius - 1.0, k + 1), 0.1});
    const double outside = k % 30 == 15 ? radius + 3.0 : radius + 1.0;
    world.walls.push_back({at(outside, k), at(outside, k + 1), 0.1});
    if (k % 30 == 15) {
      world.walls.push_back({at(radius + 1.0, k), at(outside, k), 0.1});
      world.walls.push_back({at(radius + 1.0, k + 1), at(outside, k + 1), 0.1});
    }
  }
  for (int k = 0; k <= kSides + kSides / 4; ++k) {
    world.path.push_back(at(radius, k));
  }
  return world;
}

// Two straight corridors 40 m long with niches, 16 m apart, joined by round
// ones at both ends, driven round once and a quarter.
World RoundEnds() {
  constexpr double kLength = 40.0;
  constexpr double kRadius = 8.0;
  constexpr double kArc = kPi * kRadius;
  // So far on the way, and so far to its right, m.
  const auto at = [=](double way, double aside) {
    const double half = kLength + kArc;
    const double side = std::fmod(way, 2.0 * half) < half ? 1.0 : -1.0;
    const double here = std::fmod(way, half);
    const double turned = std::max(0.0, here - kLength) / kRadius - 0.5 * kPi;
    const double x = std::min(here, kLength) - 0.5 * kLength;
    return Eigen::Vector2d(side * (x + (kRadius + aside) * std::cos(turned)),
                           side * (kRadius + aside) * std::sin(turned));
  };
  World world;
  const auto wall = [&](double way, double aside, double to, double to_aside) {
    world.walls.push_back({at(way, aside), at(to, to_aside), 0.1});
  };
  constexpr int kStraight = 40;
  constexpr int kRound = 42;
  double way = 0.0;
  for (int k = 0; k < 2 * (kStraight + kRound); ++k) {
    const bool is_straight = k % (kStraight + kRound) < kStraight;
    const double next =
        way + (is_straight ? kLength / kStraight : kArc / kRound);
    wall(way, -1.0, next, -1.0);
    const bool is_niche = is_straight && k % 7 == 3;
    const double outside = is_niche ? 2.0 : 1.0;
    wall(way, outside, next, outside);
    if (is_niche) {
      wall(way, 1.0, way, outside);
      wall(next, 1.0, next, outside);
    }
    way = next;
  }
  for (double to = 0.5; to < 1.3 * way; to += 1.0) {
    world.path.push_back(at(to, 0.0));
  }
  return world;
}

// A square ring of corridors, 10 m by 8 m, driven round one and a half times.
World Ring() {
  World world;
  const auto wall = [&world](double x1, double y1, double x2, double y2) {
    world.walls.push_back({{x1, y1}, {x2, y2}, 0.0});
  };
  wall(-1.0, -1.0, 11.0, -1.0);
  wall(11.0, -1.0, 11.0, 9.0);
  wall(11.0, 9.0, -1.0, 9.0);
  wall(-1.0, 9.0, -1.0, -1.0);
  wall(1.0, 1.0, 9.0, 1.0);
  wall(9.0, 1.0, 9.0, 7.0);
  wall(9.0, 7.0, 1.0, 7.0);
  wall(1.0, 7.0, 1.0, 1.0);
  world.path = {{0.0, 0.0}, {10.0, 0.0}, {10.0, 8.0}, {0.0, 8.0},
                {0.0, 0.0}, {10.0, 0.0}, {10.0, 8.0}};
  return world;
}

// Structure that knows one direction used to take most of the bend out of such
// corridors.
TEST(BuildingTrialTest, ABentBuildingStaysBent) {
  Registry registry;
  RegisterBuiltins(&registry);
  for (const double bend : {2.0, 3.0, 7.0}) {
    for (const bool has_niches : {false, true}) {
      BentOptions options = has_niches ? NichesOptions() : BentOptions();
      options.bend_deg = bend;
      const BuildingTrial trial = RunBuildingTrial(
          MakeBentWorld(options, 1), SimulatorOptions(), 1, registry, {});
      EXPECT_LT(trial.map.bend_error_deg, 1.2)
          << bend << " degrees, niches: " << has_niches;
      EXPECT_LT(trial.mean_position_error, 0.05)
          << bend << " degrees, niches: " << has_niches;
    }
  }
}

// Walls that turn by a few degrees each were taken for one another, so that the
// map turned 15 % too little: 9 m off, without a word, though refined odometry
// was right to a degree.
TEST(BuildingTrialTest, ARoundCorridorStaysRound) {
  Registry registry;
  RegisterBuiltins(&registry);
  const BuildingTrial trial = RunBuildingTrial(
      RoundCorridor(15.0), SimulatorOptions(), 1, registry, {});
  EXPECT_LT(trial.mean_position_error, 0.15);
}

// A wide one turns by less than a degree in 10 m otherwise than refined
// odometry: what was measured between scans fits only one of the two, though
// scans agree with each other in both.
TEST(BuildingTrialTest, AWideRoundCorridorStaysRound) {
  Registry registry;
  RegisterBuiltins(&registry);
  const BuildingTrial trial = RunBuildingTrial(
      RoundCorridor(25.0), SimulatorOptions(), 1, registry, {});
  EXPECT_LT(trial.mean_position_error, 0.3);
}

// The same where it is the smaller part of the building.
TEST(BuildingTrialTest, RoundEndsOfCorridorsStayRound) {
  Registry registry;
  RegisterBuiltins(&registry);
  SimulatorOptions simulator;
  simulator.drive.scan_rate = 10.0;
  const BuildingTrial trial =
      RunBuildingTrial(RoundEnds(), simulator, 2, registry, {});
  EXPECT_LT(trial.mean_position_error, 0.15);
}

// Distances made for a laser of 1 cm took the returns of one that is four times
// as noisy for walls beside the walls: 35 m of them, and a third was missed.
TEST(BuildingTrialTest, ANoisyLaserDrawsNoWallTwice) {
  Registry registry;
  RegisterBuiltins(&registry);
  SimulatorOptions simulator;
  simulator.laser.noise = 0.04;
  const BuildingTrial trial = RunBuildingTrial(MakeWorld("office", 41, 1.0),
                                               simulator, 41, registry, {});
  EXPECT_LT(trial.map.doubled_length, 1.0);
  EXPECT_GT(trial.map.recall, 0.75);
  EXPECT_GT(trial.map.precision, 0.98);
  EXPECT_LT(trial.mean_position_error, 0.03);
}

TEST(BuildingTrialTest, ARingOfCorridors) {
  Registry registry;
  RegisterBuiltins(&registry);
  const BuildingTrial trial =
      RunBuildingTrial(Ring(), SimulatorOptions(), 5, registry, {});
  EXPECT_FALSE(trial.is_stopped);
  EXPECT_GT(trial.scans, 200);
  EXPECT_EQ(trial.map.walls.size(), 8u);
  EXPECT_TRUE(trial.map.missed_walls.empty());
  EXPECT_TRUE(trial.map.false_walls.empty());
  EXPECT_LT(trial.map.offset_error.mean, 0.02);
  EXPECT_LT(trial.mean_position_error, 0.02);
  EXPECT_EQ(trial.closures.wrong, 0);
  EXPECT_EQ(trial.closures.closed_revisits, trial.closures.revisits);
  EXPECT_FALSE(trial.drawing.walls.empty());
}

// Small worlds from the log to the plan: what is there, and no invented room.
PlanEvaluation PlanOfWorld(const std::string& text) {
  Registry registry;
  RegisterBuiltins(&registry);
  std::istringstream input(text);
  return RunBuildingTrial(ReadWorld(input, "small.world"), SimulatorOptions(),
                          1, registry, {})
      .plan;
}

TEST(BuildingTrialTest, PlanOfOneRoom) {
  const PlanEvaluation plan = PlanOfWorld(
      "wall -0.1 0 8.1 0 0.2\n"
      "wall -0.1 5 8.1 5 0.2\n"
      "wall 0 0 0 5 0.2\n"
      "wall 8 0 8 5 0.2\n"
      "box 6.5 0.6 1.6 0.8 0\n"
      "path 1.5 2 5 1.5 6.5 3.5 2 4\n");
  EXPECT_EQ(plan.rooms.asked, 1);
  EXPECT_EQ(plan.rooms.drawn, 1);
  EXPECT_GT(plan.rooms.mean_iou, 0.9);
  EXPECT_EQ(plan.doors_drawn, 0);
  EXPECT_EQ(plan.double_walls, 0);
}

TEST(BuildingTrialTest, PlanOfOneCorridor) {
  const PlanEvaluation plan = PlanOfWorld(
      "wall -0.1 0 24.1 0 0.2\n"
      "wall -0.1 2.2 24.1 2.2 0.2\n"
      "wall 0 0 0 2.2 0.2\n"
      "wall 24 0 24 2.2 0.2\n"
      "path 1.2 1.1 22.8 1.1\n");
  EXPECT_EQ(plan.rooms.asked, 1);
  EXPECT_EQ(plan.rooms.drawn, 1);
  EXPECT_GT(plan.rooms.mean_iou, 0.9);
  EXPECT_EQ(plan.doors_drawn, 0);
}

// Columns, and walls farther than the laser sees.
TEST(BuildingTrialTest, PlanOfAHallWithoutWalls) {
  std::string text = "path 0 0 20 0 20 8 0 8\n";
  for (double x = -6.0; x <= 26.0; x += 4.0) {
    for (double y = -6.0; y <= 14.0; y += 4.0) {
      text += "circle " + std::to_string(x) + " " + std::to_string(y + 0.5) +
              " 0.25\n";
    }
  }
  const PlanEvaluation plan = PlanOfWorld(text);
  EXPECT_EQ(plan.rooms.drawn, 0);
  EXPECT_EQ(plan.doors_drawn, 0);
}

// A front of a building, cars and trees.
TEST(BuildingTrialTest, PlanOfAYard) {
  const PlanEvaluation plan = PlanOfWorld(
      "wall -5 -4 30 -4 0.3\n"
      "box 2 4 4.2 1.8 0\n"
      "box 9 4.5 4.4 1.8 8\n"
      "box 16 6 4.2 1.8 80\n"
      "circle 5 8 0.2\n"
      "circle 12 9 0.3\n"
      "circle 24.5 3 0.2\n"
      "path 0 0 12 1 20 0 22 6\n");
  EXPECT_EQ(plan.rooms.drawn, 0);
  EXPECT_EQ(plan.doors_drawn, 0);
}

TEST(BuildingTrialTest, Stopped) {
  Registry registry;
  RegisterBuiltins(&registry);
  const BuildingTrial trial = RunBuildingTrial(
      Ring(), SimulatorOptions(), 5, registry, {}, [] { return true; });
  EXPECT_TRUE(trial.is_stopped);
  EXPECT_EQ(trial.scans, 0);
}

// Covariances of walls are of the size of their errors, in every mode: over
// five small offices the ratio of NEES to its degrees of freedom, with room for
// what is not reached yet (datasets/RESULTS.md).
TEST(BuildingTrialTest, CovariancesHold) {
  struct Mode {
    const char* name;
    bool structure, closures;
    Refinement refine;
    double least, most;
  };
  const Mode modes[] = {{"none", false, false, Refinement::kMap, 0.6, 1.5},
                        {"structure", true, false, Refinement::kMap, 0.6, 1.5},
                        {"default", true, true, Refinement::kFull, 0.6, 1.5}};
  Registry registry;
  RegisterBuiltins(&registry);
  for (const Mode& mode : modes) {
    LogSolverOptions options;
    options.structure = mode.structure;
    options.global_association = mode.closures;
    options.refine = mode.refine;
    std::vector<double> ratios;
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      const BuildingTrial trial =
          RunBuildingTrial(MakeWorld("office", seed, 0.5), SimulatorOptions(),
                           seed, registry, options);
      EXPECT_GT(trial.consistency.degrees_of_freedom, 20) << mode.name;
      ratios.push_back(trial.consistency.ratio());
    }
    std::sort(ratios.begin(), ratios.end());
    EXPECT_GT(ratios[2], mode.least) << mode.name;
    EXPECT_LT(ratios[2], mode.most) << mode.name;
    // No building is far off either.
    EXPECT_GT(ratios[0], 0.5 * mode.least) << mode.name;
    EXPECT_LT(ratios[4], 2.0 * mode.most) << mode.name;
  }
}

}  // namespace
}  // namespace plumbline
