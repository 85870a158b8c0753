#include <gtest/gtest.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/error.h>
#include <plumbline/core/marginals.h>
#include <plumbline/frontend/joint_adjustment.h>

#include <cmath>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "frontend/synthetic_world.h"

namespace plumbline {
namespace {

using testing::MakeScan;
using testing::Noise;
using testing::WallEnds;

// A room of 10 m by 6 m with a pillar, driven round twice. Every scan is a key
// scan; the refined odometry is the truth with a little drift. In the map the
// walls and poses of the second half are off.
class JointAdjustmentTest : public ::testing::Test {
 protected:
  JointAdjustmentTest() {
    RegisterBuiltinRelations(&registry_);
    world_ = testing::Room(10.0, 6.0);
    for (const WallEnds& wall :
         testing::Moved(testing::Room(0.8, 0.8), Pose2(1.0, 0.3, 0.0))) {
      world_.push_back(wall);
    }
    testing::Laser laser;
    laser.sigma = 0.01;
    Noise noise(11);
    const Pose2 step_drift(0.0005, 0.0, DegToRad(0.01));
    for (int i = 0; i < 120; ++i) {
      const double angle = 2.0 * kPi * i / 60.0;
      truth_.emplace_back(3.2 * std::cos(angle), 1.9 * std::sin(angle),
                          NormalizeAngle(angle + 0.5 * kPi));
      scans_.push_back(MakeScan(world_, truth_.back(), laser, &noise));
      RefinedScan refined;
      KeyScanRecord record;
      record.scan = i;
      if (i > 0) {
        record.motion.mean =
            Compose(Between(truth_[i - 1], truth_[i]), step_drift);
        record.motion.covariance =
            Eigen::Vector3d(1e-4, 1e-4, 1e-5).asDiagonal();
        refined.since_key = record.motion;
      }
      refined.is_key = true;
      refined_.push_back(refined);
      records_.push_back(record);
      keys_.push_back(
          i < 60 ? truth_[i]
                 : Compose(Pose2(0.1, -0.08, DegToRad(1.0)), truth_[i]));
    }
    AddWalls();
  }

  // The four walls of the room, a little off but the first, and one wall that
  // nobody sees, bound to the first.
  void AddWalls() {
    const Pose2 poses[] = {Pose2(0.0, -3.0, 0.0), Pose2(5.0, 0.0, 0.5 * kPi),
                           Pose2(0.0, 3.0, kPi), Pose2(-5.0, 0.0, -0.5 * kPi)};
    Transaction transaction;
    std::vector<FeatureId> ids;
    for (int i = 0; i < 5; ++i) {
      Feature feature;
      feature.type = &registry_.GetFeature("segment");
      Pose2 pose = i < 4 ? poses[i] : Pose2(30.0, -3.0, 0.0);
      if (i > 0 && i < 4) {
        pose = Compose(pose, Pose2(0.3, 0.06, DegToRad(1.0)));
      }
      feature.parameters = {pose[0], pose[1], pose[2]};
      feature.extent_begin = i % 2 == 0 ? -5.0 : -3.0;
      feature.extent_end = -feature.extent_begin;
      feature.fixed = i == 0;
      feature.source = "frontend";
      ids.push_back(transaction.AddFeature(feature));
    }
    Feature robot;
    robot.type = &registry_.GetFeature("pose");
    ids.push_back(transaction.AddFeature(robot));
    for (int i = 1; i < 6; ++i) {
      Constraint constraint;
      constraint.type = &registry_.GetRelation("pose_pose");
      constraint.features = std::vector<FeatureId>{ids[0], ids[i]};
      constraint.expected = Eigen::Vector3d(1.0, 2.0, 3.0);
      if (i == 4) constraint.expected = Eigen::Vector3d(30.0, 0.0, 0.0);
      constraint.information = Eigen::Matrix3d::Identity();
      transaction.AddConstraint(constraint);
    }
    const TransactionResult result = graph_.Apply(std::move(transaction));
    walls_.assign(result.features.begin(), result.features.begin() + 4);
    unseen_ = result.features[4];
    robot_ = result.features[5];
    unseen_link_ = result.constraints[3];
  }

  // These walls, each free to move.
  Transaction FreeWalls(const std::vector<FeatureId>& ids) const {
    Transaction walls;
    for (const FeatureId id : ids) {
      Feature wall = graph_.GetFeature(id);
      wall.fixed = false;
      walls.AddFeature(wall);
    }
    return walls;
  }

