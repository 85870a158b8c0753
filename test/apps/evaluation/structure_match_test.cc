#include <gtest/gtest.h>
#include <plumbline/apps/evaluation/structure_match.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/transaction.h>
#include <plumbline/factors/angle.h>

#include <cmath>
#include <string>
#include <utility>

namespace plumbline {
namespace {

class StructureMatchTest : public ::testing::Test {
 protected:
  StructureMatchTest() { RegisterBuiltinRelations(&registry_); }

  // A world without noise with its true structure in place.
  SyntheticWorld Solved(const std::string& name) {
    SyntheticOptions options = DefaultSyntheticOptions(name);
    options.position_noise = 0.0;
    options.distance_noise = 0.0;
    SyntheticWorld world = MakeSyntheticWorld(name, options, 1, registry_);
    AddTrueStructure(world.truth, {}, registry_, world.graph.get());
    return world;
  }

  static Feature* First(const std::string& type, Graph* graph) {
    for (Feature* feature : graph->MutableFeatures()) {
      if (feature->is_virtual && feature->type->name == type) return feature;
    }
    return nullptr;
  }

  Registry registry_;
};

TEST_F(StructureMatchTest, TrueStructureMatchesItself) {
  const SyntheticWorld world = Solved("S1");
  const StructureMatch match = MatchStructure(*world.graph, world.truth);
  EXPECT_TRUE(match.is_exact());
  EXPECT_EQ(match.lines.found, 14);
  EXPECT_EQ(match.circles.found, 8);
  EXPECT_EQ(match.centers.found, 4);
  EXPECT_EQ(match.orientations.found, 2);
  EXPECT_EQ(match.all().found, 28);
  EXPECT_EQ(match.supports.found, 572);
  EXPECT_EQ(match.supports.missed, 0);
  EXPECT_EQ(match.supports.wrong, 0);
  // 572 to lines and circles, 14 to orientations, 8 to centres, 1 between the
  // orientations; all without error.
  int structure = 0;
  for (const Constraint* constraint :
       std::as_const(*world.graph).Constraints()) {
    if (constraint->kind == ConstraintClass::kStructure) ++structure;
  }
  EXPECT_EQ(structure, 572 + 14 + 8 + 1);
}

TEST_F(StructureMatchTest, DoesNotDependOnWhereTheMapLies) {
  SyntheticOptions options;
  options.position_noise = 0.0;
  SyntheticWorld world = MakeSyntheticWorld("S1", options, 1, registry_);
  for (Feature* feature : world.graph->MutableFeatures()) {
    const double x = feature->parameters[0];
    const double y = feature->parameters[1];
    feature->parameters[0] = -0.8 * x - 0.6 * y + 40.0;
    feature->parameters[1] = 0.6 * x - 0.8 * y - 90.0;
  }
  AddTrueStructure(world.truth, {}, registry_, world.graph.get());
  EXPECT_TRUE(MatchStructure(*world.graph, world.truth).is_exact());
  // The structure was put where the points are.
  const Feature* line = First("line", world.graph.get());
  EXPECT_GT(line->anchor[0], 0.0);
  EXPECT_LT(line->anchor[1], -60.0);
}

TEST_F(StructureMatchTest, NothingFound) {
  const SyntheticWorld world =
      MakeSyntheticWorld("S1", SyntheticOptions(), 1, registry_);
  const StructureMatch match = MatchStructure(*world.graph, world.truth);
  EXPECT_FALSE(match.is_exact());
  EXPECT_EQ(match.all().found, 0);
  EXPECT_EQ(match.all().missed, 28);
  EXPECT_EQ(match.all().wrong, 0);
  EXPECT_EQ(match.supports.missed, 572);
}

TEST_F(StructureMatchTest, WhatIsOutOfPlaceIsMissedAndFalse) {
  SyntheticWorld world = Solved("S1");
  Graph* graph = world.graph.get();
  First("line", graph)->parameters[0] += 0.7;
  First("circle", graph)->parameters[2] += 0.6;
  First("orientation", graph)->parameters[0] += DegToRad(4.0);
  const StructureMatch match = MatchStructure(*graph, world.truth);
  EXPECT_EQ(match.lines.found, 13);
  EXPECT_EQ(match.lines.missed, 1);
  EXPECT_EQ(match.lines.wrong, 1);
  EXPECT_EQ(match.circles.wrong, 1);
  EXPECT_EQ(match.orientations.wrong, 1);
  EXPECT_EQ(match.centers.wrong, 0);
  // The points on the two of them count as tied to the wrong thing.
  const int points = static_cast<int>(world.truth.lines[0].points.size() +
                                      world.truth.circles[0].points.size());
  EXPECT_EQ(match.supports.wrong, points);
  EXPECT_EQ(match.supports.missed, points);
}

TEST_F(StructureMatchTest, LinesTurnedAroundAndWithinTolerance) {
  SyntheticWorld world = Solved("S1");
  Feature* line = First("line", world.graph.get());
  // The same line, seen from the other side, and 0.5 m off.
  line->parameters[1] = NormalizeAngle(line->parameters[1] + kPi);
  line->parameters[0] = -0.5;
  EXPECT_TRUE(MatchStructure(*world.graph, world.truth).is_exact());
  // A turn of 3 degrees about its middle puts the ends 0.8 m off.
  line->parameters[0] = 0.0;
  line->parameters[1] += DegToRad(3.0);
  EXPECT_EQ(MatchStructure(*world.graph, world.truth).lines.wrong, 1);
}

TEST_F(StructureMatchTest, TheSameTwiceIsFalseOnce) {
  SyntheticWorld world = Solved("S1");
  Feature copy = *First("circle", world.graph.get());
  copy.parameters[0] += 0.1;
  Transaction transaction;
  transaction.AddFeature(copy);
  world.graph->Apply(std::move(transaction));
  const StructureMatch match = MatchStructure(*world.graph, world.truth);
  EXPECT_EQ(match.circles.found, 8);
  EXPECT_EQ(match.circles.missed, 0);
  EXPECT_EQ(match.circles.wrong, 1);
  EXPECT_FALSE(match.is_exact());
}

TEST_F(StructureMatchTest, BrokenConstraintsDoNotCount) {
  SyntheticWorld world = Solved("S4");
  const FeatureId line = First("line", world.graph.get())->id;
  const FeatureId outlier = world.truth.outliers[3];
  EXPECT_EQ(MatchStructure(*world.graph, world.truth).tied_outliers, 0);
  Constraint constraint;
  constraint.type = &registry_.GetRelation("point_line_distance");
  constraint.features = {outlier, line};
  constraint.expected = Eigen::VectorXd::Zero(1);
  constraint.information = Eigen::MatrixXd::Identity(1, 1);
  constraint.kind = ConstraintClass::kStructure;
  Transaction transaction;
  transaction.AddConstraint(constraint);
  const ConstraintId id =
      world.graph->Apply(std::move(transaction)).constraints[0];
  StructureMatch match = MatchStructure(*world.graph, world.truth);
  EXPECT_EQ(match.tied_outliers, 1);
  EXPECT_EQ(match.supports.wrong, 1);
  Transaction breaking;
  breaking.BreakConstraint(id);
  world.graph->Apply(std::move(breaking));
  match = MatchStructure(*world.graph, world.truth);
  EXPECT_EQ(match.tied_outliers, 0);
  EXPECT_EQ(match.supports.wrong, 0);
}

}  // namespace
}  // namespace plumbline
