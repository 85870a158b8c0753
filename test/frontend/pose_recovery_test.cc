#include <gtest/gtest.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/error.h>
#include <plumbline/core/marginals.h>
#include <plumbline/core/session.h>
#include <plumbline/factors/angle.h>
#include <plumbline/frontend/place_chain.h>
#include <plumbline/frontend/pose_recovery.h>

#include <Eigen/LU>
#include <cmath>
#include <memory>
#include <random>
#include <vector>

namespace plumbline {
namespace {

constexpr double kRoom = 5.0;
constexpr int kKeys = 60;
// True errors: of what matches tell (m, m, rad), and of sightings (m, rad).
constexpr double kMatchSigma[] = {0.003, 0.003, 0.001};
constexpr double kSightingSigma[] = {0.004, 0.002};

class PoseRecoveryTest : public ::testing::Test {
 protected:
  PoseRecoveryTest() { RegisterBuiltinRelations(&registry_); }

  // A robot that goes round in a room of four walls and sees all of them from
  // each key scan, in a graph as the front-end leaves it: walls bound to each
  // other, and the robot bound to one. Covariances are stated `claim` times
  // larger in sigma than they are, the drift `drift_claim` times.
  void Simulate(unsigned seed, double claim, double drift_claim = 1.0) {
    std::mt19937 engine(seed);
    std::normal_distribution<double> normal;
    graph_ = std::make_unique<Graph>();
    records_.clear();
    walls_.clear();
    truth_.clear();
    Transaction transaction;
    for (int i = 0; i < 4; ++i) {
      const double direction = 0.5 * kPi * i;
      truth_.emplace_back(kRoom * std::sin(direction),
                          -kRoom * std::cos(direction), direction);
      Feature wall;
      wall.type = &registry_.GetFeature("segment");
      wall.parameters = {truth_[i][0] + 0.01 * normal(engine),
                         truth_[i][1] + 0.01 * normal(engine),
                         truth_[i][2] + 0.005 * normal(engine)};
      wall.extent_begin = -4.0;
      wall.extent_end = 4.0;
      wall.fixed = i == 0;
      walls_.push_back(transaction.AddFeature(std::move(wall)));
    }
    Feature robot;
    robot.type = &registry_.GetFeature("pose");
    robot.parameters = {0.0, 0.0, 0.0};
    const FeatureId provisional = transaction.AddFeature(std::move(robot));
    const RelationType& relation = registry_.GetRelation("pose_pose");
    for (int i = 1; i < 4; ++i) {
      transaction.AddConstraint(MakeMeasurement(
          relation, {walls_[0], walls_[i]}, Between(truth_[0], truth_[i]),
          1e6 * Eigen::Matrix3d::Identity(), "test"));
    }
    transaction.AddConstraint(
        MakeMeasurement(relation, {walls_[0], provisional}, Inverse(truth_[0]),
                        Eigen::Matrix3d::Identity(), "test"));
    walls_ = graph_->Apply(std::move(transaction)).features;
    robot_ = walls_.back();
    walls_.pop_back();

    const MatchDrift drift;
    const Pose2 step(0.3, 0.0, 0.3 / 2.0);
    Pose2 pose = Pose2::Zero();
    for (int k = 0; k < kKeys; ++k) {
      KeyScanRecord record;
      record.scan = 4 * k;
      const double way = step.head<2>().norm();
      const Eigen::Vector3d of_drift(
          drift.translation_per_root_metre * std::sqrt(way),
          drift.translation_per_root_metre * std::sqrt(way),
          std::hypot(drift.rotation_per_root_metre * std::sqrt(way),
                     drift.rotation_per_root_radian * std::sqrt(step[2])));
      record.motion.covariance.setZero();
      record.motion.mean = step;
      for (int row = 0; row < 3; ++row) {
        const double sigma = kMatchSigma[row];
        record.motion.mean[row] +=
            std::hypot(sigma, of_drift[row] / drift_claim) * normal(engine);
        record.motion.covariance(row, row) =
            claim * claim * sigma * sigma + of_drift[row] * of_drift[row];
      }
      if (k > 0) pose = Compose(pose, step);
      for (int i = 0; i < 4; ++i) {
        FeatureMatch match;
        match.feature = walls_[i];
        SegmentObservation& seen = match.observation;
        seen.pose = Between(pose, truth_[i]);
        const double offset = kSightingSigma[0] * normal(engine);
        seen.pose[0] -= offset * std::sin(seen.pose[2]);
        seen.pose[1] += offset * std::cos(seen.pose[2]);
        seen.pose[2] =
            NormalizeAngle(seen.pose[2] + kSightingSigma[1] * normal(engine));
        seen.length = 8.0;
        seen.covariance = claim * claim *
                          Eigen::Vector2d(kSightingSigma[0] * kSightingSigma[0],
                                          kSightingSigma[1] * kSightingSigma[1])
                              .asDiagonal();
        record.matches.push_back(std::move(match));
      }
      record.pose = pose;
      records_.push_back(std::move(record));
    }
  }

  RecoveredPoses Recover(const PoseRecoveryOptions& options) {
    std::vector<Pose2> keys;
    for (const KeyScanRecord& record : records_) keys.push_back(record.pose);
    return RecoverPoses(records_, keys, robot_, options, registry_,
                        graph_.get());
  }

