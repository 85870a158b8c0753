#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/em.h>
#include <plumbline/core/error.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/session.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/factors/angle.h>

#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::UnorderedElementsAre;

class RectangleTest : public ::testing::Test {
 protected:
  RectangleTest() { RegisterBuiltins(&registry_); }

  FeatureId Add(Feature feature) {
    Transaction transaction;
    transaction.AddFeature(std::move(feature));
    return graph_->Apply(std::move(transaction)).features[0];
  }

  // A wall from one end to the other, in a frame turned by turn_ and moved by
  // shift_; its position is a third of the way along.
  FeatureId AddWall(double x1, double y1, double x2, double y2,
                    const std::string& type = "segment", int level = 0) {
    const double c = std::cos(turn_), s = std::sin(turn_);
    const double length = std::hypot(x2 - x1, y2 - y1);
    const double angle = std::atan2(y2 - y1, x2 - x1) + turn_;
    const double x = x1 + (x2 - x1) / 3.0, y = y1 + (y2 - y1) / 3.0;
    const double px = shift_[0] + c * x - s * y;
    const double py = shift_[1] + s * x + c * y;
    Feature feature;
    feature.type = &registry_.GetFeature(type);
    feature.level = level;
    feature.is_virtual = level > 0;
    if (type == "line") {
      // Its foot point is 2 m to the right of the anchor and the wall a third
      // before it.
      feature.anchor = {px - 2.0 * std::sin(angle), py + 2.0 * std::cos(angle)};
      feature.parameters = {-2.0, angle};
    } else {
      feature.parameters = {px, py, angle};
    }
    feature.extent_begin = -length / 3.0;
    feature.extent_end = 2.0 * length / 3.0;
    return Add(feature);
  }

  // The walls of a room, seen from inside: each begins and ends `gap` from the
  // corner.
  std::vector<FeatureId> AddRoom(double x1, double y1, double x2, double y2,
                                 double gap = 0.1,
                                 const std::string& type = "segment",
                                 int level = 0) {
    return {AddWall(x1 + gap, y1, x2 - gap, y1, type, level),
            AddWall(x2, y1 + gap, x2, y2 - gap, type, level),
            AddWall(x2 - gap, y2, x1 + gap, y2, type, level),
            AddWall(x1, y2 - gap, x1, y1 + gap, type, level)};
  }

  Transaction Detect(const std::vector<FeatureId>* features = nullptr,
                     int level = 0,
                     const DetectorParameters& parameters = {}) const {
    DetectionScope scope;
    scope.level = level;
    scope.features = features;
    return registry_.GetDetector("rectangle")
        .make(parameters)
        ->Detect(*graph_, registry_, scope);
  }

  // Centres and sizes of what is found, rounded to 1 mm.
  static std::vector<std::array<int, 4>> Found(const Transaction& transaction) {
    std::vector<std::array<int, 4>> found;
    for (const Feature& feature : transaction.added_features()) {
      const auto& p = feature.parameters;
      const auto mm = [](double m) {
        return static_cast<int>(std::lround(1000.0 * m));
      };
      found.push_back({mm(p[0]), mm(p[1]), mm(2.0 * p[3]), mm(2.0 * p[4])});
    }
    return found;
  }

  // Walls by side in degrees.
  static std::map<int, std::vector<FeatureId>> Sides(
      const Transaction& transaction) {
    std::map<int, std::vector<FeatureId>> sides;
    for (const Constraint& constraint : transaction.added_constraints()) {
      EXPECT_EQ(constraint.expected[0], 0.0);
      sides[static_cast<int>(std::lround(RadToDeg(constraint.expected[1])))]
          .push_back(constraint.features[0]);
    }
    return sides;
  }

  Registry registry_;
  std::unique_ptr<Graph> graph_ = std::make_unique<Graph>();
  double turn_ = 0.0;
  std::array<double, 2> shift_ = {0.0, 0.0};
};

