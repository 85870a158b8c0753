#ifndef PLUMBLINE_CORE_TRANSACTION_H_
#define PLUMBLINE_CORE_TRANSACTION_H_

#include <plumbline/core/constraint.h>
#include <plumbline/core/feature.h>

#include <vector>

namespace plumbline {

/// A change of the graph, applied whole or not at all (Graph::Apply).
///
/// New features have no id yet; new constraints name them by the provisional
/// ids that AddFeature returns. Provisional ids are negative and hold within
/// one transaction only.
class Transaction {
 public:
  /// Adds a feature; returns its provisional id for use in AddConstraint.
  FeatureId AddFeature(Feature feature) {
    added_features_.push_back(std::move(feature));
    return ProvisionalId(added_features_.size() - 1);
  }

  /// Adds a constraint between features of the graph and of this transaction.
  void AddConstraint(Constraint constraint) {
    added_constraints_.push_back(std::move(constraint));
  }

  /// Removes a feature. Every live constraint on it must be removed or broken
  /// before or in the same transaction; broken ones go with it.
  void RemoveFeature(FeatureId id) { removed_features_.push_back(id); }

  /// Forgets a constraint.
  void RemoveConstraint(ConstraintId id) { removed_constraints_.push_back(id); }

  /// Takes a constraint out of every solve but keeps it on record.
  void BreakConstraint(ConstraintId id) { broken_constraints_.push_back(id); }

  /// True when it would change nothing.
  bool empty() const {
    return added_features_.empty() && added_constraints_.empty() &&
           removed_features_.empty() && removed_constraints_.empty() &&
           broken_constraints_.empty();
  }

  /// The provisional id of the index-th added feature.
  static FeatureId ProvisionalId(std::size_t index) {
    return -2 - static_cast<FeatureId>(index);
  }
  /// True for ids made by ProvisionalId.
  static bool IsProvisional(FeatureId id) { return id <= -2; }
  /// The index of the added feature with this provisional id.
  static std::size_t ProvisionalIndex(FeatureId id) {
    return static_cast<std::size_t>(-2 - id);
  }

  /// What is to be done, in the order in which it was asked for.
  const std::vector<Feature>& added_features() const { return added_features_; }
  std::vector<Feature>& added_features() { return added_features_; }
  const std::vector<Constraint>& added_constraints() const {
    return added_constraints_;
  }
  std::vector<Constraint>& added_constraints() { return added_constraints_; }
  const std::vector<FeatureId>& removed_features() const {
    return removed_features_;
  }
  const std::vector<ConstraintId>& removed_constraints() const {
    return removed_constraints_;
  }
  const std::vector<ConstraintId>& broken_constraints() const {
    return broken_constraints_;
  }

 private:
  std::vector<Feature> added_features_;
  std::vector<Constraint> added_constraints_;
  std::vector<FeatureId> removed_features_;
  std::vector<ConstraintId> removed_constraints_;
  std::vector<ConstraintId> broken_constraints_;
};

/// The ids that a transaction's additions were given, in their order.
struct TransactionResult {
  std::vector<FeatureId> features;
  std::vector<ConstraintId> constraints;
};

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_TRANSACTION_H_
