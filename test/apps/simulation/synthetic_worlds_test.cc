#include <gtest/gtest.h>
#include <plumbline/apps/simulation/synthetic_worlds.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/error.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <queue>
#include <set>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

class SyntheticWorldsTest : public ::testing::Test {
 protected:
  SyntheticWorldsTest() { RegisterBuiltinRelations(&registry_); }

  SyntheticWorld Make(const std::string& name, std::uint64_t seed = 1) const {
    return MakeSyntheticWorld(name, DefaultSyntheticOptions(name), seed,
                              registry_);
  }

  SyntheticWorld MakeExact(const std::string& name) const {
    SyntheticOptions options = DefaultSyntheticOptions(name);
    options.position_noise = 0.0;
    options.distance_noise = 0.0;
    return MakeSyntheticWorld(name, options, 1, registry_);
  }

  Registry registry_;
};

// Smallest pivot of the normal matrix of unit-weight distances at the truth
// with three coordinates (the gauge) left out: how far the graph is from
// flexible.
double SmallestPivot(const SyntheticWorld& world) {
  const int n = static_cast<int>(world.truth.positions.size());
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(2 * n, 2 * n);
  for (const Constraint* constraint : world.graph->Constraints()) {
    const auto i = constraint->features[0];
    const auto j = constraint->features[1];
    const Eigen::Vector2d u =
        (world.truth.positions[j] - world.truth.positions[i]).normalized();
    const Eigen::Matrix2d block = u * u.transpose();
    normal.block<2, 2>(2 * i, 2 * i) += block;
    normal.block<2, 2>(2 * j, 2 * j) += block;
    normal.block<2, 2>(2 * i, 2 * j) -= block;
    normal.block<2, 2>(2 * j, 2 * i) -= block;
  }
  // Point 0 and y of point 1 (in the same row, along x) stay.
  normal(3, 3) += 1.0;
  normal(0, 0) += 1.0;
  normal(1, 1) += 1.0;
  const Eigen::LDLT<Eigen::MatrixXd> ldlt(normal);
  return ldlt.vectorD().minCoeff();
}

std::size_t Reachable(const SyntheticWorld& world) {
  std::map<FeatureId, std::vector<FeatureId>> neighbours;
  for (const Constraint* constraint : world.graph->Constraints()) {
    neighbours[constraint->features[0]].push_back(constraint->features[1]);
    neighbours[constraint->features[1]].push_back(constraint->features[0]);
  }
  std::set<FeatureId> seen = {0};
  std::queue<FeatureId> next;
  next.push(0);
  while (!next.empty()) {
    for (const FeatureId id : neighbours[next.front()]) {
      if (seen.insert(id).second) next.push(id);
    }
    next.pop();
  }
  return seen.size();
}

TEST_F(SyntheticWorldsTest, S1HasThePapersSize) {
  const SyntheticWorld world = Make("S1");
  EXPECT_EQ(world.graph->num_features(), 572u);
  EXPECT_EQ(world.graph->num_constraints(), 1193u);
  EXPECT_EQ(world.truth.lines.size(), 14u);
  EXPECT_EQ(world.truth.orientations.size(), 2u);
  EXPECT_EQ(world.truth.circles.size(), 8u);
  EXPECT_EQ(world.truth.centers.size(), 4u);
  EXPECT_EQ(world.truth.num_virtual_features(), 28);
  EXPECT_TRUE(world.truth.outliers.empty());
}

TEST_F(SyntheticWorldsTest, S1PointsLieOnTheirStructure) {
  const SyntheticTruth truth = Make("S1").truth;
  std::vector<int> supports(truth.positions.size(), 0);
  for (const SyntheticLine& line : truth.lines) {
    EXPECT_GE(line.points.size(), 11u);
    const Eigen::Vector2d along = (line.end - line.begin).normalized();
    const double angle = truth.orientations[line.orientation];
    EXPECT_NEAR(std::abs(along.x()), std::cos(angle), 1e-12);
    for (const FeatureId id : line.points) {
      const Eigen::Vector2d p = truth.positions[id] - line.begin;
      EXPECT_NEAR(along.x() * p.y() - along.y() * p.x(), 0.0, 1e-12);
      ++supports[id];
    }
  }
  for (const SyntheticCircle& circle : truth.circles) {
    EXPECT_GE(circle.points.size(), 20u);
    EXPECT_EQ(circle.center, truth.centers[circle.common_center]);
    for (const FeatureId id : circle.points) {
      EXPECT_NEAR((truth.positions[id] - circle.center).norm(), circle.radius,
                  1e-12);
      ++supports[id];
    }
  }
  EXPECT_EQ(std::count(supports.begin(), supports.end(), 1), 572);
  std::vector<int> circles_on(truth.centers.size(), 0);
  for (const SyntheticCircle& circle : truth.circles) {
    ++circles_on[circle.common_center];
  }
  EXPECT_EQ(circles_on, (std::vector<int>{2, 2, 2, 2}));
  // No two lines are one.
  std::set<std::pair<int, long>> offsets;
  for (const SyntheticLine& line : truth.lines) {
    const double offset =
        line.orientation == 0 ? line.begin.y() : line.begin.x();
    offsets.insert({line.orientation, std::lround(offset * 100)});
  }
  EXPECT_EQ(offsets.size(), 14u);
}

