#include <gtest/gtest.h>
#include <plumbline/core/em.h>
#include <plumbline/core/error.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/session.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/detectors/same_wall.h>
#include <plumbline/factors/pose2.h>

#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

using Eigen::Vector2d;

// A straight piece of a building, seen from its left.
struct WallFace {
  double x1, y1, x2, y2;
};

// Builds a graph as a robot with drift would: every wall is seen once a visit,
// in the order of the way, and bound to the walls seen just before.
class SameWallTest : public ::testing::Test {
 protected:
  SameWallTest() { RegisterBuiltins(&registry_); }

  // `face` stands at its true place moved by `drift` (m, m, rad about the
  // origin).
  FeatureId See(const WallFace& face, const Pose2& drift) {
    const Pose2 place(face.x1, face.y1,
                      std::atan2(face.y2 - face.y1, face.x2 - face.x1));
    const Pose2 pose = Compose(drift, place);
    Feature feature;
    feature.type = &registry_.GetFeature("segment");
    feature.fixed = seen_.empty();
    feature.parameters = {pose[0], pose[1], pose[2]};
    feature.extent_end = std::hypot(face.x2 - face.x1, face.y2 - face.y1);
    feature.observations = 1;
    Transaction transaction;
    const FeatureId id = transaction.AddFeature(feature);
    for (std::size_t k = seen_.size(); k > 0 && k + 4 > seen_.size(); --k) {
      Constraint constraint;
      constraint.type = &registry_.GetRelation("pose_pose");
      constraint.features = {seen_[k - 1], id};
      constraint.expected = Between(PoseOf(seen_[k - 1]), pose);
      constraint.information =
          Eigen::Vector3d(400.0, 400.0, 4e4).asDiagonal();  // 5 cm, 0.3 deg
      transaction.AddConstraint(std::move(constraint));
    }
    seen_.push_back(graph_.Apply(std::move(transaction)).features[0]);
    truth_[seen_.back()] = face;
    return seen_.back();
  }

  Pose2 PoseOf(FeatureId id) const {
    const Feature& feature = graph_.GetFeature(id);
    return Pose2(feature.parameters[0], feature.parameters[1],
                 feature.parameters[2]);
  }

  // Sees faces one after the other while the drift grows evenly.
  void Walk(const std::vector<WallFace>& faces, const Pose2& from,
            const Pose2& to) {
    for (std::size_t i = 0; i < faces.size(); ++i) {
      See(faces[i], from + (to - from) * (static_cast<double>(i + 1) /
                                          static_cast<double>(faces.size())));
    }
  }

  Transaction Detect(const DetectorParameters& parameters = {},
                     const std::vector<FeatureId>* features = nullptr) const {
    DetectionScope scope;
    scope.features = features;
    return registry_.GetDetector("same_wall")
        .make(WithDefaults(parameters))
        ->Detect(graph_, registry_, scope);
  }

  DetectorParameters WithDefaults(const DetectorParameters& given) const {
    DetectorParameters parameters =
        registry_.GetDetector("same_wall").defaults();
    for (const auto& entry : given) parameters[entry.first] = entry.second;
    return parameters;
  }

  // The EM loop with this detector alone.
  EmReport RunEm(const DetectorParameters& parameters = {}) {
    SolverSession session(&graph_, registry_, SessionOptions());
    EmOptions options;
    options.break_share = 0.25;
    EmOrchestrator em(&graph_, &session, registry_,
                      MakeHierarchy(ParseHierarchy("same_wall"), registry_,
                                    {"segment"}, {{"same_wall", parameters}}),
                      options);
    return em.Run();
  }

