#include <ceres/ceres.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/error.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/information.h>
#include <plumbline/core/marginals.h>
#include <plumbline/core/session.h>
#include <plumbline/factors/angle.h>
#include <plumbline/factors/pose_pose.h>

#include <algorithm>
#include <functional>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

using ::testing::HasSubstr;

class MarginalsTest : public ::testing::Test {
 protected:
  MarginalsTest() {
    RegisterBuiltinRelations(&registry_);
    session_ =
        std::make_unique<SolverSession>(&graph_, registry_, SessionOptions());
  }

  FeatureId Add(const std::string& type, const std::vector<double>& parameters,
                bool fixed = false) {
    Feature feature;
    feature.type = &registry_.GetFeature(type);
    feature.fixed = fixed;
    std::copy(parameters.begin(), parameters.end(), feature.parameters.begin());
    Transaction transaction;
    transaction.AddFeature(feature);
    return graph_.Apply(transaction).features[0];
  }

  ConstraintId Connect(const std::string& relation,
                       const std::vector<FeatureId>& features,
                       const Eigen::VectorXd& expected,
                       const Eigen::VectorXd& information,
                       ConstraintClass kind = ConstraintClass::kMeasurement) {
    Constraint constraint;
    constraint.type = &registry_.GetRelation(relation);
    constraint.features = features;
    constraint.expected = expected;
    constraint.information = information.asDiagonal();
    constraint.kind = kind;
    Transaction transaction;
    transaction.AddConstraint(constraint);
    return graph_.Apply(transaction).constraints[0];
  }

  // A way of four poses, each one metre on, with a side view from the first to
  // the last; no loop contradicts itself. Returns the ids.
  std::vector<FeatureId> MakeWay(bool fixed) {
    std::vector<FeatureId> ids;
    Pose2 pose(3.0, -2.0, 0.4);
    const Pose2 step(1.0, 0.2, 0.3);
    Pose2 whole(0.0, 0.0, 0.0);
    for (int i = 0; i < 4; ++i) {
      ids.push_back(Add("pose", {pose[0], pose[1], pose[2]}, fixed && i == 0));
      pose = Compose(pose, step);
      if (i > 0) {
        whole = Compose(whole, step);
        Connect("pose_pose", {ids[i - 1], ids[i]}, step,
                Eigen::Vector3d(100.0, 400.0, 900.0));
      }
    }
    Connect("pose_pose", {ids[0], ids[3]}, whole,
            Eigen::Vector3d(25.0, 25.0, 2500.0));
    return ids;
  }

  std::string Refusal(const std::function<void()>& call) const {
    try {
      call();
    } catch (const Error& error) {
      return error.what();
    }
    return "nothing was refused";
  }

  Registry registry_;
  Graph graph_;
  std::unique_ptr<SolverSession> session_;
};

TEST_F(MarginalsTest, ChainByHand) {
  const FeatureId a = Add("pose", {0.0, 0.0, 0.0}, /*fixed=*/true);
  const FeatureId b = Add("pose", {1.0, 0.0, 0.0});
  const FeatureId c = Add("pose", {2.0, 0.0, 0.0});
  const Eigen::Vector3d step(1.0, 0.0, 0.0);
  const Eigen::Vector3d information(100.0, 25.0, 400.0);
  Connect("pose_pose", {a, b}, step, information);
  Connect("pose_pose", {b, c}, step, information);
  Marginals marginals(graph_, *session_);
  EXPECT_EQ(marginals.Covariance(a), Eigen::MatrixXd::Zero(3, 3));
  Eigen::Matrix3d expected = Eigen::Vector3d(0.01, 0.04, 0.0025).asDiagonal();
  EXPECT_LT((marginals.Covariance(b) - expected).norm(), 1e-12);
  // The heading of b, 0.0025 rad^2, turns the metre from b to c.
  expected << 0.02, 0.0, 0.0,  //
      0.0, 0.0825, 0.0025,     //
      0.0, 0.0025, 0.005;
  EXPECT_LT((marginals.Covariance(c) - expected).norm(), 1e-12);
  expected = Eigen::Vector3d(0.01, 0.04, 0.0025).asDiagonal();
  EXPECT_LT((marginals.RelativeCovariance(b, c) - expected).norm(), 1e-12);
  EXPECT_LT((marginals.RelativeCovariance(a, b) - expected).norm(), 1e-12);
  // Seen from c, which looks away from b, an error of its heading moves b to
  // the other side.
  expected << 0.01, 0.0, 0.0,  //
      0.0, 0.0425, -0.0025,    //
      0.0, -0.0025, 0.0025;
  EXPECT_LT((marginals.RelativeCovariance(c, b) - expected).norm(), 1e-12);
  EXPECT_EQ(marginals.RelativeCovariance(c, c), Eigen::Matrix3d::Zero());
  const Eigen::MatrixXd joint = marginals.JointCovariance({c, b});
  ASSERT_EQ(joint.rows(), 6);
  EXPECT_LT((joint.topLeftCorner(3, 3) - marginals.Covariance(c)).norm(),
            1e-12);
  // Cov(c, b): y and heading of c go with the heading of b.
  expected << 0.01, 0.0, 0.0,  //
      0.0, 0.04, 0.0025,       //
      0.0, 0.0, 0.0025;
  EXPECT_LT((joint.topRightCorner(3, 3) - expected).norm(), 1e-12);
  EXPECT_EQ(joint, Eigen::MatrixXd(joint.transpose()));
  EXPECT_TRUE(marginals.IsDetermined(c));
}

