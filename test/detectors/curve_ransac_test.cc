#include <gtest/gtest.h>
#include <plumbline/core/detector.h>
#include <plumbline/core/error.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/session.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/detectors/line_ransac.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "detectors/point_world.h"

namespace plumbline {
namespace {

// line_ransac and circle_ransac.
class CurveRansacTest : public ::testing::Test {
 protected:
  CurveRansacTest() { RegisterBuiltins(&registry_); }

  Transaction Detect(const std::string& detector,
                     const std::vector<FeatureId>* features = nullptr,
                     int level = 0,
                     const DetectorParameters& parameters = {}) const {
    DetectionScope scope;
    scope.level = level;
    scope.features = features;
    return registry_.GetDetector(detector)
        .make(parameters)
        ->Detect(graph_, registry_, scope);
  }

  Feature Point(double x, double y, int level = 0) const {
    Feature feature;
    feature.type = &registry_.GetFeature("point");
    feature.parameters = {x, y};
    feature.level = level;
    feature.is_virtual = level > 0;
    return feature;
  }

  // Adds points; each is linked with the next two when `spacing` is given.
  std::vector<FeatureId> AddChain(
      const std::vector<std::array<double, 2>>& positions, bool is_linked) {
    Transaction transaction;
    for (const auto& position : positions) {
      transaction.AddFeature(Point(position[0], position[1]));
    }
    for (std::size_t i = 0; is_linked && i < positions.size(); ++i) {
      for (std::size_t j = i + 1; j < std::min(i + 3, positions.size()); ++j) {
        transaction.AddConstraint(
            Link(Transaction::ProvisionalId(i), Transaction::ProvisionalId(j)));
      }
    }
    return graph_.Apply(std::move(transaction)).features;
  }

  Constraint Link(FeatureId a, FeatureId b) const {
    Constraint constraint;
    constraint.type = &registry_.GetRelation("point_point_distance");
    constraint.features = {a, b};
    constraint.expected = Eigen::VectorXd::Constant(1, 1.0);
    constraint.information = Eigen::MatrixXd::Identity(1, 1);
    return constraint;
  }

  // How many of the world's walls (or circles) are found once, by at least 60 %
  // of a curve's points; -1 for each proposed curve that is none of them.
  int Score(const PointWorld& world, const std::vector<FeatureId>& ids,
            const Transaction& transaction, bool is_circle) const {
    std::map<FeatureId, int> index;
    for (std::size_t i = 0; i < ids.size(); ++i) {
      index[ids[i]] = world.curve_of()[i];
    }
    std::vector<std::map<int, int>> votes(transaction.added_features().size());
    for (const Constraint& constraint : transaction.added_constraints()) {
      ++votes[Transaction::ProvisionalIndex(constraint.features[1])]
             [index.at(constraint.features[0])];
    }
    std::set<int> found;
    int wrong = 0;
    for (const auto& curves : votes) {
      int total = 0, best = -1, most = 0;
      for (const auto& [curve, count] : curves) {
        total += count;
        if (count > most) {
          most = count;
          best = curve;
        }
      }
      if (best < 0 || most < 0.6 * total ||
          world.is_circle(best) != is_circle || !found.insert(best).second) {
        ++wrong;
      }
    }
    return static_cast<int>(found.size()) - wrong;
  }