TEST_F(RectangleTest, FourWallsMakeARectangleOneLevelUp) {
  turn_ = DegToRad(10.0);
  shift_ = {100.0, -50.0};
  const std::vector<FeatureId> walls = AddRoom(-3.0, -2.0, 3.0, 2.0);
  const Transaction transaction =
      Detect(nullptr, 0, {{"sigma", 0.1}, {"sigma_deg", 0.5}});
  ASSERT_EQ(transaction.added_features().size(), 1u);
  const Feature& rectangle = transaction.added_features()[0];
  EXPECT_EQ(rectangle.type->name, "rectangle");
  EXPECT_EQ(rectangle.level, 1);
  EXPECT_TRUE(rectangle.is_virtual);
  EXPECT_EQ(rectangle.source, "rectangle");
  EXPECT_NEAR(rectangle.parameters[0], 100.0, 1e-9);
  EXPECT_NEAR(rectangle.parameters[1], -50.0, 1e-9);
  EXPECT_NEAR(rectangle.parameters[2], DegToRad(10.0), 1e-9);
  EXPECT_NEAR(rectangle.parameters[3], 3.0, 1e-9);
  EXPECT_NEAR(rectangle.parameters[4], 2.0, 1e-9);
  EXPECT_THAT(Sides(transaction),
              UnorderedElementsAre(std::pair(0, std::vector{walls[0]}),
                                   std::pair(90, std::vector{walls[1]}),
                                   std::pair(180, std::vector{walls[2]}),
                                   std::pair(-90, std::vector{walls[3]})));
  for (const Constraint& constraint : transaction.added_constraints()) {
    EXPECT_EQ(constraint.type->name, "segment_rectangle");
    EXPECT_EQ(constraint.kind, ConstraintClass::kStructure);
    EXPECT_EQ(constraint.source, "rectangle");
    EXPECT_EQ(constraint.features[1], Transaction::ProvisionalId(0));
    // 1 / (0.1 m)^2, 1 / (0.5 degrees)^2.
    EXPECT_NEAR(constraint.information(0, 0), 100.0, 1e-9);
    EXPECT_NEAR(constraint.information(1, 1), 13131.225, 0.01);
    EXPECT_EQ(constraint.information(0, 1), 0.0);
  }
  graph_->Apply(transaction);
  EXPECT_TRUE(Detect().empty());
  // What holds of walls that lie on it exactly: no residual.
  SolverSession session(graph_.get(), registry_, {});
  EXPECT_NEAR(session.Cost().total(), 0.0, 1e-15);
}

TEST_F(RectangleTest, LinesOfALevelMakeOneAsWell) {
  turn_ = DegToRad(-30.0);
  shift_ = {-7.0, 1e4};
  AddRoom(-1.0, -4.0, 1.0, 4.0, 0.3, "line", 1);
  EXPECT_TRUE(Detect().empty());  // level 0
  const Transaction transaction = Detect(nullptr, 1);
  ASSERT_EQ(transaction.added_features().size(), 1u);
  const Feature& rectangle = transaction.added_features()[0];
  EXPECT_EQ(rectangle.level, 2);
  EXPECT_NEAR(rectangle.parameters[0], -7.0, 1e-6);
  EXPECT_NEAR(rectangle.parameters[1], 1e4, 1e-6);
  EXPECT_NEAR(rectangle.parameters[2], DegToRad(-30.0), 1e-9);
  EXPECT_NEAR(rectangle.parameters[3], 1.0, 1e-6);
  EXPECT_NEAR(rectangle.parameters[4], 4.0, 1e-6);
  ASSERT_EQ(transaction.added_constraints().size(), 4u);
  EXPECT_EQ(transaction.added_constraints()[0].type->name, "line_rectangle");
  graph_->Apply(transaction);
  EXPECT_TRUE(Detect(nullptr, 1).empty());
  SolverSession session(graph_.get(), registry_, {});
  EXPECT_NEAR(session.Cost().total(), 0.0, 1e-9);
}

