#ifndef PLUMBLINE_CORE_RIGID_MOTION_H_
#define PLUMBLINE_CORE_RIGID_MOTION_H_

#include <plumbline/core/graph.h>
#include <plumbline/factors/pose2.h>

#include <memory>

namespace plumbline {

/// A feature moved rigidly: its anchor, its position and its angles. Throws
/// Error for types that it does not know how to move: those that neither begin
/// with a position, nor refer to an anchor, nor consist of angles, nor are a
/// single measure (a thickness), which stays.
Feature Moved(const Pose2& by, Feature feature);

/// A copy of a graph with all features moved, under the same ids. Measurements
/// between features stay as they are. Throws Error as the other Moved does, and
/// for live relations of a single feature, which tie it to the map frame.
std::unique_ptr<Graph> Moved(const Pose2& by, const Graph& graph);

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_RIGID_MOTION_H_
