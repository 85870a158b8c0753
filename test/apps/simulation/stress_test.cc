#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/apps/simulation/stress.h>
#include <plumbline/core/error.h>
#include <plumbline/factors/angle.h>

#include <cmath>
#include <string>
#include <vector>

namespace plumbline {
namespace {

constexpr double kNone = 30.0;  // m

// A drive with a turn of 90 degrees every 60 scans, an ODOM line between scans.
Simulation MakeDrive() {
  Simulation simulation;
  Pose2 pose = Pose2::Zero();
  for (int i = 0; i < 2000; ++i) {
    SimulatedState state;
    state.time = 0.1 * i;
    state.pose = pose;
    state.odometry = pose;
    if (i % 2 == 0) state.ranges.assign(180, 5.0);
    simulation.states.push_back(state);
    const double turn = i % 120 < 40 ? DegToRad(2.25) : 0.0;
    pose = Compose(pose, Pose2(0.03, 0.0, turn));
  }
  return simulation;
}

// Steps of odometry that differ from the true ones.
int WrongSteps(const Simulation& simulation) {
  int wrong = 0;
  for (std::size_t i = 1; i < simulation.states.size(); ++i) {
    const SimulatedState& a = simulation.states[i - 1];
    const SimulatedState& b = simulation.states[i];
    const Pose2 error =
        Between(Between(a.pose, b.pose), Between(a.odometry, b.odometry));
    if (error.norm() > 1e-6) ++wrong;
  }
  return wrong;
}

int ChangedScans(const Simulation& simulation) {
  int changed = 0;
  for (const SimulatedState& state : simulation.states) {
    bool is_changed = false;
    for (const double range : state.ranges) is_changed |= range != 5.0;
    if (is_changed) ++changed;
  }
  return changed;
}

TEST(StressTest, EveryKindDoesWhatItSays) {
  struct Case {
    const char* kind;
    std::size_t begins;
    int missing;  // -1: between 3 x 2 and 3 x 40
    int wrong_steps;
    int changed_scans;
  };
  for (const Case& c :
       {Case{"turns", 3, -1, 0, 0}, Case{"dead", 3, 0, 120, 0},
        Case{"scale", 1, 0, 999, 0}, Case{"jump", 3, 0, 3, 0},
        Case{"blind", 3, 0, 0, 180}, Case{"people", 2, 0, 0, -1},
        Case{"carried", 2, 300, 2, 0}}) {
    SCOPED_TRACE(c.kind);
    Simulation simulation = MakeDrive();
    const std::vector<int> begins =
        Stress(c.kind, static_cast<int>(c.begins), 4, kNone, &simulation);
    EXPECT_EQ(begins.size(), c.begins);
    const int missing = 1000 - static_cast<int>(simulation.states.size());
    if (c.missing >= 0) {
      EXPECT_EQ(missing, c.missing);
    } else {
      EXPECT_GE(missing, 6);
      EXPECT_LE(missing, 120);
    }
    EXPECT_EQ(WrongSteps(simulation), c.wrong_steps);
    if (c.changed_scans >= 0) {
      EXPECT_EQ(ChangedScans(simulation), c.changed_scans);
    } else {
      EXPECT_GT(ChangedScans(simulation), 200);
    }
    for (const SimulatedState& state : simulation.states) {
      EXPECT_EQ(state.ranges.size(), 180u);
    }
  }
}

TEST(StressTest, StaleOdometryCatchesUp) {
  Simulation simulation = MakeDrive();
  EXPECT_EQ(Stress("stale", 3, 2, kNone, &simulation).size(), 3u);
  int stale = 0;
  for (const SimulatedState& state : simulation.states) {
    if ((state.odometry - state.pose).norm() > 1e-6) ++stale;
  }
  EXPECT_GE(stale, 3);
  EXPECT_LE(stale, 6);
}

TEST(StressTest, SameArgumentsSameDrive) {
  Simulation first = MakeDrive();
  Simulation second = MakeDrive();
  Simulation third = MakeDrive();
  const std::vector<int> begins = Stress("people", 2, 7, kNone, &first);
  EXPECT_EQ(Stress("people", 2, 7, kNone, &second), begins);
  EXPECT_NE(Stress("people", 2, 8, kNone, &third), begins);
  for (std::size_t i = 0; i < first.states.size(); ++i) {
    EXPECT_EQ(first.states[i].ranges, second.states[i].ranges);
  }
}

TEST(StressTest, NoRoomAndBadArguments) {
  Simulation simulation = MakeDrive();
  simulation.states.resize(100);
  EXPECT_TRUE(Stress("carried", 3, 1, kNone, &simulation).empty());
  EXPECT_THROW(Stress("earthquake", 1, 1, kNone, &simulation), Error);
  EXPECT_THROW(Stress("dead", 0, 1, kNone, &simulation), Error);
}

}  // namespace
}  // namespace plumbline