TEST_F(SyntheticWorldsTest, S1LinksNearPointsOnceAndIsRigid) {
  const SyntheticWorld world = MakeExact("S1");
  std::set<std::pair<FeatureId, FeatureId>> pairs;
  std::vector<int> degree(572, 0);
  for (const Constraint* constraint : world.graph->Constraints()) {
    EXPECT_EQ(constraint->type->name, "point_point_distance");
    EXPECT_EQ(constraint->kind, ConstraintClass::kMeasurement);
    EXPECT_TRUE(pairs.insert({constraint->features[0], constraint->features[1]})
                    .second);
    EXPECT_LT(constraint->features[0], constraint->features[1]);
    for (const FeatureId id : constraint->features) ++degree[id];
    EXPECT_GT(constraint->expected[0], 0.6);
    EXPECT_LT(constraint->expected[0], 2.6);
  }
  EXPECT_GE(*std::min_element(degree.begin(), degree.end()), 2);
  EXPECT_LE(*std::max_element(degree.begin(), degree.end()), 7);
  EXPECT_EQ(Reachable(world), 572u);
  EXPECT_GT(SmallestPivot(world), 1e-4);
}

TEST_F(SyntheticWorldsTest, NoiseIsUniformWithinItsBounds) {
  const SyntheticWorld world = Make("S1", 3);
  double largest = 0.0;
  double sum = 0.0;
  double squares = 0.0;
  for (const Feature* feature : world.graph->Features()) {
    for (const int i : {0, 1}) {
      const double error =
          feature->parameters[i] - world.truth.positions[feature->id][i];
      largest = std::max(largest, std::abs(error));
      sum += error;
      squares += error * error;
    }
  }
  EXPECT_LE(largest, 0.25);
  EXPECT_GT(largest, 0.24);
  // Five standard deviations of the mean of 1144 draws.
  EXPECT_NEAR(sum / 1144, 0.0, 0.022);
  EXPECT_NEAR(std::sqrt(squares / 1144), 0.25 / std::sqrt(3.0), 0.01);
  squares = 0.0;
  for (const Constraint* constraint : world.graph->Constraints()) {
    const double length = (world.truth.positions[constraint->features[0]] -
                           world.truth.positions[constraint->features[1]])
                              .norm();
    const double error = constraint->expected[0] - length;
    EXPECT_LE(std::abs(error), 0.05);
    squares += error * error;
    EXPECT_NEAR(constraint->information(0, 0), 3.0 / (0.05 * 0.05), 1e-9);
  }
  EXPECT_NEAR(std::sqrt(squares / 1193), 0.05 / std::sqrt(3.0), 0.002);
}

TEST_F(SyntheticWorldsTest, SeedsDrawNoiseButNotTheLayout) {
  const SyntheticWorld a = Make("S1", 1);
  const SyntheticWorld b = Make("S1", 1);
  const SyntheticWorld c = Make("S1", 2);
  EXPECT_EQ(a.graph->GetFeature(100).parameters,
            b.graph->GetFeature(100).parameters);
  EXPECT_NE(a.graph->GetFeature(100).parameters,
            c.graph->GetFeature(100).parameters);
  EXPECT_EQ(a.truth.positions, c.truth.positions);
}

TEST_F(SyntheticWorldsTest, OptionsSetTheNoise) {
  EXPECT_EQ(DefaultSyntheticOptions("S2").position_noise, 0.3);
  EXPECT_EQ(DefaultSyntheticOptions("S3").distance_noise, 0.1);
  const SyntheticWorld world = Make("S3");
  EXPECT_NEAR(world.graph->GetConstraint(0).information(0, 0), 300.0, 1e-9);
  // Exact distances have a floor under their deviation.
  EXPECT_NEAR(MakeExact("S1").graph->GetConstraint(0).information(0, 0), 1e6,
              1e-3);
}

