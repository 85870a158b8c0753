#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/em_scope.h>

#include <vector>

#include "core/em_test_util.h"

namespace plumbline {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

class EmScopeTest : public WallsTest {};

std::vector<ConstraintId> IdsOf(const std::vector<Constraint*>& constraints) {
  std::vector<ConstraintId> ids;
  for (const Constraint* constraint : constraints) {
    ids.push_back(constraint->id);
  }
  return ids;
}

TEST_F(EmScopeTest, TheWholeGraphHasAllLiveStructure) {
  const FeatureId a = AddSegment(0.0);
  const FeatureId b = AddSegment(0.0);
  const FeatureId orientation = AddOrientation(0.0, {a, b});
  const EmScope whole = MakeEmScope(graph_, nullptr);
  EXPECT_TRUE(whole.is_whole());
  EXPECT_EQ(whole.session_scope(), nullptr);
  const ConstraintId first = Between(a, orientation);
  const ConstraintId second = Between(b, orientation);
  EXPECT_THAT(IdsOf(LiveStructure(whole, &graph_)), ElementsAre(first, second));
  Break(first);
  EXPECT_THAT(IdsOf(LiveStructure(whole, &graph_)), ElementsAre(second));
}

TEST_F(EmScopeTest, AListBringsTheVirtualFeaturesOnIt) {
  const FeatureId a = AddSegment(0.0);
  const FeatureId b = AddSegment(90.0);
  const FeatureId c = AddSegment(90.0);
  const FeatureId first = AddOrientation(0.0, {a});
  AddOrientation(90.0, {b, c});
  const std::vector<FeatureId> list = {a, 77, a};
  const EmScope scope = MakeEmScope(graph_, &list);
  EXPECT_FALSE(scope.is_whole());
  EXPECT_THAT(scope.variables, ElementsAre(a, first));
  EXPECT_EQ(scope.session_scope(), &scope.variables);
  EXPECT_THAT(IdsOf(LiveStructure(scope, &graph_)),
              ElementsAre(Between(a, first)));
  // Through a broken constraint nothing is reached.
  Break(Between(a, first));
  const EmScope after = MakeEmScope(graph_, &list);
  EXPECT_THAT(after.variables, ElementsAre(a));
  EXPECT_THAT(LiveStructure(after, &graph_), IsEmpty());
}

TEST_F(EmScopeTest, LargeVirtualFeaturesAreAttachedButHeld) {
  for (int i = 0; i < 51; ++i) AddSegment(0.0);
  const FeatureId orientation = AddOrientation(0.0, segments_);
  const std::vector<FeatureId> list = {segments_[3]};
  const EmScope scope = MakeEmScope(graph_, &list);
  EXPECT_THAT(scope.variables, ElementsAre(segments_[3]));
  EXPECT_THAT(scope.attached, ElementsAre(segments_[3], orientation));
  EXPECT_THAT(IdsOf(LiveStructure(scope, &graph_)),
              ElementsAre(Between(segments_[3], orientation)));
}

}  // namespace
}  // namespace plumbline
