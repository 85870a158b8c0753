#include <plumbline/core/support_policy.h>

#include <algorithm>

namespace plumbline {
namespace {

bool IsEnough(const StructureDetector& detector,
              const FeatureSupport& support) {
  return static_cast<int>(support.from_below.size()) >=
             detector.minimum_support() &&
         detector.IsSupported(support.from_below);
}

// The other feature of the constraint that a follower has: it identifies the
// follower, whose value does not matter. kNoId when there is none.
FeatureId Followed(const Constraint& constraint, FeatureId follower) {
  for (const FeatureId other : constraint.features) {
    if (other != follower) return other;
  }
  return kNoId;
}

}  // namespace

SupportPolicy::SupportPolicy(Graph* graph, const Hierarchy& hierarchy,
                             const Registry& registry)
    : graph_(graph) {
  for (const auto& level : hierarchy) {
    for (const auto& detector : level) {
      detectors_[&registry.GetDetector(detector->name())] = detector.get();
    }
  }
}

void SupportPolicy::OnConstraintLost(const Constraint& constraint) {
  for (const FeatureId id : constraint.features) {
    const Feature* feature = graph_->FindFeature(id);
    if (feature != nullptr && feature->is_virtual) lost_support_.insert(id);
  }
}

void SupportPolicy::OnFeatureRemoved(const Feature& feature) {
  silent_alone_.erase(feature.id);
}

void SupportPolicy::RecheckAll() {
  for (const int level : graph_->VirtualLevels()) {
    const auto& ids = graph_->VirtualFeatures(level);
    lost_support_.insert(ids.begin(), ids.end());
  }
}

bool SupportPolicy::DropUnsupported() {
  bool has_dropped = false;
  while (!lost_support_.empty()) {
    const FeatureId id = *lost_support_.begin();
    lost_support_.erase(lost_support_.begin());
    const Feature* feature = graph_->FindFeature(id);
    if (feature == nullptr || !feature->is_virtual || feature->fixed) continue;
    const FeatureSupport support = SupportOf(*feature);
    if (support.is_measured) continue;
    const StructureDetector* const maker = MakerOf(*feature);
    const bool is_supported = maker == nullptr ? !support.from_below.empty()
                                               : IsEnough(*maker, support);
    const bool may_follow = maker != nullptr && maker->keeps_followers();
    if (is_supported && (support.structure.size() > 1 || may_follow)) continue;
    if (is_supported && !support.structure.empty()) {
      const Constraint& last = *support.structure.back();
      silent_alone_[Followed(last, id)].insert(last.type);
    }
    Transaction transaction;
    for (const Constraint* constraint : support.structure) {
      transaction.RemoveConstraint(constraint->id);
    }
    transaction.RemoveFeature(id);
    graph_->Apply(std::move(transaction));
    has_dropped = true;
  }
  return has_dropped;
}

const DetectorType* SupportPolicy::TypeOf(
    const StructureDetector& detector) const {
  for (const auto& [type, its_detector] : detectors_) {
    if (its_detector->name() == detector.name()) return type;
  }
  return nullptr;
}

bool SupportPolicy::MayBeAdded(const StructureDetector& detector, FeatureId id,
                               const FeatureSupport& support) const {
  if (!IsEnough(detector, support)) return false;
  if (support.structure.size() != 1) return true;
  const Constraint& only = *support.structure.front();
  const auto found = silent_alone_.find(Followed(only, id));
  return found == silent_alone_.end() || found->second.count(only.type) == 0;
}

// Null when it is none of the hierarchy's.
const StructureDetector* SupportPolicy::MakerOf(const Feature& feature) const {
  const auto found = detectors_.find(feature.maker);
  return found == detectors_.end() ? nullptr : found->second;
}

FeatureSupport SupportPolicy::SupportOf(const Feature& feature) const {
  FeatureSupport support;
  for (const ConstraintId id : graph_->ConstraintsOf(feature.id)) {
    const Constraint& constraint = *graph_->FindConstraint(id);
    if (constraint.state != ConstraintState::kLive) continue;
    if (constraint.kind == ConstraintClass::kMeasurement) {
      support.is_measured = true;
      continue;
    }
    support.structure.push_back(&constraint);
    if (std::any_of(constraint.features.begin(), constraint.features.end(),
                    [&](FeatureId other) {
                      return graph_->FindFeature(other)->level < feature.level;
                    })) {
      support.from_below.push_back(&constraint);
    }
  }
  return support;
}

}  // namespace plumbline
