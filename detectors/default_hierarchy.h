#ifndef PLUMBLINE_DETECTORS_DEFAULT_HIERARCHY_H_
#define PLUMBLINE_DETECTORS_DEFAULT_HIERARCHY_H_

#include <plumbline/core/hierarchy_spec.h>
#include <plumbline/core/registry.h>

#include <vector>

namespace plumbline {

/// EmOptions::loop_tolerance for graphs of points: points that turned over
/// settle slowly, one here and one there.
constexpr double kPointsLoopTolerance = 3e-4;

/// The hierarchy that is looked for in a graph with these types of raw features
/// when nothing is asked for (core/method.md, section 5):
///
///   points   line_ransac,circle_ransac /
///            center_cluster,orientation_mixture / orientation_relation
///   walls    orientation_mixture / orientation_relation
///   circles  center_cluster
///
/// The role of a type (FeatureTraits) tells what it is; types that no detector
/// of level 0 reads are passed over. The hierarchies of several types are
/// merged level by level. Empty when no type has structure of its own (poses).
/// Throws Error when the built-in detectors are not registered.
HierarchySpec DefaultHierarchy(
    const std::vector<const FeatureType*>& raw_feature_types,
    const Registry& registry);

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_DEFAULT_HIERARCHY_H_
