#include <gtest/gtest.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/outputs/closing_lines.h>

#include <string>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

class ClosingLinesTest : public ::testing::Test {
 protected:
  ClosingLinesTest() {
    RegisterBuiltins(&registry_);
    Transaction transaction;
    Feature wall;
    wall.type = &registry_.GetFeature("segment");
    wall.extent_end = 8.0;
    const FeatureId first = transaction.AddFeature(wall);
    wall.parameters[0] = 9.0;
    wall.extent_end = 2.0;
    const FeatureId second = transaction.AddFeature(wall);
    Feature direction;
    direction.type = &registry_.GetFeature("orientation");
    direction.level = 1;
    direction.is_virtual = true;
    const FeatureId orientation = transaction.AddFeature(direction);
    Constraint tie;
    tie.type = &registry_.GetRelation("segment_orientation");
    tie.expected = Eigen::VectorXd::Zero(1);
    tie.information = Eigen::MatrixXd::Identity(1, 1);
    tie.kind = ConstraintClass::kStructure;
    tie.features = {first, orientation};
    transaction.AddConstraint(tie);
    tie.features = {second, orientation};
    transaction.AddConstraint(tie);
    graph_.Apply(std::move(transaction));
    outcome_.graph = &graph_;
    outcome_.registry = &registry_;
    outcome_.summary.em_termination = EmTermination::kConvergence;
  }

  void Break(ConstraintId id) {
    Transaction transaction;
    transaction.BreakConstraint(id);
    graph_.Apply(std::move(transaction));
  }

  Registry registry_;
  Graph graph_;
  SolveOutcome outcome_;
};

TEST_F(ClosingLinesTest, NothingToLookAt) {
  EXPECT_EQ(ClosingLines(outcome_, "out"),
            (std::vector<std::string>{"out: 2 walls, 1 shared direction"}));
  outcome_.summary.files = {"map.svg", "report.html"};
  EXPECT_EQ(ClosingLines(outcome_, "out/"),
            (std::vector<std::string>{"out/: 2 walls, 1 shared direction",
                                      "open out/report.html"}));
}

TEST_F(ClosingLinesTest, WhatIsWorthALook) {
  outcome_.summary.closures = {5, 3, 2};
  outcome_.summary.em_termination = EmTermination::kNoConvergence;
  outcome_.summary.tracking.loose = {{1.0, 2.0, "lost"}};
  // The short wall says little.
  Break(0);
  Break(1);
  outcome_.summary.files = {"map.png"};
  EXPECT_EQ(
      ClosingLines(outcome_, "out"),
      (std::vector<std::string>{
          "out: 2 walls, 1 shared direction, 3 closures, 2 more broken",
          "worth a look: the search for structure did not converge, the map "
          "hangs by a thread in 1 place, 1 long wall off every direction (up "
          "to 8.0 m)",
          "open out/map.png"}));
  outcome_.summary.partial = true;
  EXPECT_NE(ClosingLines(outcome_, "out")[1].find("the run was interrupted"),
            std::string::npos);
}

TEST_F(ClosingLinesTest, MirrorsAreWorthALook) {
  outcome_.summary.mirrors.resize(2);
  EXPECT_EQ(ClosingLines(outcome_, "out")[1],
            "worth a look: 2 mirrors (reflections are left out)");
}

TEST_F(ClosingLinesTest, ASolverThatDidNotConverge) {
  Summary& summary = outcome_.summary;
  summary.solver.emplace();
  summary.solver->converged = false;
  summary.solver->hint = "more steps may help";
  // One on the way, which was made up for.
  EXPECT_EQ(ClosingLines(outcome_, "out").size(), 1u);
  summary.em_termination = EmTermination::kNoConvergence;
  EXPECT_EQ(ClosingLines(outcome_, "out")[1],
            "worth a look: the solver did not converge (more steps may help)");
}

TEST_F(ClosingLinesTest, WhatMayBeAnotherBuildingAndLengthsThatAreOpen) {
  outcome_.summary.logs.resize(3);
  outcome_.summary.logs[2].uncertain = "few parts agree";
  outcome_.summary.open_way = 41.7;
  EXPECT_EQ(ClosingLines(outcome_, "out")[1],
            "worth a look: 1 log may be of another building, lengths of "
            "corridors (42 m are open)");
  EXPECT_EQ(ClosingLinesInMap(outcome_, "out", "map.json")[1],
            "worth a look: 1 log may be of another building");
}

TEST_F(ClosingLinesTest, AWayThroughWhatIsOnNoPlan) {
  outcome_.summary.plan = Summary::Plan{3, 2, 4.0};
  EXPECT_EQ(ClosingLines(outcome_, "out").size(), 1u);
  outcome_.summary.plan->way_outside = 23.4;
  EXPECT_EQ(ClosingLines(outcome_, "out")[1],
            "worth a look: 23 m of the way lie in no room");
  // Outdoors there are none.
  outcome_.summary.plan->rooms = 0;
  EXPECT_EQ(ClosingLines(outcome_, "out").size(), 1u);
}

TEST_F(ClosingLinesTest, LogsThatWereKeptApart) {
  outcome_.summary.logs.resize(4);
  outcome_.summary.logs[1].why_apart = "it fits in two places";
  outcome_.summary.logs[1].map = "map_2";
  EXPECT_EQ(ClosingLines(outcome_, "out")[1],
            "worth a look: 1 log kept apart (map_2)");
  for (const int i : {2, 3}) {
    outcome_.summary.logs[i] = outcome_.summary.logs[1];
    outcome_.summary.logs[i].map = "map_3";
  }
  outcome_.summary.logs[3].candidate = Pose2::Zero();
  EXPECT_EQ(ClosingLines(outcome_, "out")[1],
            "worth a look: 3 logs kept apart (map_2, map_3), 1 log kept apart "
            "may be of the first one's building");
}

// A wall that has another direction in its place is fine.
TEST_F(ClosingLinesTest, ADirectionInPlaceOfTheOneThatWasBroken) {
  Break(0);
  Transaction transaction;
  Constraint again = graph_.GetConstraint(1);
  again.features[0] = 0;
  transaction.AddConstraint(again);
  graph_.Apply(std::move(transaction));
  EXPECT_EQ(ClosingLines(outcome_, "out").size(), 1u);
}

}  // namespace
}  // namespace plumbline
