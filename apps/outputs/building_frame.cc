#include <plumbline/outputs/building_frame.h>
#include <plumbline/outputs/floor_plan.h>

#include <cmath>
#include <optional>
#include <string>
#include <utility>

namespace plumbline {
namespace {

using Eigen::Vector2d;

constexpr double kQuarterTurn = 0.5 * kPi;

// Of the walls that share it, or of the longest one; none without walls.
std::optional<double> MainDirection(const FloorPlan& plan) {
  if (!plan.directions.empty()) return plan.directions.front();
  double longest = 0.0;
  std::optional<double> direction;
  for (const FloorPlanWall& wall : plan.walls) {
    const Vector2d along = wall.end - wall.begin;
    if (along.norm() <= longest) continue;
    longest = along.norm();
    direction = std::atan2(along[1], along[0]);
  }
  return direction;
}

}  // namespace

Pose2 BuildingFrame(const Graph& graph, const std::vector<Pose2>& path) {
  const FloorPlan plan = MakeFloorPlan(graph, path);
  const std::optional<double> direction = MainDirection(plan);
  if (!direction || plan.walls.empty()) return Pose2::Zero();
  Pose2 frame = Pose2::Zero();
  frame[2] = -WrapAngle(*direction, kQuarterTurn);
  const PoseTransform turn(frame);
  Vector2d low = turn.Point(plan.walls.front().begin);
  const auto take = [&](const Vector2d& point) {
    low = low.cwiseMin(turn.Point(point));
  };
  for (const FloorPlanWall& wall : plan.walls) {
    take(wall.begin);
    take(wall.end);
  }
  for (const Pose2& pose : plan.path) take(pose.head<2>());
  frame.head<2>() = -low;
  return frame;
}

}  // namespace plumbline
