#ifndef PLUMBLINE_TEST_DETECTORS_POINT_CHAIN_H_
#define PLUMBLINE_TEST_DETECTORS_POINT_CHAIN_H_

#include <gtest/gtest.h>
#include <plumbline/core/constraint.h>
#include <plumbline/core/detector.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/information.h>
#include <plumbline/core/registry.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/detectors/point_graph.h>

#include <Eigen/Core>
#include <utility>
#include <vector>

namespace plumbline {

// Points of which each is linked with the one before it, and lines that some of
// them are tied to. Points are named by their number.
class PointChainTest : public ::testing::Test {
 protected:
  PointChainTest() { RegisterBuiltins(&registry_); }

  // Returns its number.
  int AddPoint(double x, double y, bool is_linked = true) {
    Transaction transaction;
    Feature feature;
    feature.type = &registry_.GetFeature("point");
    feature.parameters = {x, y};
    transaction.AddFeature(feature);
    points_.push_back(graph_.Apply(std::move(transaction)).features[0]);
    const int index = static_cast<int>(points_.size()) - 1;
    if (is_linked && index > 0) Link(index - 1, index);
    return index;
  }

  void Link(int i, int j) {
    Constraint constraint;
    constraint.type = &registry_.GetRelation("point_point_distance");
    constraint.features = {points_[static_cast<std::size_t>(i)],
                           points_[static_cast<std::size_t>(j)]};
    constraint.expected = Eigen::VectorXd::Constant(1, 1.0);
    constraint.information = Eigen::MatrixXd::Identity(1, 1);
    Transaction transaction;
    transaction.AddConstraint(constraint);
    graph_.Apply(std::move(transaction));
  }

  // A virtual line through (x, y) that points are tied to.
  FeatureId AddLine(double x, double y, double direction,
                    const std::vector<int>& points) {
    Transaction transaction;
    Feature feature;
    feature.type = &registry_.GetFeature("line");
    feature.anchor = {x, y};
    feature.parameters = {0.0, direction};
    feature.level = 1;
    feature.is_virtual = true;
    const FeatureId id = transaction.AddFeature(feature);
    for (const int i : points) {
      transaction.AddConstraint(MakeStructure(
          registry_.GetRelation("point_line_distance"),
          {points_[static_cast<std::size_t>(i)], id}, Eigen::VectorXd::Zero(1),
          InformationFromSigmas(Eigen::VectorXd::Constant(1, 0.02)), "test"));
    }
    return graph_.Apply(std::move(transaction)).features[0];
  }

  PointGraph Points() const {
    return PointGraph(graph_, DetectionScope(), /*reach=*/0);
  }

  Registry registry_;
  Graph graph_;
  std::vector<FeatureId> points_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_TEST_DETECTORS_POINT_CHAIN_H_
