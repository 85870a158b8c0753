#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/error.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>

#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

FeatureType MakeType(const std::string& name, int size) {
  FeatureType type;
  type.name = name;
  type.size = size;
  return type;
}

RelationType MakeRelation() {
  RelationType type;
  type.name = "link";
  type.feature_types = {{"dot", "bar"}, {"dot"}};
  type.residual_size = 2;
  return type;
}

class GraphTest : public ::testing::Test {
 protected:
  Feature Dot(double x = 0.0) const {
    Feature feature;
    feature.type = &dot_;
    feature.parameters[0] = x;
    return feature;
  }

  Constraint Link(FeatureId a, FeatureId b) const {
    Constraint constraint;
    constraint.type = &link_;
    constraint.features = {a, b};
    constraint.expected = Eigen::Vector2d(1.0, 2.0);
    constraint.information = Eigen::Matrix2d::Identity();
    return constraint;
  }

  // Three dots in a chain: constraints 0 (0-1) and 1 (1-2).
  void AddChain() {
    Transaction transaction;
    const FeatureId a = transaction.AddFeature(Dot(10.0));
    const FeatureId b = transaction.AddFeature(Dot(11.0));
    const FeatureId c = transaction.AddFeature(Dot(12.0));
    transaction.AddConstraint(Link(a, b));
    transaction.AddConstraint(Link(b, c));
    graph_.Apply(transaction);
  }

  // The transaction is refused with a message that holds `part`, and the graph
  // is as it was.
  void ExpectRefused(const Transaction& transaction, const std::string& part) {
    const std::size_t features = graph_.num_features();
    const std::size_t constraints = graph_.num_constraints();
    const FeatureId feature_end = graph_.feature_id_end();
    const ConstraintId constraint_end = graph_.constraint_id_end();
    std::vector<ConstraintState> states;
    for (const Constraint* constraint : graph_.Constraints()) {
      states.push_back(constraint->state);
    }
    try {
      graph_.Apply(transaction);
      ADD_FAILURE() << "not refused; expected: " << part;
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr(part));
    }
    EXPECT_EQ(graph_.num_features(), features);
    EXPECT_EQ(graph_.num_constraints(), constraints);
    EXPECT_EQ(graph_.feature_id_end(), feature_end);
    EXPECT_EQ(graph_.constraint_id_end(), constraint_end);
    std::vector<ConstraintState> states_after;
    for (const Constraint* constraint : graph_.Constraints()) {
      states_after.push_back(constraint->state);
    }
    EXPECT_EQ(states_after, states);
  }

  const FeatureType dot_ = MakeType("dot", 2);
  const FeatureType bar_ = MakeType("bar", 3);
  const RelationType link_ = MakeRelation();
  Graph graph_;
};

TEST_F(GraphTest, IsRestoredUnderTheSameIds) {
  AddChain();
  Transaction change;
  change.RemoveConstraint(0);
  change.BreakConstraint(1);
  change.RemoveFeature(0);
  graph_.Apply(std::move(change));
  std::vector<Feature> features;
  for (const Feature* feature : std::as_const(graph_).Features()) {
    features.push_back(*feature);
  }
  std::vector<Constraint> constraints;
  for (const Constraint* constraint : std::as_const(graph_).Constraints()) {
    constraints.push_back(*constraint);
  }
  Graph copy;
  copy.Restore(features, constraints, 4, 2);
  EXPECT_EQ(copy.num_features(), 2u);
  EXPECT_EQ(copy.num_constraints(), 1u);
  EXPECT_EQ(copy.FindFeature(0), nullptr);
  EXPECT_EQ(copy.GetFeature(2).parameters[0], 12.0);
  EXPECT_EQ(copy.GetConstraint(1).state, ConstraintState::kBroken);
  EXPECT_THAT(copy.ConstraintsOf(1), ElementsAre(1));
  // The id 3 was handed out and is gone, too.
  Transaction more;
  more.AddFeature(Dot(1.0));
  EXPECT_THAT(copy.Apply(std::move(more)).features, ElementsAre(4));
  // Nor twice, nor with ids that do not fit.
  EXPECT_THROW(copy.Restore(features, constraints, 4, 2), Error);
  Graph other;
  EXPECT_THROW(other.Restore(features, constraints, 2, 2), Error);
  EXPECT_THROW(other.Restore({features[0]}, constraints, 4, 2), Error);
  EXPECT_EQ(other.feature_id_end(), 0);
}