  Registry registry_;
  Graph graph_;
};

TEST_F(CurveRansacTest, MakesALineOneLevelUp) {
  std::vector<std::array<double, 2>> positions;
  for (int i = 0; i <= 10; ++i) {
    positions.push_back({3.0 + 0.4 * i, -2.0 + 0.3 * i});
  }
  const std::vector<FeatureId> ids = AddChain(positions, true);
  const Transaction transaction = Detect("line_ransac");
  ASSERT_EQ(transaction.added_features().size(), 1u);
  const Feature& line = transaction.added_features()[0];
  EXPECT_EQ(line.type->name, "line");
  EXPECT_EQ(line.level, 1);
  EXPECT_TRUE(line.is_virtual);
  EXPECT_EQ(line.source, "line_ransac");
  EXPECT_NEAR(line.anchor[0], 5.0, 1e-9);
  EXPECT_NEAR(line.anchor[1], -0.5, 1e-9);
  EXPECT_NEAR(line.parameters[0], 0.0, 1e-9);
  EXPECT_NEAR(line.parameters[1], std::atan2(3.0, 4.0), 1e-9);
  EXPECT_NEAR(line.extent_begin, -2.5, 1e-9);
  EXPECT_NEAR(line.extent_end, 2.5, 1e-9);
  ASSERT_EQ(transaction.added_constraints().size(), 11u);
  for (std::size_t i = 0; i < 11; ++i) {
    const Constraint& constraint = transaction.added_constraints()[i];
    EXPECT_EQ(constraint.type->name, "point_line_distance");
    EXPECT_EQ(constraint.kind, ConstraintClass::kStructure);
    EXPECT_EQ(constraint.features[0], ids[i]);
    EXPECT_EQ(constraint.expected[0], 0.0);
    // 1 / (0.02 m)^2.
    EXPECT_NEAR(constraint.information(0, 0), 2500.0, 1e-6);
  }
  EXPECT_TRUE(Detect("circle_ransac").empty());
  graph_.Apply(transaction);
  EXPECT_TRUE(Detect("line_ransac").empty());
}

TEST_F(CurveRansacTest, MakesACircleOneLevelUp) {
  PointWorld world(1);
  world.AddCircle(4.0, 5.0, 1.5, 0.3);
  const auto ids = world.Build(registry_, 0.0, 0.0, 4, &graph_);
  const Transaction transaction = Detect("circle_ransac");
  ASSERT_EQ(transaction.added_features().size(), 1u);
  const Feature& circle = transaction.added_features()[0];
  EXPECT_EQ(circle.type->name, "circle");
  EXPECT_EQ(circle.level, 1);
  EXPECT_TRUE(circle.is_virtual);
  EXPECT_EQ(circle.source, "circle_ransac");
  EXPECT_NEAR(circle.parameters[0], 4.0, 1e-6);
  EXPECT_NEAR(circle.parameters[1], 5.0, 1e-6);
  EXPECT_NEAR(circle.parameters[2], 1.5, 1e-6);
  EXPECT_EQ(transaction.added_constraints().size(), ids.size());
  EXPECT_EQ(transaction.added_constraints()[0].type->name,
            "point_circle_distance");
  EXPECT_TRUE(Detect("line_ransac").empty());
  graph_.Apply(transaction);
  EXPECT_TRUE(Detect("circle_ransac").empty());
  EXPECT_TRUE(Detect("line_ransac").empty());
}

TEST_F(CurveRansacTest, NoStructureInNothing) {
  for (const char* detector : {"line_ransac", "circle_ransac"}) {
    EXPECT_TRUE(Detect(detector).empty());
  }
  AddChain({{0.0, 0.0}, {1.0, 0.0}, {2.0, 0.0}}, true);
  AddChain({{9.0, 9.0}}, false);
  for (const char* detector : {"line_ransac", "circle_ransac"}) {
    EXPECT_TRUE(Detect(detector).empty()) << detector;
  }
}

TEST_F(CurveRansacTest, PointsOnOneSpot) {
  AddChain(std::vector<std::array<double, 2>>(300, {2.0, 3.0}), true);
  EXPECT_TRUE(Detect("line_ransac").empty());
  EXPECT_TRUE(Detect("circle_ransac").empty());
}

TEST_F(CurveRansacTest, NotFinitePointsAreLeftOut) {
  std::vector<std::array<double, 2>> positions;
  for (int i = 0; i <= 12; ++i) positions.push_back({0.4 * i, 0.0});
  const std::vector<FeatureId> ids = AddChain(positions, true);
  graph_.GetFeature(ids[6]).parameters[1] = std::nan("");
  const Transaction transaction = Detect("line_ransac");
  EXPECT_EQ(transaction.added_features().size(), 1u);
  EXPECT_EQ(transaction.added_constraints().size(), 12u);
}

// What is on a line but not connected does not belong together.
TEST_F(CurveRansacTest, IsolatedPointsMakeNothing) {
  std::vector<std::array<double, 2>> positions;
  for (int i = 0; i <= 50; ++i) positions.push_back({0.3 * i, 1.0});
  AddChain(positions, false);
  EXPECT_TRUE(Detect("line_ransac").empty());
}

// One false curve in 1,000 points is expected in ten graphs at most.
TEST_F(CurveRansacTest, WanderingChainsMakeNothing) {
  int found = 0;
  for (int seed = 1; seed <= 6; ++seed) {
    Graph graph;
    PointWorld world(seed);
    double x = 0.0, y = 0.0;
    for (int i = 0; i < 300; ++i) {
      if (i % 30 == 0) {
        x = world.Noise(10.0);
        y = world.Noise(10.0);
      }
      const double direction = world.Noise(kPi);
      x += 0.34 * std::cos(direction);
      y += 0.34 * std::sin(direction);
      world.AddPoint(x, y);
    }
    world.Build(registry_, 0.0, 0.0, 5, &graph);
    for (const char* name : {"line_ransac", "circle_ransac"}) {
      if (!registry_.GetDetector(name)
               .make({})
               ->Detect(graph, registry_, {})
               .empty()) {
        ++found;
      }
    }
  }
  EXPECT_LE(found, 4);
}

// Neighbours in all directions: the background that the test of significance
// models only roughly.
TEST_F(CurveRansacTest, FewCurvesInScatteredPoints) {
  PointWorld world(5);
  for (int i = 0; i < 500; ++i) {
    world.AddPoint(10.0 + world.Noise(10.0), 10.0 + world.Noise(10.0));
  }
  world.Build(registry_, 0.0, 0.0, 5, &graph_);
  EXPECT_LE(Detect("line_ransac").added_features().size(), 5u);
  EXPECT_LE(Detect("circle_ransac").added_features().size(), 5u);
  EXPECT_TRUE(
      Detect("line_ransac", nullptr, 0, {{"max_log_false_alarms", -3.0}})
          .empty());
}

// Which of two walls that meet the point at their corner is on nobody knows,
// however near it is to either; the walls are found all the same.
TEST_F(CurveRansacTest, CornerIsOnNeitherWall) {
  for (const double off : {0.0, 0.015, 0.04}) {
    SCOPED_TRACE(off);
    Graph graph;
    PointWorld world(2);
    world.AddWall(off, 0.0, 4.0 + off, 0.0, 0.25);
    world.AddWall(0.0, 0.25, 0.0, 4.0, 0.25);
    const auto ids = world.Build(registry_, 0.0, 0.0, 4, &graph);
    const auto detect = [&](const char* name) {
      return registry_.GetDetector(name).make({})->Detect(graph, registry_, {});
    };
    EXPECT_TRUE(detect("circle_ransac").empty());
    Transaction transaction = detect("line_ransac");
    EXPECT_EQ(Score(world, ids, transaction, false), 2);
    EXPECT_EQ(transaction.added_constraints().size(), ids.size() - 1);
    for (const Constraint& constraint : transaction.added_constraints()) {
      EXPECT_NE(constraint.features[0], ids[0]);
    }
    graph.Apply(std::move(transaction));
    EXPECT_TRUE(detect("line_ransac").empty());
  }
}

// A tie to the wall across that was there before goes.
TEST_F(CurveRansacTest, TieAcrossIsTakenBack) {
  PointWorld world(2);
  world.AddWall(0.0, 0.0, 4.0, 0.0, 0.25);
  world.AddWall(2.0, 0.25, 2.0, 4.0, 0.25);
  const auto ids = world.Build(registry_, 0.0, 0.0, 4, &graph_);
  Transaction transaction = Detect("line_ransac");
  ASSERT_EQ(Score(world, ids, transaction, false), 2);
  ASSERT_EQ(transaction.added_constraints().size(), ids.size());
  graph_.Apply(std::move(transaction));
  // The point below the end of the second wall: from the first to that.
  const FeatureId point = ids[8];
  ASSERT_EQ(graph_.GetFeature(point).parameters[0], 2.0);
  ASSERT_EQ(graph_.GetFeature(point).parameters[1], 0.0);
  ConstraintId own = kNoId;
  for (const ConstraintId id : graph_.ConstraintsOf(point)) {
    if (graph_.GetConstraint(id).kind == ConstraintClass::kStructure) own = id;
  }
  ASSERT_NE(own, kNoId);
  const FeatureId wall = graph_.GetConstraint(own).features[1];
  Constraint across = graph_.GetConstraint(own);
  for (const Feature* feature : std::as_const(graph_).Features()) {
    if (feature->is_virtual && feature->id != wall) {
      across.features[1] = feature->id;
    }
  }
  Transaction swap;
  swap.RemoveConstraint(own);
  swap.AddConstraint(across);
  const ConstraintId wrong = graph_.Apply(std::move(swap)).constraints[0];

  transaction = Detect("line_ransac");
  EXPECT_EQ(transaction.removed_constraints(),
            std::vector<ConstraintId>{wrong});
  ASSERT_EQ(transaction.added_constraints().size(), 1u);
  EXPECT_EQ(transaction.added_constraints()[0].features,
            (std::vector<FeatureId>{point, wall}));
  EXPECT_TRUE(transaction.removed_features().empty());
}

TEST_F(CurveRansacTest, ExactBuilding) {
  PointWorld world(1);
  world.AddBuilding(0.34);
  const auto ids = world.Build(registry_, 0.0, 0.0, 4, &graph_);
  Transaction lines = Detect("line_ransac");
  EXPECT_EQ(Score(world, ids, lines, false), 14);
  Transaction circles = Detect("circle_ransac");
  EXPECT_EQ(Score(world, ids, circles, true), 8);
  // Each of them leaves the other's points alone, and nothing is left over.
  graph_.Apply(std::move(lines));
  EXPECT_EQ(Score(world, ids, Detect("circle_ransac"), true), 8);
  graph_.Apply(std::move(circles));
  EXPECT_TRUE(Detect("line_ransac").empty());
  EXPECT_TRUE(Detect("circle_ransac").empty());
}

// However noisy, a second look finds nothing.
TEST_F(CurveRansacTest, NothingIsProposedTwice) {
  for (int seed = 1; seed <= 4; ++seed) {
    Graph graph;
    PointWorld world(seed);
    world.AddBuilding(0.34);
    for (int i = 0; i < 30; ++i) {
      world.AddPoint(12.0 + world.Noise(12.0), 6.0 + world.Noise(6.0));
    }
    world.Build(registry_, 0.15, 0.03, 5, &graph);
    for (const char* name : {"line_ransac", "circle_ransac"}) {
      const auto detector = registry_.GetDetector(name).make({});
      Transaction transaction = detector->Detect(graph, registry_, {});
      EXPECT_FALSE(transaction.empty());
      graph.Apply(std::move(transaction));
      EXPECT_TRUE(detector->Detect(graph, registry_, {}).empty())
          << name << " seed " << seed;
    }
  }
}

TEST_F(CurveRansacTest, EqualCurvesAreMerged) {
  std::vector<std::array<double, 2>> positions;
  for (int i = 0; i <= 20; ++i) {
    // The second half turned away, and has been brought back since.
    positions.push_back({0.4 * i, i <= 10 ? 0.0 : 0.3 * (i - 10)});
  }
  AddChain(positions, true);
  const TransactionResult pieces = graph_.Apply(Detect("line_ransac"));
  ASSERT_EQ(pieces.features.size(), 2u);
  for (int i = 0; i <= 20; ++i) graph_.GetFeature(i).parameters[1] = 0.0;
  for (const FeatureId id : pieces.features) {
    Feature& line = graph_.GetFeature(id);
    line.anchor[1] = 0.0;
    line.parameters = {0.0, 0.0};
  }
  Transaction transaction = Detect("line_ransac");
  ASSERT_EQ(transaction.removed_features().size(), 1u);
  EXPECT_TRUE(transaction.added_features().empty());
  graph_.Apply(std::move(transaction));
  EXPECT_TRUE(Detect("line_ransac").empty());
  int lines = 0;
  for (const FeatureId id : graph_.VirtualFeatures(1)) {
    EXPECT_EQ(graph_.ConstraintsOf(id).size(), 21u);
    ++lines;
  }
  EXPECT_EQ(lines, 1);
}

// Walls of two buildings that happen to be in line, and a distance from the one
// to the other: neither is the other's other end. Taken for one they would be
// found again by every look, and taken out again.
TEST_F(CurveRansacTest, WallsInLineAreNotMerged) {
  std::vector<std::array<double, 2>> first, second;
  for (int i = 0; i <= 25; ++i) {
    first.push_back({0.4 * i, 0.0});
    second.push_back({18.4 + 0.4 * i, 0.02});
  }
  const FeatureId end = AddChain(first, true).back();
  const FeatureId begin = AddChain(second, true).front();
  ASSERT_EQ(graph_.Apply(Detect("line_ransac")).features.size(), 2u);
  Transaction tie;
  tie.AddConstraint(Link(end, begin));
  graph_.Apply(std::move(tie));
  EXPECT_TRUE(Detect("line_ransac").empty());
}

// A search draws the same in a building, whatever stands beside it.
TEST_F(CurveRansacTest, WhatIsFarAwayDoesNotMatter) {
  PointWorld world(6);
  world.AddBuilding(0.34);
  const auto ids = world.Build(registry_, 0.1, 0.02, 5, &graph_);
  const auto supports = [&](const std::string& detector) {
    std::map<FeatureId, std::set<FeatureId>> by_curve;
    const Transaction proposal = Detect(detector);
    for (const Constraint& constraint : proposal.added_constraints()) {
      if (constraint.features[0] <= ids.back()) {
        by_curve[constraint.features[1]].insert(constraint.features[0]);
      }
    }
    std::set<std::set<FeatureId>> result;
    for (const auto& curve : by_curve) result.insert(curve.second);
    return result;
  };
  const auto lines = supports("line_ransac");
  const auto circles = supports("circle_ransac");
  EXPECT_GE(lines.size(), 10u);
  // Two walls, one after the other, so that it takes one more look.
  PointWorld other(7);
  other.AddWall(500.0, 0.0, 512.0, 0.0, 0.34);
  other.AddWall(500.0, 3.0, 503.0, 12.0, 0.34);
  other.Build(registry_, 0.05, 0.02, 5, &graph_);
  EXPECT_EQ(supports("line_ransac"), lines);
  EXPECT_EQ(supports("circle_ransac"), circles);
}

TEST_F(CurveRansacTest, DensePoints) {
  PointWorld world(3);
  world.AddBuilding(0.1);
  const auto ids = world.Build(registry_, 0.03, 0.01, 5, &graph_);
  EXPECT_EQ(Score(world, ids, Detect("line_ransac"), false), 14);
  EXPECT_EQ(Score(world, ids, Detect("circle_ransac"), true), 8);
}

TEST_F(CurveRansacTest, SameInputSameProposal) {
  PointWorld world(4);
  world.AddBuilding(0.34);
  world.Build(registry_, 0.1, 0.02, 4, &graph_);
  const Transaction a = Detect("line_ransac"), b = Detect("line_ransac");
  ASSERT_EQ(a.added_features().size(), b.added_features().size());
  ASSERT_EQ(a.added_constraints().size(), b.added_constraints().size());
  for (std::size_t i = 0; i < a.added_features().size(); ++i) {
    EXPECT_EQ(a.added_features()[i].parameters,
              b.added_features()[i].parameters);
  }
}

// Far away from the origin the same is found.
TEST_F(CurveRansacTest, FarFromTheOrigin) {
  PointWorld world(4);
  world.AddWall(1e4, 1e4, 1e4 + 5.0, 1e4 + 1.0, 0.3);
  world.AddCircle(1e4, 1e4 - 3.0, 1.2, 0.3);
  const auto ids = world.Build(registry_, 0.02, 0.02, 4, &graph_);
  EXPECT_EQ(Score(world, ids, Detect("line_ransac"), false), 1);
  EXPECT_EQ(Score(world, ids, Detect("circle_ransac"), true), 1);
}

// What the main experiment with points asks for, with less noise.
TEST_F(CurveRansacTest, NoisyBuildingAfterItsDistancesAreSolved) {
  for (int seed = 1; seed <= 5; ++seed) {
    Graph graph;
    PointWorld world(seed);
    world.AddBuilding(0.34);
    const auto ids = world.Build(registry_, 0.1, 0.03, 4, &graph);
    SolverSession session(&graph, registry_, {});
    session.SolveGlobal();
    const DetectionScope scope;
    // One look only: in EM's, which are many, a wall may come later.
    const DetectorParameters one_look = {{"max_log_false_alarms", 0.0}};
    const auto lines = registry_.GetDetector("line_ransac").make(one_look);
    const auto circles = registry_.GetDetector("circle_ransac").make(one_look);
    EXPECT_EQ(Score(world, ids, lines->Detect(graph, registry_, scope), false),
              14)
        << seed;
    EXPECT_EQ(Score(world, ids, circles->Detect(graph, registry_, scope), true),
              8)
        << seed;
  }
}

TEST_F(CurveRansacTest, ExtendsWhatIsThere) {
  std::vector<std::array<double, 2>> positions;
  for (int i = 0; i <= 14; ++i) positions.push_back({0.4 * i, 0.0});
  std::vector<FeatureId> ids = AddChain(positions, true);
  const FeatureId line = graph_.Apply(Detect("line_ransac")).features.at(0);
  // Two more along it, one of them 0.08 m off, one that turns away, and one
  // on the line that nothing connects.
  const auto more =
      AddChain({{6.0, 0.0}, {6.4, 0.08}, {6.8, 0.3}, {6.2, 0.0}}, false);
  Transaction links;
  links.AddConstraint(Link(ids.back(), more[0]));
  links.AddConstraint(Link(more[0], more[1]));
  links.AddConstraint(Link(more[1], more[2]));
  graph_.Apply(std::move(links));
  const Transaction transaction = Detect("line_ransac");
  EXPECT_TRUE(transaction.added_features().empty());
  ASSERT_EQ(transaction.added_constraints().size(), 2u);
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(transaction.added_constraints()[i].features,
              (std::vector<FeatureId>{more[i], line}));
  }
  // The same with the new points alone in the scope.
  EXPECT_EQ(Detect("line_ransac", &more).added_constraints().size(), 2u);
  graph_.Apply(transaction);
  EXPECT_TRUE(Detect("line_ransac").empty());
  EXPECT_TRUE(Detect("line_ransac", &more).empty());
}

// What was broken is proposed again, but its points make nothing new.
TEST_F(CurveRansacTest, OutliersOfACurveMakeNoOther) {
  std::vector<std::array<double, 2>> positions;
  for (int i = 0; i <= 20; ++i) positions.push_back({0.4 * i, 0.0});
  AddChain(positions, true);
  const TransactionResult result = graph_.Apply(Detect("line_ransac"));
  Transaction transaction;
  for (int i = 12; i <= 20; ++i) {
    transaction.BreakConstraint(result.constraints[i]);
    graph_.GetFeature(i).parameters[1] = 0.2 * (i - 11);
  }
  graph_.Apply(std::move(transaction));
  EXPECT_TRUE(Detect("line_ransac").empty());
}

TEST_F(CurveRansacTest, ScopeLimitsWhatIsLookedAt) {
  PointWorld world(6);
  // Linked at x = 0 only.
  world.AddWall(0.0, 0.0, 10.0, 0.0, 0.3);
  world.AddWall(0.0, 30.0, 10.0, 30.0, 0.3);
  const auto ids = world.Build(registry_, 0.0, 0.0, 4, &graph_);
  const std::vector<FeatureId> some(ids.begin() + 20, ids.begin() + 28);
  const Transaction transaction = Detect("line_ransac", &some);
  ASSERT_EQ(transaction.added_features().size(), 1u);
  EXPECT_NEAR(transaction.added_features()[0].anchor[1], 0.0, 1e-9);
  const std::vector<FeatureId> none = {123456};
  EXPECT_TRUE(Detect("line_ransac", &none).empty());
}

// Circle centres in a row are not connected by measurements.
TEST_F(CurveRansacTest, LinesThroughVirtualPoints) {
  Transaction transaction;
  for (int i = 0; i < 6; ++i) transaction.AddFeature(Point(3.0 * i, 1.0, 2));
  transaction.AddFeature(Point(4.0, 5.0, 2));
  // Of another level.
  for (int i = 0; i < 6; ++i) transaction.AddFeature(Point(3.0 * i, 9.0, 1));
  const auto ids = graph_.Apply(std::move(transaction)).features;
  const Transaction lines = Detect("line_ransac", nullptr, 2);
  ASSERT_EQ(lines.added_features().size(), 1u);
  EXPECT_EQ(lines.added_features()[0].level, 3);
  ASSERT_EQ(lines.added_constraints().size(), 6u);
  EXPECT_EQ(lines.added_constraints()[5].features[0], ids[5]);
  graph_.Apply(lines);
  EXPECT_TRUE(Detect("line_ransac", nullptr, 2).empty());
}

TEST_F(CurveRansacTest, FourCentresAtRandomMakeNothing) {
  Transaction transaction;
  for (const auto& position : std::vector<std::array<double, 2>>{
           {2.9, 2.6}, {8.6, 2.9}, {21.0, 10.0}, {20.5, 2.5}}) {
    transaction.AddFeature(Point(position[0], position[1], 2));
  }
  graph_.Apply(std::move(transaction));
  EXPECT_TRUE(Detect("line_ransac", nullptr, 2).empty());
  EXPECT_TRUE(Detect("circle_ransac", nullptr, 2).empty());
}

TEST_F(CurveRansacTest, ManyVirtualPoints) {
  Transaction transaction;
  for (int i = 0; i < 60; ++i) {
    transaction.AddFeature(Point(3.0 * i, 1.0, 1));
    transaction.AddFeature(Point(3.0 * i, 8.0, 1));
  }
  graph_.Apply(std::move(transaction));
  const Transaction lines = Detect("line_ransac", nullptr, 1);
  EXPECT_EQ(lines.added_features().size(), 2u);
  EXPECT_EQ(lines.added_constraints().size(), 120u);
}

// Two crowded quarters of a wide land: the nearest are found all the same, and
// no line leads from one to the other.
TEST_F(CurveRansacTest, VirtualPointsInFarQuarters) {
  Transaction transaction;
  for (const double x : {0.0, 5000.0}) {
    for (int i = 0; i < 40; ++i) {
      transaction.AddFeature(Point(x + 3.0 * i, 1.0, 1));
    }
    for (int i = 0; i < 40; ++i) {
      transaction.AddFeature(Point(x + 3.0 * i, 8.0, 1));
    }
  }
  graph_.Apply(std::move(transaction));
  const Transaction lines = Detect("line_ransac", nullptr, 1);
  EXPECT_EQ(lines.added_features().size(), 4u);
  EXPECT_EQ(lines.added_constraints().size(), 160u);
}

// A common centre that a circle has left is still in line with the others.
TEST_F(CurveRansacTest, BrokenTiesToOtherThingsDoNotMatter) {
  Transaction transaction;
  for (int i = 0; i < 6; ++i) transaction.AddFeature(Point(3.0 * i, 1.0, 2));
  for (int i = 0; i < 6; ++i) {
    Feature circle;
    circle.type = &registry_.GetFeature("circle");
    circle.level = 1;
    circle.is_virtual = true;
    circle.parameters = {3.0 * i, 2.0, 1.0};
    Constraint tie;
    tie.type = &registry_.GetRelation("point_point_coincidence");
    tie.features = {transaction.AddFeature(circle),
                    Transaction::ProvisionalId(static_cast<std::size_t>(i))};
    tie.expected = Eigen::VectorXd::Zero(2);
    tie.information = Eigen::MatrixXd::Identity(2, 2);
    tie.kind = ConstraintClass::kStructure;
    tie.state = ConstraintState::kBroken;
    transaction.AddConstraint(tie);
  }
  graph_.Apply(std::move(transaction));
  EXPECT_EQ(Detect("line_ransac", nullptr, 2).added_constraints().size(), 6u);
}

TEST_F(CurveRansacTest, ShortArcsAreRefused) {
  PointWorld world(7);
  world.AddCircle(0.0, 0.0, 5.0, 0.2, 0.0, 60.0);
  world.Build(registry_, 0.0, 0.0, 4, &graph_);
  EXPECT_TRUE(Detect("circle_ransac").empty());
  EXPECT_EQ(Detect("circle_ransac", nullptr, 0, {{"min_arc_deg", 45.0}})
                .added_features()
                .size(),
            1u);
}

TEST_F(CurveRansacTest, Parameters) {
  std::vector<std::array<double, 2>> positions;
  for (int i = 0; i <= 10; ++i) positions.push_back({0.4 * i, 0.0});
  AddChain(positions, true);
  EXPECT_TRUE(
      Detect("line_ransac", nullptr, 0, {{"min_line_points", 12.0}}).empty());
  EXPECT_TRUE(
      Detect("line_ransac", nullptr, 0, {{"max_log_false_alarms", -100.0}})
          .empty());
  EXPECT_NEAR(Detect("line_ransac", nullptr, 0, {{"sigma", 0.1}})
                  .added_constraints()
                  .at(0)
                  .information(0, 0),
              100.0, 1e-9);
  EXPECT_EQ(registry_.GetDetector("line_ransac").make({})->minimum_support(),
            4);
  EXPECT_EQ(registry_.GetDetector("circle_ransac")
                .make({{"min_circle_points", 7.0}})
                ->minimum_support(),
            7);
  EXPECT_THROW(Detect("line_ransac", nullptr, 0, {{"sigma", 0.0}}), Error);
  EXPECT_THROW(Detect("line_ransac", nullptr, 0, {{"min_line_points", 2.0}}),
               Error);
  EXPECT_THROW(Detect("circle_ransac", nullptr, 0, {{"radius", 1.0}}), Error);
}

}  // namespace
}  // namespace plumbline