TEST_F(MarginalsTest, AgreesWithCeres) {
  const std::vector<FeatureId> ids = MakeWay(/*fixed=*/true);
  const FeatureId point = Add("point", {4.0, 0.0});
  Connect("point_point_distance", {ids[1], point}, Eigen::VectorXd::Ones(1),
          Eigen::VectorXd::Constant(1, 16.0));
  Connect("point_point_distance", {ids[3], point}, Eigen::VectorXd::Ones(1),
          Eigen::VectorXd::Constant(1, 4.0));
  ceres::Problem problem;
  for (const Constraint* constraint : std::as_const(graph_).Constraints()) {
    RelationArguments arguments;
    arguments.expected = constraint->expected;
    arguments.sqrt_information = SqrtInformation(constraint->information);
    std::vector<double*> blocks;
    for (const FeatureId id : constraint->features) {
      arguments.features.push_back(&graph_.GetFeature(id));
      blocks.push_back(graph_.GetFeature(id).data());
    }
    problem.AddResidualBlock(constraint->type->make_cost(arguments).release(),
                             nullptr, blocks);
  }
  problem.SetParameterBlockConstant(graph_.GetFeature(ids[0]).data());
  ceres::Covariance covariance{ceres::Covariance::Options()};
  const double* last = graph_.GetFeature(ids[3]).data();
  const double* landmark = graph_.GetFeature(point).data();
  ASSERT_TRUE(covariance.Compute(
      {{last, last}, {landmark, landmark}, {last, landmark}}, &problem));
  Eigen::Matrix<double, 3, 3, Eigen::RowMajor> last_block;
  Eigen::Matrix<double, 2, 2, Eigen::RowMajor> landmark_block;
  Eigen::Matrix<double, 3, 2, Eigen::RowMajor> cross_block;
  covariance.GetCovarianceBlock(last, last, last_block.data());
  covariance.GetCovarianceBlock(landmark, landmark, landmark_block.data());
  covariance.GetCovarianceBlock(last, landmark, cross_block.data());

  Marginals marginals(graph_, *session_);
  EXPECT_LT((marginals.Covariance(ids[3]) - last_block).norm(), 1e-10);
  EXPECT_LT((marginals.Covariance(point) - landmark_block).norm(), 1e-10);
  const Eigen::MatrixXd joint = marginals.JointCovariance({ids[3], point});
  EXPECT_LT((joint.topRightCorner(3, 2) - cross_block).norm(), 1e-10);
}

