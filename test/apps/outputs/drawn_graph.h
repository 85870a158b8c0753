#ifndef PLUMBLINE_TEST_APPS_OUTPUTS_DRAWN_GRAPH_H_
#define PLUMBLINE_TEST_APPS_OUTPUTS_DRAWN_GRAPH_H_

#include <gtest/gtest.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>

#include <Eigen/Core>
#include <algorithm>
#include <string>
#include <vector>

namespace plumbline::testing {

/// Makes the graphs that drawings are tested with.
class DrawnGraphTest : public ::testing::Test {
 protected:
  DrawnGraphTest() { RegisterBuiltinRelations(&registry_); }

  Feature MakeFeature(const std::string& type, std::vector<double> parameters,
                      double begin = 0.0, double end = 0.0) {
    Feature feature;
    feature.type = &registry_.GetFeature(type);
    std::copy(parameters.begin(), parameters.end(), feature.parameters.begin());
    feature.extent_begin = begin;
    feature.extent_end = end;
    return feature;
  }

  Constraint Tie(const std::string& relation, FeatureId wall,
                 FeatureId orientation) {
    Constraint constraint;
    constraint.type = &registry_.GetRelation(relation);
    constraint.features = {wall, orientation};
    constraint.expected = Eigen::VectorXd::Zero(1);
    constraint.information = Eigen::MatrixXd::Identity(1, 1);
    constraint.kind = ConstraintClass::kStructure;
    return constraint;
  }

  Registry registry_;
};

}  // namespace plumbline::testing

#endif  // PLUMBLINE_TEST_APPS_OUTPUTS_DRAWN_GRAPH_H_
