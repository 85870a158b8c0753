#include <plumbline/core/error.h>
#include <plumbline/core/information.h>
#include <plumbline/core/proposal_filter.h>
#include <plumbline/core/registry.h>

#include <algorithm>
#include <set>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

// The features of a graph and those that a proposal would add.
class ProposedFeatures {
 public:
  ProposedFeatures(const Graph* graph, const std::vector<Feature>* added)
      : graph_(graph), added_(added) {}

  // Null when there is none.
  const Feature* Find(FeatureId id) const {
    if (!Transaction::IsProvisional(id)) return graph_->FindFeature(id);
    const std::size_t index = Transaction::ProvisionalIndex(id);
    return index < added_->size() ? &(*added_)[index] : nullptr;
  }

  // Finds out what the new features stand on, when these constraints are in the
  // graph.
  void FindRoots(const std::vector<Constraint>& constraints,
                 const HypothesisMemory& memory) {
    for (const Constraint& constraint : constraints) {
      for (const FeatureId id : constraint.features) {
        const Feature* feature = Find(id);
        if (feature == nullptr || !Transaction::IsProvisional(id)) continue;
        for (const FeatureId other_id : constraint.features) {
          const Feature* other = Find(other_id);
          if (other == nullptr || other->level >= feature->level) continue;
          const FeatureId root = RootOf(other_id, memory);
          if (root == kNoId) continue;
          const auto [found, is_new] = roots_.emplace(id, root);
          if (!is_new) found->second = std::min(found->second, root);
        }
      }
    }
  }

  // As in HypothesisMemory, new features included.
  FeatureId RootOf(FeatureId id, const HypothesisMemory& memory) const {
    if (!Transaction::IsProvisional(id)) return memory.RootOf(id);
    const auto found = roots_.find(id);
    return found == roots_.end() ? kNoId : found->second;
  }

  // Those of a constraint that are there and have a type.
  std::vector<const Feature*> Of(const Constraint& constraint) const {
    std::vector<const Feature*> features;
    for (const FeatureId id : constraint.features) {
      const Feature* feature = Find(id);
      if (feature != nullptr && feature->type != nullptr) {
        features.push_back(feature);
      }
    }
    return features;
  }

 private:
  const Graph* graph_;
  const std::vector<Feature>* added_;
  // Of new features.
  std::map<FeatureId, FeatureId> roots_;
};

// True when the numbers fit the relation and each other, so that the error can
// be computed.
bool IsWellFormed(const Constraint& constraint,
                  const std::vector<const Feature*>& between) {
  if (constraint.type == nullptr) return false;
  const RelationType& type = *constraint.type;
  const Eigen::Index size = type.residual_size;
  return between.size() == constraint.features.size() &&
         between.size() == type.feature_types.size() &&
         constraint.expected.size() == size &&
         constraint.information.rows() == size &&
         IsValidInformation(constraint.information);
}

// Takes out the added features that have too little support, and those that
// lose theirs by it.
class SupportedPart {
 public:
  SupportedPart(const std::vector<Feature>& features,
                const std::vector<Constraint>& constraints)
      : constraints_(constraints),
        is_kept_(features.size(), true),
        is_out_(constraints.size(), false),
        constraints_on_(features.size()) {
    for (std::size_t c = 0; c < constraints.size(); ++c) {
      ForEachAdded(constraints[c],
                   [&](std::size_t i) { constraints_on_[i].push_back(c); });
    }
  }

  void Reduce(const std::vector<Feature>& features,
              const ProposedFeatures& proposed,
              const StructureDetector& detector, const SupportPolicy& policy) {
    std::set<std::size_t> unchecked;
    for (std::size_t i = 0; i < features.size(); ++i) unchecked.insert(i);
    while (!unchecked.empty()) {
      const std::size_t i = *unchecked.begin();
      unchecked.erase(unchecked.begin());
      if (!is_kept_[i] || features[i].fixed ||
          policy.MayBeAdded(detector, Transaction::ProvisionalId(i),
                            SupportOf(i, features[i].level, proposed))) {
        continue;
      }
      is_kept_[i] = false;
      for (const std::size_t c : constraints_on_[i]) {
        is_out_[c] = true;
        ForEachAdded(constraints_[c],
                     [&](std::size_t other) { unchecked.insert(other); });
      }
    }
  }

  bool IsFeatureKept(std::size_t i) const { return is_kept_[i]; }
  bool IsConstraintKept(std::size_t c) const { return !is_out_[c]; }

 private:
  // Calls function(index) for the features of a constraint that are new.
  template <typename Function>
  void ForEachAdded(const Constraint& constraint,
                    const Function& function) const {
    for (const FeatureId id : constraint.features) {
      if (!Transaction::IsProvisional(id)) continue;
      const std::size_t index = Transaction::ProvisionalIndex(id);
      if (index < is_kept_.size()) function(index);
    }
  }

  FeatureSupport SupportOf(std::size_t i, int level,
                           const ProposedFeatures& proposed) const {
    FeatureSupport support;
    for (const std::size_t c : constraints_on_[i]) {
      if (is_out_[c]) continue;
      const Constraint& constraint = constraints_[c];
      support.structure.push_back(&constraint);
      if (std::any_of(constraint.features.begin(), constraint.features.end(),
                      [&](FeatureId id) {
                        const Feature* feature = proposed.Find(id);
                        return feature != nullptr && feature->level < level;
                      })) {
        support.from_below.push_back(&constraint);
      }
    }
    return support;
  }

  const std::vector<Constraint>& constraints_;
  std::vector<bool> is_kept_;
  std::vector<bool> is_out_;
  // By feature, the indices of its constraints.
  std::vector<std::vector<std::size_t>> constraints_on_;
};