// Many at once and one by one, on a graph with enough loops for fill.
TEST_F(MarginalsTest, AllAtOnce) {
  std::mt19937_64 engine(3);
  const auto draw = [&engine](double low, double high) {
    return low + (high - low) * 0x1p-53 * static_cast<double>(engine() >> 11);
  };
  std::vector<FeatureId> ids;
  std::vector<Pose2> poses;
  for (int i = 0; i < 60; ++i) {
    poses.emplace_back(draw(-9, 9), draw(-9, 9), draw(-kPi, kPi));
    ids.push_back(Add("pose", {poses[i][0], poses[i][1], poses[i][2]}, i == 7));
    for (int k = 0; i > 0 && k < 2; ++k) {
      const int j = k == 0 ? i - 1 : static_cast<int>(draw(0, i));
      if (k == 1 && j == i - 1) continue;
      Connect("pose_pose", {ids[j], ids[i]}, Between(poses[j], poses[i]),
              Eigen::Vector3d(draw(1, 900), draw(1, 900), draw(1, 900)));
    }
  }
  Marginals one_by_one(graph_, *session_);
  Marginals at_once(graph_, *session_);
  at_once.Compute(ids);
  for (const FeatureId id : ids) {
    const Eigen::MatrixXd expected = one_by_one.Covariance(id);
    EXPECT_LT((at_once.Covariance(id) - expected).norm(),
              1e-9 * (1.0 + expected.norm()))
        << id;
  }
}

TEST_F(MarginalsTest, GaugeThatIsNotFixed) {
  const std::vector<FeatureId> ids = MakeWay(/*fixed=*/false);
  Marginals marginals(graph_, *session_);
  const std::string refusal = Refusal([&] { marginals.Covariance(ids[1]); });
  EXPECT_THAT(refusal, HasSubstr("gauge of pose 1 is not fixed"));
  EXPECT_THAT(refusal, HasSubstr("expected a fixed feature (FIX) or a prior"));
  EXPECT_THAT(Refusal([&] {
                marginals.JointCovariance({ids[1], ids[2]});
              }),
              HasSubstr("gauge"));
  EXPECT_THAT(Refusal([&] { marginals.Compute(ids); }), HasSubstr("gauge"));
  EXPECT_THAT(Refusal([&] { marginals.IsDetermined(ids[0]); }),
              HasSubstr("gauge"));
  MarginalsOptions options;
  options.hold_gauge = true;
  Marginals held(graph_, *session_, options);
  EXPECT_EQ(held.Covariance(ids[0]), Eigen::MatrixXd::Zero(3, 3));
  EXPECT_GT(held.Covariance(ids[1])(0, 0), 1e-4);
}

// What is relative does not depend on where the gauge is fixed.
TEST_F(MarginalsTest, RelativeCovarianceWithoutGauge) {
  const std::vector<FeatureId> ids = MakeWay(/*fixed=*/false);
  Marginals free(graph_, *session_);
  for (const FeatureId fixed : ids) {
    for (const FeatureId id : ids) graph_.GetFeature(id).fixed = id == fixed;
    Marginals marginals(graph_, *session_);
    EXPECT_LT((marginals.RelativeCovariance(ids[1], ids[2]) -
               free.RelativeCovariance(ids[1], ids[2]))
                  .norm(),
              1e-12);
    EXPECT_LT((marginals.RelativeCovariance(ids[3], ids[0]) -
               free.RelativeCovariance(ids[3], ids[0]))
                  .norm(),
              1e-12);
    if (fixed == ids[0]) {
      // Seen from what is fixed: turned into its frame, 0.4 rad.
      const Eigen::Matrix3d turn =
          Eigen::AngleAxisd(-0.4, Eigen::Vector3d::UnitZ()).toRotationMatrix();
      EXPECT_LT((free.RelativeCovariance(ids[0], ids[2]) -
                 turn * marginals.Covariance(ids[2]) * turn.transpose())
                    .norm(),
                1e-12);
    }
  }
}

