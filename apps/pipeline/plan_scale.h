#ifndef PLUMBLINE_PIPELINE_PLAN_SCALE_H_
#define PLUMBLINE_PIPELINE_PLAN_SCALE_H_

#include <Eigen/Core>
#include <optional>
#include <vector>

namespace plumbline {

/// A wall beside its line of a plan, frame of the plan: a point of the wall, m,
/// the normal of the line, and how far along it the point lies from the line,
/// m.
struct WallBesideLine {
  Eigen::Vector2d point = Eigen::Vector2d::Zero();
  Eigen::Vector2d normal = Eigen::Vector2d::UnitX();
  double across = 0.0;
};

/// How much larger a plan is drawn than the walls beside its lines lie.
struct PlanScale {
  /// The share by which it is too large, negative where it is too small, and
  /// its standard error as the scatter of the walls has it.
  double excess = 0.0;
  double sigma = 0.0;
  /// How far off that puts the wall that is farthest from the middle, m.
  double most_offset = 0.0;
};

/// Finds the scale at which the lines of a plan lie best on the walls beside
/// them, by least squares with the plan's pose left free; nothing where there
/// are too few walls, or they do not tell.
std::optional<PlanScale> FindPlanScale(
    const std::vector<WallBesideLine>& walls);

}  // namespace plumbline

#endif  // PLUMBLINE_PIPELINE_PLAN_SCALE_H_