TEST_F(GraphTest, HandsOutIdsInOrder) {
  AddChain();
  EXPECT_EQ(graph_.num_features(), 3u);
  EXPECT_EQ(graph_.num_constraints(), 2u);
  EXPECT_EQ(graph_.feature_id_end(), 3);
  EXPECT_EQ(graph_.GetFeature(2).id, 2);
  EXPECT_EQ(graph_.GetFeature(2).parameters[0], 12.0);
  EXPECT_THAT(graph_.GetConstraint(1).features, ElementsAre(1, 2));
  EXPECT_THAT(graph_.ConstraintsOf(1), ElementsAre(0, 1));
  EXPECT_THAT(graph_.ConstraintsOf(0), ElementsAre(0));
}

TEST_F(GraphTest, ResultNamesTheIdsGiven) {
  AddChain();
  Transaction transaction;
  const FeatureId added = transaction.AddFeature(Dot());
  transaction.AddConstraint(Link(2, added));
  const TransactionResult result = graph_.Apply(transaction);
  EXPECT_THAT(result.features, ElementsAre(3));
  EXPECT_THAT(result.constraints, ElementsAre(2));
  EXPECT_THAT(graph_.GetConstraint(2).features, ElementsAre(2, 3));
}

TEST_F(GraphTest, ParametersPastTheSizeAreZero) {
  Feature feature = Dot();
  feature.parameters.fill(1.0);
  feature.parameters[1] = 2.0;
  Transaction transaction;
  transaction.AddFeature(feature);
  graph_.Apply(transaction);
  std::array<double, kMaxFeatureSize> expected = {1.0, 2.0};
  EXPECT_EQ(graph_.GetFeature(0).parameters, expected);
}

TEST_F(GraphTest, IdsAreNeverReusedAndIterationSkipsHoles) {
  AddChain();
  Transaction removal;
  removal.RemoveConstraint(0);
  removal.RemoveFeature(0);
  graph_.Apply(removal);
  Transaction addition;
  addition.AddFeature(Dot());
  EXPECT_THAT(graph_.Apply(addition).features, ElementsAre(3));
  std::vector<FeatureId> ids;
  for (const Feature* feature : graph_.Features()) ids.push_back(feature->id);
  EXPECT_THAT(ids, ElementsAre(1, 2, 3));
  EXPECT_EQ(graph_.Constraints().size(), 1u);
  EXPECT_EQ(graph_.FindFeature(0), nullptr);
  EXPECT_EQ(graph_.FindConstraint(0), nullptr);
  EXPECT_THAT(graph_.ConstraintsOf(1), ElementsAre(1));
  EXPECT_THROW(graph_.GetFeature(0), Error);
  EXPECT_THROW(graph_.GetConstraint(0), Error);
  EXPECT_THROW(graph_.ConstraintsOf(0), Error);
}

TEST_F(GraphTest, LookUpsOutOfRange) {
  EXPECT_EQ(graph_.FindFeature(kNoId), nullptr);
  EXPECT_EQ(graph_.FindFeature(0), nullptr);
  EXPECT_EQ(graph_.FindFeature(1000000), nullptr);
  EXPECT_EQ(graph_.FindConstraint(-7), nullptr);
  EXPECT_THAT(graph_.Features(), IsEmpty());
}

