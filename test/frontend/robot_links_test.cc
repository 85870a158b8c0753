#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/builtins.h>
#include <plumbline/frontend/robot_links.h>

#include <Eigen/LU>
#include <cmath>
#include <vector>

namespace plumbline {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

class RobotLinksTest : public ::testing::Test {
 protected:
  RobotLinksTest() : robot_(&graph_) { RegisterBuiltinRelations(&registry_); }

  FeatureId AddPoint(double x, double y) {
    Transaction transaction;
    Feature feature;
    feature.type = &registry_.GetFeature("point");
    feature.parameters = {x, y};
    transaction.AddFeature(feature);
    return graph_.Apply(std::move(transaction)).features.front();
  }

  Constraint Distance(FeatureId a, FeatureId b) {
    Constraint constraint;
    constraint.type = &registry_.GetRelation("point_point_distance");
    constraint.features = {a, b};
    constraint.expected = Eigen::VectorXd::Constant(1, 1.0);
    constraint.information = Eigen::MatrixXd::Identity(1, 1);
    return constraint;
  }

  void Bind(FeatureId a, FeatureId b) {
    Transaction transaction;
    transaction.AddConstraint(Distance(a, b));
    graph_.Apply(std::move(transaction));
  }

  static Eigen::Matrix3d Diagonal(double xx, double yy, double tt) {
    return Eigen::Vector3d(xx, yy, tt).asDiagonal();
  }

  // Distance of a point from the robot.
  double Away(const Feature& feature) const {
    return std::hypot(feature.parameters[0] - robot_.pose()[0],
                      feature.parameters[1] - robot_.pose()[1]);
  }

