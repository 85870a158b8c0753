#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/detectors/supported_curves.h>

#include <utility>
#include <vector>

#include "detectors/point_chain.h"

namespace plumbline {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

class SupportedCurvesTest : public PointChainTest {};

TEST_F(SupportedCurvesTest, AreThoseThatPointsAreTiedTo) {
  for (int i = 0; i < 8; ++i) AddPoint(0.5 * i, 0.0);
  const FeatureId line = AddLine(0.0, 0.0, 0.0, {0, 1, 2, 3});
  AddLine(0.0, 5.0, 0.0, {});
  const PointGraph points = Points();
  const SupportedCurves curves(graph_, points);
  ASSERT_EQ(curves.size(), 1u);
  EXPECT_EQ(curves[0].id, line);
  EXPECT_THAT(curves[0].found.support, ElementsAre(0, 1, 2, 3));
  EXPECT_THAT(curves[0].joining, IsEmpty());
  EXPECT_TRUE(curves[0].may_go);
  EXPECT_THAT(curves.On(2), ElementsAre(0u));
  EXPECT_THAT(curves.On(5), IsEmpty());
}

TEST_F(SupportedCurvesTest, BrokenTiesLeaveOutliers) {
  for (int i = 0; i < 4; ++i) AddPoint(0.5 * i, 0.0);
  AddLine(0.0, 0.0, 0.0, {0, 1, 2, 3});
  Transaction transaction;
  transaction.BreakConstraint(graph_.ConstraintsOf(points_[1]).back());
  graph_.Apply(std::move(transaction));
  const PointGraph points = Points();
  const SupportedCurves curves(graph_, points);
  ASSERT_EQ(curves.size(), 1u);
  EXPECT_THAT(curves[0].found.support, ElementsAre(0, 2, 3));
  EXPECT_THAT(curves.outliers(), ElementsAre(1));
}

TEST_F(SupportedCurvesTest, CurveWithPointsThatAreNotLookedAtStays) {
  for (int i = 0; i < 4; ++i) AddPoint(0.5 * i, 0.0);
  AddLine(0.0, 0.0, 0.0, {0, 1, 2, 3});
  const std::vector<FeatureId> listed = {points_[0], points_[1]};
  DetectionScope scope;
  scope.features = &listed;
  const PointGraph points(graph_, scope, /*reach=*/0);
  const SupportedCurves curves(graph_, points);
  ASSERT_EQ(curves.size(), 1u);
  EXPECT_FALSE(curves[0].may_go);
}

TEST_F(SupportedCurvesTest, TouchingHaveAPointOrALinkInCommon) {
  for (int i = 0; i < 10; ++i) AddPoint(0.5 * i, 0.0);
  AddLine(0.0, 0.0, 0.0, {0, 1, 2});
  AddLine(0.0, 0.0, 0.0, {3, 4, 5});
  AddLine(0.0, 0.0, 0.0, {5, 6, 7});
  AddLine(0.0, 0.0, 0.0, {9});
  const PointGraph points = Points();
  const SupportedCurves curves(graph_, points);
  EXPECT_THAT(curves.Touching(0), ElementsAre(1u));
  EXPECT_THAT(curves.Touching(1), ElementsAre(0u, 2u));
  EXPECT_THAT(curves.Touching(3), IsEmpty());
}

TEST_F(SupportedCurvesTest, PointThatIsTakenOutLeavesUntilItComesBack) {
  for (int i = 0; i < 5; ++i) AddPoint(0.5 * i, 0.0);
  AddLine(0.0, 0.0, 0.0, {0, 1, 2, 3});
  const PointGraph points = Points();
  SupportedCurves curves(graph_, points);
  curves[0].is_dirty = false;
  curves.TakeOut(0, 2);
  EXPECT_THAT(curves[0].found.support, ElementsAre(0, 1, 3));
  EXPECT_THAT(curves[0].leaving, ElementsAre(2));
  EXPECT_THAT(curves.On(2), IsEmpty());
  EXPECT_TRUE(curves[0].is_dirty);
  // It is tied still: nothing is to be done.
  curves.AddPoint(0, 2);
  EXPECT_THAT(curves[0].leaving, IsEmpty());
  EXPECT_THAT(curves[0].joining, IsEmpty());
  EXPECT_THAT(curves.On(2), ElementsAre(0u));
  // One that was not tied yet is forgotten.
  curves.AddPoint(0, 4);
  curves.TakeOut(0, 4);
  EXPECT_THAT(curves[0].joining, IsEmpty());
  EXPECT_THAT(curves[0].leaving, IsEmpty());
}

TEST_F(SupportedCurvesTest, GapLimitIsThreeTimesTheUsualSpacing) {
  for (const double x : {0.0, 0.5, 1.0, 1.6, 4.0}) AddPoint(x, 0.0);
  AddLine(0.0, 0.0, 0.0, {0, 1, 2, 3, 4});
  const PointGraph points = Points();
  const SupportedCurves curves(graph_, points);
  EXPECT_NEAR(curves.GapLimit(curves[0].found, 0.1), 3.0 * 0.6, 1e-12);
  EXPECT_EQ(curves.GapLimit(curves[0].found, 2.5), 2.5);
}

TEST_F(SupportedCurvesTest, WhatIsLeftMovesUp) {
  for (int i = 0; i < 9; ++i) AddPoint(0.5 * i, 0.0);
  AddLine(0.0, 0.0, 0.0, {0, 1, 2});
  const FeatureId second = AddLine(0.0, 0.0, 0.0, {3, 4, 5});
  const PointGraph points = Points();
  SupportedCurves curves(graph_, points);
  FoundCurve found;
  found.support = {6, 7};
  curves.Add(found);
  ASSERT_EQ(curves.size(), 3u);
  EXPECT_EQ(curves[2].id, kNoId);
  EXPECT_THAT(curves[2].joining, ElementsAre(6, 7));
  curves.AddPoint(2, 8);
  EXPECT_THAT(curves[2].joining, ElementsAre(6, 7, 8));
  EXPECT_THAT(curves.On(8), ElementsAre(2u));
  curves.Remove({true, false, false});
  ASSERT_EQ(curves.size(), 2u);
  EXPECT_EQ(curves[0].id, second);
  EXPECT_THAT(curves.On(0), IsEmpty());
  EXPECT_THAT(curves.On(8), ElementsAre(1u));
}

}  // namespace
}  // namespace plumbline
