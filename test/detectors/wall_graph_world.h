#ifndef PLUMBLINE_TEST_DETECTORS_WALL_GRAPH_WORLD_H_
#define PLUMBLINE_TEST_DETECTORS_WALL_GRAPH_WORLD_H_

#include <gtest/gtest.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/detectors/same_wall.h>
#include <plumbline/factors/pose2.h>

#include <cmath>

namespace plumbline {

// A graph of walls, measurements between them and closures. Walls are named by
// their index: they are the only features.
class WallGraphTest : public ::testing::Test {
 protected:
  WallGraphTest() { RegisterBuiltins(&registry_); }

  // From one point to another, m.
  int AddWall(double x1, double y1, double x2, double y2) {
    Feature feature;
    feature.type = &registry_.GetFeature("segment");
    feature.fixed = graph_.num_features() == 0;
    feature.parameters = {x1, y1, std::atan2(y2 - y1, x2 - x1)};
    feature.extent_end = std::hypot(x2 - x1, y2 - y1);
    Transaction transaction;
    transaction.AddFeature(feature);
    return static_cast<int>(graph_.Apply(transaction).features[0]);
  }

  ConstraintId AddLink(int i, int j, double sigma = 0.05) {
    const auto pose = [this](int k) {
      const Feature& feature = graph_.GetFeature(k);
      return Pose2(feature.parameters[0], feature.parameters[1],
                   feature.parameters[2]);
    };
    Constraint constraint;
    constraint.type = &registry_.GetRelation("pose_pose");
    constraint.features = {i, j};
    constraint.expected = Between(pose(i), pose(j));
    constraint.information = Eigen::Matrix3d::Identity() / (sigma * sigma);
    return Add(constraint);
  }

  ConstraintId AddClosure(int i, int j) {
    Constraint constraint;
    constraint.type = &registry_.GetRelation(kSameWallRelation);
    constraint.features = {i, j};
    constraint.expected = Eigen::Vector2d::Zero();
    constraint.information = Eigen::Matrix2d::Identity();
    constraint.kind = ConstraintClass::kStructure;
    return Add(constraint);
  }

  void Break(ConstraintId id) {
    Transaction transaction;
    transaction.BreakConstraint(id);
    graph_.Apply(transaction);
  }

  Registry registry_;
  Graph graph_;

 private:
  ConstraintId Add(const Constraint& constraint) {
    Transaction transaction;
    transaction.AddConstraint(constraint);
    return graph_.Apply(transaction).constraints[0];
  }
};

}  // namespace plumbline

#endif  // PLUMBLINE_TEST_DETECTORS_WALL_GRAPH_WORLD_H_
