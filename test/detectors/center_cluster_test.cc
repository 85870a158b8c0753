#include <gtest/gtest.h>
#include <plumbline/core/detector.h>
#include <plumbline/core/error.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>
#include <plumbline/detectors/builtins.h>

#include <cmath>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

class CenterClusterTest : public ::testing::Test {
 protected:
  CenterClusterTest() { RegisterBuiltins(&registry_); }

  FeatureId AddCircle(double x, double y, double radius, int level = 1) {
    Feature feature;
    feature.type = &registry_.GetFeature("circle");
    feature.level = level;
    feature.is_virtual = level > 0;
    feature.parameters = {x, y, radius};
    Transaction transaction;
    transaction.AddFeature(std::move(feature));
    return graph_.Apply(std::move(transaction)).features[0];
  }

  Transaction Detect(int level = 1,
                     const std::vector<FeatureId>* features = nullptr,
                     const DetectorParameters& parameters = {},
                     const char* detector = "center_cluster") const {
    DetectionScope scope;
    scope.level = level;
    scope.features = features;
    return registry_.GetDetector(detector)
        .make(parameters)
        ->Detect(graph_, registry_, scope);
  }

  Registry registry_;
  Graph graph_;
};

TEST_F(CenterClusterTest, MakesCentresOfGravityOneLevelUp) {
  const FeatureId a = AddCircle(1.0, 2.0, 1.0);
  const FeatureId b = AddCircle(7.0, 2.0, 1.0);
  const FeatureId c = AddCircle(1.1, 2.2, 2.0);
  AddCircle(4.0, 9.0, 1.0);
  const FeatureId d = AddCircle(7.1, 1.9, 3.0);
  const FeatureId e = AddCircle(0.9, 2.1, 4.0);
  const Transaction transaction = Detect();
  ASSERT_EQ(transaction.added_features().size(), 2u);
  const Feature& first = transaction.added_features()[0];
  EXPECT_EQ(first.type->name, "point");
  EXPECT_EQ(first.level, 2);
  EXPECT_TRUE(first.is_virtual);
  EXPECT_EQ(first.source, "center_cluster");
  EXPECT_NEAR(first.parameters[0], 1.0, 1e-12);
  EXPECT_NEAR(first.parameters[1], 2.1, 1e-12);
  EXPECT_NEAR(transaction.added_features()[1].parameters[0], 7.05, 1e-12);
  const FeatureId p = Transaction::ProvisionalId(0);
  const FeatureId q = Transaction::ProvisionalId(1);
  const std::vector<std::vector<FeatureId>> expected = {
      {a, p}, {b, q}, {c, p}, {d, q}, {e, p}};
  ASSERT_EQ(transaction.added_constraints().size(), 5u);
  for (std::size_t i = 0; i < 5; ++i) {
    const Constraint& constraint = transaction.added_constraints()[i];
    EXPECT_EQ(constraint.type->name, "point_point_coincidence");
    EXPECT_EQ(constraint.kind, ConstraintClass::kStructure);
    EXPECT_EQ(constraint.features, expected[i]);
    EXPECT_TRUE(constraint.expected.isZero());
    // 1 / (0.05 m)^2.
    EXPECT_TRUE(
        constraint.information.isApprox(400.0 * Eigen::Matrix2d::Identity()));
  }
  graph_.Apply(transaction);
  EXPECT_TRUE(Detect().empty());
}

TEST_F(CenterClusterTest, OneCircleHasNoCommonCentre) {
  EXPECT_TRUE(Detect().empty());
  AddCircle(1.0, 2.0, 1.0);
  EXPECT_TRUE(Detect().empty());
  // Beyond the gate, of another level, not finite.
  AddCircle(1.5, 2.0, 1.0);
  AddCircle(1.0, 2.0, 2.0, 2);
  AddCircle(1.0, 2.0, 2.0, 0);
  const FeatureId broken = AddCircle(1.0, 2.0, 3.0);
  graph_.GetFeature(broken).parameters[0] = std::nan("");
  EXPECT_TRUE(Detect().empty());
}

TEST_F(CenterClusterTest, SmallColumnsSideBySide) {
  AddCircle(0.0, 0.0, 0.15);
  AddCircle(0.35, 0.0, 0.15);
  EXPECT_TRUE(Detect().empty());
}

TEST_F(CenterClusterTest, RawCirclesAtLevelZero) {
  AddCircle(0.0, 0.0, 1.0, 0);
  AddCircle(0.1, 0.0, 2.0, 0);
  const Transaction transaction = Detect(0);
  ASSERT_EQ(transaction.added_features().size(), 1u);
  EXPECT_EQ(transaction.added_features()[0].level, 1);
}