TEST_F(MarginalsTest, TwoParts) {
  const std::vector<FeatureId> first = MakeWay(/*fixed=*/true);
  const std::vector<FeatureId> second = MakeWay(/*fixed=*/false);
  Marginals marginals(graph_, *session_);
  EXPECT_NO_THROW(marginals.Covariance(first[3]));
  EXPECT_THAT(Refusal([&] { marginals.Covariance(second[3]); }),
              HasSubstr("gauge of pose 7"));
  EXPECT_LT((marginals.RelativeCovariance(second[0], second[3]) -
             marginals.RelativeCovariance(first[0], first[3]))
                .norm(),
            1e-12);
  EXPECT_THAT(
      Refusal([&] { marginals.RelativeCovariance(first[0], second[0]); }),
      HasSubstr("nothing connects pose 0 and pose 4"));
  // Two parts that are both fixed are connected by the map; they begin at the
  // same place.
  graph_.GetFeature(second[0]).fixed = true;
  Marginals both(graph_, *session_);
  EXPECT_LT((both.RelativeCovariance(second[0], first[3]) -
             both.RelativeCovariance(first[0], first[3]))
                .norm(),
            1e-12);
}

TEST_F(MarginalsTest, Weights) {
  const FeatureId a = Add("orientation", {0.0}, /*fixed=*/true);
  const FeatureId b = Add("orientation", {0.0});
  const ConstraintId id =
      Connect("orientation_orientation", {a, b}, Eigen::VectorXd::Zero(1),
              Eigen::VectorXd::Constant(1, 100.0), ConstraintClass::kStructure);
  EXPECT_NEAR(Marginals(graph_, *session_).Covariance(b)(0, 0), 0.01, 1e-14);
  graph_.GetConstraint(id).delta = 0.25;
  EXPECT_NEAR(Marginals(graph_, *session_).Covariance(b)(0, 0), 0.04, 1e-14);
  Transaction transaction;
  transaction.BreakConstraint(id);
  graph_.Apply(transaction);
  Marginals marginals(graph_, *session_);
  EXPECT_THAT(Refusal([&] { marginals.Covariance(b); }),
              HasSubstr("orientation 1 has no covariance: expected a live "
                        "constraint on it"));
}

// Collinearity says nothing about the way along the segment.
TEST_F(MarginalsTest, UndeterminedDirection) {
  const FeatureId pose = Add("pose", {1.0, 2.0, 0.5}, /*fixed=*/true);
  const double angle = kPi / 4;
  const FeatureId segment = Add("segment", {3.0, 4.0, angle});
  Connect("pose_segment_collinearity", {pose, segment},
          Eigen::Vector2d(0.0, 0.5 - angle), Eigen::Vector2d(100.0, 400.0));
  Marginals marginals(graph_, *session_);
  const Eigen::MatrixXd covariance = marginals.Covariance(segment);
  EXPECT_FALSE(marginals.IsDetermined(segment));
  const Eigen::Vector3d along(std::sqrt(0.5), std::sqrt(0.5), 0.0);
  const Eigen::Vector3d across(-std::sqrt(0.5), std::sqrt(0.5), 0.0);
  EXPECT_GT(along.dot(covariance * along), 1e7);
  EXPECT_NEAR(covariance(2, 2), 0.0025, 1e-8);
  // The segment lies 2 sqrt(2) m from the pose: across the wall there, the
  // turn of the wall adds (2 sqrt 2)^2 0.0025.
  EXPECT_NEAR(across.dot(covariance * across), 0.01 + 0.02, 1e-6);
  // Another segment tied to it is as well known as before.
  const FeatureId other = Add("segment", {3.0, 5.0, angle});
  Connect("pose_pose", {pose, other},
          Between(Pose2(1.0, 2.0, 0.5), Pose2(3.0, 5.0, angle)),
          Eigen::Vector3d(100.0, 100.0, 400.0));
  Marginals more(graph_, *session_);
  EXPECT_TRUE(more.IsDetermined(other));
  EXPECT_NEAR(more.Covariance(other)(2, 2), 0.0025, 1e-10);
}

TEST_F(MarginalsTest, Scope) {
  const std::vector<FeatureId> ids = MakeWay(/*fixed=*/true);
  Marginals whole(graph_, *session_);
  MarginalsOptions options;
  const std::vector<FeatureId> scope = {ids[2], ids[1], ids[3]};
  options.features = &scope;
  Marginals part(graph_, *session_, options);
  // Without the side view only the two steps are left.
  const Eigen::Matrix3d step =
      Eigen::Vector3d(0.01, 0.0025, 1.0 / 900.0).asDiagonal();
  EXPECT_LT((part.RelativeCovariance(ids[1], ids[2]) - step).norm(), 1e-12);
  EXPECT_GT(part.RelativeCovariance(ids[1], ids[2])(0, 0),
            whole.RelativeCovariance(ids[1], ids[2])(0, 0));
  EXPECT_THAT(Refusal([&] { part.Covariance(ids[2]); }), HasSubstr("gauge"));
  EXPECT_THAT(Refusal([&] { part.RelativeCovariance(ids[0], ids[2]); }),
              HasSubstr("no feature 0: expected a feature of the graph, or of "
                        "the scope"));
}

