#include <gtest/gtest.h>
#include <plumbline/core/em.h>
#include <plumbline/core/error.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/hierarchy.h>
#include <plumbline/core/parallel_for.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/session.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/detectors/same_wall.h>
#include <plumbline/detectors/visibility.h>
#include <plumbline/factors/wall_visibility.h>

#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

using Eigen::Vector2d;

// A face of a true wall.
struct TrueFace {
  Vector2d begin;
  Vector2d end;
};

// Where a ray from `from` hits the nearest of the faces, up to 20 m away.
Vector2d Hit(const std::vector<TrueFace>& faces, const Vector2d& from,
             double angle) {
  const Vector2d ray(std::cos(angle), std::sin(angle));
  double nearest = 20.0;
  for (const TrueFace& face : faces) {
    const Vector2d along = face.end - face.begin;
    const double determinant = ray.x() * along.y() - ray.y() * along.x();
    if (std::abs(determinant) < 1e-12) continue;
    const Vector2d to = face.begin - from;
    const double range =
        (to.x() * along.y() - to.y() * along.x()) / determinant;
    const double share = (to.x() * ray.y() - to.y() * ray.x()) / determinant;
    if (range > 0.0 && share >= 0.0 && share <= 1.0) {
      nearest = std::min(nearest, range);
    }
  }
  return from + nearest * ray;
}

// A graph of poses and walls, with what the poses have seen of a true building.
class VisibilityTest : public ::testing::Test {
 protected:
  VisibilityTest() { RegisterBuiltins(&registry_); }

  // A pose that stands at `at`; the first one is fixed.
  FeatureId AddPose(const Pose2& at) {
    Feature pose;
    pose.type = &registry_.GetFeature("pose");
    pose.fixed = graph_->num_features() == 0;
    pose.parameters = {at[0], at[1], at[2]};
    Transaction transaction;
    transaction.AddFeature(pose);
    return graph_->Apply(std::move(transaction)).features[0];
  }

  FeatureId AddWall(const Pose2& at, double begin, double end) {
    Feature wall;
    wall.type = &registry_.GetFeature("segment");
    wall.parameters = {at[0], at[1], at[2]};
    wall.extent_begin = begin;
    wall.extent_end = end;
    wall.observations = 3;
    Transaction transaction;
    transaction.AddFeature(wall);
    return graph_->Apply(std::move(transaction)).features[0];
  }

  // The second one stands in the frame of the first as it stands in the graph.
  void Measure(FeatureId first, FeatureId second, double sigma,
               double sigma_angle) {
    Transaction transaction;
    transaction.AddConstraint(MakeMeasurement(
        registry_.GetRelation("pose_pose"), {first, second},
        Between(PoseOf(first), PoseOf(second)),
        InformationFromSigmas(Eigen::Vector3d(sigma, sigma, sigma_angle)),
        "test"));
    graph_->Apply(std::move(transaction));
  }

  // Measures a wall from a pose beside this one, which has no looks: one that
  // has knows where the wall is.
  void MeasureFromBeside(FeatureId pose, FeatureId wall, double sigma,
                         double sigma_angle) {
    const FeatureId beside = AddPose(PoseOf(pose));
    Measure(pose, beside, 1e-3, 1e-3);
    Measure(beside, wall, sigma, sigma_angle);
  }

  // `pose`, which truly stands at `at`, sees the building.
  void LookAround(FeatureId pose, const Pose2& at,
                  const std::vector<TrueFace>& faces) {
    Look look;
    look.frame = pose;
    const Pose2 inverse = Inverse(at);
    for (int degree = 0; degree < 360; ++degree) {
      look.ends.push_back(TransformPoint(
          inverse, Hit(faces, at.head<2>(), DegToRad(degree + 0.25))));
    }
    looks_.push_back(std::move(look));
  }

  Pose2 PoseOf(FeatureId id) const {
    const Feature& feature = graph_->GetFeature(id);
    return Pose2(feature.parameters[0], feature.parameters[1],
                 feature.parameters[2]);
  }