TEST_F(GraphTest, AddressesAreStable) {
  AddChain();
  const Feature* feature = graph_.FindFeature(0);
  const Constraint* constraint = graph_.FindConstraint(0);
  for (int i = 0; i < 1000; ++i) {
    Transaction transaction;
    const FeatureId added = transaction.AddFeature(Dot());
    transaction.AddConstraint(Link(0, added));
    graph_.Apply(transaction);
  }
  EXPECT_EQ(graph_.FindFeature(0), feature);
  EXPECT_EQ(graph_.FindConstraint(0), constraint);
}

TEST_F(GraphTest, FeatureInUseStays) {
  AddChain();
  Transaction transaction;
  transaction.AddFeature(Dot());
  transaction.RemoveConstraint(0);
  transaction.RemoveFeature(1);
  ExpectRefused(transaction, "dot 1 cannot be removed: live constraint link 1");
}

TEST_F(GraphTest, BrokenConstraintsGoWithTheFeature) {
  AddChain();
  Transaction transaction;
  transaction.BreakConstraint(0);
  graph_.Apply(transaction);
  EXPECT_EQ(graph_.GetConstraint(0).state, ConstraintState::kBroken);
  EXPECT_THAT(graph_.ConstraintsOf(0), ElementsAre(0));

  Transaction removal;
  removal.RemoveFeature(0);
  graph_.Apply(removal);
  EXPECT_EQ(graph_.FindConstraint(0), nullptr);
  EXPECT_THAT(graph_.ConstraintsOf(1), ElementsAre(1));
  EXPECT_EQ(graph_.num_constraints(), 1u);
}

TEST_F(GraphTest, BothEndsOfABrokenConstraintRemoved) {
  AddChain();
  Transaction transaction;
  transaction.BreakConstraint(0);
  transaction.BreakConstraint(1);
  transaction.RemoveFeature(0);
  transaction.RemoveFeature(1);
  graph_.Apply(transaction);
  EXPECT_EQ(graph_.num_features(), 1u);
  EXPECT_EQ(graph_.num_constraints(), 0u);
  EXPECT_THAT(graph_.ConstraintsOf(2), IsEmpty());
}

TEST_F(GraphTest, RefusesBadIds) {
  AddChain();
  Transaction unknown_feature;
  unknown_feature.RemoveFeature(3);
  ExpectRefused(unknown_feature, "no feature 3");
  Transaction unknown_constraint;
  unknown_constraint.RemoveConstraint(2);
  ExpectRefused(unknown_constraint, "no constraint 2");
  Transaction unknown_broken;
  unknown_broken.BreakConstraint(-1);
  ExpectRefused(unknown_broken, "no constraint -1");
  Transaction dangling;
  dangling.AddFeature(Dot());
  dangling.AddConstraint(Link(0, 17));
  ExpectRefused(dangling, "no feature 17");
  Transaction provisional;
  provisional.AddConstraint(Link(0, Transaction::ProvisionalId(0)));
  ExpectRefused(provisional, "no added feature -2");
  Transaction removed_and_used;
  removed_and_used.RemoveConstraint(0);
  removed_and_used.RemoveFeature(0);
  removed_and_used.AddConstraint(Link(0, 2));
  ExpectRefused(removed_and_used, "no feature 0");
  Transaction twice;
  twice.RemoveConstraint(0);
  twice.RemoveConstraint(0);
  ExpectRefused(twice, "constraint 0 is named twice");
  Transaction both;
  both.RemoveConstraint(0);
  both.BreakConstraint(0);
  ExpectRefused(both, "both broken and removed");
}

TEST_F(GraphTest, RefusesToBreakTwice) {
  AddChain();
  Transaction transaction;
  transaction.BreakConstraint(0);
  graph_.Apply(transaction);
  ExpectRefused(transaction, "link 0 is broken already");
}

