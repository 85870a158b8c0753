#include <gtest/gtest.h>
#include <plumbline/core/solve_schedule.h>

#include <memory>
#include <vector>

#include "core/em_test_util.h"

namespace plumbline {
namespace {

class SolveScheduleTest : public WallsTest {
 protected:
  SolveSchedule& Make() {
    session_ =
        std::make_unique<SolverSession>(&graph_, registry_, SessionOptions());
    schedule_ =
        std::make_unique<SolveSchedule>(&graph_, session_.get(), options_);
    return *schedule_;
  }

  EmOptions options_;
  EmScope whole_;
  std::unique_ptr<SolverSession> session_;
  std::unique_ptr<SolveSchedule> schedule_;
};

TEST_F(SolveScheduleTest, SolvesOnlyWhenSomethingChanged) {
  const FeatureId wall = AddSegment(1.0);
  const FeatureId orientation = AddOrientation(0.0, {wall, AddSegment(-1.0)});
  SolveSchedule& schedule = Make();
  schedule.Optimize(whole_);
  EXPECT_EQ(session_->num_solves(), 1);
  schedule.Optimize(whole_);
  EXPECT_EQ(session_->num_solves(), 1);
  schedule.MarkDirty();
  schedule.Optimize(whole_);
  EXPECT_EQ(session_->num_solves(), 2);
  schedule.OnConstraintChanged(
      graph_.GetConstraint(Between(wall, orientation)));
  schedule.Optimize(whole_);
  EXPECT_EQ(session_->num_solves(), 3);
  EXPECT_TRUE(schedule.is_usable());
  EXPECT_GT(schedule.seconds(), 0.0);
}

TEST_F(SolveScheduleTest, AScopeIsAlwaysSolvedFor) {
  const std::vector<FeatureId> walls = {AddSegment(1.0)};
  SolveSchedule& schedule = Make();
  const EmScope scope = MakeEmScope(graph_, &walls);
  schedule.Optimize(scope);
  schedule.Optimize(scope);
  EXPECT_EQ(session_->num_solves(), 2);
}

TEST_F(SolveScheduleTest, ARunIsCoarseWhenTheToleranceSaysSo) {
  AddSegment(1.0);
  SolveSchedule& fine = Make();
  fine.BeginRun(true);
  EXPECT_FALSE(fine.is_coarse());
  fine.Optimize(whole_);
  EXPECT_FALSE(fine.BeginFinal());
  EXPECT_EQ(fine.cost_tolerance(), 0.0);

  options_.loop_tolerance = 1e-3;
  SolveSchedule& coarse = Make();
  coarse.BeginRun(false);
  EXPECT_FALSE(coarse.is_coarse());
  coarse.BeginRun(true);
  EXPECT_TRUE(coarse.is_coarse());
  EXPECT_EQ(coarse.cost_tolerance(), 2e-3);
  coarse.Optimize(whole_);
  coarse.BeginLoop();
  coarse.Optimize(whole_);
  EXPECT_EQ(session_->num_solves(), 1);
  // The last solve is not left out.
  EXPECT_TRUE(coarse.BeginFinal());
  coarse.Optimize(whole_);
  EXPECT_EQ(session_->num_solves(), 2);
  coarse.EndRun();
  EXPECT_FALSE(coarse.is_coarse());
}

TEST_F(SolveScheduleTest, ACoarseRunSettlesLittleFindsInPlace) {
  options_.loop_tolerance = 1e-3;
  const FeatureId wall = AddSegment(1.0);
  AddSegment(2.0);
  SolveSchedule& schedule = Make();
  schedule.BeginRun(true);
  schedule.Optimize(whole_);
  const FeatureId orientation = AddOrientation(7.0, {wall});
  schedule.OnConstraintChanged(
      graph_.GetConstraint(Between(wall, orientation)));
  const double direction = Direction(wall);
  schedule.OptimizeAfterFinds(whole_, 1, 200);
  // The orientation went to the wall, which stays where it is.
  EXPECT_NEAR(Angle(orientation), 1.0, 1e-6);
  EXPECT_EQ(Direction(wall), direction);
  // More of it is solved for with the rest.
  const int blocks = session_->totals().residual_blocks;
  schedule.OptimizeAfterFinds(whole_, 3, 200);
  EXPECT_EQ(session_->totals().residual_blocks - blocks, 3);
}

TEST_F(SolveScheduleTest, ACoarseRunTellsTheCostThatWasNoted) {
  options_.loop_tolerance = 1e-3;
  const FeatureId wall = AddSegment(1.0);
  AddOrientation(0.0, {wall, AddSegment(-1.0)});
  SolveSchedule& schedule = Make();
  EXPECT_EQ(schedule.Cost(), session_->Cost().total());
  schedule.BeginRun(true);
  schedule.Optimize(whole_);
  schedule.NoteCost();
  const double noted = schedule.Cost();
  EXPECT_EQ(noted, session_->Cost().total());
  graph_.GetFeature(wall).parameters[2] += 0.1;
  EXPECT_EQ(schedule.Cost(), noted);
  schedule.EndRun();
  EXPECT_GT(schedule.Cost(), noted);
}

}  // namespace
}  // namespace plumbline
