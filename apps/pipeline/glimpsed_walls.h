#ifndef PLUMBLINE_PIPELINE_GLIMPSED_WALLS_H_
#define PLUMBLINE_PIPELINE_GLIMPSED_WALLS_H_

#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/transaction.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/graph_builder.h>
#include <plumbline/frontend/scan.h>
#include <plumbline/frontend/wall_completion.h>

#include <vector>

namespace plumbline {

/// Walls of glimpses (FindGlimpsedWalls) for a map that has places: each bound
/// to the place whose scans saw it, and to nothing else, so that what it is
/// relative to other walls goes by way of the places. Those that no place saw
/// are left out.
///
/// `places`: features of the places, in the order of the log, one for each
/// `place_stride` of `records` (PlaceBegins). `trajectory`: the pose of every
/// scan, map frame. The graph is not changed. Cost: linear in the returns.
Transaction BindGlimpsedWalls(const Transaction& walls, const Graph& graph,
                              const Registry& registry,
                              const std::vector<FeatureId>& places,
                              const std::vector<Scan>& scans,
                              const std::vector<KeyScanRecord>& records,
                              const std::vector<Pose2>& trajectory,
                              int place_stride,
                              const WallCompletionOptions& options);

}  // namespace plumbline

#endif  // PLUMBLINE_PIPELINE_GLIMPSED_WALLS_H_