  ConstraintId AddClosure(FeatureId first, FeatureId second) {
    Transaction transaction;
    Constraint closure = MakeStructure(
        registry_.GetRelation(kSameWallRelation), {first, second},
        Eigen::Vector2d::Zero(),
        InformationFromSigmas(Eigen::Vector2d(0.05, DegToRad(0.3))), "test");
    transaction.AddConstraint(closure);
    return graph_->Apply(std::move(transaction)).constraints[0];
  }

  std::unique_ptr<StructureDetector> MakeDetector(
      const DetectorParameters& given = {}) const {
    DetectorParameters parameters =
        registry_.GetDetector("visibility").defaults();
    for (const auto& entry : given) parameters[entry.first] = entry.second;
    auto detector = registry_.GetDetector("visibility").make(parameters);
    dynamic_cast<LooksReader&>(*detector).SetLooks(
        std::make_shared<const Looks>(looks_));
    return detector;
  }

  Transaction Detect(const DetectorParameters& given = {},
                     DetectionCounts* counts = nullptr) const {
    DetectionScope scope;
    scope.counts = counts;
    return MakeDetector(given)->Detect(*graph_, registry_, scope);
  }

  // EM with this detector; without looks it sees nothing.
  EmReport RunEm(bool with_looks = true) {
    SolverSession session(graph_.get(), registry_, SessionOptions());
    EmOptions options;
    options.break_share = 0.25;
    Hierarchy hierarchy =
        MakeHierarchy(ParseHierarchy("visibility"), registry_, {"segment"}, {});
    if (with_looks) {
      EXPECT_EQ(GiveLooks(std::make_shared<const Looks>(looks_), hierarchy), 1);
    }
    EmOrchestrator em(graph_.get(), &session, registry_, std::move(hierarchy),
                      options);
    return em.Run();
  }

  int Count(ConstraintState state) const {
    int count = 0;
    for (const Constraint* constraint : graph_->Constraints()) {
      count += constraint->type->name == WallVisibility::kName &&
               constraint->state == state;
    }
    return count;
  }

  Registry registry_;
  std::unique_ptr<Graph> graph_ = std::make_unique<Graph>();
  Looks looks_;
};

const std::vector<TrueFace>& OneTrueWall() {
  static const std::vector<TrueFace>* const faces =
      new std::vector<TrueFace>{{{-5.0, 2.0}, {5.0, 2.0}}};
  return *faces;
}

TEST_F(VisibilityTest, NothingWithoutLooks) {
  const FeatureId pose = AddPose(Pose2::Zero());
  const FeatureId wall = AddWall(Pose2(0.0, 1.5, kPi), -5.0, 5.0);
  MeasureFromBeside(pose, wall, 1.0, 0.1);
  EXPECT_TRUE(Detect().empty());
  const auto detector = registry_.GetDetector("visibility").make({});
  EXPECT_TRUE(detector->Detect(*graph_, registry_, DetectionScope()).empty());
  LookAround(pose, Pose2::Zero(), OneTrueWall());
  EXPECT_FALSE(Detect().empty());
  // In a part of the graph, and a level up.
  const std::vector<FeatureId> part = {pose, wall};
  DetectionScope scope;
  scope.features = &part;
  EXPECT_TRUE(MakeDetector()->Detect(*graph_, registry_, scope).empty());
  scope.features = nullptr;
  scope.level = 1;
  EXPECT_TRUE(MakeDetector()->Detect(*graph_, registry_, scope).empty());
}

