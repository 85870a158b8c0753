#ifndef PLUMBLINE_OUTPUTS_BUILDING_FRAME_H_
#define PLUMBLINE_OUTPUTS_BUILDING_FRAME_H_

#include <plumbline/core/graph.h>
#include <plumbline/factors/pose2.h>

#include <vector>

namespace plumbline {

/// The frame of the building: points p of the map lie at TransformPoint(frame,
/// p) in it. Its x axis is the shared direction with most wall (the direction
/// of the longest wall where walls share none), turned by at most 45 degrees;
/// its origin is the lower left corner of the box around all walls and the path
/// (`path`: poses of the robot, map frame). The identity for a map without
/// walls.
Pose2 BuildingFrame(const Graph& graph, const std::vector<Pose2>& path);

}  // namespace plumbline

#endif  // PLUMBLINE_OUTPUTS_BUILDING_FRAME_H_
