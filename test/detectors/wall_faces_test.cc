#include <gtest/gtest.h>
#include <plumbline/core/marginals.h>
#include <plumbline/detectors/wall_faces.h>

#include <Eigen/Core>
#include <vector>

#include "detectors/face_world.h"

namespace plumbline {
namespace {

// How well the distance of two faces is known that lie back to back and are
// turned by 2 degrees against each other, m^2; the robot drove from one to the
// other. Far: what is held is 2 km away.
double VarianceOfThickness(bool is_far) {
  FaceWorld world;
  if (is_far) {
    world.AddPose(0.0, -2001.0, 0.0);
    world.AddPose(0.0, -2000.0, 0.0);
  }
  const FeatureId above = world.AddPose(0.0, 1.0, 0.0);
  const FeatureId below = world.AddPose(0.0, -1.0, 0.0);
  const FeatureId upper = world.AddFace(-2.0, 0.0, 2.0, 0.0);
  const FeatureId lower = world.AddFace(2.0, -0.27, -2.0, -0.13);
  world.See(above, upper, 0.01, 0.01);
  world.See(below, lower, 0.01, 0.01);
  const std::vector<WallFace> faces =
      CollectWallFaces(world.graph(), DetectionScope(), 0.0);
  EXPECT_EQ(faces.size(), 2u);
  MarginalsOptions options;
  options.hold_gauge = true;
  Marginals marginals(world.graph(), options);
  const Eigen::MatrixXd covariance = FaceCovariance(
      {}, {&faces[0], &faces[1]}, faces[1].wall.normal(), &marginals);
  const Eigen::RowVector4d thickness(1.0, 0.0, 1.0, 0.0);
  return (thickness * covariance * thickness.transpose())(0, 0);
}

// Where a building lies is known ever less the longer the way to it; what one
// of its walls is like is not.
TEST(FaceCovarianceTest, WhatIsHeldMayBeFarAway) {
  const double near = VarianceOfThickness(false);
  EXPECT_NEAR(VarianceOfThickness(true), near, 1e-3 * near);
}

// A direction that walls share says nothing of where they are.
TEST(CollectWallFacesTest, SharedDirectionsDoNotConnectParts) {
  FaceWorld world;
  std::vector<FeatureId> walls;
  for (const double x : {0.0, 10.0}) {
    world.BeginPart();
    const FeatureId pose = world.AddPose(x, 0.0, 0.0);
    for (const double y : {-1.0, -2.0}) {
      walls.push_back(world.AddFace(x - 2.0, y, x + 2.0, y));
      world.See(pose, walls.back(), 0.01, 0.01);
    }
  }
  Transaction transaction;
  Feature orientation;
  orientation.type = &world.registry().GetFeature("orientation");
  orientation.level = 1;
  const FeatureId shared = transaction.AddFeature(orientation);
  for (const FeatureId wall : walls) {
    transaction.AddConstraint(MakeStructure(
        world.registry().GetRelation("segment_orientation"), {wall, shared},
        Eigen::VectorXd::Zero(1), Eigen::MatrixXd::Identity(1, 1), "test"));
  }
  world.graph().Apply(std::move(transaction));
  const std::vector<WallFace> faces =
      CollectWallFaces(world.graph(), DetectionScope(), 0.0);
  ASSERT_EQ(faces.size(), 4u);
  EXPECT_EQ(faces[0].part, faces[1].part);
  EXPECT_EQ(faces[2].part, faces[3].part);
  EXPECT_NE(faces[0].part, faces[2].part);
}

}  // namespace
}  // namespace plumbline
