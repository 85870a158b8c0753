#include <gtest/gtest.h>
#include <plumbline/core/structure_census.h>

#include "core/em_test_util.h"

namespace plumbline {
namespace {

class StructureCensusTest : public WallsTest, public GraphListener {
 protected:
  StructureCensusTest() { graph_.AddListener(this); }
  void OnFeatureAdded(const Feature& feature) override {
    census_.OnFeatureAdded(feature);
  }
  void OnFeatureRemoved(const Feature& feature) override {
    census_.OnFeatureRemoved(feature);
  }
  void OnConstraintAdded(const Constraint& constraint) override {
    census_.OnConstraintAdded(constraint);
  }
  void OnConstraintChanged(const Constraint&) override {}
  void OnConstraintRetired(const Constraint& constraint) override {
    was_live_ = census_.OnConstraintRetired(
        constraint, graph_.FindConstraint(constraint.id) != nullptr);
  }

  StructureCensus census_;
  bool was_live_ = false;
};

TEST_F(StructureCensusTest, CountsWhatIsThere) {
  const FeatureId a = AddSegment(0.0);
  const FeatureId b = AddSegment(0.0);
  const FeatureId orientation = AddOrientation(0.0, {a, b});
  EXPECT_EQ(census_.features().at("segment"), 2);
  EXPECT_EQ(census_.features().at("orientation"), 1);
  EXPECT_EQ(census_.num_structure(), 2);
  EXPECT_EQ(census_.structure_by_relation().at("segment_orientation"), 2);
  // Two sightings and two of structure.
  EXPECT_EQ(census_.num_changes(), 4);

  const ConstraintId broken = Between(a, orientation);
  Break(broken);
  EXPECT_TRUE(was_live_);
  EXPECT_EQ(census_.num_structure(), 1);
  EXPECT_EQ(census_.num_broken(), 1);
  EXPECT_EQ(census_.broken_by_relation().at("segment_orientation"), 1);
  EXPECT_EQ(census_.num_changes(), 5);

  Transaction transaction;
  transaction.RemoveConstraint(broken);
  graph_.Apply(transaction);
  EXPECT_FALSE(was_live_);
  EXPECT_EQ(census_.num_broken(), 0);
  EXPECT_EQ(census_.num_changes(), 5);

  Transaction removal;
  removal.RemoveConstraint(Between(b, orientation));
  removal.RemoveFeature(orientation);
  graph_.Apply(removal);
  EXPECT_TRUE(was_live_);
  EXPECT_EQ(census_.num_structure(), 0);
  EXPECT_EQ(census_.features().count("orientation"), 0u);
}

// Broken and gone with its feature in one transaction: it was live before.
TEST_F(StructureCensusTest, BrokenAndGoneAtOnceIsNotOnRecord) {
  const FeatureId wall = AddSegment(0.0);
  const FeatureId orientation = AddOrientation(0.0, {wall});
  Transaction transaction;
  transaction.BreakConstraint(Between(wall, orientation));
  transaction.RemoveFeature(orientation);
  graph_.Apply(transaction);
  EXPECT_TRUE(was_live_);
  EXPECT_EQ(census_.num_structure(), 0);
  EXPECT_EQ(census_.num_broken(), 0);
}

}  // namespace
}  // namespace plumbline