  // True when both are pieces of one line, seen from one side.
  bool IsOneWall(FeatureId a, FeatureId b) const {
    const WallFace& f = truth_.at(a);
    const WallFace& g = truth_.at(b);
    const Vector2d along = Vector2d(f.x2 - f.x1, f.y2 - f.y1).normalized();
    const Vector2d other = Vector2d(g.x2 - g.x1, g.y2 - g.y1).normalized();
    const Vector2d between(g.x1 - f.x1, g.y1 - f.y1);
    return along.dot(other) > 0.999 &&
           std::abs(along.x() * between.y() - along.y() * between.x()) < 1e-6;
  }

  std::vector<std::array<double, 3>> State() const {
    std::vector<std::array<double, 3>> state;
    for (const FeatureId id : seen_) {
      const Pose2 pose = PoseOf(id);
      state.push_back({pose[0], pose[1], pose[2]});
    }
    return state;
  }

  void ExpectState(const std::vector<std::array<double, 3>>& expected,
                   double tolerance) const {
    const auto state = State();
    ASSERT_EQ(state.size(), expected.size());
    for (std::size_t i = 0; i < state.size(); ++i) {
      for (int k = 0; k < 2; ++k) {
        EXPECT_NEAR(state[i][k], expected[i][k], tolerance) << i;
      }
      EXPECT_NEAR(NormalizeAngle(state[i][2] - expected[i][2]), 0.0, tolerance);
    }
  }

  std::map<ConstraintState, int> Closures() const {
    std::map<ConstraintState, int> count;
    for (const Constraint* constraint : graph_.Constraints()) {
      if (constraint->type->name == kSameWallRelation) {
        ++count[constraint->state];
      }
    }
    return count;
  }

  Registry registry_;
  Graph graph_;
  std::vector<FeatureId> seen_;
  std::map<FeatureId, WallFace> truth_;
};

// One side of a ring of corridors, 2 m wide, with a niche: outer and inner wall
// in pieces, as met on the way from (0, 0) to (length, 0), turned by quarter
// turns about the middle of a square of that length.
std::vector<WallFace> Side(double length, int quarter) {
  std::vector<WallFace> faces;
  for (double x = -1.0; x < length - 1.0; x += 4.0) {
    faces.push_back({x, -1.0, x + 3.5, -1.0});
    faces.push_back({x + 6.0, 1.0, x + 2.5, 1.0});
    if (x == 7.0) {
      // Niche in the outer wall.
      faces.push_back({x + 3.5, -1.0, x + 3.5, -1.8});
      faces.push_back({x + 4.0, -1.8, x + 4.0, -1.0});
    }
  }
  for (WallFace& face : faces) {
    for (int q = 0; q < quarter; ++q) {
      const auto turn = [length](double* x, double* y) {
        const double from_x = *x - length / 2;
        const double from_y = *y - length / 2;
        *x = length / 2 - from_y;
        *y = length / 2 + from_x;
      };
      turn(&face.x1, &face.y1);
      turn(&face.x2, &face.y2);
    }
  }
  return faces;
}

// Three quarters and the last side of a ring, then the first two sides again.
std::vector<WallFace> Round(double length, int sides) {
  std::vector<WallFace> faces;
  for (int side = 0; side < sides; ++side) {
    const std::vector<WallFace> next = Side(length, side % 4);
    faces.insert(faces.end(), next.begin(), next.end());
  }
  return faces;
}

