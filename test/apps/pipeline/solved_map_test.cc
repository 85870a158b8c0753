#include <gtest/gtest.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/detector.h>
#include <plumbline/core/graph_json.h>
#include <plumbline/core/transaction.h>
#include <plumbline/factors/angle.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/pipeline/solved_map.h>

#include <cstddef>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

class SolvedMapTest : public ::testing::Test {
 protected:
  SolvedMapTest() : map_(Registered(&registry_), {}, {}) {}

  static const Registry& Registered(Registry* registry) {
    RegisterBuiltinRelations(registry);
    return *registry;
  }

  // A pose and a wall that it has measured elsewhere than it lies, and a wall
  // that is supposed to be the same one but stands at a right angle.
  void AddWalls(SolvedMap* map) const {
    Transaction transaction;
    Feature pose;
    pose.type = &registry_.GetFeature("pose");
    pose.fixed = true;
    const FeatureId robot = transaction.AddFeature(pose);
    std::vector<FeatureId> walls;
    for (const Pose2& at : {Pose2(3.0, 1.0, 0.0), Pose2(5.0, 1.0, 0.5 * kPi)}) {
      Feature wall;
      wall.type = &registry_.GetFeature("segment");
      wall.parameters = {at[0], at[1], at[2]};
      wall.extent_begin = -1.0;
      wall.extent_end = 1.0;
      walls.push_back(transaction.AddFeature(wall));
      transaction.AddConstraint(MakeMeasurement(
          registry_.GetRelation("pose_pose"), {robot, walls.back()},
          at + Pose2(0.2, 0.0, 0.0),
          InformationFromSigmas(Eigen::Vector3d(0.01, 0.01, 0.001)), "test"));
    }
    transaction.AddConstraint(MakeStructure(
        registry_.GetRelation("segment_segment_collinearity"), walls,
        Eigen::Vector2d::Zero(),
        InformationFromSigmas(Eigen::Vector2d(0.01, 0.01)), "test"));
    map->graph().Apply(std::move(transaction));
  }

  static std::string Json(const SolvedMap& map) {
    std::ostringstream text;
    WriteGraphJson(map.graph(), text);
    return text.str();
  }

  Registry registry_;
  SolvedMap map_;
};

TEST_F(SolvedMapTest, CountsOnOverAllThatSolvedIt) {
  AddWalls(&map_);
  map_.em().Run();
  // Not traced yet.
  EXPECT_TRUE(map_.trace().empty());
  const int first = map_.totals().iterations;
  EXPECT_GT(first, 0);
  map_.Renew();
  EXPECT_EQ(map_.totals().iterations, first);
  map_.Trace();
  map_.em().Run();
  ASSERT_FALSE(map_.trace().empty());
  EXPECT_GE(map_.trace().front().iteration, first);
  const int second = map_.totals().iterations;
  EXPECT_GT(second, first);
  const std::size_t phases = map_.trace().size();
  map_.ReplaceEm(Hierarchy(), EmOptions());
  map_.em().Run();
  // Traced from the start.
  EXPECT_GT(map_.trace().size(), phases);
  EXPECT_GE(map_.trace()[phases].iteration, second);
}

TEST_F(SolvedMapTest, WhatIsBrokenIsRememberedUntilItStartsOver) {
  AddWalls(&map_);
  map_.em().Run();
  ASSERT_EQ(map_.breaks().size(), 1u);
  map_.Discard();
  EXPECT_EQ(map_.graph().num_features(), 0u);
  EXPECT_EQ(map_.breaks().size(), 1u);
  map_.StartOver();
  EXPECT_TRUE(map_.breaks().empty());
  // The new graph is listened to as well.
  AddWalls(&map_);
  map_.Renew();
  map_.em().Run();
  EXPECT_EQ(map_.breaks().size(), 1u);
}

TEST_F(SolvedMapTest, AGraphComesBackAsItWas) {
  AddWalls(&map_);
  map_.em().Run();
  const std::string before = Json(map_);
  StateWriter state;
  map_.WriteGraph(&state);
  map_.Clear();
  EXPECT_EQ(map_.graph().num_features(), 0u);
  EXPECT_EQ(map_.graph().num_constraints(), 0u);
  const std::string bytes = state.bytes();
  StateReader reader(bytes);
  map_.RestoreGraph(&reader);
  EXPECT_EQ(Json(map_), before);
  EXPECT_NE(map_.session().Cost().total(), 0.0);
}

TEST_F(SolvedMapTest, AnotherOneGoesOnFromItsState) {
  AddWalls(&map_);
  map_.Trace();
  map_.em().Run();
  // Totals enter the state with the end of a stage.
  map_.Renew();
  StateWriter state;
  map_.ExchangeState(state);
  SolvedMap other(registry_, {}, {});
  const std::string bytes = state.bytes();
  StateReader reader(bytes);
  other.ExchangeState(reader);
  EXPECT_EQ(Json(other), Json(map_));
  EXPECT_EQ(other.trace().size(), map_.trace().size());
  EXPECT_EQ(other.breaks().size(), map_.breaks().size());
  EXPECT_EQ(other.totals().iterations, map_.totals().iterations);
}

}  // namespace
}  // namespace plumbline
