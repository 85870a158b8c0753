#ifndef PLUMBLINE_TEST_CORE_EM_TEST_UTIL_H_
#define PLUMBLINE_TEST_CORE_EM_TEST_UTIL_H_

#include <gtest/gtest.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/detector.h>
#include <plumbline/factors/angle.h>

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {

// A detector made of a function.
class TestDetector : public StructureDetector {
 public:
  using Function = std::function<Transaction(const Graph&, const Registry&,
                                             const DetectionScope&)>;
  TestDetector(std::string name, int support, Function detect,
               bool keeps_followers = false)
      : name_(std::move(name)),
        support_(support),
        keeps_followers_(keeps_followers),
        detect_(std::move(detect)) {}
  const std::string& name() const override { return name_; }
  int minimum_support() const override { return support_; }
  bool keeps_followers() const override { return keeps_followers_; }
  Transaction Detect(const Graph& graph, const Registry& registry,
                     const DetectionScope& scope) const override {
    return detect_(graph, registry, scope);
  }

 private:
  std::string name_;
  int support_;
  bool keeps_followers_;
  Function detect_;
};

// Registers a detector of this name, unless there is one. Tests make theirs by
// hand.
inline const DetectorType& RegisterTestDetector(const std::string& name,
                                                Registry* registry) {
  const DetectorType* const there = registry->FindDetector(name);
  if (there != nullptr) return *there;
  DetectorType type;
  type.name = name;
  type.reads = {"segment"};
  type.make = [name](const DetectorParameters&) {
    return std::make_unique<TestDetector>(name, 1, nullptr);
  };
  return registry->Register(std::move(type));
}

inline Feature Orientation(const Registry& registry, double angle,
                           int level = 1) {
  Feature feature;
  feature.type = &registry.GetFeature("orientation");
  feature.level = level;
  feature.is_virtual = true;
  feature.parameters[0] = angle;
  return feature;
}

inline Constraint Structure(const Registry& registry,
                            const std::string& relation, FeatureId a,
                            FeatureId b, double expected,
                            double sigma_degrees) {
  Constraint constraint;
  constraint.type = &registry.GetRelation(relation);
  constraint.features = {a, b};
  constraint.expected = Eigen::VectorXd::Constant(1, expected);
  const double sigma = DegToRad(sigma_degrees);
  constraint.information = Eigen::MatrixXd::Constant(1, 1, 1 / (sigma * sigma));
  constraint.kind = ConstraintClass::kStructure;
  return constraint;
}

inline bool HasLive(const Graph& graph, FeatureId id,
                    const std::string& relation) {
  for (const ConstraintId constraint_id : graph.ConstraintsOf(id)) {
    const Constraint& constraint = graph.GetConstraint(constraint_id);
    if (constraint.state == ConstraintState::kLive &&
        constraint.type->name == relation) {
      return true;
    }
  }
  return false;
}

// Walls seen from a robot that stands still.
class WallsTest : public ::testing::Test {
 protected:
  WallsTest() {
    RegisterBuiltinRelations(&registry_);
    Feature robot;
    robot.type = &registry_.GetFeature("pose");
    robot.fixed = true;
    Transaction transaction;
    transaction.AddFeature(robot);
    robot_ = graph_.Apply(transaction).features[0];
  }

  // A segment seen from the fixed robot in this direction, to 1 cm and 1
  // degree.
  FeatureId AddSegment(double degrees) {
    Feature segment;
    segment.type = &registry_.GetFeature("segment");
    const double n = static_cast<double>(segments_.size());
    segment.parameters = {n, 1.0, DegToRad(degrees)};
    Constraint seen;
    seen.type = &registry_.GetRelation("pose_pose");
    seen.expected = Eigen::Vector3d(n, 1.0, DegToRad(degrees));
    const double sigma = DegToRad(1.0);
    seen.information =
        Eigen::Vector3d(1e4, 1e4, 1.0 / (sigma * sigma)).asDiagonal();
    Transaction transaction;
    seen.features = {robot_, transaction.AddFeature(segment)};
    transaction.AddConstraint(seen);
    const TransactionResult result = graph_.Apply(transaction);
    segments_.push_back(result.features[0]);
    sightings_.push_back(result.constraints[0]);
    return segments_.back();
  }

  // The robot now sees the i-th segment in this direction.
  void Turn(std::size_t i, double degrees) {
    const Constraint& seen = graph_.GetConstraint(sightings_[i]);
    Eigen::VectorXd expected = seen.expected;
    expected[2] = DegToRad(degrees);
    graph_.UpdateConstraint(seen.id, expected, seen.information);
  }

  // An orientation of level 1 at this direction, with constraints to these
  // walls, tolerance 0.5 degrees, as a detector of this name makes it.
  FeatureId AddOrientation(double degrees, const std::vector<FeatureId>& walls,
                           const std::string& maker = "directions") {
    Transaction transaction;
    Feature orientation = Orientation(registry_, DegToRad(degrees));
    orientation.maker = &RegisterTestDetector(maker, &registry_);
    const FeatureId id = transaction.AddFeature(orientation);
    for (const FeatureId wall : walls) {
      transaction.AddConstraint(
          Structure(registry_, "segment_orientation", wall, id, 0.0, 0.5));
    }
    return graph_.Apply(transaction).features[0];
  }

  double Direction(FeatureId segment) const {
    return RadToDeg(graph_.GetFeature(segment).parameters[2]);
  }
  double Angle(FeatureId orientation) const {
    return RadToDeg(graph_.GetFeature(orientation).parameters[0]);
  }

  // The live structure constraint between two features, kNoId for none.
  ConstraintId Between(FeatureId a, FeatureId b) const {
    for (const ConstraintId id : graph_.ConstraintsOf(a)) {
      const Constraint& constraint = graph_.GetConstraint(id);
      if (constraint.kind == ConstraintClass::kStructure &&
          constraint.state == ConstraintState::kLive &&
          (constraint.features[0] == b || constraint.features[1] == b)) {
        return id;
      }
    }
    return kNoId;
  }

  void Break(ConstraintId id) {
    Transaction transaction;
    transaction.BreakConstraint(id);
    graph_.Apply(transaction);
  }

  Registry registry_;
  Graph graph_;
  FeatureId robot_ = kNoId;
  std::vector<FeatureId> segments_;
  std::vector<ConstraintId> sightings_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_TEST_CORE_EM_TEST_UTIL_H_