TEST_F(SameWallTest, ARevisitIsClosed) {
  const std::size_t once = Round(20.0, 4).size();
  Walk(Round(20.0, 6), Pose2::Zero(), Pose2(0.3, -0.25, 0.0));
  const Transaction transaction = Detect();
  EXPECT_TRUE(transaction.added_features().empty());
  std::set<FeatureId> closed;
  for (const Constraint& constraint : transaction.added_constraints()) {
    EXPECT_EQ(constraint.type->name, "segment_segment_collinearity");
    EXPECT_EQ(constraint.kind, ConstraintClass::kStructure);
    EXPECT_EQ(constraint.source, "same_wall");
    EXPECT_EQ(constraint.expected, Eigen::VectorXd::Zero(2));
    EXPECT_LT(constraint.features[0], constraint.features[1]);
    EXPECT_TRUE(IsOneWall(constraint.features[0], constraint.features[1]))
        << constraint.features[0] << " " << constraint.features[1];
    closed.insert(constraint.features[1]);
  }
  // The map moves by it.
  const EmReport report = RunEm();
  EXPECT_TRUE(report.converged());
  EXPECT_EQ(Closures()[ConstraintState::kBroken], 0);
  // Every wall of the second visit is on its first self again, to a tenth of
  // the drift.
  for (std::size_t i = once; i < seen_.size(); ++i) {
    const Pose2 between = Between(PoseOf(seen_[i - once]), PoseOf(seen_[i]));
    EXPECT_LT(std::abs(between[1]), 0.03) << i;
  }
  // Most were seen to be one at first sight.
  EXPECT_GT(closed.size(), (seen_.size() - once) * 2 / 3);
}

TEST_F(SameWallTest, CountsWhatWasSearchedAndRefused) {
  Walk(Round(20.0, 6), Pose2::Zero(), Pose2(0.3, -0.25, 0.0));
  DetectionCounts counts;
  DetectionScope scope;
  scope.counts = &counts;
  const Transaction transaction = registry_.GetDetector("same_wall")
                                      .make(WithDefaults({}))
                                      ->Detect(graph_, registry_, scope);
  const auto sum = [&counts](const std::string& start) {
    std::int64_t total = 0;
    for (const auto& [name, number] : counts) {
      if (name.rfind(start, 0) == 0) total += number;
    }
    return total;
  };
  EXPECT_EQ(counts.at("walls"), static_cast<std::int64_t>(seen_.size()));
  const std::int64_t places = counts.at("places");
  EXPECT_EQ(counts.at("place pairs"), places * (places - 1) / 2);
  // Every pair was refused for a reason, or brought matches.
  EXPECT_GT(counts.at("place pairs"), sum("place pairs refused"));
  EXPECT_GT(counts.at("place pairs refused: one visit"), 0);
  EXPECT_GT(counts.at("place pairs refused: out of reach"), 0);
  EXPECT_GT(counts.at("wall matches"), 0);
  EXPECT_EQ(static_cast<std::int64_t>(transaction.added_constraints().size()),
            counts.at("candidates") - sum("candidates refused"));
}

TEST_F(SameWallTest, StopsWhenItIsTold) {
  Walk(Round(20.0, 6), Pose2::Zero(), Pose2(0.3, -0.25, 0.0));
  int asked = 0;
  DetectionScope scope;
  scope.stop = [&asked] { return ++asked >= 5; };
  EXPECT_TRUE(registry_.GetDetector("same_wall")
                  .make(WithDefaults({}))
                  ->Detect(graph_, registry_, scope)
                  .empty());
  EXPECT_LT(asked, 12);
}

TEST_F(SameWallTest, NothingIsProposedTwice) {
  Walk(Round(20.0, 6), Pose2::Zero(), Pose2(0.2, 0.2, 0.0));
  RunEm();
  EXPECT_TRUE(Detect().empty());
}

TEST_F(SameWallTest, SameProposalEveryTime) {
  Walk(Round(20.0, 6), Pose2::Zero(), Pose2(0.2, 0.2, 0.01));
  const Transaction first = Detect();
  const Transaction second = Detect();
  ASSERT_EQ(first.added_constraints().size(),
            second.added_constraints().size());
  for (std::size_t i = 0; i < first.added_constraints().size(); ++i) {
    EXPECT_EQ(first.added_constraints()[i].features,
              second.added_constraints()[i].features);
    EXPECT_EQ(first.added_constraints()[i].information,
              second.added_constraints()[i].information);
  }
}