TEST_F(VisibilityTest, TheWorstFewLinesHoldAWallBack) {
  const FeatureId pose = AddPose(Pose2(0.0, 0.0, 0.7));
  // Half a metre in front of where it is, and turned.
  const FeatureId wall = AddWall(Pose2(0.0, 1.5, kPi + 0.05), -3.0, 3.0);
  MeasureFromBeside(pose, wall, 1.0, 0.1);
  LookAround(pose, Pose2(0.0, 0.0, 0.7), OneTrueWall());
  DetectionCounts counts;
  const Transaction found = Detect({}, &counts);
  ASSERT_EQ(found.added_constraints().size(), 3u);
  for (const Constraint& constraint : found.added_constraints()) {
    EXPECT_EQ(constraint.type->name, "wall_visibility");
    EXPECT_EQ(constraint.kind, ConstraintClass::kStructure);
    EXPECT_EQ(constraint.features, (std::vector<FeatureId>{pose, wall}));
    EXPECT_EQ(constraint.expected[2], 1.0);
    EXPECT_EQ(constraint.source, "visibility");
    EXPECT_EQ(constraint.break_below, 0.01);
    // Cut by the margin across the wall, near the end that is nearest.
    const Vector2d end =
        TransformPoint(PoseOf(pose), Vector2d(constraint.expected.head<2>()));
    EXPECT_NEAR(end.y(), 1.9, 0.01);
    EXPECT_LT(end.x(), -2.0);
    EXPECT_GT(end.x(), -(3.0 - 0.4 + 1.0));
  }
  EXPECT_EQ(counts.at("walls"), 1);
  EXPECT_EQ(counts.at("looks at walls"), 1);
  EXPECT_GT(counts.at("sight lines through walls"), 60);
  EXPECT_EQ(counts.at("walls held back"), 1);

  const EmReport report = RunEm();
  EXPECT_TRUE(report.converged());
  EXPECT_GE(Count(ConstraintState::kLive), 3);
  EXPECT_EQ(Count(ConstraintState::kBroken), 0);
  // Now nothing is seen through by more than the margin, door widths apart.
  EXPECT_TRUE(Detect().empty());
  const Pose2 solved = PoseOf(wall);
  for (const double along : {-2.5, 0.0, 2.5}) {
    EXPECT_GT(solved[1] + along * std::sin(solved[2]), 1.85) << along;
    EXPECT_LT(solved[1] + along * std::sin(solved[2]), 2.2) << along;
  }
}

TEST_F(VisibilityTest, AWallBehindWhatWasSeenStaysThere) {
  const FeatureId pose = AddPose(Pose2::Zero());
  const FeatureId wall = AddWall(Pose2(0.0, 2.5, kPi), -3.0, 3.0);
  MeasureFromBeside(pose, wall, 1.0, 0.1);
  LookAround(pose, Pose2::Zero(), OneTrueWall());
  EXPECT_TRUE(Detect().empty());
  RunEm();
  EXPECT_NEAR(PoseOf(wall)[1], 2.5, 1e-9);
}

TEST_F(VisibilityTest, FromBothSidesOfAFace) {
  const FeatureId pose = AddPose(Pose2::Zero());
  // As seen from above; the robot is below.
  const FeatureId wall = AddWall(Pose2(0.0, 1.5, 0.0), -3.0, 3.0);
  MeasureFromBeside(pose, wall, 1.0, 0.1);
  LookAround(pose, Pose2::Zero(), OneTrueWall());
  const Transaction found = Detect();
  ASSERT_EQ(found.added_constraints().size(), 3u);
  EXPECT_EQ(found.added_constraints()[0].expected[2], -1.0);
  RunEm();
  EXPECT_GT(PoseOf(wall)[1], 1.85);
}

TEST_F(VisibilityTest, DoorsAndOpeningsHoldNothingBack) {
  const FeatureId pose = AddPose(Pose2::Zero());
  const FeatureId wall = AddWall(Pose2(0.0, 2.0, kPi), -5.0, 5.0);
  MeasureFromBeside(pose, wall, 1.0, 0.1);
  // A room of 3 m behind an opening of 2 m; and behind the right end of the
  // wall a niche as deep as a wall may be off, narrower than a door.
  LookAround(pose, Pose2::Zero(),
             {{{-5.0, 2.0}, {-1.0, 2.0}},
              {{1.0, 2.0}, {4.65, 2.0}},
              {{-3.0, 5.0}, {3.0, 5.0}},
              {{4.0, 2.5}, {6.0, 2.5}}});
  EXPECT_TRUE(Detect().empty());
  EXPECT_FALSE(Detect({{"depth", 4.0}}).empty());
  EXPECT_FALSE(Detect({{"door", 0.0}, {"lines", 1.0}}).empty());
}