TEST_F(CenterClusterTest, ExtendsWhatIsThere) {
  AddCircle(0.0, 0.0, 1.0);
  AddCircle(0.1, 0.0, 2.0);
  const FeatureId center = graph_.Apply(Detect()).features[0];
  const FeatureId third = AddCircle(0.2, 0.1, 3.0);
  AddCircle(1.2, 0.1, 3.0);
  const std::vector<FeatureId> scope = {third};
  for (const std::vector<FeatureId>* features :
       {static_cast<const std::vector<FeatureId>*>(nullptr), &scope}) {
    const Transaction transaction = Detect(1, features);
    EXPECT_TRUE(transaction.added_features().empty());
    ASSERT_EQ(transaction.added_constraints().size(), 1u);
    EXPECT_EQ(transaction.added_constraints()[0].features,
              (std::vector<FeatureId>{third, center}));
  }
}

TEST_F(CenterClusterTest, BrokenTiesAreProposedAgain) {
  AddCircle(0.0, 0.0, 1.0);
  AddCircle(0.1, 0.0, 2.0);
  AddCircle(0.0, 0.1, 3.0);
  const ConstraintId tie = graph_.Apply(Detect()).constraints[0];
  EXPECT_TRUE(Detect().empty());
  Transaction transaction;
  transaction.BreakConstraint(tie);
  graph_.Apply(std::move(transaction));
  EXPECT_EQ(Detect().added_constraints().size(), 1u);
}

// Whatever the arrangement, a second look finds nothing.
TEST_F(CenterClusterTest, NothingIsProposedTwice) {
  std::uint64_t state = 1;
  const auto draw = [&state] {
    state = state * 6364136223846793005u + 1442695040888963407u;
    return static_cast<double>(state >> 40) / 16777216.0;
  };
  for (int i = 0; i < 400; ++i) AddCircle(8.0 * draw(), 8.0 * draw(), 1.0);
  const Transaction transaction = Detect();
  EXPECT_GT(transaction.added_features().size(), 10u);
  graph_.Apply(transaction);
  EXPECT_TRUE(Detect().empty());
}

TEST_F(CenterClusterTest, EveryCircleHasACentre) {
  const FeatureId a = AddCircle(1.0, 2.0, 1.0);
  const FeatureId b = AddCircle(7.0, 2.0, 1.0);
  const FeatureId c = AddCircle(1.1, 2.2, 2.0);
  const Transaction transaction = Detect(1, nullptr, {}, "circle_center");
  ASSERT_EQ(transaction.added_features().size(), 2u);
  EXPECT_EQ(transaction.added_features()[0].type->name, "point");
  EXPECT_EQ(transaction.added_features()[0].level, 2);
  EXPECT_EQ(transaction.added_features()[0].source, "circle_center");
  EXPECT_NEAR(transaction.added_features()[0].parameters[1], 2.1, 1e-12);
  EXPECT_EQ(transaction.added_features()[1].parameters[0], 7.0);
  ASSERT_EQ(transaction.added_constraints().size(), 3u);
  const FeatureId p = Transaction::ProvisionalId(0);
  const FeatureId q = Transaction::ProvisionalId(1);
  EXPECT_EQ(transaction.added_constraints()[0].features,
            (std::vector<FeatureId>{a, p}));
  EXPECT_EQ(transaction.added_constraints()[1].features,
            (std::vector<FeatureId>{b, q}));
  EXPECT_EQ(transaction.added_constraints()[2].features,
            (std::vector<FeatureId>{c, p}));
  EXPECT_EQ(transaction.added_constraints()[2].source, "circle_center");
  graph_.Apply(transaction);
  EXPECT_TRUE(Detect(1, nullptr, {}, "circle_center").empty());
  // Neither makes again what the other made.
  EXPECT_TRUE(Detect().empty());
}

TEST_F(CenterClusterTest, CentresOfSingleCirclesStay) {
  EXPECT_TRUE(
      registry_.GetDetector("circle_center").make({})->keeps_followers());
  EXPECT_EQ(registry_.GetDetector("circle_center").make({})->minimum_support(),
            1);
  EXPECT_FALSE(
      registry_.GetDetector("center_cluster").make({})->keeps_followers());
  EXPECT_THROW(Detect(1, nullptr, {{"minimum_support", 2.0}}, "circle_center"),
               Error);
}

TEST_F(CenterClusterTest, Parameters) {
  AddCircle(0.0, 0.0, 2.0);
  AddCircle(0.6, 0.0, 2.0);
  EXPECT_TRUE(Detect().empty());
  const Transaction wide = Detect(1, nullptr, {{"gate", 0.7}, {"sigma", 0.1}});
  ASSERT_EQ(wide.added_features().size(), 1u);
  EXPECT_NEAR(wide.added_constraints()[0].information(1, 1), 100.0, 1e-9);
  EXPECT_TRUE(
      Detect(1, nullptr, {{"gate", 0.7}, {"minimum_support", 3.0}}).empty());
  EXPECT_THROW(Detect(1, nullptr, {{"gate", 0.0}}), Error);
  EXPECT_THROW(Detect(1, nullptr, {{"minimum_support", 1.0}}), Error);
  EXPECT_THROW(Detect(1, nullptr, {{"radius", 1.0}}), Error);
}

}  // namespace
}  // namespace plumbline
