#include <gtest/gtest.h>
#include <plumbline/core/error.h>
#include <plumbline/core/support_policy.h>

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/em_test_util.h"

namespace plumbline {
namespace {

class SupportPolicyTest : public WallsTest {
 protected:
  SupportPolicyTest() {
    hierarchy_.resize(1);
    Add("two", 2, false);
    Add("one", 1, false);
    Add("follower", 1, true);
  }

  void Add(const std::string& name, int support, bool keeps_followers) {
    RegisterTestDetector(name, &registry_);
    hierarchy_[0].push_back(std::make_unique<TestDetector>(
        name, support, nullptr, keeps_followers));
  }

  const StructureDetector& Detector(const std::string& name) const {
    for (const auto& detector : hierarchy_[0]) {
      if (detector->name() == name) return *detector;
    }
    throw std::out_of_range(name);
  }

  bool IsThere(FeatureId id) const { return graph_.FindFeature(id) != nullptr; }

  void Lose(SupportPolicy* policy, FeatureId wall, FeatureId orientation) {
    const ConstraintId id = Between(wall, orientation);
    Break(id);
    policy->OnConstraintLost(graph_.GetConstraint(id));
  }

  Hierarchy hierarchy_;
};

TEST_F(SupportPolicyTest, LooksOnlyAtWhatLostSomething) {
  const FeatureId wall = AddSegment(0.0);
  const FeatureId lonely = AddOrientation(0.0, {wall}, "two");
  SupportPolicy policy(&graph_, hierarchy_, registry_);
  EXPECT_FALSE(policy.DropUnsupported());
  EXPECT_TRUE(IsThere(lonely));
  policy.RecheckAll();
  EXPECT_TRUE(policy.DropUnsupported());
  EXPECT_FALSE(IsThere(lonely));
  EXPECT_FALSE(policy.DropUnsupported());
}

TEST_F(SupportPolicyTest, TheMinimumIsTheDetectors) {
  const FeatureId a = AddSegment(0.0);
  const FeatureId b = AddSegment(0.0);
  const FeatureId c = AddSegment(0.0);
  const FeatureId orientation = AddOrientation(0.0, {a, b, c}, "two");
  SupportPolicy policy(&graph_, hierarchy_, registry_);
  Lose(&policy, a, orientation);
  EXPECT_FALSE(policy.DropUnsupported());
  Lose(&policy, b, orientation);
  EXPECT_TRUE(policy.DropUnsupported());
  EXPECT_FALSE(IsThere(orientation));
}

// Who made a feature is in its maker; a source is a label.
TEST_F(SupportPolicyTest, ALabelDecidesNothing) {
  const FeatureId a = AddSegment(0.0);
  const FeatureId b = AddSegment(0.0);
  const FeatureId follower = AddOrientation(0.0, {a, b}, "follower");
  graph_.GetFeature(follower).source = "two";
  const FeatureId labelled = AddOrientation(0.0, {a, b}, "two");
  graph_.GetFeature(labelled).source = "follower";
  SupportPolicy policy(&graph_, hierarchy_, registry_);
  EXPECT_EQ(policy.TypeOf(Detector("two")), registry_.FindDetector("two"));
  Break(Between(a, follower));
  Break(Between(a, labelled));
  policy.RecheckAll();
  EXPECT_TRUE(policy.DropUnsupported());
  EXPECT_TRUE(IsThere(follower));
  EXPECT_FALSE(IsThere(labelled));
}

TEST_F(SupportPolicyTest, RefusesADetectorThatIsNotRegistered) {
  hierarchy_[0].push_back(std::make_unique<TestDetector>("nobody", 1, nullptr));
  EXPECT_THROW(SupportPolicy(&graph_, hierarchy_, registry_), Error);
}

TEST_F(SupportPolicyTest, FixedMeasuredAndFollowersStay) {
  const FeatureId wall = AddSegment(0.0);
  Feature known = Orientation(registry_, 0.0);
  known.fixed = true;
  Transaction transaction;
  transaction.AddFeature(known);
  const FeatureId measured = transaction.AddFeature(Orientation(registry_, 0));
  Constraint compass =
      Structure(registry_, "segment_orientation", wall, measured, 0.0, 1.0);
  compass.kind = ConstraintClass::kMeasurement;
  transaction.AddConstraint(compass);
  const TransactionResult added = graph_.Apply(transaction);
  const FeatureId follower = AddOrientation(0.0, {wall}, "follower");
  const FeatureId silent = AddOrientation(0.0, {wall}, "one");
  const FeatureId stranger = AddOrientation(0.0, {wall, AddSegment(0.0)}, "x");
  SupportPolicy policy(&graph_, hierarchy_, registry_);
  policy.RecheckAll();
  policy.DropUnsupported();
  EXPECT_TRUE(IsThere(added.features[0]));
  EXPECT_TRUE(IsThere(added.features[1]));
  EXPECT_TRUE(IsThere(follower));
  EXPECT_FALSE(IsThere(silent));
  EXPECT_TRUE(IsThere(stranger));
}

TEST_F(SupportPolicyTest, WhatSaidNothingIsNotFoundAgain) {
  const FeatureId wall = AddSegment(0.0);
  const FeatureId silent = AddOrientation(0.0, {wall}, "one");
  SupportPolicy policy(&graph_, hierarchy_, registry_);
  const FeatureId provisional = Transaction::ProvisionalId(0);
  const Constraint to_wall =
      Structure(registry_, "segment_orientation", wall, provisional, 0.0, 0.5);
  FeatureSupport support;
  support.structure = {&to_wall};
  support.from_below = {&to_wall};
  EXPECT_TRUE(policy.MayBeAdded(Detector("one"), provisional, support));
  EXPECT_FALSE(policy.MayBeAdded(Detector("two"), provisional, support));
  policy.RecheckAll();
  ASSERT_TRUE(policy.DropUnsupported());
  ASSERT_FALSE(IsThere(silent));
  EXPECT_FALSE(policy.MayBeAdded(Detector("one"), provisional, support));
  // In company it may say something.
  const Constraint company = Structure(registry_, "segment_orientation",
                                       AddSegment(0.0), provisional, 0.0, 0.5);
  support.structure.push_back(&company);
  support.from_below.push_back(&company);
  EXPECT_TRUE(policy.MayBeAdded(Detector("one"), provisional, support));
  // What becomes of a wall that is gone is another's.
  support.structure.pop_back();
  support.from_below.pop_back();
  policy.OnFeatureRemoved(graph_.GetFeature(wall));
  EXPECT_TRUE(policy.MayBeAdded(Detector("one"), provisional, support));
}

TEST_F(SupportPolicyTest, DroppingGoesUpTheLevels) {
  const FeatureId a = AddSegment(0.0);
  const FeatureId b = AddSegment(0.0);
  const FeatureId low = AddOrientation(0.0, {a, b}, "two");
  const FeatureId other =
      AddOrientation(30.0, {AddSegment(30.0), AddSegment(30.0)}, "two");
  Transaction transaction;
  Feature high = Orientation(registry_, 0.0, 2);
  high.maker = &registry_.GetDetector("two");
  const FeatureId provisional = transaction.AddFeature(high);
  for (const FeatureId id : {low, other}) {
    transaction.AddConstraint(Structure(registry_, "orientation_orientation",
                                        id, provisional, 0.0, 0.5));
  }
  const FeatureId summit = graph_.Apply(transaction).features[0];

  // The orchestrator hands on what the graph tells.
  struct Listener final : GraphListener {
    explicit Listener(SupportPolicy* policy_in) : policy(policy_in) {}
    void OnFeatureAdded(const Feature&) override {}
    void OnFeatureRemoved(const Feature& feature) override {
      policy->OnFeatureRemoved(feature);
    }
    void OnConstraintAdded(const Constraint&) override {}
    void OnConstraintChanged(const Constraint&) override {}
    void OnConstraintRetired(const Constraint& constraint) override {
      policy->OnConstraintLost(constraint);
    }
    SupportPolicy* policy;
  };
  SupportPolicy policy(&graph_, hierarchy_, registry_);
  Listener listener(&policy);
  graph_.AddListener(&listener);
  Break(Between(a, low));
  EXPECT_TRUE(policy.DropUnsupported());
  graph_.RemoveListener(&listener);
  EXPECT_FALSE(IsThere(low));
  EXPECT_FALSE(IsThere(summit));
  EXPECT_TRUE(IsThere(other));
}

}  // namespace
}  // namespace plumbline