TEST_F(SameWallTest, DriftOfMetresAndDegrees) {
  // A ring of 56 m a side; the walls say where the robot is again only
  // together.
  Walk(Round(56.0, 6), Pose2::Zero(), Pose2(2.0, -1.5, DegToRad(3.0)));
  RunEm();
  EXPECT_GT(Closures()[ConstraintState::kLive], 20);
  for (const Constraint* constraint : graph_.Constraints()) {
    if (constraint->type->name != kSameWallRelation ||
        constraint->state != ConstraintState::kLive) {
      continue;
    }
    EXPECT_TRUE(IsOneWall(constraint->features[0], constraint->features[1]))
        << constraint->features[0] << " " << constraint->features[1];
  }
}

TEST_F(SameWallTest, AScopeOfFeaturesGivesNothing) {
  Walk(Round(20.0, 6), Pose2::Zero(), Pose2(0.2, 0.2, 0.0));
  EXPECT_TRUE(Detect({}, &seen_).empty());
}

// Two corridors side by side, 2.8 m apart, and the way from one to the other.
std::vector<WallFace> ParallelCorridors() {
  std::vector<WallFace> faces;
  for (double x = 0.0; x < 40.0; x += 4.0) {
    faces.push_back({x, -1.0, x + 3.5, -1.0});
    faces.push_back({x + 3.5, 1.0, x, 1.0});
  }
  faces.push_back({42.0, -1.0, 42.0, 3.8});
  for (double x = 36.0; x >= 0.0; x -= 4.0) {
    faces.push_back({x, 1.8, x + 3.5, 1.8});
    faces.push_back({x + 3.5, 3.8, x, 3.8});
  }
  return faces;
}

TEST_F(SameWallTest, AParallelCorridorIsNotClosed) {
  Walk(ParallelCorridors(), Pose2::Zero(), Pose2(0.0, 0.3, 0.0));
  EXPECT_TRUE(Detect().empty());
  // Nor when the search reaches it: it could be another one.
  EXPECT_TRUE(Detect({{"drift_rate", 0.05}}).empty());
}

TEST_F(SameWallTest, AFalseClosureIsBrokenAndTheMapReturns) {
  Walk(ParallelCorridors(), Pose2::Zero(), Pose2::Zero());
  const auto before = State();
  // Gates loose enough to take the second corridor for the first.
  const DetectorParameters loose = {
      {"drift_rate", 0.05}, {"narrow", 10.0}, {"rival_margin", 0.0}};
  const Transaction proposal = Detect(loose);
  ASSERT_GT(proposal.added_constraints().size(), 5u);
  for (const Constraint& constraint : proposal.added_constraints()) {
    EXPECT_FALSE(IsOneWall(constraint.features[0], constraint.features[1]));
  }
  const EmReport report = RunEm(loose);
  EXPECT_TRUE(report.converged());
  EXPECT_EQ(Closures()[ConstraintState::kLive], 0);
  EXPECT_GE(Closures()[ConstraintState::kBroken], 5);
  ExpectState(before, 1e-5);
}

TEST_F(SameWallTest, AFalseClosureByHandIsBrokenAndTheMapReturns) {
  Walk(Round(20.0, 6), Pose2::Zero(), Pose2(0.2, 0.2, 0.0));
  RunEm();
  const auto before = State();
  const int live = Closures()[ConstraintState::kLive];
  ASSERT_GT(live, 10);
  // An outer and an inner wall, 2 m apart; and a pair of one line off by a
  // corridor.
  Constraint closure;
  closure.type = &registry_.GetRelation(kSameWallRelation);
  closure.features = {seen_[0], seen_[7]};
  closure.expected = Eigen::VectorXd::Zero(2);
  closure.information = 2500.0 * Eigen::MatrixXd::Identity(2, 2);
  closure.kind = ConstraintClass::kStructure;
  closure.source = "same_wall";
  ASSERT_FALSE(IsOneWall(seen_[0], seen_[7]));
  Transaction transaction;
  transaction.AddConstraint(closure);
  const ConstraintId id = graph_.Apply(std::move(transaction)).constraints[0];
  RunEm();
  EXPECT_EQ(graph_.GetConstraint(id).state, ConstraintState::kBroken);
  EXPECT_LT(graph_.GetConstraint(id).delta, 0.3);
  EXPECT_EQ(Closures()[ConstraintState::kLive], live);
  ExpectState(before, 2e-3);
}

