#include <gtest/gtest.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/transaction.h>
#include <plumbline/factors/angle.h>
#include <plumbline/pipeline/glimpsed_walls.h>

#include <utility>
#include <vector>

#include "frontend/synthetic_world.h"

namespace plumbline {
namespace {

// Two rooms 40 m apart, four key scans in either; every second one begins a
// place.
class GlimpsedWallsTest : public ::testing::Test {
 protected:
  GlimpsedWallsTest() {
    RegisterBuiltinRelations(&registry_);
    std::vector<testing::WallEnds> world = testing::Room(6.0, 4.0);
    for (const testing::WallEnds& side :
         testing::Moved(testing::Room(6.0, 4.0), Pose2(40.0, 0.0, 0.0))) {
      world.push_back(side);
    }
    testing::Noise noise(2);
    Transaction transaction;
    for (int i = 0; i < 8; ++i) {
      const Pose2 pose(40.0 * (i / 4) + 0.3 * (i % 4), 0.0, 0.0);
      scans_.push_back(
          testing::MakeScan(world, pose, testing::Laser(), &noise));
      trajectory_.push_back(pose);
      KeyScanRecord record;
      record.scan = i;
      records_.push_back(record);
      if (i % 2 != 0) continue;
      Feature place;
      place.type = &registry_.GetFeature("pose");
      place.parameters = {pose[0], pose[1], pose[2]};
      transaction.AddFeature(place);
    }
    places_ = graph_.Apply(std::move(transaction)).features;
  }

  Feature WallAt(double x, double y) const {
    Feature wall;
    wall.type = &registry_.GetFeature("segment");
    wall.parameters = {x, y, 0.0};
    wall.extent_begin = -1.0;
    wall.extent_end = 1.0;
    wall.source = "test";
    return wall;
  }

  Registry registry_;
  Graph graph_;
  std::vector<Scan> scans_;
  std::vector<Pose2> trajectory_;
  std::vector<KeyScanRecord> records_;
  std::vector<FeatureId> places_;
};

TEST_F(GlimpsedWallsTest, EachIsBoundToAPlaceThatSawIt) {
  Transaction walls;
  walls.AddFeature(WallAt(40.5, -2.0));
  // Nothing stands there.
  walls.AddFeature(WallAt(20.0, 0.0));
  walls.AddFeature(WallAt(0.0, -2.0));
  const Transaction bound =
      BindGlimpsedWalls(walls, graph_, registry_, places_, scans_, records_,
                        trajectory_, 2, WallCompletionOptions());
  ASSERT_EQ(bound.added_features().size(), 2u);
  ASSERT_EQ(bound.added_constraints().size(), 2u);
  for (int w = 0; w < 2; ++w) {
    const Constraint& link = bound.added_constraints()[w];
    ASSERT_EQ(link.features.size(), 2u);
    const Feature& place = graph_.GetFeature(link.features[0]);
    // Of the same room.
    EXPECT_EQ(place.parameters[0] > 20.0, w == 0);
    const Feature& wall = bound.added_features()[w];
    const Pose2 at = Compose(place.type->frame(place), Pose2(link.expected));
    EXPECT_NEAR((at - wall.type->frame(wall)).norm(), 0.0, 1e-12);
    EXPECT_EQ(link.kind, ConstraintClass::kMeasurement);
    EXPECT_EQ(link.source, "test");
  }
  // The graph is as it was.
  EXPECT_EQ(graph_.num_features(), places_.size());
}

}  // namespace
}  // namespace plumbline