  Registry registry_;
  Graph graph_;
  RobotLinks robot_;
};

TEST_F(RobotLinksTest, MotionMovesThePoseAndWidensEveryLink) {
  const FeatureId a = AddPoint(0.0, 0.0);
  robot_.set_pose(Pose2(1.0, 2.0, 0.5 * kPi));
  robot_.Add(a, Diagonal(0.01, 0.02, 0.1));
  UncertainPose2 motion;
  motion.mean = Pose2(2.0, 0.0, 0.5 * kPi);
  motion.covariance = Diagonal(0.04, 0.09, 0.2);
  robot_.Predict(motion);
  // Two metres ahead, which is along y; then a turn to the left.
  EXPECT_NEAR(robot_.pose()[0], 1.0, 1e-12);
  EXPECT_NEAR(robot_.pose()[1], 4.0, 1e-12);
  EXPECT_NEAR(std::abs(robot_.pose()[2]), kPi, 1e-12);
  // Heading error of 0.1 rad^2 over 2 m moves x by 0.4 m^2; the motion's own
  // axes are turned by a quarter.
  const Eigen::Matrix3d& covariance = robot_.links().at(a);
  EXPECT_NEAR(covariance(0, 0), 0.01 + 4.0 * 0.1 + 0.09, 1e-12);
  EXPECT_NEAR(covariance(1, 1), 0.02 + 0.04, 1e-12);
  EXPECT_NEAR(covariance(2, 2), 0.1 + 0.2, 1e-12);
  EXPECT_NEAR(covariance(0, 2), -2.0 * 0.1, 1e-12);
}

TEST_F(RobotLinksTest, FarLinksAreCutAndTheBestStaysWhenAllAre) {
  const FeatureId near = AddPoint(1.0, 0.0);
  const FeatureId far = AddPoint(20.0, 0.0);
  robot_.Add(near, Diagonal(1.0, 1.0, 1.0));
  robot_.Add(far, Diagonal(0.1, 0.1, 0.1));
  const auto away = [this](const Feature& feature) { return Away(feature); };
  robot_.Cut(10.0, away);
  ASSERT_EQ(robot_.links().size(), 1u);
  EXPECT_EQ(robot_.links().count(near), 1u);

  robot_.Add(far, Diagonal(0.1, 0.1, 0.1));
  robot_.set_pose(Pose2(-50.0, 0.0, 0.0));
  robot_.Cut(10.0, away);
  ASSERT_EQ(robot_.links().size(), 1u);
  EXPECT_EQ(robot_.links().count(far), 1u) << "known best";

  // A feature that is gone cannot be the one that stays.
  Transaction transaction;
  transaction.RemoveFeature(far);
  graph_.Apply(std::move(transaction));
  robot_.Cut(10.0, away);
  EXPECT_THAT(robot_.links(), IsEmpty());
}

TEST_F(RobotLinksTest, CorrectionTightensLinksAndAddsWhatWasSeen) {
  const FeatureId a = AddPoint(0.0, 0.0);
  const FeatureId b = AddPoint(1.0, 0.0);
  const FeatureId c = AddPoint(2.0, 0.0);
  robot_.Add(a, Diagonal(0.5, 0.5, 0.5));
  robot_.Add(b, Diagonal(1.0, 1.0, 1.0));
  EXPECT_EQ(robot_.Widest(), Diagonal(1.0, 1.0, 1.0));
  EXPECT_EQ(robot_.Tightest(), Diagonal(0.5, 0.5, 0.5));
  // Nothing is seen along y.
  robot_.Correct(Pose2(3.0, 0.0, 0.0), Diagonal(1.0, 0.0, 3.0), {b, c});
  EXPECT_EQ(robot_.pose(), Pose2(3.0, 0.0, 0.0));
  EXPECT_TRUE(robot_.links().at(a).isApprox(Diagonal(1.0 / 3.0, 0.5, 0.2)));
  EXPECT_TRUE(robot_.links().at(b).isApprox(Diagonal(0.5, 1.0, 0.25)));
  // From the widest link that there was.
  EXPECT_TRUE(robot_.links().at(c).isApprox(Diagonal(0.5, 1.0, 0.25)));
}

TEST_F(RobotLinksTest, WithoutLinks) {
  EXPECT_EQ(robot_.Widest(), Eigen::Matrix3d(Eigen::Matrix3d::Zero()));
  EXPECT_EQ(robot_.Tightest(), Diagonal(1e6, 1e6, 1e6));
  EXPECT_THAT(robot_.Neighborhood(3), IsEmpty());
  robot_.Cut(1.0, [](const Feature&) { return 0.0; });
  robot_.set_pose(Pose2(1.0, 2.0, 3.0));
  robot_.Read();
  EXPECT_EQ(robot_.pose(), Pose2(1.0, 2.0, 3.0)) << "not in the graph yet";
}

TEST_F(RobotLinksTest, NeighborhoodGoesAlongMeasurements) {
  std::vector<FeatureId> points;
  for (int i = 0; i < 5; ++i) points.push_back(AddPoint(i, 0.0));
  for (int i = 0; i + 1 < 5; ++i) Bind(points[i], points[i + 1]);
  robot_.Add(points[1], Diagonal(1.0, 1.0, 1.0));
  EXPECT_THAT(robot_.Neighborhood(1), ElementsAre(points[1]));
  EXPECT_THAT(robot_.Neighborhood(2),
              ElementsAre(points[0], points[1], points[2]));
  // The robot's own constraints are no shortcut.
  robot_.Write(registry_, "test", [&](FeatureId robot) {
    return std::vector<Constraint>{Distance(points[1], robot),
                                   Distance(points[4], robot)};
  });
  EXPECT_THAT(robot_.Neighborhood(2),
              ElementsAre(points[0], points[1], points[2], robot_.id()));
}

TEST_F(RobotLinksTest, TheRobotIsWrittenOnceAndItsConstraintsReplaced) {
  const FeatureId a = AddPoint(0.0, 0.0);
  robot_.set_pose(Pose2(1.0, 0.0, 0.1));
  const auto constraints = [&](FeatureId robot) {
    return std::vector<Constraint>{Distance(a, robot)};
  };
  robot_.Write(registry_, "test", constraints);
  const FeatureId id = robot_.id();
  ASSERT_NE(graph_.FindFeature(id), nullptr);
  EXPECT_EQ(graph_.GetFeature(id).type->name, "pose");
  EXPECT_EQ(graph_.GetFeature(id).source, "test");
  robot_.set_pose(Pose2(2.0, 0.0, 0.2));
  robot_.Write(registry_, "test", constraints);
  EXPECT_EQ(robot_.id(), id);
  EXPECT_EQ(graph_.num_features(), 2u);
  EXPECT_EQ(graph_.num_constraints(), 1u);
  EXPECT_EQ(graph_.GetFeature(id).parameters[0], 2.0);
  graph_.GetFeature(id).parameters = {5.0, 6.0, 4.0};
  robot_.Read();
  EXPECT_EQ(robot_.pose()[0], 5.0);
  EXPECT_EQ(robot_.pose()[1], 6.0);
  EXPECT_NEAR(robot_.pose()[2], 4.0 - 2.0 * kPi, 1e-12);
}

}  // namespace
}  // namespace plumbline
