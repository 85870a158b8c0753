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

  // `behind`: there is a face of the same length this far behind that of one
  // wall, m; 0: none. `half`: the wall's own face ends half way. `stray`: the
  // robot was behind the wall, too, where the map is off by as much.
  Consistency Trial(double factor, unsigned seed, double behind = 0.0,
                    bool half = false, bool stray = false) {
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
    if (behind != 0.0) {
      TruthWall back = truth.walls[2];
      const Eigen::Vector2d along = (back.end - back.begin).normalized();
      if (half) truth.walls[2].end = 0.5 * (back.begin + back.end);
      back.begin += behind * Eigen::Vector2d(along.y(), -along.x());
      back.end += behind * Eigen::Vector2d(along.y(), -along.x());
      truth.walls.push_back(back);
    }
    if (stray) {
      trajectory.emplace_back();
      trajectory[2].timestamp = 2.0;
      trajectory[2].pose = Pose2(poses[2][0], poses[2][1], 0.0);
      const Eigen::Vector2d side(std::sin(poses[2][2]), -std::cos(poses[2][2]));
      trajectory[2].pose.head<2>() += 0.5 * side;
      TimedPose timed = trajectory[2];
      timed.pose.head<2>() += behind * side;
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

// A wall of the map that is longer than the face that it is lies as a whole on
// the face behind it only.
TEST_F(ConsistencyTest, TheFaceBehindIsNoOther) {
  for (const double behind : {0.15, -0.15}) {
    const Consistency result = Trial(0.0, 1, behind, true);
    EXPECT_EQ(result.walls, 3);
    EXPECT_NEAR(result.nees, 0.0, 1e-9);
  }
  // Too far away to matter.
  EXPECT_EQ(Trial(0.0, 1, 1.0, true).walls, 3);
}

// What the robot saw of a wall it saw from in front of it.
TEST_F(ConsistencyTest, PosesBehindAWallDoNotTellWhichItIs) {
  const Consistency result = Trial(0.0, 1, 0.15, false, true);
  EXPECT_EQ(result.walls, 4);
  EXPECT_LT(result.nees, 1.0);
}

TEST_F(ConsistencyTest, APerfectMapHasNoError) {
  const Consistency perfect = Trial(0.0, 1);
  EXPECT_NEAR(perfect.nees, 0.0, 1e-9);
  EXPECT_NEAR(perfect.offset_error, 0.0, 1e-9);
  EXPECT_GT(perfect.offset_sigma, 0.001);
}

// Points in a grid that distances with the noise that they claim, times
// `factor`, tie to each other and to nothing else.
double RatioOfPoints(double factor, unsigned seed) {
  Registry registry;
  RegisterBuiltinRelations(&registry);
  std::mt19937 engine(seed);
  std::normal_distribution<double> normal;
  constexpr double kSigma = 0.01;
  constexpr int kSide = 5;
  SyntheticTruth truth;
  Transaction transaction;
  std::vector<FeatureId> ids;
  std::vector<Eigen::Vector2d> positions;
  for (int i = 0; i < kSide * kSide; ++i) {
    Feature point;
    point.type = &registry.GetFeature("point");
    positions.emplace_back(i % kSide, i / kSide);
    // Far from where the truth is.
    point.parameters = {7.0 - positions.back().y(), positions.back().x()};
    ids.push_back(transaction.AddFeature(point));
  }
  for (std::size_t i = 0; i < ids.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const double distance = (positions[i] - positions[j]).norm();
      if (distance > 1.5) continue;
      Constraint constraint;
      constraint.type = &registry.GetRelation("point_point_distance");
      constraint.features = std::vector<FeatureId>{ids[j], ids[i]};
      constraint.expected = Eigen::VectorXd::Constant(
          1, distance + factor * kSigma * normal(engine));
      constraint.information =
          Eigen::MatrixXd::Constant(1, 1, 1.0 / (kSigma * kSigma));
      transaction.AddConstraint(std::move(constraint));
    }
  }
  Graph graph;
  const std::vector<FeatureId> added =
      graph.Apply(std::move(transaction)).features;
  for (std::size_t i = 0; i < added.size(); ++i) {
    const auto id = static_cast<std::size_t>(added[i]);
    if (truth.positions.size() <= id) truth.positions.resize(id + 1);
    truth.positions[id] = positions[i];
  }
  SolverSession session(&graph, registry, SessionOptions());
  EXPECT_TRUE(session.SolveGlobal().usable);
  const Consistency consistency =
      EvaluatePointConsistency(graph, session, truth);
  EXPECT_EQ(consistency.walls, kSide * kSide);
  EXPECT_EQ(consistency.degrees_of_freedom, 2 * kSide * kSide - 3);
  EXPECT_LT(consistency.offset_sigma, 0.05);
  return consistency.ratio();
}

TEST(PointConsistencyTest, RatioIsThatOfTheNoise) {
  double honest = 0.0;
  double twice = 0.0;
  constexpr int kTrials = 20;
  for (unsigned seed = 1; seed <= kTrials; ++seed) {
    honest += RatioOfPoints(1.0, seed) / kTrials;
    twice += RatioOfPoints(2.0, seed) / kTrials;
  }
  // 940 degrees of freedom: standard deviations of 0.05 and 0.18.
  EXPECT_NEAR(honest, 1.0, 0.2);
  EXPECT_NEAR(twice, 4.0, 0.8);
}

}  // namespace
}  // namespace plumbline
