#include <gtest/gtest.h>
#include <plumbline/core/constraint.h>
#include <plumbline/core/error.h>
#include <plumbline/core/graph_json.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/detectors/default_hierarchy.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/pipeline/graph_solver.h>

#include <Eigen/Core>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "detectors/point_world.h"

namespace plumbline {
namespace {

class GraphSolverTest : public ::testing::Test {
 protected:
  GraphSolverTest() { RegisterBuiltins(&registry_); }

  void Build(Graph* graph) const {
    PointWorld world(1);
    world.AddCorridors();
    world.Build(registry_, 0.25, 0.05, 5, graph);
  }

  static std::string Json(const Graph& graph) {
    std::ostringstream output;
    WriteGraphJson(graph, output);
    return output.str();
  }

  static int CountVirtual(const Graph& graph) {
    int count = 0;
    for (const Feature* feature : graph.Features()) {
      if (feature->is_virtual) ++count;
    }
    return count;
  }

  Registry registry_;
};

TEST_F(GraphSolverTest, IsTheLoopWithWhatThePointsAskFor) {
  Graph by_hand;
  Build(&by_hand);
  SolverSession session(&by_hand, registry_, {});
  EmOptions em_options;
  em_options.full_weight_test = true;
  em_options.loop_tolerance = kPointsLoopTolerance;
  EmOrchestrator em(
      &by_hand, &session, registry_,
      MakeHierarchy(
          DefaultHierarchy({&registry_.GetFeature("point")}, registry_),
          registry_, {"point"}, {}),
      em_options);
  const EmReport expected = em.Run();

  Graph graph;
  Build(&graph);
  GraphSolver solver(registry_, {}, &graph);
  EXPECT_GT(solver.initial_cost().total(), 0.0);
  int phases = 0;
  const GraphSolverResult result =
      solver.Run(nullptr, [&phases](const EmPhase&) { ++phases; });
  EXPECT_EQ(Json(graph), Json(by_hand));
  EXPECT_EQ(result.em.iterations, expected.iterations);
  EXPECT_TRUE(result.em.converged());
  EXPECT_EQ(result.initial_cost.total(), solver.initial_cost().total());
  EXPECT_EQ(result.final_cost.total(), session.Cost().total());
  EXPECT_EQ(result.num_solves, session.num_solves());
  EXPECT_EQ(static_cast<int>(result.trace.size()), phases);
  EXPECT_GT(phases, 5);
  EXPECT_GT(CountVirtual(graph), 20);

  // Somebody else's test of weights is another map.
  Graph other;
  Build(&other);
  GraphSolverOptions options;
  options.full_weight_test = false;
  GraphSolver(registry_, options, &other).Run();
  EXPECT_NE(Json(other), Json(graph));
}

TEST_F(GraphSolverTest, WithoutStructure) {
  Graph graph;
  Build(&graph);
  GraphSolverOptions options;
  options.structure = false;
  // Not looked at.
  options.hierarchy = ParseHierarchy("no_such_detector");
  const GraphSolverResult result =
      GraphSolver(registry_, options, &graph).Run();
  EXPECT_EQ(CountVirtual(graph), 0);
  EXPECT_LT(result.final_cost.total(), result.initial_cost.total());
  EXPECT_EQ(result.final_cost.structure, 0.0);
}

// A graph that was solved with structure has it.
TEST_F(GraphSolverTest, WithoutStructureThatOfTheGraphIsLeftOut) {
  Graph measured;
  Build(&measured);
  Graph graph;
  Build(&graph);
  GraphSolver(registry_, {}, &graph).Run();
  // What a measurement names stays, virtual or not.
  Feature center;
  center.type = &registry_.GetFeature("point");
  center.parameters = {1.0, 2.0};
  center.level = 2;
  center.is_virtual = true;
  Transaction transaction;
  transaction.AddConstraint(MakeMeasurement(
      registry_.GetRelation("point_prior"), {transaction.AddFeature(center)},
      Eigen::Vector2d(1.0, 2.0), Eigen::Matrix2d::Identity(), "survey"));
  graph.Apply(std::move(transaction));
  GraphSolverOptions options;
  options.structure = false;
  const GraphSolverResult result =
      GraphSolver(registry_, options, &graph).Run();
  EXPECT_EQ(CountVirtual(graph), 1);
  EXPECT_EQ(graph.num_features(), measured.num_features() + 1);
  EXPECT_EQ(graph.num_constraints(), measured.num_constraints() + 1);
  EXPECT_EQ(result.initial_cost.structure, 0.0);
  EXPECT_EQ(result.final_cost.structure, 0.0);
  const LeftOutStructure again = LeaveOutStructure(&graph);
  EXPECT_EQ(again.constraints, 0);
  EXPECT_EQ(again.features, 0);
}

// Nothing comes or goes, but the last solve was not carried to its end.
TEST_F(GraphSolverTest, HasNotConvergedWhereTheSolverHasNot) {
  for (const char* const minimizer : {"ceres", "resident"}) {
    SCOPED_TRACE(minimizer);
    // Round a square; the last edge says that it is not quite one.
    Graph graph;
    Transaction transaction;
    std::vector<FeatureId> poses;
    for (int i = 0; i < 4; ++i) {
      Feature pose;
      pose.type = &registry_.GetFeature("pose");
      pose.fixed = i == 0;
      poses.push_back(transaction.AddFeature(pose));
    }
    for (std::size_t i = 0; i < 4; ++i) {
      transaction.AddConstraint(MakeMeasurement(
          registry_.GetRelation("pose_pose"), {poses[i], poses[(i + 1) % 4]},
          Pose2(i < 3 ? 1.0 : 1.2, 0.0, 0.5 * kPi), Eigen::Matrix3d::Identity(),
          "test"));
    }
    graph.Apply(std::move(transaction));
    GraphSolverOptions options;
    options.structure = false;
    options.session.minimizer = minimizer;
    options.session.max_iterations = 1;
    const GraphSolverResult few = GraphSolver(registry_, options, &graph).Run();
    EXPECT_FALSE(few.solves.converged);
    EXPECT_EQ(few.em.termination, EmTermination::kNoConvergence);
    options.session.max_iterations = 100;
    const GraphSolverResult more =
        GraphSolver(registry_, options, &graph).Run();
    EXPECT_TRUE(more.solves.converged);
    EXPECT_TRUE(more.em.converged());
  }
}

TEST_F(GraphSolverTest, StopsEarly) {
  Graph graph;
  Build(&graph);
  int asked = 0;
  const GraphSolverResult result =
      GraphSolver(registry_, {}, &graph).Run([&asked] { return ++asked > 3; });
  EXPECT_FALSE(result.em.converged());
  EXPECT_GE(result.trace.size(), 1u);
}

TEST_F(GraphSolverTest, WrongHierarchyIsRefused) {
  Graph graph;
  Build(&graph);
  GraphSolverOptions options;
  options.hierarchy = ParseHierarchy("orientation_mixture");
  EXPECT_THROW(GraphSolver(registry_, options, &graph), Error);
}

}  // namespace
}  // namespace plumbline
