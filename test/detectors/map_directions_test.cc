#include <gtest/gtest.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/detectors/map_directions.h>
#include <plumbline/factors/angle.h>
#include <plumbline/factors/pose2.h>

#include <Eigen/Core>
#include <cmath>
#include <random>
#include <vector>

namespace plumbline {
namespace {

// How much the walls at both ends of a straight corridor differ in direction,
// rad, by what was measured on the way from one to the other: 80 m in steps of
// one, with noise of 0.1 degrees and so much drift a step. The map has the
// corridor straight, as a loop that was closed would have it.
double DifferenceOfEnds(double drift) {
  constexpr int kSteps = 80;
  const double sigma = DegToRad(0.1);
  Registry registry;
  RegisterBuiltins(&registry);
  Graph graph;
  Transaction transaction;
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0.0, sigma);
  std::vector<FeatureId> poses;
  for (int k = 0; k <= kSteps; ++k) {
    Feature pose;
    pose.type = &registry.GetFeature("pose");
    pose.fixed = k == 0;
    pose.parameters = {1.0 * k, 0.0, 0.0};
    poses.push_back(transaction.AddFeature(pose));
    if (k == 0) continue;
    const Eigen::Vector3d information(1e4, 1e4, 1.0 / (sigma * sigma));
    transaction.AddConstraint(MakeMeasurement(
        registry.GetRelation("pose_pose"), {poses[k - 1], poses[k]},
        Pose2(1.0, 0.0, noise(random) - drift), information.asDiagonal(),
        "test"));
  }
  std::vector<FeatureId> walls;
  for (const FeatureId pose : {poses.front(), poses.back()}) {
    Feature wall;
    wall.type = &registry.GetFeature("segment");
    wall.parameters = {pose == poses.front() ? 0.0 : 1.0 * kSteps, 1.0, 0.0};
    wall.extent_end = 3.0;
    walls.push_back(transaction.AddFeature(wall));
    transaction.AddConstraint(MakeMeasurement(
        registry.GetRelation("pose_segment_collinearity"), {pose, walls.back()},
        Eigen::Vector2d(-1.0, 0.0),
        Eigen::Vector2d(1e4, 1.0 / (sigma * sigma)).asDiagonal(), "test"));
  }
  const std::vector<FeatureId> ids =
      graph.Apply(std::move(transaction)).features;
  MapDirections map = CollectDirections(graph, nullptr, {});
  EXPECT_TRUE(map.has_sightings);
  map.network.Solve();
  // Features come back in the order in which they were added.
  return NormalizeAxial(map.network.Angle(map.nodes.at(ids[kSteps + 2])) -
                        map.network.Angle(map.nodes.at(ids[kSteps + 1])));
}

TEST(MapDirectionsTest, DriftThatTheMapShowsDoesNotTurnAWall) {
  // Eight degrees by the measurements alone.
  EXPECT_LT(std::abs(DifferenceOfEnds(DegToRad(0.1))), DegToRad(1.0));
  EXPECT_LT(std::abs(DifferenceOfEnds(DegToRad(-0.1))), DegToRad(1.0));
}

TEST(MapDirectionsTest, WithoutDriftMeasurementsStand) {
  // A tenth of the noise of a step is no drift.
  EXPECT_GT(std::abs(DifferenceOfEnds(DegToRad(0.01)) -
                     DifferenceOfEnds(DegToRad(-0.01))),
            DegToRad(1.5));
}

}  // namespace
}  // namespace plumbline
