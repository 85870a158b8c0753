#ifndef PLUMBLINE_CORE_SUPPORT_POLICY_H_
#define PLUMBLINE_CORE_SUPPORT_POLICY_H_

#include <plumbline/core/graph.h>
#include <plumbline/core/hierarchy.h>
#include <plumbline/core/registry.h>

#include <map>
#include <set>
#include <vector>

namespace plumbline {

/// Support of a virtual feature: its live constraints, in the order of ids.
struct FeatureSupport {
  /// Structure constraints to features of lower levels.
  std::vector<const Constraint*> from_below;
  /// All structure constraints, those from below included.
  std::vector<const Constraint*> structure;
  /// A measurement is on it.
  bool is_measured = false;
};

/// Rules by which virtual features stay.
///
/// One is dropped, with its constraints, when it has fewer live structure
/// constraints from features of lower levels than its detector's
/// minimum_support, or not those that it needs
/// (StructureDetector::IsSupported). It is dropped as well with a single live
/// constraint altogether: it would follow that one and say nothing, unless its
/// detector keeps_followers. Fixed virtual features and those with measurements
/// stay, and one that no detector of the hierarchy has made needs one
/// constraint from below. Dropping goes on up the levels.
///
/// The support of a feature that said nothing is remembered: otherwise the
/// feature would be found and dropped for ever.
class SupportPolicy {
 public:
  /// None is owned; all must outlive the policy. Throws Error when a detector
  /// is not registered.
  SupportPolicy(Graph* graph, const Hierarchy& hierarchy,
                const Registry& registry);

  /// A live constraint was broken or removed: the virtual features on it are
  /// looked at by the next DropUnsupported.
  void OnConstraintLost(const Constraint& constraint);

  /// Whatever was known of it is forgotten.
  void OnFeatureRemoved(const Feature& feature);

  /// Has the next DropUnsupported look at all virtual features.
  void RecheckAll();

  /// Drops those without support among the features that lost some, and those
  /// that lose theirs by it, each in a transaction of its own. True when there
  /// were any.
  bool DropUnsupported();

  /// What a feature made by this detector of the hierarchy has for its maker;
  /// null when the hierarchy has no such detector.
  const DetectorType* TypeOf(const StructureDetector& detector) const;

  /// Whether a virtual feature of this detector may be added with such support.
  /// `id` is the one that the constraints have for it.
  bool MayBeAdded(const StructureDetector& detector, FeatureId id,
                  const FeatureSupport& support) const;

 private:
  const StructureDetector* MakerOf(const Feature& feature) const;
  FeatureSupport SupportOf(const Feature& feature) const;

  Graph* graph_;
  // Of the hierarchy, by type.
  std::map<const DetectorType*, const StructureDetector*> detectors_;
  // Virtual features that lost a constraint.
  std::set<FeatureId> lost_support_;
  // Features and the relations through which each alone made a virtual feature
  // that said nothing.
  std::map<FeatureId, std::set<const RelationType*>> silent_alone_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_SUPPORT_POLICY_H_
