#include <plumbline/core/wall.h>
#include <plumbline/core/wall_pair.h>
#include <plumbline/pipeline/loop_closures.h>

#include <cstddef>
#include <limits>
#include <optional>

namespace plumbline {

std::vector<LoopClosure> FindLoopClosures(
    const Graph& graph, const std::vector<KeyScanRecord>& records,
    const std::vector<Pose2>& trajectory) {
  std::vector<LoopClosure> closures;
  for (const Constraint* constraint : graph.Constraints()) {
    if (!constraint->type->Is(RelationRole::kSameWall)) continue;
    const std::optional<Wall> first =
        WallOf(graph.GetFeature(constraint->features[0]));
    const std::optional<Wall> second =
        WallOf(graph.GetFeature(constraint->features[1]));
    if (!first || !second) continue;
    const Pose2 middle = MiddleOfCommonPart(*first, *second);
    LoopClosure closure;
    double nearest = std::numeric_limits<double>::infinity();
    for (const KeyScanRecord& record : records) {
      const Pose2& pose = trajectory[static_cast<std::size_t>(record.scan)];
      const double distance = (pose - middle).head<2>().squaredNorm();
      if (distance >= nearest) continue;
      nearest = distance;
      closure.scan = record.scan;
      closure.place = Between(pose, middle);
    }
    closure.holds = constraint->state == ConstraintState::kLive;
    closure.delta = constraint->delta;
    closures.push_back(closure);
  }
  return closures;
}

}  // namespace plumbline
