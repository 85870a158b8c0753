#include <gtest/gtest.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/transaction.h>
#include <plumbline/factors/angle.h>
#include <plumbline/pipeline/loop_closures.h>

#include <utility>
#include <vector>

namespace plumbline {
namespace {

// Two walls in line, 4 m each, that overlap by 1 m about x = 20, and four key
// scans on the way past them.
class LoopClosuresTest : public ::testing::Test {
 protected:
  LoopClosuresTest() {
    RegisterBuiltinRelations(&registry_);
    Transaction transaction;
    for (const double x : {18.5, 21.5}) {
      Feature wall;
      wall.type = &registry_.GetFeature("segment");
      wall.parameters = {x, 2.0, 0.0};
      wall.extent_begin = -2.0;
      wall.extent_end = 2.0;
      walls_.push_back(transaction.AddFeature(wall));
    }
    walls_ = graph_.Apply(std::move(transaction)).features;
    for (int i = 0; i < 4; ++i) {
      // Every second scan is a key scan.
      KeyScanRecord record;
      record.scan = 2 * i;
      records_.push_back(record);
      trajectory_.emplace_back(10.0 * i, 0.0, 0.5 * kPi);
      trajectory_.emplace_back(10.0 * i + 5.0, 0.0, 0.5 * kPi);
    }
  }

  ConstraintId Relate(const char* relation, double delta) {
    Constraint constraint;
    constraint.type = &registry_.GetRelation(relation);
    constraint.features = walls_;
    constraint.expected = Eigen::VectorXd::Zero(constraint.type->residual_size);
    constraint.information = Eigen::MatrixXd::Identity(
        constraint.expected.size(), constraint.expected.size());
    constraint.kind = ConstraintClass::kStructure;
    constraint.delta = delta;
    Transaction transaction;
    transaction.AddConstraint(std::move(constraint));
    return graph_.Apply(std::move(transaction)).constraints.front();
  }

  Registry registry_;
  Graph graph_;
  std::vector<FeatureId> walls_;
  std::vector<KeyScanRecord> records_;
  std::vector<Pose2> trajectory_;
};

TEST_F(LoopClosuresTest, LieWhereBothWallsAre) {
  Relate("segment_segment_collinearity", 0.4);
  const std::vector<LoopClosure> closures =
      FindLoopClosures(graph_, records_, trajectory_);
  ASSERT_EQ(closures.size(), 1u);
  EXPECT_EQ(closures[0].scan, 4);
  EXPECT_TRUE(closures[0].holds);
  EXPECT_EQ(closures[0].delta, 0.4);
  // Ahead of the robot, which looks at the wall; the wall goes to its right.
  EXPECT_NEAR((closures[0].place - Pose2(2.0, 0.0, -0.5 * kPi)).norm(), 0.0,
              1e-12);
}

TEST_F(LoopClosuresTest, BrokenOnesAreToldOthersAreNot) {
  const ConstraintId closure = Relate("segment_segment_collinearity", 0.01);
  Relate("pose_pose", 1.0);
  Transaction transaction;
  transaction.BreakConstraint(closure);
  graph_.Apply(std::move(transaction));
  const std::vector<LoopClosure> closures =
      FindLoopClosures(graph_, records_, trajectory_);
  ASSERT_EQ(closures.size(), 1u);
  EXPECT_FALSE(closures[0].holds);
  EXPECT_EQ(closures[0].delta, 0.01);
}

}  // namespace
}  // namespace plumbline