TEST_F(MarginalsTest, CombinationsOfFeatures) {
  const std::vector<FeatureId> ids = MakeWay(/*fixed=*/false);
  Marginals marginals(graph_, *session_);
  Eigen::MatrixXd turn = Eigen::MatrixXd::Zero(1, 3);
  turn(0, 2) = 1.0;
  // Without a gauge: the difference of two headings does not need one.
  const Eigen::MatrixXd variance =
      marginals.PropagatedCovariance({ids[0], ids[2]}, {-turn, turn});
  ASSERT_EQ(variance.size(), 1);
  EXPECT_NEAR(variance(0, 0),
              marginals.RelativeCovariance(ids[0], ids[2])(2, 2),
              1e-9 * variance(0, 0));
  EXPECT_NEAR(
      marginals.PropagatedCovariance({ids[2], ids[2]}, {turn, -turn})(0, 0),
      0.0, 1e-15);
  const auto refusal = [&](const std::vector<FeatureId>& of,
                           const std::vector<Eigen::MatrixXd>& jacobians) {
    return Refusal([&] { marginals.PropagatedCovariance(of, jacobians); });
  };
  const Eigen::MatrixXd wide = Eigen::MatrixXd::Zero(1, 4);
  const Eigen::MatrixXd tall = Eigen::MatrixXd::Zero(2, 3);
  const char expected[] = "expected one of rows x size for each";
  EXPECT_THAT(refusal({}, {}), HasSubstr(expected));
  EXPECT_THAT(refusal({ids[0]}, {}), HasSubstr(expected));
  EXPECT_THAT(refusal({ids[0]}, {wide}), HasSubstr(expected));
  EXPECT_THAT(refusal({ids[0], ids[1]}, {turn, tall}), HasSubstr(expected));
  EXPECT_THAT(refusal({99}, {turn}), HasSubstr("no feature 99"));
}

TEST_F(MarginalsTest, WhatIsRefused) {
  const std::vector<FeatureId> ids = MakeWay(/*fixed=*/true);
  const FeatureId lonely = Add("point", {0.0, 0.0});
  const FeatureId circle = Add("circle", {0.0, 0.0, 1.0});
  Connect("point_point_distance", {ids[0], circle}, Eigen::VectorXd::Ones(1),
          Eigen::VectorXd::Ones(1));
  Marginals marginals(graph_, *session_);
  EXPECT_THAT(Refusal([&] { marginals.Covariance(99); }),
              HasSubstr("no feature 99"));
  EXPECT_THAT(Refusal([&] { marginals.Covariance(kNoId); }),
              HasSubstr("no feature -1"));
  EXPECT_THAT(Refusal([&] { marginals.Covariance(lonely); }),
              HasSubstr("point 4 has no covariance"));
  EXPECT_THAT(Refusal([&] { marginals.RelativeCovariance(ids[0], circle); }),
              HasSubstr("circle 5 has no relative pose: expected a feature "
                        "with the parameters x, y, theta"));
  EXPECT_EQ(marginals.JointCovariance({}).size(), 0);
  EXPECT_EQ(Marginals(Graph(), *session_).JointCovariance({}).size(), 0);
}