TEST_F(VisibilityTest, WhoMeasuredTheWallHoldsItNotBack) {
  const FeatureId pose = AddPose(Pose2::Zero());
  const FeatureId wall = AddWall(Pose2(0.0, 1.5, kPi), -3.0, 3.0);
  LookAround(pose, Pose2::Zero(), OneTrueWall());
  EXPECT_FALSE(Detect().empty());
  Measure(pose, wall, 1.0, 0.1);
  EXPECT_TRUE(Detect().empty());
}

TEST_F(VisibilityTest, WhatWasBrokenComesNotAgain) {
  const FeatureId pose = AddPose(Pose2::Zero());
  AddWall(Pose2(0.0, 1.5, kPi), -3.0, 3.0);
  LookAround(pose, Pose2::Zero(), OneTrueWall());
  const ConstraintId first = graph_->Apply(Detect()).constraints[0];
  EXPECT_TRUE(Detect().empty());
  Transaction transaction;
  transaction.BreakConstraint(first);
  graph_->Apply(std::move(transaction));
  EXPECT_TRUE(Detect().empty());
  // Not even from elsewhere on the wall.
  graph_->GetFeature(1).parameters = {0.0, 1.6, kPi + 0.05};
  EXPECT_TRUE(Detect().empty());
}

TEST_F(VisibilityTest, EveryBearing) {
  // The wall in front of the true one is crossed by as many lines wherever it
  // stands around the robot, whichever beam is the first.
  for (int turn = 0; turn < 12; ++turn) {
    SCOPED_TRACE(turn);
    graph_ = std::make_unique<Graph>();
    looks_.clear();
    const double angle = DegToRad(30.0 * turn);
    const FeatureId pose = AddPose(Pose2(0.0, 0.0, angle));
    AddWall(Pose2(0.0, 1.5, kPi), -3.0, 3.0);
    LookAround(pose, Pose2::Zero(), OneTrueWall());
    std::swap(looks_[0].ends[17], looks_[0].ends[200]);
    const Pose2 back = Inverse(Pose2(0.0, 0.0, angle));
    for (Vector2d& end : looks_[0].ends) end = TransformPoint(back, end);
    DetectionCounts counts;
    EXPECT_EQ(Detect({}, &counts).added_constraints().size(), 3u);
    // |x| < 2.6 at y = 1.5: 120 degrees of 1 degree each.
    EXPECT_EQ(counts.at("sight lines through walls"), 120);
  }
}

TEST_F(VisibilityTest, WhatWasMovedHoldsNothingBackInTheEnd) {
  // Three poses saw the wall as it is, tightly; for the fourth there is a niche
  // behind a part of it, whose door was shut before.
  const std::vector<TrueFace> open = {{{-5.0, 2.0}, {-1.0, 2.0}},
                                      {{-1.0, 2.6}, {1.0, 2.6}},
                                      {{1.0, 2.0}, {5.0, 2.0}}};
  const FeatureId wall = AddWall(Pose2(0.0, 2.0, kPi), -5.0, 5.0);
  for (int k = 0; k < 4; ++k) {
    const Pose2 at(k - 1.5, 0.0, 0.1 * k);
    const FeatureId pose = AddPose(at);
    LookAround(pose, at, k < 3 ? OneTrueWall() : open);
    if (k < 3) {
      Measure(pose, wall, 0.02, 0.005);
    } else {
      MeasureFromBeside(pose, wall, 0.02, 0.005);
    }
  }
  EXPECT_EQ(Detect().added_constraints().size(), 3u);
  const EmReport report = RunEm();
  EXPECT_TRUE(report.converged());
  EXPECT_EQ(Count(ConstraintState::kLive), 0);
  EXPECT_GE(Count(ConstraintState::kBroken), 3);
  EXPECT_NEAR(PoseOf(wall)[1], 2.0, 1e-6);
}

