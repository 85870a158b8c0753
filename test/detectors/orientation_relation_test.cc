#include <gtest/gtest.h>
#include <plumbline/core/error.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/information.h>
#include <plumbline/core/registry.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/detectors/orientation_relation.h>

#include <cmath>
#include <set>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

class OrientationRelationTest : public ::testing::Test {
 protected:
  OrientationRelationTest() { RegisterBuiltins(&registry_); }

  FeatureId AddOrientation(double direction_deg, int level = 1) {
    Feature feature;
    feature.type = &registry_.GetFeature("orientation");
    feature.level = level;
    feature.is_virtual = level > 0;
    feature.parameters = {DegToRad(direction_deg)};
    Transaction transaction;
    transaction.AddFeature(std::move(feature));
    return graph_.Apply(std::move(transaction)).features[0];
  }

  Transaction Detect(const DetectorParameters& parameters = {}, int level = 1,
                     const std::vector<FeatureId>* features = nullptr) const {
    DetectionScope scope;
    scope.level = level;
    scope.features = features;
    return registry_.GetDetector("orientation_relation")
        .make(parameters)
        ->Detect(graph_, registry_, scope);
  }

  Registry registry_;
  Graph graph_;
};

TEST_F(OrientationRelationTest, NearestAllowedAngle) {
  AddOrientation(10.0);
  AddOrientation(-78.0);  // 88 degrees from the first, the other way round
  AddOrientation(54.5);   // 44.5 from the first, 132.5 from the second
  AddOrientation(30.0);   // 20 from the first
  const Transaction transaction =
      Detect({{"sigma_deg", 0.2}, {"gate_deg", 3.0}});
  EXPECT_TRUE(transaction.added_features().empty());
  ASSERT_EQ(transaction.added_constraints().size(), 3u);
  const Constraint& right = transaction.added_constraints()[0];
  EXPECT_EQ(right.type->name, "orientation_orientation");
  EXPECT_EQ(right.kind, ConstraintClass::kStructure);
  EXPECT_EQ(right.source, "orientation_relation");
  EXPECT_EQ(right.features, (std::vector<FeatureId>{0, 1}));
  EXPECT_DOUBLE_EQ(right.expected[0], kPi / 2);
  // 1 / (0.2 degrees)^2.
  EXPECT_NEAR(right.information(0, 0), 82070.159, 0.01);
  EXPECT_EQ(transaction.added_constraints()[1].features,
            (std::vector<FeatureId>{0, 2}));
  EXPECT_DOUBLE_EQ(transaction.added_constraints()[1].expected[0], kPi / 4);
  EXPECT_EQ(transaction.added_constraints()[2].features,
            (std::vector<FeatureId>{1, 2}));
  // 132.5 degrees is -47.5.
  EXPECT_DOUBLE_EQ(transaction.added_constraints()[2].expected[0], -kPi / 4);
  graph_.Apply(transaction);
  EXPECT_TRUE(Detect().empty());
}

TEST_F(OrientationRelationTest, DuplicatesAreTheSame) {
  AddOrientation(-89.8);
  AddOrientation(89.7);
  const Transaction transaction = Detect();
  ASSERT_EQ(transaction.added_constraints().size(), 1u);
  EXPECT_EQ(transaction.added_constraints()[0].expected[0], 0.0);
}

TEST_F(OrientationRelationTest, Gate) {
  AddOrientation(0.0);
  AddOrientation(86.9);
  EXPECT_TRUE(Detect().empty());
  EXPECT_EQ(Detect({{"gate_deg", 3.2}}).added_constraints().size(), 1u);
}

TEST_F(OrientationRelationTest, AnObliqueWingNearAnExpectedAngleStaysOblique) {
  AddOrientation(0.0);
  AddOrientation(90.2);
  AddOrientation(46.0);
  const Transaction transaction = Detect();
  ASSERT_EQ(transaction.added_constraints().size(), 1u);
  EXPECT_EQ(transaction.added_constraints()[0].features,
            (std::vector<FeatureId>{0, 1}));
}

// A map of points and distances says itself how far it may be out of square.
TEST_F(OrientationRelationTest, WiderGateWhereTheMapIsUncertain) {
  const FeatureId north = AddOrientation(0.0, /*level=*/0);
  const FeatureId first = AddOrientation(0.0);
  const FeatureId second = AddOrientation(91.2);
  // Nothing is known of them.
  EXPECT_TRUE(Detect().empty());
  const auto measure = [&](FeatureId orientation, double sigma_deg) {
    Constraint constraint;
    constraint.type = &registry_.GetRelation("orientation_orientation");
    constraint.features = {north, orientation};
    constraint.expected = Eigen::VectorXd::Constant(
        1, orientation == first ? 0.0 : DegToRad(91.2));
    constraint.information = InformationFromSigmas(
        Eigen::VectorXd::Constant(1, DegToRad(sigma_deg)));
    Transaction transaction;
    transaction.AddConstraint(constraint);
    return graph_.Apply(std::move(transaction)).constraints[0];
  };
  const auto forget = [&](ConstraintId id) {
    Transaction transaction;
    transaction.RemoveConstraint(id);
    graph_.Apply(std::move(transaction));
  };
  measure(first, 0.15);
  // Three standard deviations of the difference are 1.17 and 1.23 degrees.
  ConstraintId id = measure(second, 0.36);
  EXPECT_TRUE(Detect().empty());
  forget(id);
  id = measure(second, std::sqrt(0.41 * 0.41 - 0.15 * 0.15));
  EXPECT_EQ(Detect({{"uncertain_gate_deg", 1.1}}).added_constraints().size(),
            0u);
  const Transaction transaction = Detect();
  ASSERT_EQ(transaction.added_constraints().size(), 1u);
  EXPECT_DOUBLE_EQ(transaction.added_constraints()[0].expected[0], kPi / 2);
  // What is hardly known at all is not square.
  forget(id);
  id = measure(second, 3.1);
  EXPECT_TRUE(Detect().empty());
  // Nor is a wing where poses tell directions.
  forget(id);
  measure(second, 0.39);
  Transaction pose;
  Feature feature;
  feature.type = &registry_.GetFeature("pose");
  pose.AddFeature(feature);
  graph_.Apply(std::move(pose));
  EXPECT_TRUE(Detect().empty());
}