TEST_F(SameWallTest, AClosedLoopIsNoLongWay) {
  // The search is wide after a way of 80 m and narrow after one of a few, and
  // no evidence is enough in a wide one.
  const DetectorParameters parameters = {
      {"drift_rate", 0.02}, {"known_sigma", 0.0}, {"min_evidence", 1e9}};
  const int once = static_cast<int>(Round(20.0, 4).size());
  const int side = static_cast<int>(Round(20.0, 1).size());
  Walk(Round(20.0, 6), Pose2::Zero(), Pose2::Zero());
  const auto close = [&](int wall) {
    Constraint closure;
    closure.type = &registry_.GetRelation(kSameWallRelation);
    closure.features = {seen_[wall], seen_[wall + once]};
    closure.expected = Eigen::VectorXd::Zero(2);
    closure.information = 400.0 * Eigen::MatrixXd::Identity(2, 2);
    closure.kind = ConstraintClass::kStructure;
    closure.source = "by hand";
    Transaction transaction;
    transaction.AddConstraint(closure);
    graph_.Apply(std::move(transaction));
  };
  EXPECT_TRUE(Detect(parameters).empty());
  // One direction leaves the way along the corridor open.
  close(side - 1);
  EXPECT_TRUE(Detect(parameters).empty());
  close(side);
  const Transaction found = Detect(parameters);
  EXPECT_GT(found.added_constraints().size(), 5u);
  for (const Constraint& constraint : found.added_constraints()) {
    EXPECT_TRUE(IsOneWall(constraint.features[0], constraint.features[1]))
        << constraint.features[0] << " " << constraint.features[1];
  }
}

TEST_F(SameWallTest, TheFacesOfAWallAreNotOne) {
  // Round a thin wall and back on its other side.
  std::vector<WallFace> faces;
  for (double x = 0.0; x < 40.0; x += 4.0)
    faces.push_back({x, 0.0, x + 4.0, 0.0});
  faces.push_back({42.0, 5.0, 42.0, -5.0});
  for (double x = 36.0; x >= 0.0; x -= 4.0) {
    faces.push_back({x + 4.0, -0.02, x, -0.02});
  }
  Walk(faces, Pose2::Zero(), Pose2::Zero());
  EXPECT_TRUE(Detect().empty());
}

TEST_F(SameWallTest, WallsOnEachOtherAreOneWheneverSeen) {
  See({0.0, 0.0, 4.0, 0.0}, Pose2::Zero());
  See({5.0, 0.0, 5.0, 4.0}, Pose2::Zero());
  See({3.0, 0.01, 7.0, 0.01}, Pose2::Zero());
  See({3.0, 0.15, 7.0, 0.15}, Pose2::Zero());  // a cupboard
  const Transaction transaction = Detect();
  ASSERT_EQ(transaction.added_constraints().size(), 1u);
  EXPECT_EQ(transaction.added_constraints()[0].features,
            (std::vector<FeatureId>{0, 2}));
  // Offset and direction are independent at the middle of the common part, 0.5
  // m along the second wall.
  const Eigen::MatrixXd& information =
      transaction.added_constraints()[0].information;
  EXPECT_NEAR(information(0, 1) / information(0, 0), 0.5, 1e-9);
}

TEST_F(SameWallTest, Parameters) {
  EXPECT_THROW(Detect({{"no_such", 1.0}}), Error);
  EXPECT_THROW(Detect({{"sigma_offset", 0.0}}), Error);
  EXPECT_THROW(Detect({{"place_links", 1.5}}), Error);
  EXPECT_TRUE(Detect().empty());  // an empty graph
}

}  // namespace
}  // namespace plumbline
