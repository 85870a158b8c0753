#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/em.h>
#include <plumbline/core/structure_judge.h>

#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include "core/em_test_util.h"

namespace plumbline {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

TEST(BreakWorstTest, ABreakShareSparesTheBetterOnes) {
  const std::vector<Refutation> refutations = {{1, 8.0}, {2, 10.0}, {5, 4.0}};
  const Verdict all = BreakWorst(refutations, 0.0);
  EXPECT_THAT(all.refuted, ElementsAre(1, 2, 5));
  EXPECT_TRUE(all.is_final);
  const Verdict worst = BreakWorst(refutations, 0.75);
  EXPECT_THAT(worst.refuted, ElementsAre(1, 2));
  EXPECT_FALSE(worst.is_final);
  const Verdict none = BreakWorst({}, 0.75);
  EXPECT_THAT(none.refuted, IsEmpty());
  EXPECT_TRUE(none.is_final);
}

TEST(BreakWorstTest, WhatCannotBeEvaluatedIsTheWorst) {
  const double infinity = std::numeric_limits<double>::infinity();
  const Verdict verdict = BreakWorst({{1, 8.0}, {2, infinity}}, 0.5);
  EXPECT_THAT(verdict.refuted, ElementsAre(2));
  EXPECT_FALSE(verdict.is_final);
}

class ResidualJudgeTest : public WallsTest {
 protected:
  // Walls at 0, 0.25 and 2 degrees are tied to 0 with a tolerance of half a
  // degree: they are 0, 0.5 and 4 standard deviations off.
  ResidualJudgeTest() {
    for (const double degrees : {0.0, 0.25, 2.0}) AddSegment(degrees);
    orientation_ = AddOrientation(0.0, segments_);
    session_ =
        std::make_unique<SolverSession>(&graph_, registry_, SessionOptions());
  }

  double DeltaOf(std::size_t i) const {
    return graph_.GetConstraint(Between(segments_[i], orientation_)).delta;
  }

  EmScope whole_;
  FeatureId orientation_ = kNoId;
  std::unique_ptr<SolverSession> session_;
};

TEST_F(ResidualJudgeTest, WeighsByThePValueOfTheResidual) {
  ResidualJudge judge(&graph_, session_.get(), EmOptions());
  EXPECT_EQ(judge.Prepare(whole_), 0.0);
  EXPECT_GT(judge.Weigh(whole_), 0.99);
  EXPECT_EQ(DeltaOf(0), 1.0);
  // erfc(k / sqrt(2)) at k = 0.5 and 4.
  EXPECT_NEAR(DeltaOf(1), 0.61708, 1e-5);
  EXPECT_NEAR(DeltaOf(2), 6.3342e-5, 1e-8);
  EXPECT_EQ(judge.Weigh(whole_), 0.0);
  const Verdict verdict = judge.Judge(whole_);
  EXPECT_THAT(verdict.refuted,
              ElementsAre(Between(segments_[2], orientation_)));
  EXPECT_TRUE(verdict.is_final);
}

TEST_F(ResidualJudgeTest, AThresholdUnderTheFloorHolds) {
  graph_.GetFeature(segments_[2]).parameters[2] = DegToRad(10.0);
  EmOptions options;
  options.delta_threshold = 1e-20;
  ResidualJudge judge(&graph_, session_.get(), options);
  judge.Weigh(whole_);
  EXPECT_EQ(DeltaOf(2), kDeltaFloor);
  EXPECT_THAT(judge.Judge(whole_).refuted,
              ElementsAre(Between(segments_[2], orientation_)));
  graph_.GetFeature(segments_[2]).parameters[2] = DegToRad(4.0);
  judge.Weigh(whole_);
  EXPECT_THAT(judge.Judge(whole_).refuted, IsEmpty());
}

TEST_F(ResidualJudgeTest, AConstraintMayAllowForLess) {
  const ConstraintId tie = Between(segments_[2], orientation_);
  // Its p-value is 6e-5.
  graph_.GetConstraint(tie).break_below = 1e-5;
  ResidualJudge judge(&graph_, session_.get(), EmOptions());
  judge.Weigh(whole_);
  EXPECT_THAT(judge.Judge(whole_).refuted, IsEmpty());
  graph_.GetConstraint(tie).break_below = 1e-4;
  EXPECT_THAT(judge.Judge(whole_).refuted, ElementsAre(tie));
  // What the options let pass passes.
  EmOptions options;
  options.delta_threshold = 1e-5;
  ResidualJudge lenient(&graph_, session_.get(), options);
  EXPECT_THAT(lenient.Judge(whole_).refuted, IsEmpty());
}

TEST_F(ResidualJudgeTest, AFullWeightTestRestoresWeights) {
  EmOptions options;
  options.full_weight_test = true;
  ResidualJudge judge(&graph_, session_.get(), options);
  EXPECT_EQ(judge.Prepare(whole_), 0.0);
  judge.Weigh(whole_);
  EXPECT_GT(judge.Prepare(whole_), 0.99);
  for (std::size_t i = 0; i < segments_.size(); ++i) {
    EXPECT_EQ(DeltaOf(i), 1.0);
  }
}

TEST_F(ResidualJudgeTest, AScopeIsJudgedAlone) {
  const std::vector<FeatureId> walls = {segments_[0]};
  const EmScope scope = MakeEmScope(graph_, &walls);
  // The orientation comes along, with all its walls.
  EXPECT_THAT(scope.variables, ElementsAre(segments_[0], orientation_));
  const FeatureId other = AddSegment(45.0);
  const FeatureId far = AddOrientation(0.0, {other});
  ResidualJudge judge(&graph_, session_.get(), EmOptions());
  judge.Weigh(scope);
  EXPECT_LT(DeltaOf(2), 0.1);
  EXPECT_EQ(graph_.GetConstraint(Between(other, far)).delta, 1.0);
  EXPECT_EQ(judge.Judge(scope).refuted.size(), 1u);
}

// Breaks what is on one wall, whatever its residual.
class PrejudicedJudge final : public StructureJudge {
 public:
  PrejudicedJudge(Graph* graph, FeatureId wall) : graph_(graph), wall_(wall) {}
  double Weigh(const EmScope&) override {
    ++calls_;
    return 0.0;
  }
  Verdict Judge(const EmScope& scope) override {
    Verdict verdict;
    for (const Constraint* constraint : LiveStructure(scope, graph_)) {
      if (constraint->features[0] == wall_) {
        verdict.refuted.push_back(constraint->id);
      }
    }
    // Once more with what is left.
    verdict.is_final = verdict.refuted.empty();
    return verdict;
  }
  int calls() const { return calls_; }

 private:
  Graph* graph_;
  FeatureId wall_;
  int calls_ = 0;
};

TEST_F(ResidualJudgeTest, AnotherJudgeTakesItsPlace) {
  auto judge = std::make_unique<PrejudicedJudge>(&graph_, segments_[0]);
  const PrejudicedJudge& watched = *judge;
  EmOrchestrator em(&graph_, session_.get(), registry_, Hierarchy(),
                    EmOptions(), std::move(judge));
  em.Run();
  EXPECT_EQ(Between(segments_[0], orientation_), kNoId);
  // Four standard deviations off, and nobody minds.
  EXPECT_NE(Between(segments_[2], orientation_), kNoId);
  EXPECT_GE(watched.calls(), 2);
}

}  // namespace
}  // namespace plumbline
