#include <plumbline/core/constraint_evaluation.h>
#include <plumbline/core/hypothesis_memory.h>

#include <algorithm>
#include <cmath>

namespace plumbline {
namespace {

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

void HypothesisMemory::OnConstraintAdded(const Constraint& constraint) {
  if (constraint.kind != ConstraintClass::kStructure) return;
  for (const FeatureId id : constraint.features) {
    const Feature& feature = graph_->GetFeature(id);
    if (!feature.is_virtual) continue;
    for (const FeatureId other : constraint.features) {
      if (graph_->GetFeature(other).level >= feature.level) continue;
      const FeatureId root = RootOf(other);
      if (root == kNoId) continue;
      const auto [found, is_new] = roots_.emplace(id, root);
      if (!is_new) found->second = std::min(found->second, root);
    }
  }
}

FeatureId HypothesisMemory::RootOf(FeatureId id) const {
  const auto found = roots_.find(id);
  if (found != roots_.end()) return found->second;
  const Feature* feature = graph_->FindFeature(id);
  return feature != nullptr && !feature->is_virtual ? id : kNoId;
}

void HypothesisMemory::Remember(const Constraint& constraint) {
  const std::vector<const Feature*> features = RecallAll(constraint.features);
  const FeatureId key = KeyOf(features);
  std::vector<Hypothesis>& hypotheses = hypotheses_[key];
  auto hypothesis = std::find_if(
      hypotheses.begin(), hypotheses.end(),
      [&](const auto& one) { return SaysTheSame(one, constraint, features); });
  if (hypothesis == hypotheses.end()) {
    hypothesis = hypotheses.emplace(hypotheses.end());
  }
  // The latest values are those to compare with.
  hypothesis->said = constraint;
  hypothesis->error = std::numeric_limits<double>::infinity();
  ++hypothesis->breaks;
  unmeasured_.insert(key);
  if (key == kNoId) {
    ++breaks_by_roots_[{constraint.type, RootsOf(constraint.features)}];
  }
}

void HypothesisMemory::OnFeatureRemoved(const Feature& feature) {
  if (feature.is_virtual) {
    dropped_.emplace(feature.id, feature);
    roots_.erase(feature.id);
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
          RecallAll(hypothesis.said.features);
      if (features.size() != hypothesis.said.features.size()) continue;
      hypothesis.error = WhitenedError(hypothesis.said, features).norm();
    }
  }
  unmeasured_.clear();
}

bool HypothesisMemory::MayBeProposed(
    const Constraint& constraint, const std::vector<const Feature*>& features,
    std::vector<FeatureId> roots) const {
  const FeatureId key = KeyOf(features);
  const auto found = hypotheses_.find(key);
  if (found == hypotheses_.end()) return true;
  int breaks = 0;
  if (key == kNoId) {
    if (roots.empty()) roots = RootsOf(constraint.features);
    const auto rooted =
        breaks_by_roots_.find({constraint.type, std::move(roots)});
    if (rooted != breaks_by_roots_.end()) breaks = rooted->second;
  } else {
    for (const Hypothesis& hypothesis : found->second) {
      if (hypothesis.said.type == constraint.type) breaks += hypothesis.breaks;
    }
  }
  if (breaks >= max_breaks_per_feature_) return false;
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

std::vector<FeatureId> HypothesisMemory::RootsOf(
    const std::vector<FeatureId>& ids) const {
  std::vector<FeatureId> roots;
  for (const FeatureId id : ids) roots.push_back(RootOf(id));
  return roots;
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
  const Constraint& said = hypothesis.said;
  if (said.type != constraint.type || said.expected != constraint.expected) {
    return false;
  }
  std::vector<const Feature*> replaced = features;
  bool is_same = true;
  for (std::size_t i = 0; i < features.size(); ++i) {
    // A new feature has no id and equals none.
    if (features[i]->id == said.features[i]) continue;
    is_same = false;
    const Feature* own = Recall(said.features[i]);
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
