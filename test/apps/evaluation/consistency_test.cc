#include <gtest/gtest.h>
#include <plumbline/apps/evaluation/consistency.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/registry.h>

#include <cmath>
#include <random>
#include <vector>

namespace plumbline {
namespace {

// A room of four walls whose relations to a first one are measured with the
// noise that they claim, times `factor`.
class ConsistencyTest : public ::testing::Test {
 protected:
  ConsistencyTest() { RegisterBuiltinRelations(&registry_); }

  double MeanRatio(double factor, int trials) {
    double sum = 0.0;
    for (int trial = 0; trial < trials; ++trial) {
      sum += Trial(factor, static_cast<unsigned>(trial)).ratio();
    }
    return sum / trials;
  }

  Consistency Trial(double factor, unsigned seed) {
    std::mt19937 engine(seed);
    std::normal_distribution<double> normal;
    MapTruth truth;
    Graph graph;
    Transaction transaction;
    std::vector<FeatureId> ids;
    std::vector<Pose2> poses;
    constexpr double kSize = 5.0;
    for (int i = 0; i < 4; ++i) {
      const double direction = 0.5 * kPi * i;
      const Pose2 pose(kSize * std::sin(direction),
                       -kSize * std::cos(direction), direction);
      const Eigen::Vector2d along(std::cos(direction), std::sin(direction));
      TruthWall wall;
      wall.id = i;
      wall.begin = pose.head<2>() - kSize * along;
      wall.end = pose.head<2>() + kSize * along;
      truth.walls.push_back(wall);
      Feature feature;
      feature.type = &registry_.GetFeature("segment");
      feature.parameters = {pose[0], pose[1], pose[2]};
      feature.extent_begin = -4.0;
      feature.extent_end = 4.0;
      ids.push_back(transaction.AddFeature(feature));
      poses.push_back(pose);
    }
    constexpr double kSigma[] = {0.02, 0.02, 0.005};
    for (int i = 1; i < 4; ++i) {
      Constraint constraint;
      constraint.type = &registry_.GetRelation("pose_pose");
      constraint.features = std::vector<FeatureId>{ids[0], ids[i]};
      Eigen::Vector3d expected = Between(poses[0], poses[i]);
      for (int row = 0; row < 3; ++row) {
        expected[row] += factor * kSigma[row] * normal(engine);
      }
      constraint.expected = expected;
      constraint.information = Eigen::Vector3d(kSigma[0], kSigma[1], kSigma[2])
                                   .cwiseAbs2()
                                   .cwiseInverse()
                                   .asDiagonal();
      transaction.AddConstraint(std::move(constraint));
    }
    graph.Apply(std::move(transaction));
    SolverSession session(&graph, registry_, SessionOptions());
    EXPECT_TRUE(session.SolveGlobal().usable);
    // The robot is where it is, and its map is turned and moved.
    std::vector<TimedPose> trajectory(2);
    const Pose2 map(3.0, -2.0, 0.7);
    for (int i = 0; i < 2; ++i) {
      trajectory[i].timestamp = i;
      trajectory[i].pose = Pose2(i, 0.0, 0.0);
      TimedPose timed = trajectory[i];
      timed.pose = Compose(map, timed.pose);
      truth.poses.push_back(timed);
    }
    for (TruthWall& wall : truth.walls) {
      wall.begin = TransformPoint(map, wall.begin);
      wall.end = TransformPoint(map, wall.end);
    }
    return EvaluateConsistency(graph, session, truth, trajectory);
  }

  Registry registry_;
};

TEST_F(ConsistencyTest, RatioIsOneWhereCovariancesAreRight) {
  const Consistency one = Trial(1.0, 7);
  EXPECT_EQ(one.walls, 4);
  EXPECT_EQ(one.degrees_of_freedom, 5);
  // Of 200 trials of 5 degrees of freedom: 1 +- 0.045.
  EXPECT_NEAR(MeanRatio(1.0, 200), 1.0, 0.18);
}

TEST_F(ConsistencyTest, RatioTellsCovariancesThatAreTooSmallOrTooWide) {
  EXPECT_NEAR(MeanRatio(2.0, 200), 4.0, 0.8);
  EXPECT_NEAR(MeanRatio(0.5, 200), 0.25, 0.05);
}

TEST_F(ConsistencyTest, APerfectMapHasNoError) {
  const Consistency perfect = Trial(0.0, 1);
  EXPECT_NEAR(perfect.nees, 0.0, 1e-9);
  EXPECT_NEAR(perfect.offset_error, 0.0, 1e-9);
  EXPECT_GT(perfect.offset_sigma, 0.001);
}

}  // namespace
}  // namespace plumbline
