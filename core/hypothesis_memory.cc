#include <plumbline/core/hypothesis_memory.h>
#include <plumbline/core/information.h>
#include <plumbline/core/registry.h>

#include <algorithm>
#include <cmath>

namespace plumbline {
namespace {

// Infinite where the relation cannot be evaluated.
Eigen::VectorXd WhitenedError(const RelationType& relation,
                              const Eigen::VectorXd& expected,
                              const Eigen::MatrixXd& information,
                              const std::vector<const Feature*>& features) {
  RelationArguments arguments;
  arguments.expected = expected;
  arguments.sqrt_information = SqrtInformation(information);
  arguments.features = features;
  std::vector<const double*> parameters;
  parameters.reserve(features.size());
  for (const Feature* feature : features) {
    parameters.push_back(feature->data());
  }
  const auto cost = relation.make_cost(arguments);
  Eigen::VectorXd error(relation.residual_size);
  if (!cost->Evaluate(parameters.data(), error.data(), nullptr) ||
      !error.allFinite()) {
    error.setConstant(std::numeric_limits<double>::infinity());
  }
  return error;
}

Eigen::VectorXd WhitenedError(const Constraint& constraint,
                              const std::vector<const Feature*>& features) {
  return WhitenedError(*constraint.type, constraint.expected,
                       constraint.information, features);
}

// The first raw feature; kNoId when all are virtual.
FeatureId KeyOf(const std::vector<const Feature*>& features) {
  for (const Feature* feature : features) {
    if (!feature->is_virtual) return feature->id;
  }
  return kNoId;
}

}  // namespace

HypothesisMemory::HypothesisMemory(const Graph* graph, const EmOptions& options)
    : graph_(graph),
      reproposal_sigmas_(options.reproposal_sigmas),
      max_breaks_(options.max_breaks),
      max_breaks_per_feature_(options.max_breaks_per_feature) {}

void HypothesisMemory::Remember(const Constraint& constraint) {
  const std::vector<const Feature*> features = RecallAll(constraint.features);
  const FeatureId key = KeyOf(features);
  std::vector<Hypothesis>& hypotheses = hypotheses_[key];
  auto hypothesis = std::find_if(
      hypotheses.begin(), hypotheses.end(),
      [&](const auto& one) { return SaysTheSame(one, constraint, features); });
  if (hypothesis == hypotheses.end()) {
    hypothesis = hypotheses.emplace(hypotheses.end());
    hypothesis->relation = constraint.type;
    hypothesis->expected = constraint.expected;
  }
  // The latest values are those to compare with.
  hypothesis->features = constraint.features;
  hypothesis->information = constraint.information;
  hypothesis->error = std::numeric_limits<double>::infinity();
  ++hypothesis->breaks;
  unmeasured_.insert(key);
}

void HypothesisMemory::OnFeatureRemoved(const Feature& feature) {
  if (feature.is_virtual) {
    dropped_.emplace(feature.id, feature);
  } else {
    hypotheses_.erase(feature.id);
  }
}

void HypothesisMemory::MeasureRelaxedErrors() {
  for (const FeatureId key : unmeasured_) {
    const auto found = hypotheses_.find(key);
    if (found == hypotheses_.end()) continue;
    for (Hypothesis& hypothesis : found->second) {
      if (!std::isinf(hypothesis.error)) continue;
      const std::vector<const Feature*> features =
          RecallAll(hypothesis.features);
      if (features.size() != hypothesis.features.size()) continue;
      hypothesis.error =
          WhitenedError(*hypothesis.relation, hypothesis.expected,
                        hypothesis.information, features)
              .norm();
    }
  }
  unmeasured_.clear();
}

bool HypothesisMemory::MayBeProposed(
    const Constraint& constraint,
    const std::vector<const Feature*>& features) const {
  const FeatureId key = KeyOf(features);
  const auto found = hypotheses_.find(key);
  if (found == hypotheses_.end()) return true;
  if (key != kNoId) {
    int breaks = 0;
    for (const Hypothesis& hypothesis : found->second) {
      if (hypothesis.relation == constraint.type) breaks += hypothesis.breaks;
    }
    if (breaks >= max_breaks_per_feature_) return false;
  }
  for (const Hypothesis& hypothesis : found->second) {
    if (!SaysTheSame(hypothesis, constraint, features)) continue;
    return hypothesis.breaks < max_breaks_ &&
           WhitenedError(constraint, features).norm() <
               hypothesis.error - reproposal_sigmas_;
  }
  return true;
}

// A feature that is there or was there once; null when it is forgotten.
const Feature* HypothesisMemory::Recall(FeatureId id) const {
  const Feature* feature = graph_->FindFeature(id);
  if (feature != nullptr) return feature;
  const auto found = dropped_.find(id);
  return found == dropped_.end() ? nullptr : &found->second;
}

// Forgotten ones are left out.
std::vector<const Feature*> HypothesisMemory::RecallAll(
    const std::vector<FeatureId>& ids) const {
  std::vector<const Feature*> features;
  features.reserve(ids.size());
  for (const FeatureId id : ids) {
    const Feature* feature = Recall(id);
    if (feature != nullptr) features.push_back(feature);
  }
  return features;
}

bool HypothesisMemory::SaysTheSame(
    const Hypothesis& hypothesis, const Constraint& constraint,
    const std::vector<const Feature*>& features) const {
  if (hypothesis.relation != constraint.type ||
      hypothesis.expected != constraint.expected) {
    return false;
  }
  std::vector<const Feature*> replaced = features;
  bool is_same = true;
  for (std::size_t i = 0; i < features.size(); ++i) {
    // A new feature has no id and equals none.
    if (features[i]->id == hypothesis.features[i]) continue;
    is_same = false;
    const Feature* own = Recall(hypothesis.features[i]);
    if (own == nullptr || !own->is_virtual || !features[i]->is_virtual ||
        own->type != features[i]->type) {
      return false;
    }
    replaced[i] = own;
  }
  if (is_same) return true;
  const Eigen::VectorXd change =
      WhitenedError(constraint, replaced) - WhitenedError(constraint, features);
  return change.norm() <= reproposal_sigmas_;
}

}  // namespace plumbline
