#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/em.h>
#include <plumbline/core/session.h>
#include <plumbline/detectors/builtins.h>

#include <algorithm>
#include <map>
#include <string>
#include <utility>

#include "detectors/hierarchy_worlds.h"

namespace plumbline {
namespace {

using ::testing::IsEmpty;

class HierarchyTest : public ::testing::TestWithParam<HierarchyCase> {
 protected:
  HierarchyTest() { RegisterBuiltins(&registry_); }

  static int CountLive(const Graph& graph, const std::string& relation) {
    int count = 0;
    for (const Constraint* constraint : graph.Constraints()) {
      if (constraint->type->name == relation &&
          constraint->state == ConstraintState::kLive) {
        ++count;
      }
    }
    return count;
  }

  Registry registry_;
};

// Precision and recall 1, whatever the noise.
TEST_P(HierarchyTest, FindsAllAndNothingElse) {
  const HierarchyCase& the_case = GetParam();
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    HierarchyWorld world(registry_, seed);
    the_case.make(&world);
    Graph graph;
    world.Build(&graph);
    SolverSession session(&graph, registry_, {});
    EmOptions options;
    // As plumbline_solve has it.
    options.full_weight_test =
        std::count(the_case.raw.begin(), the_case.raw.end(), "point") > 0;
    EmOrchestrator em(&graph, &session, registry_,
                      MakeHierarchy(ParseHierarchy(the_case.hierarchy),
                                    registry_, the_case.raw, {}),
                      options);
    const EmReport report = em.Run();
    EXPECT_TRUE(report.converged());
    EXPECT_THAT(CompareWithTruth(graph, world.truth()), IsEmpty());
    EXPECT_EQ(CountLive(graph, "orientation_orientation"),
              world.num_relations());
    // Each has its orientation, one that was found above all of them, a wall
    // of a rectangle by it.
    std::map<std::string, int> alone;
    int rectangles = 0;
    for (const Feature* feature : std::as_const(graph).Features()) {
      if (feature->type->name == "rectangle") ++rectangles;
      bool is_on_rectangle = false;
      for (const ConstraintId id : graph.ConstraintsOf(feature->id)) {
        const Constraint& constraint = graph.GetConstraint(id);
        if (constraint.state == ConstraintState::kLive &&
            constraint.type->name == feature->type->name + "_rectangle") {
          is_on_rectangle = true;
        }
      }
      if (!is_on_rectangle) ++alone[feature->type->name];
    }
    EXPECT_EQ(CountLive(graph, "line_orientation"), alone["line"]);
    EXPECT_EQ(CountLive(graph, "segment_orientation"), alone["segment"]);
    EXPECT_EQ(CountLive(graph, "rectangle_orientation"), 2 * rectangles);
  }
}

INSTANTIATE_TEST_SUITE_P(Table1, HierarchyTest,
                         ::testing::ValuesIn(HierarchyCases()),
                         [](const auto& info) { return info.param.name; });

}  // namespace
}  // namespace plumbline
