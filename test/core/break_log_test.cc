#include <gtest/gtest.h>
#include <plumbline/core/break_log.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/registry.h>

#include <cmath>
#include <utility>

namespace plumbline {
namespace {

class BreakLogTest : public ::testing::Test {
 protected:
  BreakLogTest() {
    RegisterBuiltinRelations(&registry_);
    Transaction transaction;
    Feature wall;
    wall.type = &registry_.GetFeature("segment");
    const FeatureId segment = transaction.AddFeature(wall);
    Feature direction;
    direction.type = &registry_.GetFeature("orientation");
    direction.level = 1;
    direction.is_virtual = true;
    const FeatureId orientation = transaction.AddFeature(direction);
    Constraint tie;
    tie.type = &registry_.GetRelation("segment_orientation");
    tie.features = {segment, orientation};
    tie.expected = Eigen::VectorXd::Zero(1);
    tie.information = Eigen::MatrixXd::Identity(1, 1);
    tie.kind = ConstraintClass::kStructure;
    transaction.AddConstraint(tie);
    transaction.AddConstraint(tie);
    graph_.Apply(std::move(transaction));
  }

  void Break(ConstraintId id) {
    Transaction transaction;
    transaction.BreakConstraint(id);
    graph_.Apply(std::move(transaction));
  }

  Registry registry_;
  Graph graph_;
};

TEST_F(BreakLogTest, KeepsTheStateThatItWasBrokenAt) {
  BreakLog log;
  log.Attach(&graph_);
  log.SetIteration(3);
  graph_.GetFeature(0).parameters[2] = 0.5;
  Break(0);
  graph_.GetFeature(0).parameters[2] = 0.0;
  log.SetIteration(4);
  ASSERT_EQ(log.records().size(), 1u);
  EXPECT_EQ(log.records().at(0).iteration, 3);
  ASSERT_EQ(log.records().at(0).error.size(), 1);
  EXPECT_NEAR(std::abs(log.records().at(0).error[0]), 0.5, 1e-12);
}

// What goes is not broken by that, and what was broken before keeps its record.
TEST_F(BreakLogTest, RemovalIsNoBreak) {
  BreakLog log;
  log.Attach(&graph_);
  log.SetIteration(1);
  Break(0);
  log.SetIteration(2);
  Transaction transaction;
  transaction.RemoveConstraint(0);
  transaction.RemoveConstraint(1);
  transaction.RemoveFeature(0);
  graph_.Apply(std::move(transaction));
  ASSERT_EQ(log.records().size(), 1u);
  EXPECT_EQ(log.records().at(0).iteration, 1);
}

TEST_F(BreakLogTest, HearsNothingOnceDetached) {
  {
    BreakLog log;
    log.Attach(&graph_);
    log.Detach();
    Break(0);
    EXPECT_TRUE(log.records().empty());
    log.Attach(&graph_);
  }
  // The log is gone, and the graph knows it.
  Break(1);
}

}  // namespace
}  // namespace plumbline
