#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/error.h>
#include <plumbline/core/rigid_motion.h>
#include <plumbline/core/session.h>
#include <plumbline/factors/angle.h>

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "core/graph_fixture.h"

namespace plumbline {
namespace {

using Eigen::Vector2d;
using ::testing::HasSubstr;

using RigidMotionTest = GraphFixture;

// Where a feature's points lie after it was moved.
TEST_F(RigidMotionTest, FeaturesMoveAsTheirPointsDo) {
  const Pose2 by(3.0, -2.0, 2.5);
  const Feature segment = Wall({1.0, 2.0}, {4.0, 6.0});
  const Feature moved = Moved(by, segment);
  const Pose2 frame(moved.parameters[0], moved.parameters[1],
                    moved.parameters[2]);
  EXPECT_LT((TransformPoint(frame, {5.0, 0.0}) - TransformPoint(by, {4.0, 6.0}))
                .norm(),
            1e-12);
  EXPECT_EQ(moved.extent_end, segment.extent_end);

  Feature line = Make("line", {0.7, 0.3});
  line.anchor = {5.0, 6.0};
  const Eigen::Vector3d before = line.type->frame(line);
  const Feature moved_line = Moved(by, line);
  const Eigen::Vector3d after = moved_line.type->frame(moved_line);
  EXPECT_LT((TransformPoint(after, {2.0, 0.0}) -
             TransformPoint(by, TransformPoint(before, {2.0, 0.0})))
                .norm(),
            1e-12);

  const Feature circle = Moved(by, Make("circle", {1.0, 2.0, 0.25}));
  EXPECT_LT((Vector2d(circle.parameters[0], circle.parameters[1]) -
             TransformPoint(by, {1.0, 2.0}))
                .norm(),
            1e-12);
  EXPECT_EQ(circle.parameters[2], 0.25);

  const Feature direction = Moved(by, Make("orientation", {0.4}));
  EXPECT_NEAR(NormalizeAngle(direction.parameters[0] - 2.9), 0.0, 1e-12);

  Feature corridor = Make("corridor", {0.5, 0.4, 1.1});
  corridor.anchor = {1.0, -2.0};
  const Feature moved_corridor = Moved(by, corridor);
  EXPECT_LT(
      (TransformPoint(moved_corridor.type->frame(moved_corridor), {3.0, 0.0}) -
       TransformPoint(
           by, TransformPoint(corridor.type->frame(corridor), {3.0, 0.0})))
          .norm(),
      1e-12);
  EXPECT_EQ(moved_corridor.parameters[2], 1.1);

  EXPECT_EQ(Moved(by, Make("thickness", {0.15})).parameters[0], 0.15);

  try {
    Moved(by, Make("end_points", {0.0, 0.0, 1.0, 1.0}));
    FAIL() << "end points were moved";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("end_points cannot be moved"));
  }
}

TEST_F(RigidMotionTest, AMovedGraphCostsTheSame) {
  const FeatureId pose = Add(Make("pose", {0.5, 0.2, 0.3}));
  const FeatureId next = Add(Make("pose", {1.5, 0.4, 0.2}));
  const FeatureId wall = Add(Wall({0.0, 3.0}, {6.0, 3.4}));
  Feature line = Make("line", {0.2, 0.1});
  line.anchor = {2.0, 3.0};
  Add(line);
  const FeatureId direction = Add(Make("orientation", {0.05}));
  const FeatureId point = Add(Make("point", {2.0, 2.0}));
  Tie("pose_pose", {pose, next}, Eigen::Vector3d(1.0, 0.0, 0.0));
  Tie("pose_point", {next, point}, Vector2d(1.0, 1.0));
  Tie("segment_orientation", {wall, direction}, Eigen::VectorXd::Zero(1));
  const std::unique_ptr<Graph> moved = Moved(Pose2(-8.0, 5.0, 1.1), graph_);
  EXPECT_EQ(moved->num_features(), graph_.num_features());
  EXPECT_EQ(moved->feature_id_end(), graph_.feature_id_end());
  SolverSession before(&graph_, registry_, SessionOptions());
  SolverSession after(moved.get(), registry_, SessionOptions());
  EXPECT_GT(before.Cost().total(), 0.01);
  EXPECT_NEAR(after.Cost().total(), before.Cost().total(), 1e-9);

  Tie("pose_prior", {pose}, Eigen::Vector3d(0.0, 0.0, 0.0));
  try {
    Moved(Pose2(-8.0, 5.0, 1.1), graph_);
    FAIL() << "a prior was moved";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("pose_prior ties a feature"));
  }
}

}  // namespace
}  // namespace plumbline
