#include <gtest/gtest.h>
#include <plumbline/core/error.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/detectors/orientation_mixture.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "detectors/wall_samples.h"

namespace plumbline {
namespace {

class OrientationMixtureTest : public ::testing::Test {
 protected:
  OrientationMixtureTest() { RegisterBuiltins(&registry_); }

  FeatureId Add(Feature feature) {
    Transaction transaction;
    transaction.AddFeature(std::move(feature));
    return graph_.Apply(std::move(transaction)).features[0];
  }

  FeatureId AddSegment(double direction_deg, double length, int level = 0) {
    Feature feature;
    feature.type = &registry_.GetFeature("segment");
    feature.level = level;
    feature.parameters = {1.0, 2.0, DegToRad(direction_deg)};
    feature.extent_begin = -0.25 * length;
    feature.extent_end = 0.75 * length;
    return Add(feature);
  }

  FeatureId AddLine(double direction_deg, double length, int level = 0) {
    Feature feature;
    feature.type = &registry_.GetFeature("line");
    feature.level = level;
    feature.is_virtual = level > 0;
    feature.parameters = {1.0, DegToRad(direction_deg)};
    feature.extent_end = length;
    return Add(feature);
  }

  FeatureId AddOrientation(double direction_deg, int level = 1) {
    Feature feature;
    feature.type = &registry_.GetFeature("orientation");
    feature.level = level;
    feature.is_virtual = true;
    feature.parameters = {DegToRad(direction_deg)};
    return Add(feature);
  }

  void AddSamples(const std::vector<AxialSample>& samples) {
    for (const AxialSample& sample : samples) {
      AddSegment(RadToDeg(sample.angle), sample.length);
    }
  }

  Transaction Detect(const std::vector<FeatureId>* features = nullptr,
                     int level = 0,
                     const DetectorParameters& parameters = {}) const {
    DetectionScope scope;
    scope.level = level;
    scope.features = features;
    return registry_.GetDetector("orientation_mixture")
        .make(parameters)
        ->Detect(graph_, registry_, scope);
  }