TEST_F(VisibilityTest, SameProposalWithAnyNumberOfThreads) {
  std::mt19937_64 engine(5);
  const FeatureId pose = AddPose(Pose2::Zero());
  for (int k = 0; k < 30; ++k) {
    const double y = 1.0 + static_cast<double>(engine() % 1000) * 1e-3;
    AddWall(Pose2(0.1 * k, y, kPi), -2.0, 2.0);
  }
  LookAround(pose, Pose2::Zero(), OneTrueWall());
  const Transaction one = Detect();
  EXPECT_GT(one.added_constraints().size(), 30u);
  for (const int threads : {1, 4}) {
    const ThreadsScope scope(threads);
    const Transaction other = Detect();
    ASSERT_EQ(other.added_constraints().size(), one.added_constraints().size());
    for (std::size_t i = 0; i < one.added_constraints().size(); ++i) {
      EXPECT_EQ(other.added_constraints()[i].features,
                one.added_constraints()[i].features);
      EXPECT_EQ(other.added_constraints()[i].expected,
                one.added_constraints()[i].expected);
    }
  }
}

// Two pieces of corridor along x that meet at x = 10, the second `jog` higher.
std::vector<TrueFace> TwoCorridors(double jog) {
  return {{{0.0, -1.0}, {10.0, -1.0}},
          {{10.0, -1.0 + jog}, {20.0, -1.0 + jog}},
          {{0.0, 1.0}, {10.0, 1.0}},
          {{10.0, 1.0 + jog}, {20.0, 1.0 + jog}},
          {{10.0, -1.0}, {10.0, -1.0 + jog}},
          {{10.0, 1.0}, {10.0, 1.0 + jog}}};
}

class CorridorsTest : public VisibilityTest {
 protected:
  // A robot goes through both; the way from one to the other is hardly known.
  // Closures take their walls for one.
  void Build(double jog, std::uint64_t seed) {
    std::mt19937_64 engine(seed);
    const auto noise = [&engine](double most) {
      return most * (static_cast<double>(engine() % 2001) * 1e-3 - 1.0);
    };
    const std::vector<TrueFace> faces = TwoCorridors(jog);
    std::vector<FeatureId> poses;
    for (int k = 0; k < 20; ++k) {
      const double x = 0.5 + k + noise(0.3);
      const double y = (k < 10 ? 0.0 : jog) + noise(0.3);
      const Pose2 at(x, y, noise(3.0));
      poses.push_back(AddPose(at));
      LookAround(poses.back(), at, faces);
    }
    // Directions are those from which they were seen.
    const double begin = 0.2 + noise(0.2);
    const double gap = 0.5 + noise(0.4);
    const FeatureId lower[] = {
        AddWall(Pose2(0.0, -1.0, 0.0), begin, 10.0 - gap),
        AddWall(Pose2(0.0, -1.0 + jog, 0.0), 10.0 + gap, 20.0 - begin)};
    const FeatureId upper[] = {
        AddWall(Pose2(0.0, 1.0, kPi), -10.0 + gap, -begin),
        AddWall(Pose2(0.0, 1.0 + jog, kPi), -20.0 + begin, -10.0 - gap)};
    for (int k = 0; k < 20; ++k) {
      const int part = k < 10 ? 0 : 1;
      Measure(poses[k], lower[part], 0.02, DegToRad(0.3));
      Measure(poses[k], upper[part], 0.02, DegToRad(0.3));
      if (k == 0) continue;
      const bool passes = k == 10;
      Measure(poses[k - 1], poses[k], passes ? 2.0 : 0.03,
              DegToRad(passes ? 2.0 : 0.3));
    }
    closures_ = {AddClosure(lower[0], lower[1]),
                 AddClosure(upper[0], upper[1])};
  }

