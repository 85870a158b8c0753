#include <gtest/gtest.h>
#include <plumbline/core/hypothesis_memory.h>

#include <vector>

#include "core/em_test_util.h"

namespace plumbline {
namespace {

class HypothesisMemoryTest : public WallsTest {
 protected:
  // Breaks the hypothesis that the wall has this orientation, and lets the map
  // relax: the wall goes where it is seen.
  void BreakAndRelax(HypothesisMemory* memory, FeatureId wall,
                     FeatureId orientation, double relaxed_degrees) {
    const ConstraintId id = Between(wall, orientation);
    Break(id);
    memory->Remember(graph_.GetConstraint(id));
    SetDirection(wall, relaxed_degrees);
    memory->MeasureRelaxedErrors();
  }

  void SetDirection(FeatureId wall, double degrees) {
    graph_.GetFeature(wall).parameters[2] = DegToRad(degrees);
  }

  // Proposes to tie the wall to an orientation that is there.
  bool MayBeTied(const HypothesisMemory& memory, FeatureId wall,
                 FeatureId orientation) const {
    return memory.MayBeProposed(
        Structure(registry_, "segment_orientation", wall, orientation, 0.0,
                  0.5),
        {&graph_.GetFeature(wall), &graph_.GetFeature(orientation)});
  }

  // Proposes to tie the wall to a new orientation.
  bool MayBeTiedToNew(const HypothesisMemory& memory, FeatureId wall,
                      double degrees) const {
    const Feature orientation = Orientation(registry_, DegToRad(degrees));
    return memory.MayBeProposed(
        Structure(registry_, "segment_orientation", wall,
                  Transaction::ProvisionalId(0), 0.0, 0.5),
        {&graph_.GetFeature(wall), &orientation});
  }

  void Drop(HypothesisMemory* memory, FeatureId id) {
    const Feature feature = graph_.GetFeature(id);
    Transaction transaction;
    for (const ConstraintId constraint : graph_.ConstraintsOf(id)) {
      if (graph_.GetConstraint(constraint).state == ConstraintState::kLive) {
        transaction.RemoveConstraint(constraint);
      }
    }
    transaction.RemoveFeature(id);
    memory->OnFeatureRemoved(feature);
    graph_.Apply(transaction);
  }