TEST_F(GraphTest, RefusesWhatDoesNotFit) {
  AddChain();
  Feature bar;
  bar.type = &bar_;
  Transaction wrong_type;
  wrong_type.AddConstraint(Link(0, wrong_type.AddFeature(bar)));
  ExpectRefused(wrong_type, "feature 2 of link is a bar: expected dot");

  Transaction fitting;
  const FeatureId id = fitting.AddFeature(bar);
  fitting.AddConstraint(Link(id, 0));
  EXPECT_NO_THROW(graph_.Apply(fitting));

  Transaction itself;
  itself.AddConstraint(Link(0, 0));
  ExpectRefused(itself, "itself");

  Constraint constraint = Link(0, 1);
  constraint.features.push_back(2);
  Transaction arity;
  arity.AddConstraint(constraint);
  ExpectRefused(arity, "between 3 features: expected 2");

  Transaction untyped;
  untyped.AddFeature(Feature());
  ExpectRefused(untyped, "without a type");
  Transaction untyped_constraint;
  untyped_constraint.AddConstraint(Constraint());
  ExpectRefused(untyped_constraint, "without a type");

  Feature negative = Dot();
  negative.level = -1;
  Transaction level;
  level.AddFeature(negative);
  ExpectRefused(level, "level -1");
  Feature high = Dot();
  high.level = kMaxLevel + 1;
  Transaction too_high;
  too_high.AddFeature(high);
  ExpectRefused(too_high, "level 1001: expected a level from 0 to 1000");
}

TEST_F(GraphTest, RefusesBadNumbers) {
  AddChain();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  const auto refuse = [this](const std::function<void(Constraint*)>& spoil,
                             const std::string& part) {
    Constraint constraint = Link(0, 1);
    spoil(&constraint);
    Transaction transaction;
    transaction.AddFeature(Dot());
    transaction.AddConstraint(constraint);
    ExpectRefused(transaction, part);
  };
  refuse([](Constraint* c) { c->expected = Eigen::Vector3d::Zero(); },
         "has 3 numbers: expected 2");
  refuse([](Constraint* c) { c->information = Eigen::Matrix3d::Identity(); },
         "is 3x3: expected 2x2");
  refuse([&](Constraint* c) { c->expected[1] = nan; }, "not finite");
  refuse([&](Constraint* c) { c->information(0, 0) = infinity; }, "not finite");
  refuse([](Constraint* c) { c->information(0, 1) = 0.5; }, "symmetric");
  refuse([](Constraint* c) { c->information(0, 0) = -1.0; }, "semidefinite");
  refuse([&](Constraint* c) { c->delta = nan; }, "delta");
  refuse([](Constraint* c) { c->delta = 1.5; }, "delta");

  Transaction feature;
  feature.AddFeature(Dot(nan));
  ExpectRefused(feature, "not finite");
  Feature anchored = Dot();
  anchored.anchor[1] = infinity;
  Transaction anchor;
  anchor.AddFeature(anchored);
  ExpectRefused(anchor, "not finite");
}

TEST_F(GraphTest, SemidefiniteInformationFits) {
  AddChain();
  Constraint constraint = Link(0, 2);
  constraint.information << 4.0, 2.0, 2.0, 1.0;
  Transaction transaction;
  transaction.AddConstraint(constraint);
  EXPECT_NO_THROW(graph_.Apply(transaction));
}

TEST_F(GraphTest, UpdateConstraintChecksAsApplyDoes) {
  AddChain();
  graph_.UpdateConstraint(0, Eigen::Vector2d(5.0, 6.0),
                          2.0 * Eigen::Matrix2d::Identity());
  EXPECT_EQ(graph_.GetConstraint(0).expected[1], 6.0);
  EXPECT_EQ(graph_.GetConstraint(0).information(0, 0), 2.0);
  EXPECT_THROW(graph_.UpdateConstraint(0, Eigen::Vector3d::Zero(),
                                       Eigen::Matrix2d::Identity()),
               Error);
  EXPECT_THROW(graph_.UpdateConstraint(0, Eigen::Vector2d::Zero(),
                                       -Eigen::Matrix2d::Identity()),
               Error);
  EXPECT_EQ(graph_.GetConstraint(0).expected[1], 6.0);
  EXPECT_THROW(graph_.UpdateConstraint(9, Eigen::Vector2d::Zero(),
                                       Eigen::Matrix2d::Identity()),
               Error);

  Transaction transaction;
  transaction.BreakConstraint(0);
  Constraint structure = Link(0, 2);
  structure.kind = ConstraintClass::kStructure;
  transaction.AddConstraint(structure);
  graph_.Apply(transaction);
  EXPECT_THROW(graph_.UpdateConstraint(0, Eigen::Vector2d::Zero(),
                                       Eigen::Matrix2d::Identity()),
               Error);
  EXPECT_THROW(graph_.UpdateConstraint(2, Eigen::Vector2d::Zero(),
                                       Eigen::Matrix2d::Identity()),
               Error);
}