  int LiveClosures() const {
    int live = 0;
    for (const ConstraintId id : closures_) {
      live += graph_->GetConstraint(id).state == ConstraintState::kLive;
    }
    return live;
  }

  std::vector<ConstraintId> closures_;
};

TEST_F(CorridorsTest, HalfAMetreOutOfLineIsNeverOneWall) {
  int live_without = 0;
  for (std::uint64_t seed = 0; seed < 25; ++seed) {
    const double jog = seed % 2 == 0 ? 0.5 : -0.5;
    for (const bool with_looks : {false, true}) {
      SCOPED_TRACE(seed);
      graph_ = std::make_unique<Graph>();
      looks_.clear();
      Build(jog, seed);
      RunEm(with_looks);
      if (with_looks) {
        EXPECT_EQ(LiveClosures(), 0);
      } else {
        live_without += LiveClosures();
      }
    }
  }
  // Measurements alone allow it.
  EXPECT_EQ(live_without, 50);
}

TEST_F(CorridorsTest, WhatIsInLineStaysOneWall) {
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    SCOPED_TRACE(seed);
    graph_ = std::make_unique<Graph>();
    looks_.clear();
    Build(0.0, seed);
    RunEm();
    EXPECT_EQ(LiveClosures(), 2);
    EXPECT_EQ(Count(ConstraintState::kLive), 0);
  }
}

TEST_F(CorridorsTest, CountsWhatItRefutes) {
  Build(0.5, 1);
  DetectionCounts counts;
  const Transaction found = Detect({}, &counts);
  EXPECT_EQ(found.broken_constraints(), closures_);
  EXPECT_EQ(counts.at("hypotheses checked"), 2);
  EXPECT_EQ(counts.at("hypotheses broken: the sensor looked through"), 2);
  // Half a metre is no more than this.
  EXPECT_TRUE(Detect({{"passed", 0.6}}).broken_constraints().empty());
}

TEST_F(CorridorsTest, SidesOfARectangle) {
  Build(0.5, 1);
  const Constraint closure = graph_->GetConstraint(closures_[0]);
  Transaction transaction;
  Feature rectangle;
  rectangle.type = &registry_.GetFeature("rectangle");
  rectangle.level = 1;
  rectangle.is_virtual = true;
  rectangle.parameters = {10.0, 0.0, 0.0, 10.0, 1.0};
  const FeatureId room = transaction.AddFeature(rectangle);
  for (const FeatureId wall : closure.features) {
    transaction.AddConstraint(MakeStructure(
        registry_.GetRelation("segment_rectangle"), {wall, room},
        Eigen::Vector2d::Zero(),
        InformationFromSigmas(Eigen::Vector2d(0.05, 0.01)), "test"));
  }
  for (const ConstraintId id : closures_) transaction.RemoveConstraint(id);
  const std::vector<ConstraintId> sides =
      graph_->Apply(std::move(transaction)).constraints;
  // One of the two goes, and the wall that is longer stays.
  const Transaction found = Detect();
  ASSERT_EQ(found.broken_constraints().size(), 1u);
  const auto length = [this](FeatureId id) {
    const Feature& wall = graph_->GetFeature(id);
    return wall.extent_end - wall.extent_begin;
  };
  const bool first_is_longer =
      length(closure.features[0]) >= length(closure.features[1]);
  EXPECT_EQ(found.broken_constraints()[0], sides[first_is_longer ? 1 : 0]);
}

TEST_F(VisibilityTest, Parameters) {
  EXPECT_THROW(Detect({{"no_such", 1.0}}), Error);
  EXPECT_THROW(Detect({{"sigma", 0.0}}), Error);
  EXPECT_THROW(Detect({{"lines", 0.0}}), Error);
  EXPECT_THROW(Detect({{"break_below", 1.5}}), Error);
  EXPECT_TRUE(Detect().empty());  // an empty graph
}

}  // namespace
}  // namespace plumbline
