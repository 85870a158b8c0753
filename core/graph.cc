#include <plumbline/core/error.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/information.h>
#include <plumbline/core/registry.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

namespace plumbline {
namespace {

std::string Describe(const Feature& feature) {
  return feature.type->name + " " + std::to_string(feature.id);
}

std::string Describe(const Constraint& constraint) {
  return constraint.type->name + " " + std::to_string(constraint.id);
}

template <typename Range>
bool AllFinite(const Range& numbers) {
  return std::all_of(numbers.begin(), numbers.end(),
                     [](double number) { return std::isfinite(number); });
}

void CheckNumbers(const RelationType& type, const Eigen::VectorXd& expected,
                  const Eigen::MatrixXd& information) {
  const Eigen::Index size = type.residual_size;
  if (expected.size() != size) {
    throw PLUMBLINE_ERROR("expected value of " + type.name + " has " +
                              std::to_string(expected.size()) + " numbers",
                          std::to_string(size));
  }
  if (information.rows() != size || information.cols() != size) {
    throw PLUMBLINE_ERROR("information of " + type.name + " is " +
                              std::to_string(information.rows()) + "x" +
                              std::to_string(information.cols()),
                          std::to_string(size) + "x" + std::to_string(size));
  }
  if (!expected.allFinite() || !information.allFinite()) {
    throw PLUMBLINE_ERROR(type.name + " has a number that is not finite",
                          "finite numbers");
  }
  if (!IsValidInformation(information)) {
    throw PLUMBLINE_ERROR("information of " + type.name + " is not valid",
                          "a symmetric positive semidefinite matrix");
  }
}

void CheckFeature(const Feature& feature) {
  if (feature.type == nullptr) {
    throw PLUMBLINE_ERROR("feature without a type", "a registered type");
  }
  const std::array<double, 2> extent = {feature.extent_begin,
                                        feature.extent_end};
  if (!AllFinite(feature.parameters) || !AllFinite(feature.anchor) ||
      !AllFinite(extent)) {
    throw PLUMBLINE_ERROR(
        feature.type->name + " has a number that is not finite",
        "finite numbers");
  }
  if (feature.level < 0 || feature.level > kMaxLevel) {
    throw PLUMBLINE_ERROR(
        feature.type->name + " of level " + std::to_string(feature.level),
        "a level from 0 to " + std::to_string(kMaxLevel));
  }
}

// Sorted ids; throws when one occurs twice.
template <typename Id>
std::vector<Id> SortedUnique(std::vector<Id> ids, const std::string& what) {
  std::sort(ids.begin(), ids.end());
  const auto twice = std::adjacent_find(ids.begin(), ids.end());
  if (twice != ids.end()) {
    throw PLUMBLINE_ERROR(what + " " + std::to_string(*twice) +
                              " is named twice in a transaction",
                          "each id once");
  }
  return ids;
}

template <typename Id>
bool Contains(const std::vector<Id>& sorted, Id id) {
  return std::binary_search(sorted.begin(), sorted.end(), id);
}

template <typename Id>
Error UnknownId(const std::string& what, Id id) {
  return PLUMBLINE_ERROR("no " + what + " " + std::to_string(id),
                         "the id of a " + what + " in the graph");
}

// Does nothing for a type of feature that fits the i-th place of a relation.
void CheckFits(const RelationType& relation, std::size_t i,
               const FeatureType& type) {
  if (relation.Accepts(i, type)) return;
  throw PLUMBLINE_ERROR("feature " + std::to_string(i + 1) + " of " +
                            relation.name + " is a " + type.name,
                        relation.AcceptedNames(i));
}

}  // namespace

// What is left to do of a transaction that was checked. Ids ascending.
struct Graph::Removals {
  std::vector<FeatureId> features;
  // Broken ones that go with their features included.
  std::vector<ConstraintId> constraints;
  std::vector<ConstraintId> broken;
};

// What is no longer live or there, for the listeners.
struct Graph::Retired {
  // In the order of ids; removed ones are among `dead_constraints`.
  std::vector<const Constraint*> constraints;
  std::vector<std::unique_ptr<Constraint>> dead_constraints;
  std::vector<std::unique_ptr<Node>> dead_features;
};

TransactionResult Graph::Apply(Transaction&& transaction) {
  // First everything is checked, then everything is changed: nothing below the
  // checks throws (out of memory apart).
  const Removals removals = CheckRemovals(transaction);
  for (const Feature& feature : transaction.added_features()) {
    CheckFeature(feature);
  }
  for (const Constraint& constraint : transaction.added_constraints()) {
    CheckAddition(constraint, transaction.added_features(), removals);
  }
  const Retired retired = Retire(removals);
  const TransactionResult added = Add(&transaction);
  Tell(retired, added);
  return added;
}

Graph::Removals Graph::CheckRemovals(const Transaction& transaction) const {
  Removals removals;
  removals.features = SortedUnique(transaction.removed_features(), "feature");
  removals.constraints =
      SortedUnique(transaction.removed_constraints(), "constraint");
  removals.broken =
      SortedUnique(transaction.broken_constraints(), "constraint");
  for (const ConstraintId id : removals.constraints) {
    if (FindConstraint(id) == nullptr) throw UnknownId("constraint", id);
    if (Contains(removals.broken, id)) {
      throw PLUMBLINE_ERROR(
          "constraint " + std::to_string(id) + " is both broken and removed",
          "one of the two");
    }
  }
  for (const ConstraintId id : removals.broken) {
    const Constraint* constraint = FindConstraint(id);
    if (constraint == nullptr) throw UnknownId("constraint", id);
    if (constraint->state != ConstraintState::kLive) {
      throw PLUMBLINE_ERROR(
          "constraint " + Describe(*constraint) + " is broken already",
          "a live constraint");
    }
  }
  std::vector<ConstraintId> gone_with_features;
  for (const FeatureId id : removals.features) {
    const Feature* feature = FindFeature(id);
    if (feature == nullptr) throw UnknownId("feature", id);
    for (const ConstraintId constraint_id : ConstraintsOf(id)) {
      if (Contains(removals.constraints, constraint_id)) continue;
      const Constraint& constraint = GetConstraint(constraint_id);
      if (constraint.state == ConstraintState::kLive &&
          !Contains(removals.broken, constraint_id)) {
        throw PLUMBLINE_ERROR(
            "feature " + Describe(*feature) +
                " cannot be removed: live constraint " + Describe(constraint) +
                " uses it",
            "its live constraints to be removed or broken with it");
      }
      gone_with_features.push_back(constraint_id);
    }
  }
  std::vector<ConstraintId>& removed = removals.constraints;
  removed.insert(removed.end(), gone_with_features.begin(),
                 gone_with_features.end());
  std::sort(removed.begin(), removed.end());
  // Between two removed features, a broken constraint is met twice.
  removed.erase(std::unique(removed.begin(), removed.end()), removed.end());
  return removals;
}

void Graph::CheckAddition(const Constraint& constraint,
                          const std::vector<Feature>& added,
                          const Removals& removals) const {
  if (constraint.type == nullptr) {
    throw PLUMBLINE_ERROR("constraint without a type", "a registered type");
  }
  const RelationType& type = *constraint.type;
  if (constraint.features.size() != type.feature_types.size()) {
    throw PLUMBLINE_ERROR(type.name + " between " +
                              std::to_string(constraint.features.size()) +
                              " features",
                          std::to_string(type.feature_types.size()));
  }
  for (std::size_t i = 0; i < constraint.features.size(); ++i) {
    const FeatureId id = constraint.features[i];
    if (Transaction::IsProvisional(id)) {
      const std::size_t index = Transaction::ProvisionalIndex(id);
      if (index >= added.size()) throw UnknownId("added feature", id);
      CheckFits(type, i, *added[index].type);
    } else {
      const Feature* feature = FindFeature(id);
      if (feature == nullptr || Contains(removals.features, id)) {
        throw UnknownId("feature", id);
      }
      CheckFits(type, i, *feature->type);
    }
    // A solver takes each block once in a residual.
    if (std::count(constraint.features.begin(), constraint.features.end(), id) >
        1) {
      throw PLUMBLINE_ERROR(
          type.name + " from feature " + std::to_string(id) + " to itself",
          "different features");
    }
  }
  CheckNumbers(type, constraint.expected, constraint.information);
  if (!(constraint.delta >= 0.0 && constraint.delta <= 1.0)) {
    throw PLUMBLINE_ERROR(
        "delta of " + type.name + " is " + std::to_string(constraint.delta),
        "a number in [0, 1]");
  }
}

Graph::Retired Graph::Retire(const Removals& removals) {
  Retired retired;
  for (const ConstraintId id : removals.broken) {
    Constraint& constraint = *constraints_[id];
    constraint.state = ConstraintState::kBroken;
    retired.constraints.push_back(&constraint);
  }
  for (const ConstraintId id : removals.constraints) {
    std::unique_ptr<Constraint>& slot = constraints_[id];
    for (const FeatureId feature_id : slot->features) {
      std::vector<ConstraintId>& adjacent = features_[feature_id]->constraints;
      adjacent.erase(std::lower_bound(adjacent.begin(), adjacent.end(), id));
    }
    if (!Contains(removals.broken, id)) {
      retired.constraints.push_back(slot.get());
    }
    retired.dead_constraints.push_back(std::move(slot));
    --num_constraints_;
  }
  std::sort(
      retired.constraints.begin(), retired.constraints.end(),
      [](const Constraint* a, const Constraint* b) { return a->id < b->id; });
  for (const FeatureId id : removals.features) {
    const Feature& feature = features_[id]->feature;
    if (feature.is_virtual) {
      std::vector<FeatureId>& ids = virtual_features_[feature.level];
      ids.erase(std::lower_bound(ids.begin(), ids.end(), id));
    }
    retired.dead_features.push_back(std::move(features_[id]));
    --num_features_;
  }
  return retired;
}

TransactionResult Graph::Add(Transaction* transaction) {
  TransactionResult result;
  for (Feature& feature : transaction->added_features()) {
    auto node = std::make_unique<Node>();
    node->feature = std::move(feature);
    node->feature.id = feature_id_end();
    std::fill(node->feature.parameters.begin() + node->feature.type->size,
              node->feature.parameters.end(), 0.0);
    if (node->feature.is_virtual) {
      virtual_features_[node->feature.level].push_back(node->feature.id);
    }
    result.features.push_back(node->feature.id);
    features_.push_back(std::move(node));
    ++num_features_;
  }
  for (Constraint& added : transaction->added_constraints()) {
    auto constraint = std::make_unique<Constraint>(std::move(added));
    constraint->id = constraint_id_end();
    for (FeatureId& id : constraint->features) {
      if (Transaction::IsProvisional(id)) {
        id = result.features[Transaction::ProvisionalIndex(id)];
      }
      features_[id]->constraints.push_back(constraint->id);
    }
    result.constraints.push_back(constraint->id);
    constraints_.push_back(std::move(constraint));
    ++num_constraints_;
  }
  return result;
}

void Graph::Restore(std::vector<Feature> features,
                    std::vector<Constraint> constraints, FeatureId feature_end,
                    ConstraintId constraint_end) {
  if (feature_id_end() > 0 || constraint_id_end() > 0) {
    throw PLUMBLINE_ERROR("the graph had features already", "a new graph");
  }
  // As a transaction on a graph of the same features under new ids it is
  // checked whole.
  std::map<FeatureId, FeatureId> provisional;
  FeatureId last_feature = kNoId;
  for (const Feature& feature : features) {
    if (feature.id <= last_feature || feature.id >= feature_end) {
      throw UnknownId("feature", feature.id);
    }
    last_feature = feature.id;
    CheckFeature(feature);
    provisional.emplace(feature.id,
                        Transaction::ProvisionalId(provisional.size()));
  }
  ConstraintId last_constraint = kNoId;
  for (Constraint& constraint : constraints) {
    if (constraint.id <= last_constraint || constraint.id >= constraint_end) {
      throw UnknownId("constraint", constraint.id);
    }
    last_constraint = constraint.id;
    const std::vector<FeatureId> ids = constraint.features;
    for (FeatureId& id : constraint.features) {
      const auto found = provisional.find(id);
      if (found == provisional.end()) throw UnknownId("feature", id);
      id = found->second;
    }
    CheckAddition(constraint, features, Removals());
    constraint.features = ids;
  }
  features_.resize(static_cast<std::size_t>(feature_end));
  constraints_.resize(static_cast<std::size_t>(constraint_end));
  TransactionResult added;
  for (Feature& feature : features) {
    if (feature.is_virtual) {
      virtual_features_[feature.level].push_back(feature.id);
    }
    added.features.push_back(feature.id);
    auto node = std::make_unique<Node>();
    node->feature = std::move(feature);
    features_[static_cast<std::size_t>(added.features.back())] =
        std::move(node);
  }
  for (Constraint& constraint : constraints) {
    for (const FeatureId id : constraint.features) {
      features_[static_cast<std::size_t>(id)]->constraints.push_back(
          constraint.id);
    }
    added.constraints.push_back(constraint.id);
    constraints_[static_cast<std::size_t>(constraint.id)] =
        std::make_unique<Constraint>(std::move(constraint));
  }
  num_features_ = features.size();
  num_constraints_ = constraints.size();
  Tell(Retired(), added);
}

void Graph::Tell(const Retired& retired, const TransactionResult& added) const {
  for (GraphListener* listener : listeners_) {
    for (const Constraint* constraint : retired.constraints) {
      listener->OnConstraintRetired(*constraint);
    }
    for (const auto& node : retired.dead_features) {
      listener->OnFeatureRemoved(node->feature);
    }
    for (const FeatureId id : added.features) {
      listener->OnFeatureAdded(features_[id]->feature);
    }
    for (const ConstraintId id : added.constraints) {
      listener->OnConstraintAdded(*constraints_[id]);
    }
  }
}

void Graph::UpdateConstraint(ConstraintId id, const Eigen::VectorXd& expected,
                             const Eigen::MatrixXd& information) {
  Constraint& constraint = GetConstraint(id);
  if (constraint.kind != ConstraintClass::kMeasurement ||
      constraint.state != ConstraintState::kLive) {
    throw PLUMBLINE_ERROR(
        "constraint " + Describe(constraint) + " cannot be updated",
        "a live measurement");
  }
  CheckNumbers(*constraint.type, expected, information);
  if (constraint.expected == expected &&
      constraint.information == information) {
    return;
  }
  constraint.expected = expected;
  constraint.information = information;
  for (GraphListener* listener : listeners_) {
    listener->OnConstraintChanged(constraint);
  }
}

const Feature* Graph::FindFeature(FeatureId id) const {
  if (id < 0 || id >= feature_id_end() || features_[id] == nullptr) {
    return nullptr;
  }
  return &features_[id]->feature;
}

Feature* Graph::FindFeature(FeatureId id) {
  return const_cast<Feature*>(std::as_const(*this).FindFeature(id));
}

const Constraint* Graph::FindConstraint(ConstraintId id) const {
  if (id < 0 || id >= constraint_id_end()) return nullptr;
  return constraints_[id].get();
}

Constraint* Graph::FindConstraint(ConstraintId id) {
  return const_cast<Constraint*>(std::as_const(*this).FindConstraint(id));
}

const Feature& Graph::GetFeature(FeatureId id) const {
  const Feature* feature = FindFeature(id);
  if (feature == nullptr) throw UnknownId("feature", id);
  return *feature;
}

Feature& Graph::GetFeature(FeatureId id) {
  return const_cast<Feature&>(std::as_const(*this).GetFeature(id));
}

const Constraint& Graph::GetConstraint(ConstraintId id) const {
  const Constraint* constraint = FindConstraint(id);
  if (constraint == nullptr) throw UnknownId("constraint", id);
  return *constraint;
}

Constraint& Graph::GetConstraint(ConstraintId id) {
  return const_cast<Constraint&>(std::as_const(*this).GetConstraint(id));
}

const std::vector<ConstraintId>& Graph::ConstraintsOf(FeatureId id) const {
  if (FindFeature(id) == nullptr) throw UnknownId("feature", id);
  return features_[id]->constraints;
}

const std::vector<FeatureId>& Graph::VirtualFeatures(int level) const {
  static const std::vector<FeatureId> none;
  const auto found = virtual_features_.find(level);
  return found == virtual_features_.end() ? none : found->second;
}

std::vector<int> Graph::VirtualLevels() const {
  std::vector<int> levels;
  for (const auto& [level, ids] : virtual_features_) {
    if (!ids.empty()) levels.push_back(level);
  }
  return levels;
}

std::vector<const Feature*> Graph::Features() const {
  std::vector<const Feature*> features;
  features.reserve(num_features_);
  for (const auto& node : features_) {
    if (node != nullptr) features.push_back(&node->feature);
  }
  return features;
}

std::vector<Feature*> Graph::MutableFeatures() {
  std::vector<Feature*> features;
  features.reserve(num_features_);
  for (const auto& node : features_) {
    if (node != nullptr) features.push_back(&node->feature);
  }
  return features;
}

std::vector<const Constraint*> Graph::Constraints() const {
  std::vector<const Constraint*> constraints;
  constraints.reserve(num_constraints_);
  for (const auto& constraint : constraints_) {
    if (constraint != nullptr) constraints.push_back(constraint.get());
  }
  return constraints;
}

std::vector<Constraint*> Graph::MutableConstraints() {
  std::vector<Constraint*> constraints;
  constraints.reserve(num_constraints_);
  for (const auto& constraint : constraints_) {
    if (constraint != nullptr) constraints.push_back(constraint.get());
  }
  return constraints;
}

void Graph::AddListener(GraphListener* listener) {
  listeners_.push_back(listener);
}

void Graph::RemoveListener(GraphListener* listener) {
  listeners_.erase(std::remove(listeners_.begin(), listeners_.end(), listener),
                   listeners_.end());
}

}  // namespace plumbline