// However a room is turned, its direction is within 45 degrees of the map's.
TEST_F(RectangleTest, AnyDirection) {
  for (int degrees = -180; degrees < 180; degrees += 15) {
    turn_ = DegToRad(degrees + 1.0);
    shift_[0] += 20.0;
    AddRoom(-3.0, -2.0, 3.0, 2.0);
  }
  const Transaction transaction = Detect();
  ASSERT_EQ(transaction.added_features().size(), 24u);
  for (const Feature& feature : transaction.added_features()) {
    const auto& p = feature.parameters;
    EXPECT_LE(std::abs(RadToDeg(p[2])), 45.0);
    EXPECT_NEAR(std::max(p[3], p[4]), 3.0, 1e-6);
    EXPECT_NEAR(std::min(p[3], p[4]), 2.0, 1e-6);
  }
  EXPECT_EQ(transaction.added_constraints().size(), 96u);
  graph_->Apply(transaction);
  EXPECT_TRUE(Detect().empty());
  SolverSession session(graph_.get(), registry_, {});
  EXPECT_NEAR(session.Cost().total(), 0.0, 1e-9);
}

TEST_F(RectangleTest, WhatIsNone) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<std::pair<const char*, std::function<void()>>> cases = {
      {"nothing", [] {}},
      {"a niche",
       [&] {
         AddWall(0, 0, 6, 0);
         AddWall(0, 0, 0, 4);
         AddWall(6, 0, 6, 4);
       }},
      {"a corner behind a wide gap",
       [&] {
         AddRoom(0, 0, 6, 4);
         graph_->GetFeature(0).extent_begin += 0.6;
       }},
      {"a trapezoid",
       [&] {
         AddWall(0, 0, 6, 0);
         AddWall(6, 0, 6, 4);
         AddWall(6, 4, 0.5, 4);
         AddWall(0.5, 4, 0, 0);
       }},
      {"a parallelogram",
       [&] {
         AddWall(0, 0, 6, 0);
         AddWall(6, 0, 7, 4);
         AddWall(7, 4, 1, 4);
         AddWall(1, 4, 0, 0);
       }},
      {"a cupboard", [&] { AddRoom(0, 0, 2, 0.9, 0.0); }},
      {"a wall with a wide opening",
       [&] {
         AddWall(0, 0, 10, 0);
         AddWall(10, 0, 10, 6);
         AddWall(0, 0, 0, 6);
         AddWall(0, 6, 3, 6);
         AddWall(7, 6, 10, 6);
       }},
      {"the crossing of two corridors",
       [&] {
         for (const double y : {-1.0, 1.0}) {
           AddWall(-9, y, -1, y);
           AddWall(1, y, 9, y);
           AddWall(y, -9, y, -1);
           AddWall(y, 1, y, 9);
         }
       }},
      {"walls without a length",
       [&] {
         for (const FeatureId id : AddRoom(0, 0, 6, 4)) {
           graph_->GetFeature(id).extent_begin = 0.0;
           graph_->GetFeature(id).extent_end = 0.0;
         }
       }},
      {"a wall without a place",
       [&] {
         AddRoom(0, 0, 6, 4);
         graph_->GetFeature(2).parameters[1] = nan;
       }},
      {"a wall of another level",
       [&] {
         AddWall(0, 0, 6, 0);
         AddWall(6, 0, 6, 4);
         AddWall(6, 4, 0, 4);
         AddWall(0, 4, 0, 0, "segment", 1);
       }},
      {"parallel walls", [&] {
         for (int i = 0; i < 6; ++i) AddWall(0, i, 6, i);
       }}};
  for (const auto& [name, make] : cases) {
    SCOPED_TRACE(name);
    graph_ = std::make_unique<Graph>();
    make();
    EXPECT_TRUE(Detect().empty());
  }
}

