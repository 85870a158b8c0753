#include <gtest/gtest.h>
#include <plumbline/detectors/direction_assignment.h>

#include <cmath>
#include <random>
#include <vector>

namespace plumbline {
namespace {

// Walls in a row, each linked with the next two; the truth turns by `bend`
// (degrees) after the middle. Every fourth wall is across.
struct Row {
  DirectionNetwork network;
  std::vector<DirectionWall> walls;
  std::vector<double> truth;
};

Row MakeRow(int count, double bend_deg, double sigma_deg, std::uint64_t seed) {
  std::mt19937_64 engine(seed);
  std::normal_distribution<double> noise(0.0, DegToRad(sigma_deg));
  Row row;
  for (int i = 0; i < count; ++i) {
    row.truth.push_back(DegToRad(i < count / 2 ? 0.0 : bend_deg) +
                        (i % 4 == 3 ? 0.5 * kPi : 0.0));
    // What a map that a wrong structure has bent would start from.
    row.network.AddNode(i % 4 == 3 ? 0.5 * kPi : 0.0);
    DirectionWall wall;
    wall.node = static_cast<std::size_t>(i);
    wall.length = 3.0;
    row.walls.push_back(wall);
  }
  for (int i = 0; i < count; ++i) {
    for (int step = 1; step <= 2 && i + step < count; ++step) {
      row.network.AddLink(i, i + step,
                          row.truth[i + step] - row.truth[i] + noise(engine),
                          DegToRad(sigma_deg) * DegToRad(sigma_deg), false);
    }
  }
  return row;
}

// Walls tied to a direction with a wall of the other half.
int Mixed(const DirectionAssignment& assignment, int count) {
  int mixed = 0;
  for (const SharedDirection& direction : assignment.directions) {
    int first = 0, second = 0;
    for (const std::size_t wall : direction.walls) {
      ++(static_cast<int>(wall) < count / 2 ? first : second);
    }
    mixed += std::min(first, second);
  }
  return mixed;
}

DirectionAssignment Assign(Row row) {
  SharedDirection given;
  given.walls = {0};
  return AssignDirections(std::move(row.network), row.walls, {given}, {});
}

TEST(DirectionAssignmentTest, AStraightRowHasOneDirectionAndItsRightAngle) {
  constexpr int kCount = 60;
  int stray = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const DirectionAssignment assignment =
        Assign(MakeRow(kCount, 0.0, 0.3, seed));
    int used = 0;
    for (const SharedDirection& direction : assignment.directions) {
      used += !direction.walls.empty();
    }
    stray += used != 2;
    for (const int k : assignment.direction_of) stray += k < 0;
  }
  EXPECT_LE(stray, 10);
}

TEST(DirectionAssignmentTest, ABendThatWasMeasuredIsKept) {
  constexpr int kCount = 60;
  for (const double bend : {2.0, 3.0, 5.0, 7.0, 10.0}) {
    int mixed = 0, tied = 0;
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
      const DirectionAssignment assignment =
          Assign(MakeRow(kCount, bend, 0.3, seed));
      mixed += Mixed(assignment, kCount);
      for (const int k : assignment.direction_of) tied += k >= 0;
    }
    // Of 1,200 walls. Two degrees are what links of 0.3 degrees come to in a
    // dozen steps.
    EXPECT_LE(mixed, bend < 3.0 ? 80 : 24) << bend << " degrees";
    EXPECT_GE(tied, 1000) << bend << " degrees";
  }
}

// The same bend, where the graph leaves the joint open to within 3 degrees: it
// says nothing against one direction.
TEST(DirectionAssignmentTest, WhatTheMeasurementsLeaveOpenMayBeTied) {
  constexpr int kCount = 20;
  DirectionNetwork network;
  std::vector<DirectionWall> walls;
  for (int i = 0; i < kCount; ++i) {
    network.AddNode(0.0);
    DirectionWall wall;
    wall.node = static_cast<std::size_t>(i);
    wall.length = 3.0;
    walls.push_back(wall);
    if (i == 0) continue;
    const bool is_joint = i == kCount / 2;
    const double sigma = DegToRad(is_joint ? 3.0 : 0.1);
    network.AddLink(i - 1, i, is_joint ? DegToRad(3.0) : 0.0, sigma * sigma,
                    false);
  }
  SharedDirection given;
  given.walls = {0};
  const DirectionAssignment assignment =
      AssignDirections(std::move(network), walls, {given}, {});
  for (const int k : assignment.direction_of) EXPECT_EQ(k, 0);
}

// Two rows that nothing connects, or only a turn that is known to 20 degrees:
// each has its directions, and they say nothing of each other's.
TEST(DirectionAssignmentTest, PartsThatAreOpenToEachOtherHaveTheirOwn) {
  constexpr int kCount = 40;
  for (const bool is_joined : {false, true}) {
    DirectionNetwork network;
    std::vector<DirectionWall> walls;
    for (int i = 0; i < kCount; ++i) {
      const bool is_across = i % 4 == 3;
      network.AddNode(is_across ? 0.5 * kPi : 0.0);
      DirectionWall wall;
      wall.node = static_cast<std::size_t>(i);
      wall.length = 3.0;
      walls.push_back(wall);
      if (i == 0) continue;
      const bool is_joint = i == kCount / 2;
      if (is_joint && !is_joined) continue;
      const double sigma = DegToRad(is_joint ? 20.0 : 0.1);
      network.AddLink(
          i - 1, i,
          (is_across ? 0.5 * kPi : 0.0) - (i % 4 == 0 ? 0.5 * kPi : 0.0),
          sigma * sigma, false);
    }
    const DirectionAssignment assignment =
        AssignDirections(std::move(network), walls, {}, {});
    EXPECT_EQ(Mixed(assignment, kCount), 0) << is_joined;
    int used = 0;
    for (const SharedDirection& direction : assignment.directions) {
      used += !direction.walls.empty();
    }
    EXPECT_EQ(used, 4) << is_joined;
    for (const int k : assignment.direction_of) EXPECT_GE(k, 0) << is_joined;
  }
}