// A transaction of what is kept of new features and constraints; moves from
// them.
Transaction MakeTransaction(const SupportedPart& part,
                            std::vector<Feature>* features,
                            std::vector<Constraint>* constraints) {
  Transaction transaction;
  std::map<FeatureId, FeatureId> new_ids;
  for (std::size_t i = 0; i < features->size(); ++i) {
    if (!part.IsFeatureKept(i)) continue;
    new_ids[Transaction::ProvisionalId(i)] =
        transaction.AddFeature(std::move((*features)[i]));
  }
  for (std::size_t c = 0; c < constraints->size(); ++c) {
    if (!part.IsConstraintKept(c)) continue;
    Constraint& constraint = (*constraints)[c];
    for (FeatureId& id : constraint.features) {
      const auto found = new_ids.find(id);
      if (found != new_ids.end()) id = found->second;
    }
    transaction.AddConstraint(std::move(constraint));
  }
  return transaction;
}

}  // namespace

ProposalFilter::ProposalFilter(
    const Graph* graph,
    const std::map<std::string, RelationPrior>& relation_priors,
    const HypothesisMemory* memory, const SupportPolicy* support)
    : graph_(graph),
      relation_priors_(relation_priors),
      memory_(memory),
      support_(support) {}

Transaction ProposalFilter::Filter(Transaction proposal,
                                   const StructureDetector& detector,
                                   const DetectionScope& scope) const {
  std::vector<Feature>& features = proposal.added_features();
  for (Feature& feature : features) {
    feature.is_virtual = true;
    feature.maker = support_->TypeOf(detector);
    if (feature.source.empty()) feature.source = detector.name();
  }
  ProposedFeatures proposed(graph_, &features);
  proposed.FindRoots(proposal.added_constraints(), *memory_);
  std::vector<Constraint> constraints;
  std::int64_t unexpected = 0;
  std::int64_t there = 0;
  std::int64_t broken = 0;
  for (Constraint& constraint : proposal.added_constraints()) {
    if (!ApplyPrior(&constraint)) {
      ++unexpected;
      continue;
    }
    const std::vector<const Feature*> between = proposed.Of(constraint);
    if (IsWellFormed(constraint, between)) {
      if (IsThere(constraint)) {
        ++there;
        continue;
      }
      std::vector<FeatureId> roots;
      for (const FeatureId id : constraint.features) {
        roots.push_back(proposed.RootOf(id, *memory_));
      }
      if (!memory_->MayBeProposed(constraint, between, std::move(roots))) {
        ++broken;
        continue;
      }
    }
    if (constraint.source.empty()) constraint.source = detector.name();
    constraints.push_back(std::move(constraint));
  }
  SupportedPart part(features, constraints);
  part.Reduce(features, proposed, detector, *support_);

  const auto proposed_features = static_cast<std::int64_t>(features.size());
  const auto possible = static_cast<std::int64_t>(constraints.size());
  Transaction accepted = MakeTransaction(part, &features, &constraints);
  const auto let_in =
      static_cast<std::int64_t>(accepted.added_constraints().size());
  scope.Count("features proposed", proposed_features);
  scope.Count("features refused: too little support",
              proposed_features -
                  static_cast<std::int64_t>(accepted.added_features().size()));
  scope.Count("constraints proposed",
              static_cast<std::int64_t>(proposal.added_constraints().size()));
  scope.Count("constraints refused: not expected", unexpected);
  scope.Count("constraints refused: there already", there);
  scope.Count("constraints refused: broken before", broken);
  scope.Count("constraints refused: feature with too little support",
              possible - let_in);
  for (const FeatureId id : proposal.removed_features()) {
    accepted.RemoveFeature(id);
  }
  for (const ConstraintId id : proposal.removed_constraints()) {
    accepted.RemoveConstraint(id);
  }
  for (const ConstraintId id : proposal.broken_constraints()) {
    accepted.BreakConstraint(id);
  }
  return accepted;
}

// Gives a proposal the tolerances that are known beforehand; false when it is
// not expected at all.
bool ProposalFilter::ApplyPrior(Constraint* constraint) const {
  if (constraint->type == nullptr) return true;
  const auto found = relation_priors_.find(constraint->type->name);
  if (found == relation_priors_.end()) return true;
  const std::vector<double>& sigmas = found->second.sigmas;
  if (!found->second.is_expected) return false;
  if (sigmas.empty()) return true;
  const auto rows = static_cast<Eigen::Index>(sigmas.size());
  if (rows != constraint->type->residual_size) {
    throw PLUMBLINE_ERROR(
        "prior of " + found->first + " has " + std::to_string(rows) + " sigmas",
        std::to_string(constraint->type->residual_size));
  }
  constraint->information = InformationFromSigmas(
      Eigen::Map<const Eigen::VectorXd>(sigmas.data(), rows));
  return true;
}

// True when a live constraint says the same already.
bool ProposalFilter::IsThere(const Constraint& constraint) const {
  const std::vector<ConstraintId>* fewest = nullptr;
  for (const FeatureId id : constraint.features) {
    if (graph_->FindFeature(id) == nullptr) return false;
    const auto& constraints = graph_->ConstraintsOf(id);
    if (fewest == nullptr || constraints.size() < fewest->size()) {
      fewest = &constraints;
    }
  }
  return fewest != nullptr &&
         std::any_of(fewest->begin(), fewest->end(), [&](ConstraintId id) {
           const Constraint& other = *graph_->FindConstraint(id);
           return other.state == ConstraintState::kLive &&
                  other.type == constraint.type &&
                  other.features == constraint.features &&
                  other.expected == constraint.expected;
         });
}

}  // namespace plumbline