class Recorder : public GraphListener {
 public:
  explicit Recorder(const Graph* graph) : graph_(graph) {}
  void OnFeatureAdded(const Feature& feature) override {
    EXPECT_EQ(graph_->FindFeature(feature.id), &feature);
    log.push_back("+f" + std::to_string(feature.id));
  }
  void OnFeatureRemoved(const Feature& feature) override {
    EXPECT_EQ(graph_->FindFeature(feature.id), nullptr);
    log.push_back("-f" + std::to_string(feature.id));
  }
  void OnConstraintAdded(const Constraint& constraint) override {
    EXPECT_EQ(graph_->FindConstraint(constraint.id), &constraint);
    log.push_back("+c" + std::to_string(constraint.id));
  }
  void OnConstraintChanged(const Constraint& constraint) override {
    log.push_back("~c" + std::to_string(constraint.id));
  }
  void OnConstraintRetired(const Constraint& constraint) override {
    log.push_back((constraint.state == ConstraintState::kBroken ? "!c" : "-c") +
                  std::to_string(constraint.id));
  }
  std::vector<std::string> log;

 private:
  const Graph* graph_;
};

TEST_F(GraphTest, ListenersAreToldInOrder) {
  Recorder recorder(&graph_);
  graph_.AddListener(&recorder);
  AddChain();
  EXPECT_THAT(recorder.log, ElementsAre("+f0", "+f1", "+f2", "+c0", "+c1"));
  recorder.log.clear();

  graph_.UpdateConstraint(1, Eigen::Vector2d::Zero(),
                          Eigen::Matrix2d::Identity());
  Transaction transaction;
  transaction.RemoveConstraint(1);
  transaction.BreakConstraint(0);
  transaction.RemoveFeature(2);
  const FeatureId added = transaction.AddFeature(Dot());
  transaction.AddConstraint(Link(0, added));
  graph_.Apply(transaction);
  EXPECT_THAT(recorder.log,
              ElementsAre("~c1", "!c0", "-c1", "-f2", "+f3", "+c2"));
  recorder.log.clear();

  // A broken constraint that goes with its feature is reported again.
  Transaction removal;
  removal.RemoveFeature(1);
  graph_.Apply(removal);
  EXPECT_THAT(recorder.log, ElementsAre("!c0", "-f1"));
  recorder.log.clear();

  graph_.RemoveListener(&recorder);
  Transaction more;
  more.AddFeature(Dot());
  graph_.Apply(more);
  EXPECT_THAT(recorder.log, IsEmpty());
}

TEST_F(GraphTest, RefusedTransactionTellsNobody) {
  AddChain();
  Recorder recorder(&graph_);
  graph_.AddListener(&recorder);
  Transaction transaction;
  transaction.AddFeature(Dot());
  transaction.BreakConstraint(0);
  transaction.RemoveFeature(77);
  ExpectRefused(transaction, "no feature 77");
  EXPECT_THAT(recorder.log, IsEmpty());
  graph_.RemoveListener(&recorder);
}

TEST_F(GraphTest, EmptyTransactionIsFine) {
  const TransactionResult result = graph_.Apply(Transaction());
  EXPECT_THAT(result.features, IsEmpty());
  EXPECT_THAT(result.constraints, IsEmpty());
}

}  // namespace
}  // namespace plumbline
