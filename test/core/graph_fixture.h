#ifndef PLUMBLINE_TEST_CORE_GRAPH_FIXTURE_H_
#define PLUMBLINE_TEST_CORE_GRAPH_FIXTURE_H_

#include <gtest/gtest.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/transaction.h>

#include <cmath>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {

// A graph that features and relations of any type are put into.
class GraphFixture : public ::testing::Test {
 protected:
  GraphFixture() { RegisterBuiltinRelations(&registry_); }

  Feature Make(const std::string& type, const std::vector<double>& parameters) {
    Feature feature;
    feature.type = &registry_.GetFeature(type);
    for (std::size_t i = 0; i < parameters.size(); ++i) {
      feature.parameters[i] = parameters[i];
    }
    return feature;
  }

  // A wall from one point to the other, seen from its left.
  Feature Wall(const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
    const Eigen::Vector2d along = to - from;
    Feature wall =
        Make("segment", {from[0], from[1], std::atan2(along[1], along[0])});
    wall.extent_end = along.norm();
    return wall;
  }

  FeatureId Add(const Feature& feature) {
    Transaction transaction;
    transaction.AddFeature(feature);
    return graph_.Apply(std::move(transaction)).features.at(0);
  }
  ConstraintId Tie(const std::string& relation,
                   const std::vector<FeatureId>& features,
                   const Eigen::VectorXd& expected) {
    Transaction transaction;
    Constraint constraint;
    constraint.type = &registry_.GetRelation(relation);
    constraint.features = features;
    constraint.expected = expected;
    constraint.information =
        Eigen::MatrixXd::Identity(expected.size(), expected.size());
    transaction.AddConstraint(constraint);
    return graph_.Apply(std::move(transaction)).constraints.at(0);
  }

  Registry registry_;
  Graph graph_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_TEST_CORE_GRAPH_FIXTURE_H_
