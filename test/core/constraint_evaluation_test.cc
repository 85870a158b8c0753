#include <gtest/gtest.h>
#include <plumbline/core/constraint_evaluation.h>
#include <plumbline/core/error.h>
#include <plumbline/core/information.h>

#include <cmath>
#include <limits>
#include <vector>

#include "core/em_test_util.h"

namespace plumbline {
namespace {

// A wall at 3 degrees that is tied to 0 with a tolerance of half a degree.
class ConstraintEvaluationTest : public WallsTest {
 protected:
  ConstraintEvaluationTest() {
    wall_ = AddSegment(3.0);
    orientation_ = AddOrientation(0.0, {wall_});
    id_ = Between(wall_, orientation_);
  }

  const Constraint& constraint() const { return graph_.GetConstraint(id_); }

  FeatureId wall_ = kNoId;
  FeatureId orientation_ = kNoId;
  ConstraintId id_ = kNoId;
};

TEST_F(ConstraintEvaluationTest, ErrorsAreInUnitsAndWhitenedOnesInTolerances) {
  EXPECT_NEAR(std::abs(ErrorOf(graph_, constraint())[0]), DegToRad(3.0), 1e-12);
  EXPECT_NEAR(
      WhitenedError(constraint(), FeaturesOf(graph_, constraint())).norm(), 6.0,
      1e-9);
  // Between others than those of the graph.
  const Feature turned = Orientation(registry_, DegToRad(2.0));
  EXPECT_NEAR(
      WhitenedError(constraint(), {&graph_.GetFeature(wall_), &turned}).norm(),
      2.0, 1e-9);
}

TEST_F(ConstraintEvaluationTest, TheModelPredictsTheResidual) {
  const auto cost =
      MakeCost(constraint(), SqrtInformation(constraint().information),
               FeaturesOf(graph_, constraint()));
  const LinearizedConstraint model = Linearize(graph_, constraint(), *cost);
  ASSERT_EQ(model.jacobians.size(), 2u);
  EXPECT_EQ(model.jacobians[0].cols(), 3);
  EXPECT_EQ(model.jacobians[1].cols(), 1);
  constexpr double kStep = 1e-3;
  graph_.GetFeature(wall_).parameters[2] += kStep;
  double residual = 0.0;
  ASSERT_TRUE(Evaluate(graph_, constraint(), *cost, &residual));
  EXPECT_NEAR(residual, model.residual[0] + model.jacobians[0](0, 2) * kStep,
              1e-9);
  const LinearizedConstraint half = Weighted(model, 0.5);
  EXPECT_EQ(half.residual[0], 0.5 * model.residual[0]);
  EXPECT_EQ(half.jacobians[1](0, 0), 0.5 * model.jacobians[1](0, 0));
}

TEST_F(ConstraintEvaluationTest, WhatIsNotFiniteIsToldApart) {
  const auto cost =
      MakeCost(constraint(), SqrtInformation(constraint().information),
               FeaturesOf(graph_, constraint()));
  graph_.GetFeature(wall_).parameters[2] =
      std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(Linearize(graph_, constraint(), *cost), Error);
  EXPECT_TRUE(std::isinf(
      WhitenedError(constraint(), FeaturesOf(graph_, constraint()))[0]));
}

}  // namespace
}  // namespace plumbline