// Each of the gates of the parameters, from both sides.
TEST_F(RectangleTest, ParametersAreWhatTheySay) {
  AddRoom(0.0, 0.0, 6.0, 4.0, 0.3);
  EXPECT_FALSE(Detect().empty());
  EXPECT_TRUE(Detect(nullptr, 0, {{"corner_gap", 0.29}}).empty());
  EXPECT_FALSE(Detect(nullptr, 0, {{"corner_gap", 0.31}}).empty());
  EXPECT_TRUE(Detect(nullptr, 0, {{"min_side", 4.1}}).empty());
  EXPECT_TRUE(Detect(nullptr, 0, {{"max_side", 5.9}}).empty());
  EXPECT_TRUE(Detect(nullptr, 0, {{"min_length", 3.5}}).empty());
  EXPECT_TRUE(Detect(nullptr, 0, {{"min_coverage", 0.9}}).empty());
  graph_->GetFeature(0).parameters[2] = DegToRad(2.0);
  EXPECT_FALSE(Detect().empty());
  EXPECT_TRUE(Detect(nullptr, 0, {{"gate_deg", 1.0}}).empty());
  for (const auto& [name, value] : DetectorParameters{{"sigma", 0.0},
                                                      {"sigma_deg", -1.0},
                                                      {"min_coverage", 1.1},
                                                      {"max_side", 0.5}}) {
    EXPECT_THROW(Detect(nullptr, 0, {{name, value}}), Error) << name;
  }
  try {
    Detect(nullptr, 0, {{"size", 1.0}});
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("rectangle has no parameter \"size\""));
    EXPECT_THAT(error.what(), HasSubstr("corner_gap"));
  }
}

// A wall with a door is two walls on one side; the one that was seen later
// joins the rectangle.
TEST_F(RectangleTest, WallsInALineShareASide) {
  AddWall(0.0, 0.0, 6.0, 0.0);
  AddWall(6.0, 0.0, 6.0, 4.0);
  AddWall(0.0, 0.0, 0.0, 4.0);
  const FeatureId left = AddWall(0.0, 4.0, 2.0, 4.0);
  const FeatureId right = AddWall(3.0, 4.02, 6.0, 4.02);
  Transaction transaction = Detect();
  ASSERT_EQ(transaction.added_features().size(), 1u);
  EXPECT_THAT(Sides(transaction)[180], UnorderedElementsAre(left, right));
  EXPECT_NEAR(2.0 * transaction.added_features()[0].parameters[4],
              4.0 + 0.02 * 3.0 / 5.0, 1e-3);
  const FeatureId rectangle = graph_->Apply(transaction).features[0];
  EXPECT_TRUE(Detect().empty());

  // The door's leaf, closed.
  const FeatureId door = AddWall(2.1, 4.03, 2.9, 4.03);
  // The other face of the wall, another room's wall in line, one across.
  AddWall(0.0, 4.08, 6.0, 4.08);
  AddWall(6.3, 4.0, 12.0, 4.0);
  AddWall(3.0, 3.0, 3.0, 4.0);
  transaction = Detect();
  EXPECT_TRUE(transaction.added_features().empty());
  ASSERT_EQ(transaction.added_constraints().size(), 1u);
  EXPECT_THAT(transaction.added_constraints()[0].features,
              ElementsAre(door, rectangle));
  EXPECT_NEAR(RadToDeg(transaction.added_constraints()[0].expected[1]), 180.0,
              1e-9);
  graph_->Apply(transaction);
  EXPECT_TRUE(Detect().empty());
}

// Rooms side by side, between two long walls: the rooms, and not what several
// of them make together.
TEST_F(RectangleTest, SmallestOnesOnly) {
  AddWall(0.0, 0.0, 12.0, 0.0);
  AddWall(0.0, 5.0, 12.0, 5.0);
  for (const double x : {0.0, 4.0, 8.0, 12.0}) AddWall(x, 0.0, x, 5.0);
  const Transaction transaction = Detect();
  EXPECT_THAT(Found(transaction),
              UnorderedElementsAre(ElementsAre(2000, 2500, 4000, 5000),
                                   ElementsAre(6000, 2500, 4000, 5000),
                                   ElementsAre(10000, 2500, 4000, 5000)));
  EXPECT_EQ(transaction.added_constraints().size(), 12u);
  graph_->Apply(transaction);
  EXPECT_TRUE(Detect().empty());
}