  EmOptions options_;
};

TEST_F(HypothesisMemoryTest, WhatWasNeverBrokenMayBeProposed) {
  const FeatureId wall = AddSegment(5.0);
  const FeatureId orientation = AddOrientation(0.0, {wall});
  const HypothesisMemory memory(&graph_, options_);
  EXPECT_TRUE(MayBeTied(memory, wall, orientation));
}

TEST_F(HypothesisMemoryTest, OnlyAClearlySmallerErrorIsAReasonToTryAgain) {
  const FeatureId wall = AddSegment(5.0);
  const FeatureId orientation = AddOrientation(0.0, {wall});
  HypothesisMemory memory(&graph_, options_);
  BreakAndRelax(&memory, wall, orientation, 5.0);
  EXPECT_FALSE(MayBeTied(memory, wall, orientation));
  // The tolerance is half a degree, and one such is asked for.
  SetDirection(wall, 4.6);
  EXPECT_FALSE(MayBeTied(memory, wall, orientation));
  SetDirection(wall, 4.4);
  EXPECT_TRUE(MayBeTied(memory, wall, orientation));
  SetDirection(wall, 5.9);
  EXPECT_FALSE(MayBeTied(memory, wall, orientation));
}

TEST_F(HypothesisMemoryTest, NothingIsTriedAgainBeforeItsErrorIsKnown) {
  const FeatureId wall = AddSegment(5.0);
  const FeatureId orientation = AddOrientation(0.0, {wall});
  HypothesisMemory memory(&graph_, options_);
  const ConstraintId id = Between(wall, orientation);
  Break(id);
  memory.Remember(graph_.GetConstraint(id));
  // The error of a hypothesis that still bends the map says nothing: any is
  // smaller.
  SetDirection(wall, 5.0);
  EXPECT_TRUE(MayBeTied(memory, wall, orientation));
  memory.MeasureRelaxedErrors();
  EXPECT_FALSE(MayBeTied(memory, wall, orientation));
}

TEST_F(HypothesisMemoryTest, AHypothesisHasSoManyChances) {
  options_.max_breaks = 2;
  const FeatureId wall = AddSegment(5.0);
  const FeatureId orientation = AddOrientation(0.0, {wall});
  HypothesisMemory memory(&graph_, options_);
  BreakAndRelax(&memory, wall, orientation, 5.0);
  Transaction again;
  again.AddConstraint(
      Structure(registry_, "segment_orientation", wall, orientation, 0.0, 0.5));
  graph_.Apply(again);
  BreakAndRelax(&memory, wall, orientation, 4.0);
  SetDirection(wall, 0.0);
  EXPECT_FALSE(MayBeTied(memory, wall, orientation));
}

TEST_F(HypothesisMemoryTest, AVirtualFeatureThatComesAgainIsKnownByItsValue) {
  const FeatureId wall = AddSegment(5.0);
  const FeatureId orientation = AddOrientation(0.0, {wall});
  HypothesisMemory memory(&graph_, options_);
  BreakAndRelax(&memory, wall, orientation, 5.0);
  Drop(&memory, orientation);
  EXPECT_FALSE(MayBeTiedToNew(memory, wall, 0.0));
  // Within one tolerance of half a degree it is the same.
  EXPECT_FALSE(MayBeTiedToNew(memory, wall, 0.4));
  EXPECT_FALSE(MayBeTiedToNew(memory, wall, -0.4));
  EXPECT_TRUE(MayBeTiedToNew(memory, wall, 0.6));
}

TEST_F(HypothesisMemoryTest, ARawFeatureHasSoManyHypothesesOfARelation) {
  options_.max_breaks_per_feature = 3;
  const FeatureId wall = AddSegment(5.0);
  HypothesisMemory memory(&graph_, options_);
  for (const double degrees : {20.0, 40.0, 60.0}) {
    EXPECT_TRUE(MayBeTiedToNew(memory, wall, 80.0));
    BreakAndRelax(&memory, wall, AddOrientation(degrees, {wall}), 5.0);
  }
  EXPECT_FALSE(MayBeTiedToNew(memory, wall, 80.0));
  // Another wall has its own.
  EXPECT_TRUE(MayBeTiedToNew(memory, AddSegment(5.0), 80.0));
}

TEST_F(HypothesisMemoryTest, ARawFeatureTakesItsHypothesesAlong) {
  const FeatureId wall = AddSegment(5.0);
  const FeatureId orientation = AddOrientation(0.0, {wall});
  HypothesisMemory memory(&graph_, options_);
  BreakAndRelax(&memory, wall, orientation, 5.0);
  ASSERT_FALSE(MayBeTied(memory, wall, orientation));
  memory.OnFeatureRemoved(graph_.GetFeature(wall));
  EXPECT_TRUE(MayBeTied(memory, wall, orientation));
}

TEST_F(HypothesisMemoryTest, AnotherExpectedValueIsAnotherHypothesis) {
  const FeatureId first = AddOrientation(0.0, {AddSegment(0.0)});
  const FeatureId second = AddOrientation(80.0, {AddSegment(80.0)});
  HypothesisMemory memory(&graph_, options_);
  const auto relation = [&](double degrees) {
    return Structure(registry_, "orientation_orientation", first, second,
                     DegToRad(degrees), 0.5);
  };
  Transaction transaction;
  transaction.AddConstraint(relation(90.0));
  const ConstraintId id = graph_.Apply(transaction).constraints[0];
  Break(id);
  memory.Remember(graph_.GetConstraint(id));
  memory.MeasureRelaxedErrors();
  const std::vector<const Feature*> between = {&graph_.GetFeature(first),
                                               &graph_.GetFeature(second)};
  EXPECT_FALSE(memory.MayBeProposed(relation(90.0), between));
  EXPECT_TRUE(memory.MayBeProposed(relation(80.0), between));
}

TEST_F(HypothesisMemoryTest, TheRootIsTheFirstRawFeatureBelow) {
  const FeatureId a = AddSegment(0.0);
  const FeatureId b = AddSegment(0.0);
  const FeatureId low = AddOrientation(0.0, {b});
  Transaction transaction;
  const FeatureId provisional =
      transaction.AddFeature(Orientation(registry_, 0.0, 2));
  transaction.AddConstraint(Structure(registry_, "orientation_orientation", low,
                                      provisional, 0.0, 0.5));
  const FeatureId high = graph_.Apply(transaction).features[0];
  HypothesisMemory memory(&graph_, options_);
  for (const Constraint* constraint : graph_.Constraints()) {
    memory.OnConstraintAdded(*constraint);
  }
  EXPECT_EQ(memory.RootOf(a), a);
  EXPECT_EQ(memory.RootOf(low), b);
  EXPECT_EQ(memory.RootOf(high), b);
  EXPECT_EQ(memory.RootOf(77), kNoId);
  Transaction more;
  more.AddConstraint(
      Structure(registry_, "segment_orientation", a, low, 0.0, 0.5));
  memory.OnConstraintAdded(
      graph_.GetConstraint(graph_.Apply(more).constraints[0]));
  EXPECT_EQ(memory.RootOf(low), a);
  memory.OnFeatureRemoved(graph_.GetFeature(low));
  EXPECT_EQ(memory.RootOf(low), kNoId);
}

}  // namespace
}  // namespace plumbline