TEST_F(MarginalsTest, LinearizationIsThatOfTheSolve) {
  const FeatureId a = Add("pose", {0.0, 0.0, 0.0});
  const FeatureId b = Add("pose", {2.0, 0.0, 0.0});
  const ConstraintId id =
      Connect("pose_pose", {a, b}, Eigen::Vector3d(1.0, 0.0, 0.0),
              Eigen::Vector3d(4.0, 9.0, 16.0), ConstraintClass::kStructure);
  graph_.GetConstraint(id).delta = 0.25;
  const LinearizedConstraint linearized =
      session_->Linearize(graph_.GetConstraint(id));
  // Half (the root of delta) of 2 times an error of 1 m.
  EXPECT_LT((linearized.residual - Eigen::Vector3d(1.0, 0.0, 0.0)).norm(),
            1e-14);
  ASSERT_EQ(linearized.jacobians.size(), 2u);
  Eigen::Matrix3d expected = Eigen::Vector3d(1.0, 1.5, 2.0).asDiagonal();
  EXPECT_LT((linearized.jacobians[1] - expected).norm(), 1e-14);
  expected = -expected;
  expected(1, 2) = -3.0;  // 1.5 times -2 m
  EXPECT_LT((linearized.jacobians[0] - expected).norm(), 1e-14);
  Transaction transaction;
  transaction.BreakConstraint(id);
  graph_.Apply(transaction);
  EXPECT_THAT(Refusal([&] { session_->Linearize(graph_.GetConstraint(id)); }),
              HasSubstr("constraint 0 is broken"));
}

TEST_F(MarginalsTest, ManyRelativeCovariancesAtOnce) {
  const std::vector<FeatureId> ids = MakeWay(true);
  Marginals one_by_one(graph_, *session_);
  Marginals at_once(graph_);
  const std::vector<Eigen::Matrix3d> covariances =
      at_once.RelativeCovariances(ids[1], {ids[3], ids[0], ids[1]});
  EXPECT_TRUE(covariances[0].isApprox(
      one_by_one.RelativeCovariance(ids[1], ids[3]), 1e-9));
  EXPECT_TRUE(covariances[1].isApprox(
      one_by_one.RelativeCovariance(ids[1], ids[0]), 1e-9));
  EXPECT_EQ(covariances[2], Eigen::Matrix3d::Zero());
  // From the fixed one, and to nothing.
  EXPECT_TRUE(at_once.RelativeCovariances(ids[0], {ids[2]})[0].isApprox(
      one_by_one.RelativeCovariance(ids[0], ids[2]), 1e-9));
  EXPECT_TRUE(at_once.RelativeCovariances(ids[0], {}).empty());
}

TEST_F(MarginalsTest, ManyRelativeCovariancesWithoutGauge) {
  const std::vector<FeatureId> ids = MakeWay(false);
  Marginals marginals(graph_);
  const std::vector<FeatureId> others(15, ids[3]);
  const std::vector<Eigen::Matrix3d> covariances =
      marginals.RelativeCovariances(ids[1], others);
  const Eigen::Matrix3d expected = marginals.RelativeCovariance(ids[1], ids[3]);
  for (const Eigen::Matrix3d& covariance : covariances) {
    EXPECT_TRUE(covariance.isApprox(expected, 1e-9));
  }
  const FeatureId alone = Add("pose", {0.0, 0.0, 0.0});
  EXPECT_THROW(Marginals(graph_).RelativeCovariances(ids[0], {alone}), Error);
}

TEST_F(MarginalsTest, StructureCountsByItsDeltaWithoutASession) {
  const FeatureId a = Add("segment", {0.0, 0.0, 0.0}, true);
  const FeatureId b = Add("segment", {1.0, 0.0, 0.0});
  Connect("pose_pose", {a, b}, Eigen::Vector3d(1.0, 0.0, 0.0),
          Eigen::Vector3d(25.0, 25.0, 25.0));
  const ConstraintId structure = Connect(
      "pose_pose", {a, b}, Eigen::Vector3d(1.0, 0.0, 0.0),
      Eigen::Vector3d(100.0, 100.0, 100.0), ConstraintClass::kStructure);
  graph_.GetConstraint(structure).delta = 0.5;
  // Information 25 + 0.5 * 100.
  EXPECT_NEAR(Marginals(graph_).RelativeCovariance(a, b)(1, 1), 1.0 / 75.0,
              1e-12);
  Transaction transaction;
  transaction.BreakConstraint(structure);
  graph_.Apply(std::move(transaction));
  EXPECT_NEAR(Marginals(graph_).RelativeCovariance(a, b)(1, 1), 0.04, 1e-12);
}

}  // namespace
}  // namespace plumbline