  double WorstKey(const std::vector<Pose2>& keys) const {
    double worst = 0.0;
    for (std::size_t i = 0; i < keys.size(); ++i) {
      worst = std::max(worst, testing::PositionError(keys[i], truth_[i]));
    }
    return worst;
  }

  Registry registry_;
  Graph graph_;
  std::vector<WallEnds> world_;
  std::vector<Scan> scans_;
  std::vector<RefinedScan> refined_;
  std::vector<KeyScanRecord> records_;
  std::vector<Pose2> truth_;
  std::vector<Pose2> keys_;
  std::vector<FeatureId> walls_;
  FeatureId unseen_ = kNoId;
  FeatureId robot_ = kNoId;
  ConstraintId unseen_link_ = kNoId;
  JointAdjustmentOptions options_;
};

TEST_F(JointAdjustmentTest, PosesAndWallsComeTrue) {
  SolverSession session(&graph_, registry_, {});
  EXPECT_GT(WorstKey(keys_), 0.1);
  JointAdjustment adjustment(&graph_, &session, registry_, scans_, refined_,
                             records_, keys_, robot_, options_);
  EXPECT_GT(adjustment.num_relations(), 40);
  adjustment.Adjust();
  EXPECT_GT(adjustment.num_votes(), 80);
  const std::vector<Pose2> keys = adjustment.KeyPoses();
  ASSERT_EQ(keys.size(), truth_.size());
  EXPECT_LT(WorstKey(keys), 0.02);
  const double offsets[] = {-3.0, 5.0, 3.0, -5.0};
  for (int i = 0; i < 4; ++i) {
    const Feature& wall = graph_.GetFeature(walls_[i]);
    EXPECT_NEAR(wall.parameters[i % 2 == 0 ? 1 : 0], offsets[i], 0.01) << i;
    EXPECT_NEAR(NormalizeAngle(wall.parameters[2] - 0.5 * kPi * i), 0.0,
                DegToRad(0.15))
        << i;
    // Its place along itself is where it was.
    EXPECT_NEAR(std::hypot(wall.parameters[0], wall.parameters[1]),
                std::hypot(offsets[i], i == 0 ? 0.0 : 0.3), 0.05)
        << i;
  }
}

TEST_F(JointAdjustmentTest,
       NothingIsUncertainOnlyBecauseOfWhereAWallsPositionIs) {
  graph_.GetFeature(walls_[0]).fixed = true;
  SolverSession session(&graph_, registry_, {});
  JointAdjustment adjustment(&graph_, &session, registry_, scans_, refined_,
                             records_, keys_, robot_, options_);
  adjustment.Adjust();
  Marginals marginals(graph_, session);
  // Across the next wall: along the fixed one.
  const Eigen::MatrixXd covariance = marginals.Covariance(walls_[1]);
  EXPECT_LT(std::sqrt(covariance(0, 0)), 0.05);
  EXPECT_GT(std::sqrt(covariance(0, 0)), 0.0005);
}

TEST_F(JointAdjustmentTest, WhatStoodForThePosesGoes) {
  SolverSession session(&graph_, registry_, {});
  const std::size_t features = graph_.num_features();
  JointAdjustment adjustment(&graph_, &session, registry_, scans_, refined_,
                             records_, keys_, robot_, options_);
  EXPECT_EQ(graph_.FindFeature(robot_), nullptr);
  // 120 key scans, every third a place.
  EXPECT_EQ(graph_.num_features(), features - 1 + 40);
  // A wall that no return votes for keeps what binds it.
  EXPECT_NE(graph_.FindConstraint(unseen_link_), nullptr);
  EXPECT_EQ(graph_.ConstraintsOf(unseen_).size(), 1u);
  for (const Constraint* constraint : graph_.Constraints()) {
    if (constraint->id == unseen_link_) continue;
    EXPECT_EQ(constraint->source, "refinement");
  }
  adjustment.Adjust();
  EXPECT_NEAR(graph_.GetFeature(unseen_).parameters[0], 30.0, 1e-3);
}

// Without a map poses are adjusted alone, in the frame of the first; walls that
// come later are bound by the returns on them, and one that nobody saw is not
// taken.
TEST_F(JointAdjustmentTest, PosesFirstThenWalls) {
  Graph graph;
  SolverSession session(&graph, registry_, {});
  JointAdjustment adjustment(&graph, &session, registry_, scans_, refined_,
                             records_, keys_, kNoId, options_);
  EXPECT_EQ(graph.num_features(), 40u);
  adjustment.Adjust();
  EXPECT_EQ(adjustment.num_votes(), 0);
  EXPECT_LT(WorstKey(adjustment.KeyPoses()), 0.02);
  adjustment.MatchAnew();
  adjustment.Adjust();
  EXPECT_LT(WorstKey(adjustment.KeyPoses()), 0.02);
  adjustment.AddWalls(FreeWalls({walls_[0], walls_[1], walls_[2], unseen_}));
  EXPECT_EQ(graph.num_features(), 43u);
  adjustment.Adjust();
  EXPECT_GT(adjustment.num_votes(), 60);
  EXPECT_LT(WorstKey(adjustment.KeyPoses()), 0.02);
  // The first key scan is where it was.
  EXPECT_EQ(adjustment.KeyPoses()[0], keys_[0]);
}

// A wall to which the adjustment leaves no return is held along itself only:
// its place across would mean nothing.
TEST_F(JointAdjustmentTest, AWallThatLosesItsReturnsGoes) {
  Graph graph;
  SolverSession session(&graph, registry_, {});
  JointAdjustment adjustment(&graph, &session, registry_, scans_, refined_,
                             records_, keys_, kNoId, options_);
  adjustment.Adjust();
  adjustment.AddWalls(FreeWalls(walls_));
  std::vector<FeatureId> found;
  for (const Feature* feature : std::as_const(graph).Features()) {
    if (feature->type->Is(FeatureRole::kWall)) found.push_back(feature->id);
  }
  ASSERT_EQ(found.size(), 4u);
  Feature& lost = graph.GetFeature(found[2]);
  lost.parameters[1] += 0.5;
  adjustment.Adjust();
  EXPECT_EQ(graph.FindFeature(found[2]), nullptr);
  for (const int i : {0, 1, 3}) EXPECT_NE(graph.FindFeature(found[i]), nullptr);
}

// Odometry and matches that promise too little are believed as far as they
// agree, within bounds; what few links say is not.
TEST_F(JointAdjustmentTest, VariancesComeFromResiduals) {
  const auto estimate = [&](double scale, JointAdjustmentOptions options) {
    for (std::size_t i = 1; i < records_.size(); ++i) {
      records_[i].motion.covariance =
          scale *
          Eigen::Matrix3d(Eigen::Vector3d(1e-4, 1e-4, 1e-5).asDiagonal());
    }
    Graph graph;
    SolverSession session(&graph, registry_, {});
    JointAdjustment adjustment(&graph, &session, registry_, scans_, refined_,
                               records_, keys_, kNoId, options);
    EXPECT_EQ(adjustment.motion_variance_factor(), 1.0);
    adjustment.Adjust();
    adjustment.MatchAnew();
    adjustment.Adjust();
    // Of the motion between the first two places.
    const auto information = [&graph] {
      return std::as_const(graph).Constraints().front()->information(2, 2);
    };
    const double before = information();
    adjustment.EstimateVariances();
    EXPECT_LT(WorstKey(adjustment.KeyPoses()), 0.02);
    EXPECT_NEAR(information() * adjustment.motion_variance_factor() / before,
                1.0, 1e-9);
    return std::make_pair(adjustment.motion_variance_factor(),
                          adjustment.relation_variance_factor());
  };
  JointAdjustmentOptions open = options_;
  open.min_variance_factor = 1e-6;
  open.max_variance_factor = 1e6;
  const auto [motion, relation] = estimate(1.0, open);
  // The laser's noise is 0.01 m, a return is given 0.03 m.
  EXPECT_LT(relation, 0.3);
  EXPECT_GT(relation, 0.001);
  const auto [wide_motion, wide_relation] = estimate(100.0, open);
  EXPECT_LT(wide_motion, 0.1 * motion);
  EXPECT_NEAR(std::log(wide_relation), std::log(relation), 1.0);
  const auto [bounded_motion, bounded_relation] = estimate(100.0, options_);
  EXPECT_EQ(bounded_motion, options_.min_variance_factor);
  EXPECT_GE(bounded_relation, options_.min_variance_factor);
}

// The same for what returns say of walls.
TEST_F(JointAdjustmentTest, VariancesOfVotesComeFromResiduals) {
  JointAdjustmentOptions options = options_;
  options.min_variance_factor = 1e-6;
  options.max_variance_factor = 1e6;
  const auto estimate = [&](double independence) {
    options.votes.independence = independence;
    Graph graph;
    SolverSession session(&graph, registry_, {});
    JointAdjustment adjustment(&graph, &session, registry_, scans_, refined_,
                               records_, keys_, kNoId, options);
    adjustment.Adjust();
    adjustment.AddWalls(FreeWalls(walls_));
    adjustment.Adjust();
    const auto information = [&graph] {
      for (const Constraint* constraint : std::as_const(graph).Constraints()) {
        if (constraint->type->name == "pose_segment_points") {
          return constraint->information(2, 2);
        }
      }
      return 0.0;
    };
    const double before = information();
    EXPECT_GT(before, 0.0);
    EXPECT_EQ(adjustment.vote_variance_factor(), 1.0);
    adjustment.EstimateVariances();
    EXPECT_NEAR(information() * adjustment.vote_variance_factor() / before, 1.0,
                1e-9);
    // A second time nothing is scaled twice.
    const double factor = adjustment.vote_variance_factor();
    adjustment.EstimateVariances();
    EXPECT_NEAR(std::log(adjustment.vote_variance_factor() / factor), 0.0, 0.7);
    return factor;
  };
  const double factor = estimate(0.5);
  EXPECT_LT(factor, 0.5);
  EXPECT_GT(factor, 1e-4);
  // Votes that count less are found to be better than they say.
  EXPECT_LT(estimate(0.05), 0.5 * factor);
}

// A bound of the factor keeps votes wide in solves; what is reported is as the
// residuals have it, down to a bound of its own.
TEST_F(JointAdjustmentTest, CovariancesAreReportedWithoutTheBoundOfSolves) {
  const auto excess = [&](double least, double least_reported) {
    JointAdjustmentOptions options = options_;
    options.min_variance_factor = least;
    options.min_reported_factor = least_reported;
    Graph graph;
    SolverSession session(&graph, registry_, {});
    JointAdjustment adjustment(&graph, &session, registry_, scans_, refined_,
                               records_, keys_, kNoId, options);
    adjustment.Adjust();
    adjustment.AddWalls(FreeWalls(walls_));
    adjustment.Adjust();
    adjustment.EstimateVariances();
    std::map<ConstraintId, Eigen::MatrixXd> before;
    for (const Constraint* constraint : std::as_const(graph).Constraints()) {
      before[constraint->id] = constraint->information;
    }
    ReportVoteVariances(adjustment.vote_variance_excess(), registry_, &graph);
    for (const Constraint* constraint : std::as_const(graph).Constraints()) {
      const double scale = constraint->type->name == "pose_segment_points"
                               ? adjustment.vote_variance_excess()
                               : 1.0;
      const Eigen::MatrixXd& was = before[constraint->id];
      EXPECT_LE((constraint->information - scale * was).norm(),
                1e-12 * constraint->information.norm());
    }
    return adjustment.vote_variance_excess();
  };
  // The laser is better than votes are given, so that the bounds count.
  EXPECT_DOUBLE_EQ(excess(0.5, 0.25), 2.0);
  EXPECT_EQ(excess(1e-6, 0.25), 1.0);
  EXPECT_GT(excess(0.5, 1e-6), 2.0);
}

// A map that is bent between two places does not keep its bend: scans are
// matched with submaps as odometry has them.
TEST_F(JointAdjustmentTest, ABentStartComesStraight) {
  for (std::size_t i = 30; i < keys_.size(); ++i) {
    keys_[i] = Compose(keys_[30], Compose(Pose2(0.0, 0.0, DegToRad(4.0)),
                                          Between(truth_[30], truth_[i])));
  }
  Graph graph;
  SolverSession session(&graph, registry_, {});
  JointAdjustment adjustment(&graph, &session, registry_, scans_, refined_,
                             records_, keys_, kNoId, options_);
  adjustment.Adjust();
  EXPECT_LT(WorstKey(adjustment.KeyPoses()), 0.03);
}

TEST_F(JointAdjustmentTest, EndsWhenItIsTold) {
  SolverSession session(&graph_, registry_, {});
  std::function<bool()> stop = [] { return false; };
  JointAdjustment adjustment(&graph_, &session, registry_, scans_, refined_,
                             records_, keys_, robot_, options_,
                             [&stop] { return stop(); });
  const std::vector<Pose2> before = adjustment.KeyPoses();
  stop = [] { return true; };
  adjustment.Adjust();
  EXPECT_EQ(adjustment.KeyPoses(), before);
  // It is asked within a solve as well.
  stop = [&] { return session.num_solves() > 0; };
  adjustment.Adjust();
  EXPECT_EQ(session.num_solves(), 1);
  const std::vector<Pose2> after_one = adjustment.KeyPoses();
  EXPECT_LT(WorstKey(after_one), WorstKey(before));
  stop = [] { return false; };
  adjustment.Adjust();
  EXPECT_NE(adjustment.KeyPoses(), after_one);
}

TEST_F(JointAdjustmentTest, WithoutDriftNothingMovesFar) {
  SolverSession session(&graph_, registry_, {});
  for (int i = 0; i < 120; ++i) {
    keys_[i] = truth_[i];
    if (i > 0) records_[i].motion.mean = Between(truth_[i - 1], truth_[i]);
  }
  JointAdjustment adjustment(&graph_, &session, registry_, scans_, refined_,
                             records_, keys_, robot_, options_);
  adjustment.Adjust();
  EXPECT_LT(WorstKey(adjustment.KeyPoses()), 0.01);
}

// What comes again keeps its constraint, whatever it says now: each round would
// take all votes out and put others in, else.
TEST_F(JointAdjustmentTest, VotesAndMatchesThatComeAgainKeepTheirConstraints) {
  SolverSession session(&graph_, registry_, {});
  JointAdjustment adjustment(&graph_, &session, registry_, scans_, refined_,
                             records_, keys_, robot_, options_);
  adjustment.Adjust();
  const auto measurements = [this] {
    std::map<ConstraintId, double> found;
    for (const Constraint* constraint : graph_.Constraints()) {
      found[constraint->id] = constraint->information.trace();
    }
    return found;
  };
  const std::map<ConstraintId, double> before = measurements();
  const std::int64_t votes = adjustment.num_votes();
  // From poses that are a little off.
  for (const FeatureId id : adjustment.places()) {
    Feature& pose = graph_.GetFeature(id);
    if (!pose.fixed) pose.parameters[0] += 0.003 * (id % 3 - 1);
  }
  adjustment.MatchAnew();
  adjustment.Adjust();
  EXPECT_NEAR(static_cast<double>(adjustment.num_votes()),
              static_cast<double>(votes), 0.05 * static_cast<double>(votes));
  std::size_t kept = 0;
  std::size_t changed = 0;
  for (const auto& [id, information] : measurements()) {
    const auto found = before.find(id);
    if (found == before.end()) continue;
    ++kept;
    if (found->second != information) ++changed;
  }
  EXPECT_GT(kept, before.size() * 9 / 10);
  EXPECT_GT(changed, kept / 3);
  EXPECT_LT(WorstKey(adjustment.KeyPoses()), 0.02);
  // As many as there are, each once.
  std::set<std::vector<FeatureId>> pairs;
  std::int64_t num_votes = 0;
  for (const Constraint* constraint : graph_.Constraints()) {
    if (constraint->type->name != "pose_segment_points") continue;
    ++num_votes;
    EXPECT_TRUE(pairs.insert(constraint->features).second);
  }
  EXPECT_EQ(num_votes, adjustment.num_votes());
}

TEST_F(JointAdjustmentTest, SameForAnyNumberOfThreads) {
  std::vector<Pose2> results[2];
  for (int run = 0; run < 2; ++run) {
    options_.num_threads = run == 0 ? 1 : 3;
    if (run == 1) {
      // The same graph again.
      Transaction all;
      for (const Constraint* constraint : graph_.Constraints()) {
        all.RemoveConstraint(constraint->id);
      }
      for (const Feature* feature : graph_.Features()) {
        all.RemoveFeature(feature->id);
      }
      graph_.Apply(std::move(all));
      AddWalls();
    }
    SolverSession session(&graph_, registry_, {});
    JointAdjustment adjustment(&graph_, &session, registry_, scans_, refined_,
                               records_, keys_, robot_, options_);
    adjustment.Adjust();
    results[run] = adjustment.KeyPoses();
  }
  EXPECT_EQ(results[0], results[1]);
}

TEST_F(JointAdjustmentTest, EmptyAndBrokenInput) {
  SolverSession session(&graph_, registry_, {});
  EXPECT_THROW(JointAdjustment(&graph_, &session, registry_, scans_, refined_,
                               records_, {Pose2::Zero()}, robot_, options_),
               Error);
  options_.place_stride = 0;
  EXPECT_THROW(JointAdjustment(&graph_, &session, registry_, scans_, refined_,
                               records_, keys_, robot_, options_),
               Error);
  options_.place_stride = 3;
  Graph empty;
  SolverSession other(&empty, registry_, {});
  // It refers to these for as long as it lives.
  const std::vector<Scan> no_scans;
  const std::vector<RefinedScan> none_refined;
  const std::vector<KeyScanRecord> no_records;
  JointAdjustment nothing(&empty, &other, registry_, no_scans, none_refined,
                          no_records, {}, kNoId, options_);
  nothing.Adjust();
  EXPECT_TRUE(nothing.KeyPoses().empty());
  EXPECT_EQ(empty.num_features(), 0u);
}

}  // namespace
}  // namespace plumbline
