#ifndef PLUMBLINE_OUTPUTS_BUILDING_FRAME_H_
#define PLUMBLINE_OUTPUTS_BUILDING_FRAME_H_

#include <plumbline/core/graph.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/map_without_structure.h>

#include <memory>
#include <vector>

namespace plumbline {

/// The frame of the building: points p of the map lie at TransformPoint(frame,
/// p) in it. Its x axis is the shared direction with most wall (the direction
/// of the longest wall where walls share none), turned by at most 45 degrees;
/// its origin is the lower left corner of the box around all walls and the path
/// (`path`: poses of the robot, map frame). The identity for a map without
/// walls.
Pose2 BuildingFrame(const Graph& graph, const std::vector<Pose2>& path);

/// A feature moved rigidly: its anchor, its position and its angles. Throws
/// Error for types that it does not know how to move: those that neither begin
/// with a position, nor refer to an anchor, nor consist of angles, nor are a
/// single measure (a thickness), which stays.
Feature Moved(const Pose2& by, Feature feature);

/// A copy of a graph with all features moved, under the same ids. Measurements
/// between features stay as they are. Throws Error as the other Moved does, and
/// for live relations of a single feature, which tie it to the map frame.
std::unique_ptr<Graph> Moved(const Pose2& by, const Graph& graph);

/// A map without structure moved. Throws Error as above.
MapWithoutStructure Moved(const Pose2& by, MapWithoutStructure map);

}  // namespace plumbline

#endif  // PLUMBLINE_OUTPUTS_BUILDING_FRAME_H_
