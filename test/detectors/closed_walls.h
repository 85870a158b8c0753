#ifndef PLUMBLINE_TEST_DETECTORS_CLOSED_WALLS_H_
#define PLUMBLINE_TEST_DETECTORS_CLOSED_WALLS_H_

#include <gtest/gtest.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/detectors/same_wall.h>

#include <utility>

namespace plumbline {

// Segments, and closures that make several of them one wall.
class ClosedWallsTest : public ::testing::Test {
 protected:
  ClosedWallsTest() { RegisterBuiltins(&registry_); }

  // Along x from (x, y).
  FeatureId AddSegment(double x, double y, double length) {
    Feature feature;
    feature.type = &registry_.GetFeature("segment");
    feature.parameters = {x, y, 0.0};
    feature.extent_end = length;
    feature.observations = 3;
    Transaction transaction;
    transaction.AddFeature(feature);
    return graph_.Apply(std::move(transaction)).features[0];
  }

  ConstraintId Close(FeatureId first, FeatureId second) {
    Transaction transaction;
    transaction.AddConstraint(MakeStructure(
        registry_.GetRelation(kSameWallRelation), {first, second},
        Eigen::Vector2d::Zero(), Eigen::Matrix2d::Identity(), "test"));
    return graph_.Apply(std::move(transaction)).constraints[0];
  }

  Registry registry_;
  Graph graph_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_TEST_DETECTORS_CLOSED_WALLS_H_
