#ifndef PLUMBLINE_DETECTORS_DEFAULT_HIERARCHY_H_
#define PLUMBLINE_DETECTORS_DEFAULT_HIERARCHY_H_

#include <plumbline/core/hierarchy_spec.h>

#include <set>
#include <string>

namespace plumbline {

/// EmOptions::loop_tolerance for graphs of points: points that turned over
/// settle slowly, one here and one there.
constexpr double kPointsLoopTolerance = 3e-4;

/// The hierarchy that is looked for in a graph with these types of raw features
/// when nothing is asked for (core/method.md, section 5):
///
///   point          line_ransac,circle_ransac /
///                  center_cluster,orientation_mixture / orientation_relation
///   segment, line  orientation_mixture / orientation_relation
///   circle         center_cluster
///
/// Those of several types are laid over each other, level by level. Empty when
/// no type has structure of its own (poses).
HierarchySpec DefaultHierarchy(const std::set<std::string>& raw_feature_types);

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_DEFAULT_HIERARCHY_H_
