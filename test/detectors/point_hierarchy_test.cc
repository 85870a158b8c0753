#include <gtest/gtest.h>
#include <plumbline/core/em.h>
#include <plumbline/core/session.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/detectors/default_hierarchy.h>

#include <map>
#include <set>
#include <string>
#include <utility>

#include "detectors/point_world.h"

namespace plumbline {
namespace {

// Hierarchies over points (core/method.md, Table 1) in the whole loop.
class PointHierarchyTest : public ::testing::Test {
 protected:
  PointHierarchyTest() { RegisterBuiltins(&registry_); }

  // With the options that graphs of points have by default.
  EmReport Run(const std::string& hierarchy, Graph* graph) const {
    SessionOptions session_options;
    // Distances alone take many steps to the end.
    session_options.max_iterations = 200;
    SolverSession session(graph, registry_, session_options);
    EmOptions options;
    options.loop_tolerance = kPointsLoopTolerance;
    options.full_weight_test = true;
    EmOrchestrator em(
        graph, &session, registry_,
        MakeHierarchy(ParseHierarchy(hierarchy), registry_, {"point"}, {}),
        options);
    return em.Run();
  }

  // Virtual features by type and level.
  static std::map<std::pair<std::string, int>, int> Count(const Graph& graph) {
    std::map<std::pair<std::string, int>, int> count;
    for (const Feature* feature : graph.Features()) {
      if (feature->is_virtual) ++count[{feature->type->name, feature->level}];
    }
    return count;
  }

  Registry registry_;
};

// Noise of the main experiment with points: 0.25 m on the first guess, 0.05 m
// on the distances.
TEST_F(PointHierarchyTest, LinesAndCircles) {
  int exact = 0;
  for (int seed = 1; seed <= 4; ++seed) {
    Graph graph;
    PointWorld world(seed);
    world.AddCorridors();
    world.Build(registry_, 0.25, 0.05, 5, &graph);
    const EmReport report =
        Run("line_ransac,circle_ransac/center_cluster,orientation_mixture/"
            "orientation_relation",
            &graph);
    EXPECT_TRUE(report.converged()) << seed;
    const std::map<std::pair<std::string, int>, int> expected = {
        {{"line", 1}, 14},
        {{"circle", 1}, 8},
        {{"orientation", 2}, 2},
        {{"point", 2}, 4}};
    if (Count(graph) == expected) ++exact;
  }
  EXPECT_GE(exact, 3);
}

TEST_F(PointHierarchyTest, LinesOnly) {
  Graph graph;
  PointWorld world(2);
  world.AddCorridors();
  world.Build(registry_, 0.1, 0.02, 5, &graph);
  EXPECT_TRUE(Run("line_ransac/orientation_mixture", &graph).converged());
  // Nothing is made of the circles' points.
  const std::map<std::pair<std::string, int>, int> expected = {
      {{"line", 1}, 14}, {{"orientation", 2}, 2}};
  EXPECT_EQ(Count(graph), expected);
}

// A row of round halls: circles, their centres, the line through those.
TEST_F(PointHierarchyTest, LinesThroughCircleCentres) {
  Graph graph;
  PointWorld world(3);
  for (int i = 0; i < 6; ++i) {
    world.AddCircle(8.0 * i, 2.0 * i, 2.0, 0.5);
    world.AddCircle(8.0 * i, 2.0 * i, 3.0, 0.5);
  }
  // Known positions: nothing else would hold the halls in a row.
  for (const FeatureId id : world.Build(registry_, 0.02, 0.01, 4, &graph)) {
    graph.GetFeature(id).fixed = true;
  }
  Run("circle_ransac/center_cluster/line_ransac/orientation_mixture", &graph);
  const auto count = Count(graph);
  EXPECT_EQ(count.at({"circle", 1}), 12);
  EXPECT_EQ(count.at({"point", 2}), 6);
  ASSERT_EQ(count.count({"line", 3}), 1u);
  EXPECT_EQ(count.at({"line", 3}), 1);
}

// Raw circles, as a front-end for trees or columns would give them.
TEST_F(PointHierarchyTest, CirclesFirst) {
  Graph graph;
  Transaction transaction;
  for (int i = 0; i < 6; ++i) {
    for (const double radius : {0.5, 0.8}) {
      Feature circle;
      circle.type = &registry_.GetFeature("circle");
      circle.parameters = {4.0 * i, 0.05 * (i % 2), radius};
      circle.fixed = true;
      transaction.AddFeature(std::move(circle));
    }
  }
  graph.Apply(std::move(transaction));
  SolverSession session(&graph, registry_, {});
  EmOrchestrator em(&graph, &session, registry_,
                    MakeHierarchy(ParseHierarchy("center_cluster/line_ransac"),
                                  registry_, {"circle"}, {}),
                    {});
  EXPECT_TRUE(em.Run().converged());
  const std::map<std::pair<std::string, int>, int> expected = {
      {{"point", 1}, 6}, {{"line", 2}, 1}};
  EXPECT_EQ(Count(graph), expected);
}

}  // namespace
}  // namespace plumbline