  // Mean of the squared errors of the walls' offsets and directions over their
  // variances, in the frame of the first place.
  double MeanRatio() {
    SolverSession session(graph_.get(), registry_, SessionOptions());
    EXPECT_TRUE(session.SolveGlobal().usable);
    Marginals marginals(*graph_, session, MarginalsOptions());
    double sum = 0.0;
    for (int i = 0; i < 4; ++i) {
      const Feature& wall = graph_->GetFeature(walls_[i]);
      const Pose2 pose(wall.parameters[0], wall.parameters[1],
                       wall.parameters[2]);
      const Eigen::Matrix3d joint = marginals.JointCovariance({walls_[i]});
      const Eigen::Vector3d normal(-std::sin(pose[2]), std::cos(pose[2]), 0.0);
      const Pose2 error = pose - truth_[i];
      const double turn = NormalizeAngle(error[2]);
      sum += normal.dot(error) * normal.dot(error) / normal.dot(joint * normal);
      sum += turn * turn / joint(2, 2);
    }
    return sum / 8.0;
  }

  Registry registry_;
  std::unique_ptr<Graph> graph_;
  std::vector<KeyScanRecord> records_;
  std::vector<FeatureId> walls_;
  std::vector<Pose2> truth_;
  FeatureId robot_ = kNoId;
};

TEST_F(PoseRecoveryTest, CovariancesHoldWhateverWasStated) {
  PoseRecoveryOptions options;
  options.place_stride = 1;
  for (const double claim : {1.0, 5.0}) {
    double sum = 0.0;
    double factor = 0.0;
    constexpr int kTrials = 8;
    for (unsigned trial = 0; trial < kTrials; ++trial) {
      Simulate(trial, claim);
      factor += Recover(options).sighting_variance_factor / kTrials;
      sum += MeanRatio() / kTrials;
    }
    EXPECT_NEAR(factor * claim * claim, 1.0, 0.2) << claim;
    EXPECT_GT(sum, 0.6) << claim;
    EXPECT_LT(sum, 1.5) << claim;
  }
}

// In a building where matching drifts by far less than it may, the map knows.
TEST_F(PoseRecoveryTest, DriftIsEstimated) {
  PoseRecoveryOptions options;
  options.place_stride = 1;
  double ratio = 0.0;
  double way = 0.0;
  double turn = 0.0;
  constexpr int kTrials = 8;
  for (unsigned trial = 0; trial < kTrials; ++trial) {
    Simulate(trial, 1.0, 8.0);
    const RecoveredPoses recovered = Recover(options);
    way += recovered.way_variance_factor / kTrials;
    turn += recovered.turn_variance_factor / kTrials;
    ratio += MeanRatio() / kTrials;
  }
  EXPECT_LT(way, 0.5);
  EXPECT_LT(turn, 0.2);
  EXPECT_GT(ratio, 0.6);
  EXPECT_LT(ratio, 1.5);
}

TEST_F(PoseRecoveryTest, ReplacesWhatStoodForThePoses) {
  Simulate(1, 1.0);
  const RecoveredPoses recovered = Recover(PoseRecoveryOptions());
  EXPECT_EQ(recovered.places.size(), std::size_t{kKeys / 3});
  EXPECT_EQ(graph_->FindFeature(robot_), nullptr);
  EXPECT_TRUE(graph_->GetFeature(recovered.places[0]).fixed);
  for (std::size_t p = 1; p < recovered.places.size(); ++p) {
    EXPECT_FALSE(graph_->GetFeature(recovered.places[p]).fixed);
  }
  for (const FeatureId wall : walls_) {
    EXPECT_FALSE(graph_->GetFeature(wall).fixed);
    for (const ConstraintId id : graph_->ConstraintsOf(wall)) {
      EXPECT_NE(graph_->GetConstraint(id).source, "test");
    }
  }
}

TEST_F(PoseRecoveryTest, AWrongSightingBendsNothing) {
  Simulate(2, 1.0);
  SegmentObservation& seen = records_[30].matches[1].observation;
  seen.pose[2] = NormalizeAngle(seen.pose[2] + 0.1);
  Recover(PoseRecoveryOptions());
  SolverSession session(graph_.get(), registry_, SessionOptions());
  ASSERT_TRUE(session.SolveGlobal().usable);
  for (int i = 0; i < 4; ++i) {
    EXPECT_NEAR(NormalizeAngle(graph_->GetFeature(walls_[i]).parameters[2] -
                               truth_[i][2]),
                0.0, 0.006);
  }
}

TEST_F(PoseRecoveryTest, DoesNothingWithoutSightings) {
  Simulate(3, 1.0);
  for (KeyScanRecord& record : records_) record.matches.clear();
  const std::size_t constraints = graph_->num_constraints();
  EXPECT_TRUE(Recover(PoseRecoveryOptions()).places.empty());
  EXPECT_EQ(graph_->num_constraints(), constraints);
  EXPECT_NE(graph_->FindFeature(robot_), nullptr);
}

TEST_F(PoseRecoveryTest, OnePoseForEachRecord) {
  Simulate(4, 1.0);
  EXPECT_THROW(RecoverPoses(records_, {Pose2::Zero()}, robot_,
                            PoseRecoveryOptions(), registry_, graph_.get()),
               Error);
}

TEST(PlaceChainTest, WhereTheRobotWasLostAPlaceBegins) {
  std::vector<KeyScanRecord> records(8);
  records[4].is_loose = true;
  records[6].from = 1;
  const std::vector<std::size_t> begins = PlaceBegins(records, 3);
  EXPECT_EQ(begins, (std::vector<std::size_t>{0, 3, 4, 6}));
  EXPECT_EQ(ArrivalAt(records, begins, 2).from, 1u);
  EXPECT_EQ(ArrivalAt(records, begins, 2).steps, (std::vector<std::size_t>{4}));
  EXPECT_EQ(ArrivalAt(records, begins, 3).from, 0u);
  EXPECT_EQ(ArrivalAt(records, begins, 3).steps,
            (std::vector<std::size_t>{1, 6}));
  EXPECT_THROW(PlaceBegins(records, 0), Error);
}

}  // namespace
}  // namespace plumbline