TEST_F(SyntheticWorldsTest, S4IsS1WithPointsBesideTheStructure) {
  const SyntheticWorld s1 = Make("S1", 5);
  const SyntheticWorld s4 = Make("S4", 5);
  ASSERT_EQ(s4.graph->num_features(), 592u);
  EXPECT_EQ(s4.graph->num_constraints(), 1193u + 60u);
  EXPECT_EQ(s4.truth.outliers.size(), 20u);
  EXPECT_EQ(s4.truth.num_virtual_features(), 28);
  for (FeatureId id = 0; id < 572; ++id) {
    EXPECT_EQ(s1.graph->GetFeature(id).parameters,
              s4.graph->GetFeature(id).parameters);
  }
  for (ConstraintId id = 0; id < 1193; ++id) {
    EXPECT_EQ(s1.graph->GetConstraint(id).expected,
              s4.graph->GetConstraint(id).expected);
  }
  for (const FeatureId id : s4.truth.outliers) {
    EXPECT_GE(id, 572);
    const Eigen::Vector2d& p = s4.truth.positions[id];
    for (const SyntheticLine& line : s4.truth.lines) {
      const Eigen::Vector2d along = (line.end - line.begin).normalized();
      const Eigen::Vector2d q = p - line.begin;
      EXPECT_GE(std::abs(along.x() * q.y() - along.y() * q.x()), 0.5);
    }
    for (const SyntheticCircle& circle : s4.truth.circles) {
      EXPECT_GE(std::abs((p - circle.center).norm() - circle.radius), 0.5);
    }
    EXPECT_GE(s4.graph->ConstraintsOf(id).size(), 3u);
  }
  EXPECT_GT(SmallestPivot(s4), 1e-4);
}

TEST_F(SyntheticWorldsTest, S5TreesStandBesideALineInTurn) {
  const SyntheticWorld world = MakeExact("S5");
  EXPECT_EQ(world.truth.lines.size(), 6u);
  EXPECT_EQ(world.truth.orientations.size(), 1u);
  EXPECT_TRUE(world.truth.circles.empty());
  EXPECT_EQ(world.graph->num_features(), 3u * 61u + 2u * 30u);
  ASSERT_EQ(world.truth.outliers.size(), 60u);
  for (int i = 0; i < 60; ++i) {
    const Eigen::Vector2d& tree =
        world.truth.positions[world.truth.outliers[i]];
    EXPECT_NEAR(tree.x(), i % 30 + 0.5, 1e-12);
    const double deviation = tree.y() - (i < 30 ? 4.75 : 14.25);
    EXPECT_EQ(deviation > 0.0, i % 2 == 1);
    EXPECT_GE(std::abs(deviation), 0.05);
    EXPECT_LE(std::abs(deviation), 0.15);
  }
  EXPECT_EQ(Reachable(world), world.graph->num_features());
  EXPECT_GT(SmallestPivot(world), 1e-4);
}

TEST_F(SyntheticWorldsTest, S6HasSixConcentricCirclesAndOneThatIsNot) {
  std::set<FeatureId> places;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const SyntheticWorld world = Make("S6", seed);
    ASSERT_EQ(world.graph->num_features(), 8u);
    EXPECT_EQ(world.graph->num_constraints(), 7u);
    EXPECT_TRUE(world.graph->GetFeature(0).fixed);
    ASSERT_EQ(world.truth.outliers.size(), 1u);
    places.insert(world.truth.outliers[0]);
    for (FeatureId id = 1; id <= 7; ++id) {
      const Eigen::Vector2d& center = world.truth.positions[id];
      const SyntheticCircle& circle = world.truth.circles[id - 1];
      EXPECT_EQ(circle.center, center);
      if (id == world.truth.outliers[0]) {
        EXPECT_EQ(circle.common_center, -1);
        EXPECT_GE(center.minCoeff(), 0.2);
        EXPECT_LE(center.maxCoeff(), 0.5);
      } else {
        EXPECT_EQ(circle.common_center, 0);
        EXPECT_EQ(center, Eigen::Vector2d::Zero());
      }
      const Feature& feature = world.graph->GetFeature(id);
      EXPECT_LE(std::abs(feature.parameters[0] - center.x()), 0.1);
      EXPECT_LE(std::abs(feature.parameters[1] - center.y()), 0.1);
      EXPECT_EQ(feature.parameters[2], circle.radius);
    }
  }
  EXPECT_GE(places.size(), 4u);
}

