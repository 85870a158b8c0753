#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/error.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/initial_guess.h>
#include <plumbline/core/session.h>
#include <plumbline/factors/angle.h>
#include <plumbline/factors/pose2.h>

#include <cmath>
#include <complex>
#include <random>
#include <string>
#include <vector>

namespace plumbline {
namespace {

using ::testing::HasSubstr;

constexpr InitialGuessMethod kMethods[] = {InitialGuessMethod::kOdometry,
                                           InitialGuessMethod::kSpanningTree,
                                           InitialGuessMethod::kChordal};

class InitialGuessTest : public ::testing::Test {
 protected:
  InitialGuessTest() { RegisterBuiltinRelations(&registry_); }

  FeatureId Add(const std::string& type, const Eigen::VectorXd& parameters,
                bool fixed = false) {
    return Add(&graph_, type, parameters, fixed);
  }
  FeatureId Add(Graph* graph, const std::string& type,
                const Eigen::VectorXd& parameters, bool fixed = false) {
    Feature feature;
    feature.type = &registry_.GetFeature(type);
    feature.fixed = fixed;
    for (int i = 0; i < parameters.size(); ++i) {
      feature.parameters[static_cast<std::size_t>(i)] = parameters[i];
    }
    Transaction transaction;
    transaction.AddFeature(feature);
    return graph->Apply(transaction).features[0];
  }
  FeatureId AddPose(double x, double y, double theta, bool fixed = false) {
    return Add("pose", Pose2(x, y, theta), fixed);
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
  ConstraintId Connect(FeatureId first, FeatureId second, const Pose2& step,
                       double heading_information = 100.0) {
    return Connect("pose_pose", {first, second}, step,
                   Eigen::Vector3d(100.0, 100.0, heading_information));
  }

  Pose2 PoseAt(FeatureId id) const {
    const auto& p = graph_.GetFeature(id).parameters;
    return {p[0], p[1], p[2]};
  }
  void ExpectPose(FeatureId id, double x, double y, double theta,
                  double tolerance = 1e-9) const {
    const Pose2 pose = PoseAt(id);
    EXPECT_NEAR(pose[0], x, tolerance) << id;
    EXPECT_NEAR(pose[1], y, tolerance) << id;
    EXPECT_NEAR(NormalizeAngle(pose[2] - theta), 0.0, tolerance) << id;
  }

  InitialGuessReport Make(InitialGuessMethod method) {
    InitialGuessOptions options;
    options.method = method;
    return MakeInitialGuess(options, &graph_);
  }

  double Cost() { return SolverSession(&graph_, registry_, {}).Cost().total(); }

  Registry registry_;
  Graph graph_;
};

TEST_F(InitialGuessTest, TheFileStays) {
  const FeatureId a = AddPose(1.0, 2.0, 3.0);
  const FeatureId b = AddPose(9.0, 9.0, 0.0);
  Connect(a, b, {1.0, 0.0, 0.0});
  const InitialGuessReport report = Make(InitialGuessMethod::kFile);
  EXPECT_EQ(report.poses, 0);
  ExpectPose(b, 9.0, 9.0, 0.0, 0.0);
}

// A square of 2 m walked round to the left, the way back given from the first
// corner to the last, and one relation that names the later pose first. Nothing
// contradicts, so every start is exact.
TEST_F(InitialGuessTest, ASquareIsExact) {
  for (const InitialGuessMethod method : kMethods) {
    SCOPED_TRACE(static_cast<int>(method));
    const Pose2 step(2.0, 0.0, kPi / 2);
    const FeatureId a = AddPose(1.0, -1.0, 0.0);
    const FeatureId b = AddPose(50.0, 60.0, 3.0);
    const FeatureId c = AddPose(-50.0, 60.0, 2.0);
    const FeatureId d = AddPose(50.0, -60.0, 1.0);
    Connect(a, b, step);
    Connect(c, b, Inverse(step));
    Connect(c, d, step);
    Connect(d, a, step);
    const InitialGuessReport report = Make(method);
    ExpectPose(a, 1.0, -1.0, 0.0, 0.0);
    ExpectPose(b, 3.0, -1.0, kPi / 2);
    ExpectPose(c, 3.0, 1.0, kPi);
    ExpectPose(d, 1.0, 1.0, -kPi / 2);
    // The first pose stays and is counted as placed.
    EXPECT_GE(report.poses, 4);
  }
}

// 0 -> 1 -> 2 along x, and 0 -> 2 better known and a metre to the left.
TEST_F(InitialGuessTest, WaysThatMethodsTake) {
  const auto make = [&] {
    const FeatureId a = AddPose(0.0, 0.0, 0.0);
    const FeatureId b = AddPose(0.0, 0.0, 0.0);
    const FeatureId c = AddPose(0.0, 0.0, 0.0);
    Connect(a, b, {1.0, 0.0, 0.0}, 100.0);
    Connect(b, c, {1.0, 0.0, 0.0}, 100.0);
    Connect(a, c, {2.0, 1.0, 0.0}, 51.0);
    return std::vector<FeatureId>{a, b, c};
  };
  std::vector<FeatureId> ids = make();
  Make(InitialGuessMethod::kOdometry);
  ExpectPose(ids[1], 1.0, 0.0, 0.0);
  ExpectPose(ids[2], 2.0, 0.0, 0.0);
  // Variances of 1/100 + 1/100 against 1/51.
  Make(InitialGuessMethod::kSpanningTree);
  ExpectPose(ids[1], 1.0, 0.0, 0.0);
  ExpectPose(ids[2], 2.0, 1.0, 0.0);
  // With 1/49 the way over b is the better one.
  graph_.UpdateConstraint(
      2, Eigen::Vector3d(2.0, 1.0, 0.0),
      Eigen::Vector3d(100.0, 100.0, 49.0).asDiagonal().toDenseMatrix());
  Make(InitialGuessMethod::kSpanningTree);
  ExpectPose(ids[2], 2.0, 0.0, 0.0);
  // Positions by least squares, all headings zero: with b in the middle of a
  // and c, the chain of two pulls c with half the weight of the direct one:
  // y = 2/3.
  Make(InitialGuessMethod::kChordal);
  ExpectPose(ids[1], 1.0, 1.0 / 3.0, 0.0);
  ExpectPose(ids[2], 2.0, 2.0 / 3.0, 0.0);
}

// Where no relation binds neighbours, odometry goes over the shortest span.
TEST_F(InitialGuessTest, OdometryWithAHole) {
  std::vector<FeatureId> ids;
  for (int i = 0; i < 4; ++i) ids.push_back(AddPose(0.0, 0.0, 0.0));
  Connect(ids[0], ids[1], {1.0, 0.0, 0.0});
  Connect(ids[2], ids[3], {1.0, 0.0, 0.0});
  Connect(ids[0], ids[3], {9.0, 9.0, 0.0});
  Connect(ids[1], ids[3], {2.0, 0.0, 0.0});
  Make(InitialGuessMethod::kOdometry);
  ExpectPose(ids[3], 3.0, 0.0, 0.0);
  ExpectPose(ids[2], 2.0, 0.0, 0.0);
}

TEST_F(InitialGuessTest, HeadingsOfARingByHand) {
  // Three poses on one spot; each is told to be turned by 0.1 rad from the one
  // before, round the ring: 0.3 rad too much. By symmetry the relaxed headings
  // share it: differences of 0.
  std::vector<FeatureId> ids;
  for (int i = 0; i < 3; ++i) ids.push_back(AddPose(0.0, 0.0, 1.0));
  for (int i = 0; i < 3; ++i) {
    Connect(ids[i], ids[(i + 1) % 3], {0.0, 0.0, 0.1});
  }
  Make(InitialGuessMethod::kOdometry);
  ExpectPose(ids[2], 0.0, 0.0, 1.2);
  Make(InitialGuessMethod::kChordal);
  // With z_0 = 1, u = exp(0.1 i): 2 z_1 = u + conj(u) z_2 and 2 z_2 = u z_1 +
  // conj(u), so z_1 = (2 u + conj(u)^2) / 3 and z_2 its conjugate.
  const std::complex<double> u = std::polar(1.0, 0.1);
  const std::complex<double> z = (2.0 * u + std::conj(u * u)) / 3.0;
  ExpectPose(ids[1], 0.0, 0.0, 1.0 + std::arg(z));
  ExpectPose(ids[2], 0.0, 0.0, 1.0 - std::arg(z));
}

TEST_F(InitialGuessTest, FixedPosesHold) {
  for (const InitialGuessMethod method : kMethods) {
    SCOPED_TRACE(static_cast<int>(method));
    const FeatureId a = AddPose(7.0, 7.0, 1.0);
    const FeatureId b = AddPose(5.0, 0.0, kPi / 2, /*fixed=*/true);
    const FeatureId c = AddPose(7.0, 7.0, 1.0);
    Connect(a, b, {1.0, 0.0, 0.0});
    Connect(b, c, {1.0, 0.0, 0.0});
    Make(method);
    ExpectPose(a, 5.0, -1.0, kPi / 2);
    ExpectPose(b, 5.0, 0.0, kPi / 2, 0.0);
    ExpectPose(c, 5.0, 1.0, kPi / 2);
  }
}

TEST_F(InitialGuessTest, PriorsPlaceTheirPart) {
  for (const InitialGuessMethod method : kMethods) {
    SCOPED_TRACE(static_cast<int>(method));
    const FeatureId a = AddPose(7.0, 7.0, 1.0);
    const FeatureId b = AddPose(8.0, 8.0, 2.0);
    Connect(a, b, {1.0, 0.0, 0.0});
    Connect("pose_prior", {b}, Pose2(5.0, 0.0, kPi / 2),
            Eigen::Vector3d(1.0, 2.0, 3.0));
    Make(method);
    ExpectPose(a, 5.0, -1.0, kPi / 2);
    ExpectPose(b, 5.0, 0.0, kPi / 2);
  }
}

// A relaxed start weighs a prior against the rest.
TEST_F(InitialGuessTest, TwoPriorsAreWeighed) {
  const FeatureId a = AddPose(7.0, 7.0, 1.0);
  for (const double x : {0.0, 3.0}) {
    Connect("pose_prior", {a}, Pose2(x, 0.0, 0.0),
            Eigen::Vector3d(x == 0.0 ? 2.0 : 1.0, 1.0, 1.0));
  }
  Make(InitialGuessMethod::kOdometry);
  ExpectPose(a, 0.0, 0.0, 0.0);
  Make(InitialGuessMethod::kChordal);
  ExpectPose(a, 1.0, 0.0, 0.0);
}

TEST_F(InitialGuessTest, PartsByThemselves) {
  for (const InitialGuessMethod method : kMethods) {
    SCOPED_TRACE(static_cast<int>(method));
    const FeatureId a = AddPose(0.0, 0.0, 0.0);
    const FeatureId b = AddPose(9.0, 9.0, 0.0);
    const FeatureId c = AddPose(0.0, 5.0, kPi / 2);
    const FeatureId d = AddPose(9.0, 9.0, 0.0);
    const FeatureId alone = AddPose(-3.0, -4.0, 0.5);
    Connect(a, b, {1.0, 0.0, 0.0});
    Connect(d, c, {1.0, 0.0, 0.0});
    const int parts_before = static_cast<int>(graph_.num_features()) / 5 - 1;
    const InitialGuessReport report = Make(method);
    EXPECT_EQ(report.parts, 2 * (parts_before + 1));
    EXPECT_EQ(report.kept, parts_before + 1);
    ExpectPose(b, 1.0, 0.0, 0.0);
    ExpectPose(c, 0.0, 5.0, kPi / 2, 0.0);
    ExpectPose(d, 0.0, 4.0, kPi / 2);
    ExpectPose(alone, -3.0, -4.0, 0.5, 0.0);
  }
}

TEST_F(InitialGuessTest, Landmarks) {
  for (const InitialGuessMethod method : kMethods) {
    SCOPED_TRACE(static_cast<int>(method));
    const FeatureId a = AddPose(0.0, 0.0, 0.0, /*fixed=*/true);
    const FeatureId b = AddPose(9.0, 9.0, 0.0);
    const FeatureId tree = Add("point", Eigen::Vector2d(-7.0, -7.0));
    const FeatureId known = Add("point", Eigen::Vector2d(1.0, 2.0), true);
    const FeatureId line = Add("line", Eigen::Vector2d(7.0, 7.0));
    const FeatureId ends =
        Add("end_points", Eigen::Vector4d(7.0, 7.0, 8.0, 8.0));
    const FeatureId far = Add("point", Eigen::Vector2d(-5.0, 6.0));
    Connect(a, b, {2.0, 0.0, kPi / 2});
    Connect("pose_point", {a, tree}, Eigen::Vector2d(3.0, 1.0),
            Eigen::Vector2d(4.0, 4.0));
    // Seen half a metre farther to the right; the same weight.
    Connect("pose_point", {b, tree}, Eigen::Vector2d(1.0, -1.5),
            Eigen::Vector2d(4.0, 4.0));
    Connect("pose_point", {a, known}, Eigen::Vector2d(1.0, 2.0),
            Eigen::Vector2d(4.0, 4.0));
    // The wall y = 4 along x; seen by b, which looks along y, at its left hand.
    Connect("pose_line", {b, line}, Eigen::Vector2d(2.0, -kPi / 2),
            Eigen::Vector2d(4.0, 4.0));
    Connect("pose_end_points", {b, ends}, Eigen::Vector4d(1.0, 0.0, 1.0, -2.0),
            Eigen::Vector4d::Ones());
    Connect("pose_point_bearing", {a, far}, Eigen::VectorXd::Ones(1),
            Eigen::VectorXd::Ones(1));
    const std::size_t graphs = graph_.num_features() / 7;
    const InitialGuessReport report = Make(method);
    EXPECT_EQ(report.landmarks, 3 * static_cast<int>(graphs));
    EXPECT_EQ(report.kept, static_cast<int>(graphs));
    EXPECT_EQ(report.poses, static_cast<int>(graphs));
    // The mean of (3, 1) and (3.5, 1).
    const auto& p = graph_.GetFeature(tree).parameters;
    if (method != InitialGuessMethod::kChordal) {
      EXPECT_NEAR(p[0], 3.25, 1e-9);
    } else {
      // The pose gives way as well: between the two.
      EXPECT_GT(p[0], 3.0);
      EXPECT_LT(p[0], 3.25);
    }
    EXPECT_NEAR(p[1], 1.0, 0.1);
    EXPECT_EQ(graph_.GetFeature(known).parameters[0], 1.0);
    const Pose2 seen_by = PoseAt(b);
    const auto& l = graph_.GetFeature(line).parameters;
    EXPECT_NEAR(NormalizeAngle(l[1] - seen_by[2] + kPi / 2), 0.0, 1e-9);
    const auto& e = graph_.GetFeature(ends).parameters;
    EXPECT_NEAR(e[0], (TransformPoint(seen_by, Eigen::Vector2d(1.0, 0.0))[0]),
                1e-9);
    EXPECT_NEAR(e[3], (TransformPoint(seen_by, Eigen::Vector2d(1.0, -2.0))[1]),
                1e-9);
    EXPECT_EQ(graph_.GetFeature(far).parameters[0], -5.0);
    EXPECT_EQ(graph_.GetFeature(far).parameters[1], 6.0);
  }
}

// Two rounds past the same trees with a heading that drifts: only the trees
// close the loop. The start is near enough for the optimum, and odometry's is
// far worse.
TEST_F(InitialGuessTest, TreesCloseTheLoop) {
  std::mt19937 engine(5);
  std::normal_distribution<double> noise;
  std::vector<Eigen::Vector2d> trees;
  std::vector<FeatureId> tree_ids;
  for (int i = 0; i < 12; ++i) {
    const double angle = 2 * kPi * i / 12;
    trees.emplace_back(25.0 * std::cos(angle), 25.0 * std::sin(angle));
    tree_ids.push_back(Add("point", Eigen::Vector2d(0.0, 0.0)));
  }
  std::vector<FeatureId> poses;
  Pose2 before;
  for (int i = 0; i < 120; ++i) {
    const double angle = 2 * kPi * i / 60;
    const Pose2 pose(20.0 * std::cos(angle), 20.0 * std::sin(angle),
                     angle + kPi / 2);
    poses.push_back(AddPose(0.0, 0.0, 0.0, i == 0));
    if (i == 0) {
      graph_.GetFeature(poses[0]).parameters = {pose[0], pose[1], pose[2]};
    } else {
      Pose2 step = Between(before, pose);
      step += Pose2(0.02 * noise(engine), 0.02 * noise(engine),
                    0.01 + 0.02 * noise(engine));
      Connect("pose_pose",
              {poses[static_cast<std::size_t>(i) - 1], poses.back()}, step,
              Eigen::Vector3d(2500.0, 2500.0, 2500.0));
    }
    before = pose;
    for (std::size_t k = 0; k < trees.size(); ++k) {
      const Eigen::Vector2d seen = TransformPoint(Inverse(pose), trees[k]);
      if (seen.norm() > 12.0) continue;
      Connect("pose_point", {poses.back(), tree_ids[k]},
              Eigen::Vector2d(seen[0] + 0.05 * noise(engine),
                              seen[1] + 0.05 * noise(engine)),
              Eigen::Vector2d(400.0, 400.0));
    }
  }
  Make(InitialGuessMethod::kOdometry);
  const double odometry = Cost();
  Make(InitialGuessMethod::kChordal);
  const double chordal = Cost();
  SolverSession session(&graph_, registry_, {});
  session.SolveGlobal();
  const double optimum = session.Cost().total();
  EXPECT_GT(odometry, 1000.0 * optimum);
  EXPECT_LT(chordal, 3.0 * optimum);
}

// At the headings that it found, no other positions have a lower objective.
TEST_F(InitialGuessTest, PositionsAreOptimalAtTheirHeadings) {
  std::mt19937 engine(7);
  std::normal_distribution<double> noise;
  std::vector<FeatureId> ids;
  for (int i = 0; i < 12; ++i) ids.push_back(AddPose(i, 0.0, 0.0));
  const FeatureId tree = Add("point", Eigen::Vector2d(0.0, 0.0));
  Eigen::Matrix3d full;
  full << 40.0, 9.0, -12.0, 9.0, 90.0, 20.0, -12.0, 20.0, 70.0;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    for (std::size_t j : {i + 1, i + 4}) {
      if (j >= ids.size()) continue;
      const ConstraintId id =
          Connect(ids[i], ids[j],
                  {static_cast<double>(j - i) + 0.1 * noise(engine),
                   0.1 * noise(engine), 0.2 * noise(engine)});
      graph_.UpdateConstraint(id, graph_.GetConstraint(id).expected, full);
    }
    Connect("pose_point", {ids[i], tree},
            Eigen::Vector2d(5.0 - static_cast<double>(i), 3.0),
            Eigen::Vector2d(3.0, 1.0));
  }
  Make(InitialGuessMethod::kChordal);
  const double cost = Cost();
  for (const Feature* feature : graph_.Features()) {
    if (feature->id == ids[0]) continue;
    for (const int axis : {0, 1}) {
      for (const double change : {-1e-3, 1e-3}) {
        double& value = graph_.GetFeature(feature->id).parameters[axis];
        const double at = value;
        value = at + change;
        EXPECT_GT(Cost(), cost) << feature->id << " " << axis;
        value = at;
      }
    }
  }
}

TEST_F(InitialGuessTest, MeasurementsAlone) {
  for (const InitialGuessMethod method : kMethods) {
    SCOPED_TRACE(static_cast<int>(method));
    const FeatureId a = AddPose(0.0, 0.0, 0.0);
    const FeatureId b = AddPose(9.0, 9.0, 0.0);
    Connect(a, b, {1.0, 0.0, 0.0});
    // Structure, a broken measurement and one that says nothing.
    Connect("pose_pose", {a, b}, Pose2(5.0, 5.0, 1.0),
            Eigen::Vector3d(1e9, 1e9, 1e9), ConstraintClass::kStructure);
    const ConstraintId broken = Connect(a, b, {7.0, 7.0, 2.0}, 1e9);
    Transaction transaction;
    transaction.BreakConstraint(broken);
    graph_.Apply(transaction);
    Connect("pose_pose", {a, b}, Pose2(3.0, 3.0, 3.0), Eigen::Vector3d::Zero());
    Make(method);
    ExpectPose(b, 1.0, 0.0, 0.0);
  }
}

TEST_F(InitialGuessTest, NothingToPlace) {
  for (const InitialGuessMethod method : kMethods) {
    EXPECT_EQ(Make(method).parts, 0);
  }
  Add("point", Eigen::Vector2d(1.0, 1.0));
  for (const InitialGuessMethod method : kMethods) {
    EXPECT_EQ(Make(method).kept, 1);
  }
}

TEST_F(InitialGuessTest, HeadingsOfWhichNothingIsKnown) {
  const FeatureId a = AddPose(0.0, 0.0, 0.0);
  const FeatureId b = AddPose(9.0, 9.0, 0.0);
  Connect(a, b, {1.0, 0.0, 0.5}, /*heading_information=*/0.0);
  for (const InitialGuessMethod method : kMethods) {
    SCOPED_TRACE(static_cast<int>(method));
    Make(method);
    // What was expected is the best guess that there is.
    ExpectPose(b, 1.0, 0.0, 0.5);
  }
}

TEST_F(InitialGuessTest, NumbersThatOverflow) {
  const FeatureId a = AddPose(0.0, 0.0, 0.0);
  FeatureId last = a;
  for (int i = 0; i < 3; ++i) {
    const FeatureId next = AddPose(0.0, 0.0, 0.0);
    Connect(last, next, {1e308, 0.0, 0.0});
    last = next;
  }
  for (const InitialGuessMethod method : kMethods) {
    try {
      Make(method);
      ADD_FAILURE() << "no error";
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr("expected"));
    }
    EXPECT_EQ(graph_.GetFeature(last).parameters[0], 0.0);
  }
}

}  // namespace
}  // namespace plumbline