// No wall of the second half is beyond its own gate; together they are.
TEST(DirectionAssignmentTest, ADirectionIsSplitWhenTwoExplainItsWallsBetter) {
  constexpr int kCount = 40;
  int apart = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Row row = MakeRow(kCount, 1.0, 0.05, seed);
    for (DirectionWall& wall : row.walls) wall.own_sigma = DegToRad(0.4);
    const DirectionAssignment assignment = Assign(std::move(row));
    apart += Mixed(assignment, kCount) == 0;
  }
  EXPECT_GE(apart, 18);
}

// Walls that are all known to 0.05 degrees against a first one, their true
// directions around `modes` (degrees) by turns with a normal scatter.
Row MakeScattered(int count, const std::vector<double>& modes_deg,
                  double scatter_deg, double own_deg, std::uint64_t seed) {
  std::mt19937_64 engine(seed);
  std::normal_distribution<double> scatter(0.0, DegToRad(scatter_deg));
  const double variance = DegToRad(0.05) * DegToRad(0.05);
  Row row;
  const std::size_t origin = row.network.AddNode(0.0);
  for (int i = 0; i < count; ++i) {
    const double mode =
        modes_deg[static_cast<std::size_t>(i) % modes_deg.size()];
    const double angle = DegToRad(mode) + scatter(engine);
    DirectionWall wall;
    wall.node = row.network.AddNode(angle);
    wall.length = 3.0;
    wall.own_sigma = DegToRad(own_deg);
    row.network.AddLink(origin, wall.node, angle, variance, false);
    row.walls.push_back(wall);
  }
  return row;
}

int NumUsed(const DirectionAssignment& assignment) {
  int used = 0;
  for (const SharedDirection& direction : assignment.directions) {
    used += !direction.walls.empty();
  }
  return used;
}

// The upper half of any scatter differs from the lower one by far more than
// chance allows parts that are chosen otherwise.
TEST(DirectionAssignmentTest, ScatterIsNotSplit) {
  for (const double own : {0.4, 0.6}) {
    int one = 0;
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
      one += NumUsed(Assign(MakeScattered(120, {0.0}, 0.4, own, seed))) == 1;
    }
    EXPECT_GE(one, 19) << own;
  }
}

// Two directions whose walls alternate are found by their angles.
TEST(DirectionAssignmentTest, DirectionsThatAlternateAreTwo) {
  int two = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const DirectionAssignment assignment =
        Assign(MakeScattered(60, {0.0, 1.5}, 0.2, 0.2, seed));
    int mixed = 0;
    for (const SharedDirection& direction : assignment.directions) {
      int odd = 0;
      for (const std::size_t wall : direction.walls) odd += wall % 2 == 1;
      mixed += std::min(odd, static_cast<int>(direction.walls.size()) - odd);
    }
    two += NumUsed(assignment) == 2 && mixed <= 2;
  }
  EXPECT_GE(two, 18);
}

TEST(DirectionAssignmentTest, AFewWallsMakeNoDirection) {
  DirectionNetwork network;
  std::vector<DirectionWall> walls;
  for (int i = 0; i < 12; ++i) {
    // The last two are turned by 4 degrees.
    const double turn = i < 10 ? 0.0 : DegToRad(4.0);
    network.AddNode(turn);
    DirectionWall wall;
    wall.node = static_cast<std::size_t>(i);
    wall.length = 3.0;
    walls.push_back(wall);
    if (i > 0) {
      network.AddLink(0, i, turn, DegToRad(0.1) * DegToRad(0.1), false);
    }
  }
  SharedDirection given;
  given.walls = {0};
  const DirectionAssignment assignment =
      AssignDirections(std::move(network), walls, {given}, {});
  EXPECT_EQ(assignment.direction_of[9], 0);
  EXPECT_EQ(assignment.direction_of[10], -1);
  EXPECT_EQ(assignment.direction_of[11], -1);
  EXPECT_GT(assignment.innovations[10].chi_square, 16.0);
}

TEST(DirectionAssignmentTest, EndsWhenItIsTold) {
  constexpr int kCount = 40;
  Row row = MakeRow(kCount, 1.0, 0.1, 1);
  int asked = 0;
  const DirectionAssignment assignment =
      AssignDirections(std::move(row.network), row.walls, {}, {},
                       [&asked] { return ++asked > 1; });
  EXPECT_EQ(asked, 2);
  // A round is too short for all of them.
  EXPECT_GT(std::count(assignment.direction_of.begin(),
                       assignment.direction_of.end(), -1),
            0);
}

TEST(DirectionAssignmentTest, NothingToDo) {
  EXPECT_TRUE(
      AssignDirections(DirectionNetwork(), {}, {}, {}).direction_of.empty());
}

}  // namespace
}  // namespace plumbline