  Registry registry_;
  Graph graph_;
};

TEST_F(OrientationMixtureTest, MakesOrientationsOneLevelUp) {
  for (int i = 0; i < 10; ++i) {
    AddSegment(20.0 + 0.1 * i, 3.0);
    AddSegment(110.4 - 0.1 * i, 3.0);
  }
  const FeatureId oblique = AddSegment(60.0, 3.0);
  const Transaction transaction =
      Detect(nullptr, 0, {{"sigma_deg", 0.5}, {"gate_deg", 5.0}});
  ASSERT_EQ(transaction.added_features().size(), 2u);
  std::vector<double> directions;
  for (const Feature& feature : transaction.added_features()) {
    EXPECT_EQ(feature.type->name, "orientation");
    EXPECT_EQ(feature.level, 1);
    EXPECT_TRUE(feature.is_virtual);
    EXPECT_FALSE(feature.fixed);
    EXPECT_EQ(feature.source, "orientation_mixture");
    directions.push_back(RadToDeg(feature.parameters[0]));
  }
  std::sort(directions.begin(), directions.end());
  EXPECT_NEAR(directions[0], -70.05, 0.05);
  EXPECT_NEAR(directions[1], 20.45, 0.05);
  ASSERT_EQ(transaction.added_constraints().size(), 20u);
  FeatureId last = -1;
  for (const Constraint& constraint : transaction.added_constraints()) {
    EXPECT_EQ(constraint.type->name, "segment_orientation");
    EXPECT_EQ(constraint.kind, ConstraintClass::kStructure);
    EXPECT_EQ(constraint.source, "orientation_mixture");
    ASSERT_EQ(constraint.features.size(), 2u);
    EXPECT_NE(constraint.features[0], oblique);
    EXPECT_GT(constraint.features[0], last);
    last = constraint.features[0];
    EXPECT_EQ(constraint.expected[0], 0.0);
    // 1 / (0.5 degrees)^2.
    EXPECT_NEAR(constraint.information(0, 0), 13131.225, 0.01);
  }
  EXPECT_TRUE(transaction.removed_features().empty());
  EXPECT_TRUE(transaction.removed_constraints().empty());
  EXPECT_TRUE(transaction.broken_constraints().empty());
  EXPECT_NO_THROW(graph_.Apply(transaction));
}

TEST_F(OrientationMixtureTest, NothingIsProposedTwice) {
  for (int seed = 0; seed < 3; ++seed) {
    WallSampler sampler(seed);
    std::vector<AxialSample> samples;
    sampler.AddWalls(200, 5.0, 2.5, 1.5, &samples);
    sampler.AddWalls(150, 95.0, 1.5, 1.5, &samples);
    sampler.AddWalls(30, 35.0, 1.0, 1.5, &samples);
    sampler.AddClutter(150, 0.5, &samples);
    AddSamples(samples);
  }
  Transaction transaction = Detect();
  EXPECT_EQ(transaction.added_features().size(), 3u);
  graph_.Apply(std::move(transaction));
  EXPECT_TRUE(Detect().empty());
}

TEST_F(OrientationMixtureTest, ClutterMakesNothing) {
  WallSampler sampler(11);
  std::vector<AxialSample> samples;
  sampler.AddClutter(2000, 0.6, &samples);
  AddSamples(samples);
  EXPECT_TRUE(Detect().empty());
}

TEST_F(OrientationMixtureTest, ReadsLinesAndSegmentsOfTheLevel) {
  for (int i = 0; i < 4; ++i) {
    AddLine(30.0 + 0.1 * i, 10.0, 1);
    AddLine(70.0, 10.0, 2);
    AddSegment(30.0 + 180.0 * (i % 2), 4.0, 1);
  }
  const Transaction transaction = Detect(nullptr, 1);
  ASSERT_EQ(transaction.added_features().size(), 1u);
  EXPECT_EQ(transaction.added_features()[0].level, 2);
  EXPECT_NEAR(RadToDeg(transaction.added_features()[0].parameters[0]), 30.1,
              0.1);
  int lines = 0;
  for (const Constraint& constraint : transaction.added_constraints()) {
    if (constraint.type->name == "line_orientation") ++lines;
  }
  EXPECT_EQ(lines, 4);
  EXPECT_EQ(transaction.added_constraints().size(), 8u);
}

// Walls at level 0 and a row of columns at level 2 share a direction.
TEST_F(OrientationMixtureTest, ReadsWhatHasNoOrientationFurtherDown) {
  std::vector<FeatureId> walls;
  for (int i = 0; i < 4; ++i) walls.push_back(AddSegment(30.0 + 0.1 * i, 4.0));
  const FeatureId row = AddLine(30.2, 10.0, 2);
  const TransactionResult result = graph_.Apply(Detect(nullptr, 2));
  ASSERT_EQ(result.features.size(), 1u);
  const FeatureId orientation = result.features[0];
  EXPECT_EQ(graph_.GetFeature(orientation).level, 3);
  ASSERT_EQ(result.constraints.size(), 5u);
  EXPECT_EQ(graph_.GetConstraint(result.constraints[4]).features,
            (std::vector<FeatureId>{row, orientation}));
  EXPECT_TRUE(Detect(nullptr, 2).empty());
  // They have one now.
  EXPECT_TRUE(Detect(nullptr, 0).empty());
  // A wall that comes later makes none of its own.
  const std::vector<FeatureId> late = {AddSegment(30.1, 4.0)};
  EXPECT_TRUE(Detect(nullptr, 0).empty());
  EXPECT_EQ(Detect(nullptr, 2).added_constraints().size(), 1u);
  EXPECT_EQ(Detect(&late, 2).added_constraints().size(), 1u);
}

TEST_F(OrientationMixtureTest, ShortFeaturesAreLeftOut) {
  for (int i = 0; i < 10; ++i) AddSegment(0.1 * i, 3.0);
  const FeatureId shorter = AddSegment(0.5, 0.45);
  const FeatureId longer = AddSegment(0.5, 0.55);
  // Without an extent the length is unknown.
  const FeatureId unknown = AddSegment(0.5, 0.0);
  std::set<FeatureId> tied;
  const Transaction transaction = Detect();
  for (const Constraint& constraint : transaction.added_constraints()) {
    tied.insert(constraint.features[0]);
  }
  EXPECT_EQ(tied.count(shorter), 0u);
  EXPECT_EQ(tied.count(longer), 1u);
  EXPECT_EQ(tied.count(unknown), 1u);
}

TEST_F(OrientationMixtureTest, ExtendsWhatIsThere) {
  const FeatureId first = AddOrientation(0.0);
  const FeatureId second = AddOrientation(89.0);
  AddOrientation(45.0, 2);
  std::vector<FeatureId> segments;
  for (const double direction : {0.2, 3.0, -91.5, 87.0, 184.0, 40.0, 6.0}) {
    segments.push_back(AddSegment(direction, 2.0));
  }
  // The last one is beyond the gate.
  const Transaction transaction = Detect(nullptr, 0, {{"gate_deg", 5.0}});
  EXPECT_TRUE(transaction.added_features().empty());
  ASSERT_EQ(transaction.added_constraints().size(), 5u);
  const std::vector<FeatureId> expected = {first, first, second, second, first};
  for (int i = 0; i < 5; ++i) {
    const Constraint& constraint = transaction.added_constraints()[i];
    EXPECT_EQ(constraint.features[0], segments[i]);
    EXPECT_EQ(constraint.features[1], expected[i]);
  }
}

TEST_F(OrientationMixtureTest, NoNewOrientationNearOneThatIsThere) {
  AddOrientation(0.0);
  for (int i = 0; i < 30; ++i) AddSegment(3.0 + 0.02 * i, 3.0);
  const Transaction transaction = Detect();
  EXPECT_TRUE(transaction.added_features().empty());
  EXPECT_EQ(transaction.added_constraints().size(), 30u);
}

// A tie holds until it is broken.
TEST_F(OrientationMixtureTest, BrokenTiesAreProposedAgain) {
  AddOrientation(0.0);
  AddOrientation(4.0);
  AddSegment(1.0, 3.0);
  const ConstraintId tie = graph_.Apply(Detect()).constraints[0];
  EXPECT_TRUE(Detect().empty());
  // Nearer to the other one now, but tied.
  graph_.GetFeature(2).parameters[2] = DegToRad(3.5);
  EXPECT_TRUE(Detect().empty());
  Transaction transaction;
  transaction.BreakConstraint(tie);
  graph_.Apply(std::move(transaction));
  const Transaction again = Detect();
  ASSERT_EQ(again.added_constraints().size(), 1u);
  EXPECT_EQ(again.added_constraints()[0].features[1], 1);
}

TEST_F(OrientationMixtureTest, ScopeLimitsWhatIsLookedAt) {
  std::vector<FeatureId> old_ids, scope;
  for (int i = 0; i < 10; ++i) old_ids.push_back(AddSegment(0.1 * i, 3.0));
  for (int i = 0; i < 5; ++i) scope.push_back(AddSegment(40.0, 3.0));
  // Only the five, and ids that are gone or of another type do not disturb.
  const FeatureId gone = AddSegment(40.0, 3.0);
  Transaction removal;
  removal.RemoveFeature(gone);
  graph_.Apply(std::move(removal));
  scope.push_back(gone);
  Transaction transaction = Detect(&scope);
  ASSERT_EQ(transaction.added_features().size(), 1u);
  EXPECT_NEAR(RadToDeg(transaction.added_features()[0].parameters[0]), 40.0,
              1e-6);
  EXPECT_EQ(transaction.added_constraints().size(), 5u);
  graph_.Apply(std::move(transaction));
  EXPECT_TRUE(Detect(&scope).empty());

  // The orientation is found from features that have nothing to do with it.
  const std::vector<FeatureId> later = {
      AddSegment(41.0, 3.0), AddSegment(-140.5, 3.0), AddSegment(38.0, 3.0)};
  const Transaction extension = Detect(&later);
  EXPECT_TRUE(extension.added_features().empty());
  EXPECT_EQ(extension.added_constraints().size(), 3u);
  const std::vector<FeatureId> none;
  EXPECT_TRUE(Detect(&none).empty());
}

TEST_F(OrientationMixtureTest, RemovedOrientationsAreNotExtended) {
  const FeatureId gone = AddOrientation(0.0);
  const FeatureId stays = AddOrientation(2.0);
  Transaction transaction;
  transaction.RemoveFeature(gone);
  graph_.Apply(std::move(transaction));
  EXPECT_EQ(graph_.VirtualFeatures(1), (std::vector<FeatureId>{stays}));
  EXPECT_TRUE(graph_.VirtualFeatures(0).empty());
  AddSegment(0.0, 3.0);
  const Transaction extension = Detect();
  ASSERT_EQ(extension.added_constraints().size(), 1u);
  EXPECT_EQ(extension.added_constraints()[0].features[1], stays);
}

// A diverged state must not reach the graph as a hypothesis.
TEST_F(OrientationMixtureTest, DirectionsThatAreNotNumbersAreLeftOut) {
  for (int i = 0; i < 6; ++i) AddSegment(0.1 * i, 3.0);
  graph_.GetFeature(5).parameters[2] = std::nan("");
  const Transaction transaction = Detect();
  EXPECT_EQ(transaction.added_features().size(), 1u);
  EXPECT_EQ(transaction.added_constraints().size(), 5u);
}

TEST_F(OrientationMixtureTest, SameInputSameProposal) {
  WallSampler sampler(12);
  std::vector<AxialSample> samples;
  sampler.AddWalls(100, 5.0, 1.5, 1.5, &samples);
  sampler.AddWalls(80, 95.0, 1.5, 1.5, &samples);
  sampler.AddClutter(80, 0.5, &samples);
  AddSamples(samples);
  const Transaction a = Detect(), b = Detect();
  ASSERT_EQ(a.added_features().size(), 2u);
  ASSERT_EQ(b.added_features().size(), 2u);
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(a.added_features()[i].parameters,
              b.added_features()[i].parameters);
  }
  EXPECT_EQ(a.added_constraints().size(), b.added_constraints().size());
}

TEST_F(OrientationMixtureTest, Parameters) {
  for (int i = 0; i < 4; ++i) AddSegment(10.0, 3.0);
  EXPECT_EQ(Detect(nullptr, 0, {{"min_support", 4.0}}).added_features().size(),
            1u);
  EXPECT_TRUE(Detect(nullptr, 0, {{"min_support", 5.0}}).empty());
  EXPECT_TRUE(Detect(nullptr, 0, {{"min_length", 3.5}}).empty());
  const Transaction loose = Detect(nullptr, 0, {{"sigma_deg", 1.0}});
  EXPECT_NEAR(loose.added_constraints()[0].information(0, 0), 3282.806, 0.01);
  EXPECT_EQ(
      registry_.GetDetector("orientation_mixture").make({})->minimum_support(),
      2);

  EXPECT_THROW(Detect(nullptr, 0, {{"sigma", 1.0}}), Error);
  EXPECT_THROW(Detect(nullptr, 0, {{"sigma_deg", 0.0}}), Error);
  EXPECT_THROW(Detect(nullptr, 0, {{"gate_deg", 90.0}}), Error);
  EXPECT_THROW(Detect(nullptr, 0, {{"min_support", 2.5}}), Error);
  try {
    Detect(nullptr, 0, {{"gate", 1.0}});
    FAIL();
  } catch (const Error& error) {
    const std::string message = error.what();
    EXPECT_NE(message.find("no parameter \"gate\""), std::string::npos);
    EXPECT_NE(message.find("gate_deg"), std::string::npos);
  }
}

}  // namespace
}  // namespace plumbline
