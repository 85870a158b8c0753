#ifndef PLUMBLINE_PIPELINE_LOOP_CLOSURES_H_
#define PLUMBLINE_PIPELINE_LOOP_CLOSURES_H_

#include <plumbline/core/graph.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/graph_builder.h>

#include <vector>

namespace plumbline {

/// Two walls of the first map that were supposed to be one, seen on different
/// visits, while loops were closed. A second map, whose walls are made anew
/// from all visits, has none of them any more.
struct LoopClosure {
  /// The scan made nearest to the middle of what both walls have in common, and
  /// this middle, with the wall's direction, in the robot's frame there.
  int scan = 0;
  Pose2 place = Pose2::Zero();
  bool holds = false;
  /// p-value of the hypothesis as it was judged last.
  double delta = 0.0;
};

/// The closures of a map (relations of RelationRole::kSameWall between two
/// walls), in the order of their ids. `trajectory`: the pose of every scan, map
/// frame; `records` name the key scans among them, of which there must be one.
/// Cost: closures times records.
std::vector<LoopClosure> FindLoopClosures(
    const Graph& graph, const std::vector<KeyScanRecord>& records,
    const std::vector<Pose2>& trajectory);

}  // namespace plumbline

#endif  // PLUMBLINE_PIPELINE_LOOP_CLOSURES_H_