// A pillar in a room, and a court: one in the other.
TEST_F(RectangleTest, OneInTheOther) {
  AddRoom(0.0, 0.0, 12.0, 9.0);
  AddRoom(4.0, 4.0, 6.0, 5.5);
  const Transaction transaction = Detect();
  EXPECT_THAT(Found(transaction),
              UnorderedElementsAre(ElementsAre(6000, 4500, 12000, 9000),
                                   ElementsAre(5000, 4750, 2000, 1500)));
  graph_->Apply(transaction);
  EXPECT_TRUE(Detect().empty());
}

TEST_F(RectangleTest, ReadsWhatTheScopeLists) {
  const std::vector<FeatureId> first = AddRoom(0.0, 0.0, 6.0, 4.0);
  std::vector<FeatureId> second = AddRoom(7.0, 0.0, 13.0, 4.0);
  second.push_back(999);
  const Transaction transaction = Detect(&second);
  EXPECT_THAT(Found(transaction),
              ElementsAre(ElementsAre(10000, 2000, 6000, 4000)));
  graph_->Apply(transaction);
  EXPECT_TRUE(Detect(&second).empty());
  EXPECT_EQ(Found(Detect()).size(), 1u);
  second.pop_back();
  second.pop_back();
  EXPECT_TRUE(Detect(&first).added_features().size() == 1u);
}

// A rectangle that lost a side has no size across it: it goes, however many
// walls hold the other sides.
TEST_F(RectangleTest, GoesWithASide) {
  const std::vector<FeatureId> walls = {
      AddWall(0.0, 0.0, 2.5, 0.0), AddWall(3.5, 0.0, 6.0, 0.0),
      AddWall(6.0, 0.0, 6.0, 4.0), AddWall(6.0, 4.0, 0.0, 4.0),
      AddWall(0.0, 4.0, 0.0, 0.0)};
  // In truth the last wall is 1.5 degrees off, and well measured to be.
  graph_->GetFeature(walls[4]).parameters[2] += DegToRad(1.5);
  Transaction measurements;
  Feature robot;
  robot.type = &registry_.GetFeature("pose");
  robot.fixed = true;
  const FeatureId pose = measurements.AddFeature(robot);
  for (const FeatureId wall : walls) {
    const auto& p = graph_->GetFeature(wall).parameters;
    Constraint constraint;
    constraint.type = &registry_.GetRelation("pose_pose");
    constraint.features = {pose, wall};
    constraint.expected = Eigen::Vector3d(p[0], p[1], p[2]);
    constraint.information = Eigen::Vector3d(1e6, 1e6, 1e8).asDiagonal();
    measurements.AddConstraint(constraint);
  }
  graph_->Apply(std::move(measurements));
  ASSERT_EQ(Found(Detect()).size(), 1u);
  SolverSession session(graph_.get(), registry_, {});
  EmOrchestrator em(
      graph_.get(), &session, registry_,
      MakeHierarchy(ParseHierarchy("rectangle"), registry_, {"segment"}, {}),
      {});
  EXPECT_TRUE(em.Run().converged());
  EXPECT_TRUE(graph_->VirtualFeatures(1).empty());
  // Without the false wall it would have stayed.
  graph_->GetFeature(walls[4]).parameters[2] -= DegToRad(1.5);
  for (Constraint* constraint : graph_->MutableConstraints()) {
    if (constraint->features.back() == walls[4]) {
      Eigen::VectorXd expected = constraint->expected;
      expected[2] -= DegToRad(1.5);
      graph_->UpdateConstraint(constraint->id, expected,
                               constraint->information);
    }
  }
  EmOrchestrator again(
      graph_.get(), &session, registry_,
      MakeHierarchy(ParseHierarchy("rectangle"), registry_, {"segment"}, {}),
      {});
  EXPECT_TRUE(again.Run().converged());
  EXPECT_EQ(graph_->VirtualFeatures(1).size(), 1u);
}

}  // namespace
}  // namespace plumbline