TEST_F(OrientationRelationTest, BrokenOnesAreLeftToTheOrchestrator) {
  AddOrientation(0.0);
  AddOrientation(90.0);
  const ConstraintId id = graph_.Apply(Detect()).constraints[0];
  EXPECT_TRUE(Detect().empty());
  Transaction transaction;
  transaction.BreakConstraint(id);
  graph_.Apply(std::move(transaction));
  EXPECT_EQ(Detect().added_constraints().size(), 1u);
}

TEST_F(OrientationRelationTest, ListOfAngles) {
  AddOrientation(0.0);
  AddOrientation(60.5);
  AddOrientation(90.0);
  AddOrientation(-30.0);
  const Transaction transaction = Detect({{"angle_0", 60.0}});
  // No sign: -60 from 90 to -30 (120 in the half circle) is a relation too.
  ASSERT_EQ(transaction.added_constraints().size(), 2u);
  EXPECT_EQ(transaction.added_constraints()[0].features,
            (std::vector<FeatureId>{0, 1}));
  EXPECT_NEAR(transaction.added_constraints()[0].expected[0], DegToRad(60.0),
              1e-12);
  EXPECT_EQ(transaction.added_constraints()[1].features,
            (std::vector<FeatureId>{2, 3}));
  EXPECT_NEAR(transaction.added_constraints()[1].expected[0], DegToRad(60.0),
              1e-12);
}

TEST_F(OrientationRelationTest, Resolution) {
  AddOrientation(0.0);
  AddOrientation(14.5);
  AddOrientation(37.5);
  EXPECT_TRUE(Detect().empty());
  const Transaction transaction = Detect({{"resolution_deg", 15.0}});
  ASSERT_EQ(transaction.added_constraints().size(), 1u);
  EXPECT_NEAR(transaction.added_constraints()[0].expected[0], DegToRad(15.0),
              1e-12);
  EXPECT_EQ(Detect({{"resolution_deg", 15.0}, {"angle_0", 37.5}})
                .added_constraints()
                .size(),
            2u);
}

TEST_F(OrientationRelationTest, ManyGetEnoughForRedundancy) {
  for (int i = 0; i < 40; ++i) AddOrientation(i % 2 == 0 ? 0.0 : 90.0);
  const Transaction transaction = Detect();
  // 1 + 2 + 3 + 4 for the first five, 4 for each of the others.
  EXPECT_EQ(transaction.added_constraints().size(), 10u + 35u * 4u);
  std::set<FeatureId> reached = {0};
  for (const Constraint& constraint : transaction.added_constraints()) {
    if (reached.count(constraint.features[0]) > 0) {
      reached.insert(constraint.features[1]);
    }
  }
  EXPECT_EQ(reached.size(), 40u);
  graph_.Apply(transaction);
  EXPECT_TRUE(Detect().empty());
}

TEST_F(OrientationRelationTest, LevelsAndScope) {
  AddOrientation(0.0);
  AddOrientation(90.0, 2);
  EXPECT_TRUE(Detect().empty());
  const FeatureId third = AddOrientation(90.0);
  const std::vector<FeatureId> scope = {1, third};
  EXPECT_EQ(Detect({}, 1, &scope).added_constraints().size(), 1u);
  const std::vector<FeatureId> none;
  EXPECT_EQ(Detect({}, 1, &none).added_constraints().size(), 1u);
  AddOrientation(5.0, 0);
  AddOrientation(95.0, 0);
  EXPECT_EQ(Detect({}, 0).added_constraints().size(), 1u);
}

TEST_F(OrientationRelationTest, BadParameters) {
  EXPECT_THROW(Detect({{"angle", 1.0}}), Error);
  EXPECT_THROW(Detect({{"angle_", 1.0}}), Error);
  EXPECT_THROW(Detect({{"angle_x", 1.0}}), Error);
  EXPECT_THROW(Detect({{"angle_0", 400.0}}), Error);
  EXPECT_THROW(Detect({{"resolution_deg", 1e-6}}), Error);
  EXPECT_THROW(Detect({{"sigma_deg", -1.0}}), Error);
  EXPECT_THROW(Detect({{"max_relations", 0.0}}), Error);
}

}  // namespace
}  // namespace plumbline