TEST_F(SyntheticWorldsTest, PositionErrorIsFreeOfTheGauge) {
  SyntheticWorld world = MakeExact("S1");
  EXPECT_NEAR(MeanPositionError(*world.graph, world.truth), 0.0, 1e-12);
  for (Feature* feature : world.graph->MutableFeatures()) {
    const double x = feature->parameters[0];
    const double y = feature->parameters[1];
    feature->parameters[0] = 0.6 * x - 0.8 * y + 100.0;
    feature->parameters[1] = 0.8 * x + 0.6 * y - 7.0;
  }
  EXPECT_NEAR(MeanPositionError(*world.graph, world.truth), 0.0, 1e-9);
  const RigidTransform transform = AlignToTruth(*world.graph, world.truth);
  EXPECT_NEAR(transform.rotation(0, 0), 0.6, 1e-12);
  EXPECT_NEAR(transform.rotation(1, 0), -0.8, 1e-12);
}

TEST_F(SyntheticWorldsTest, PositionErrorWorkedOutByHand) {
  // Four points whose centre and directions stay: each is 0.1 m too far out.
  SyntheticTruth truth;
  truth.positions = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};
  Graph graph;
  Transaction transaction;
  for (const Eigen::Vector2d& p : truth.positions) {
    Feature feature;
    feature.type = &registry_.GetFeature("point");
    feature.parameters = {1.1 * p.x(), 1.1 * p.y()};
    transaction.AddFeature(feature);
  }
  graph.Apply(transaction);
  EXPECT_NEAR(MeanPositionError(graph, truth), 0.1, 1e-12);
  // The last one counts only when those beside the structure do; the map is
  // aligned on all.
  truth.outliers = {3};
  graph.GetFeature(3).parameters = {0.0, -1.5};
  const double all = MeanPositionError(graph, truth);
  const double structured = MeanPositionError(graph, truth, false);
  // Centre (0, -0.1): errors (0.1, 0.1), (0, 0.2), (-0.1, 0.1), (0, -0.4).
  EXPECT_NEAR(all, (2 * std::sqrt(0.02) + 0.2 + 0.4) / 4, 1e-12);
  EXPECT_NEAR(structured, (2 * std::sqrt(0.02) + 0.2) / 3, 1e-12);
  // With a fixed feature the map has its place.
  graph.GetFeature(0).fixed = true;
  EXPECT_NEAR(MeanPositionError(graph, truth), (0.1 + 0.1 + 0.5) / 3, 1e-12);
}

TEST_F(SyntheticWorldsTest, TruthAsJson) {
  const SyntheticTruth truth = Make("S4").truth;
  std::ostringstream output;
  WriteSyntheticTruth(truth, output);
  const nlohmann::json json = nlohmann::json::parse(output.str());
  EXPECT_EQ(json["format"], "plumbline-synthetic-truth");
  EXPECT_EQ(json["version"], 1);
  ASSERT_EQ(json["positions"].size(), 592u);
  EXPECT_EQ(json["positions"][7][0], 7);
  EXPECT_NEAR(json["positions"][7][1].get<double>(), truth.positions[7].x(),
              1e-6);
  EXPECT_EQ(json["lines"].size(), 14u);
  EXPECT_EQ(json["lines"][0]["points"].size(), truth.lines[0].points.size());
  EXPECT_EQ(json["circles"].size(), 8u);
  EXPECT_EQ(json["circles"][3]["common_center"], 1);
  EXPECT_EQ(json["orientations_deg"], (nlohmann::json{0.0, 90.0}));
  EXPECT_EQ(json["centers"].size(), 4u);
  EXPECT_EQ(json["outliers"].size(), 20u);
}

TEST_F(SyntheticWorldsTest, RefusesWhatItCannotMake) {
  EXPECT_THROW(MakeSyntheticWorld("S7", {}, 1, registry_), Error);
  EXPECT_THROW(MakeSyntheticWorld("", {}, 1, registry_), Error);
  SyntheticOptions options;
  options.position_noise = -0.1;
  EXPECT_THROW(MakeSyntheticWorld("S1", options, 1, registry_), Error);
  options.position_noise = std::nan("");
  EXPECT_THROW(MakeSyntheticWorld("S1", options, 1, registry_), Error);
  options = {};
  options.distance_noise = 0.5;
  EXPECT_THROW(MakeSyntheticWorld("S1", options, 1, registry_), Error);
  options = {};
  options.outliers = -1;
  EXPECT_THROW(MakeSyntheticWorld("S1", options, 1, registry_), Error);
  options.outliers = 1001;
  EXPECT_THROW(MakeSyntheticWorld("S1", options, 1, registry_), Error);
}

}  // namespace
}  // namespace plumbline
