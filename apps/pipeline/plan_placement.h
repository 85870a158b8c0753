#ifndef PLUMBLINE_PIPELINE_PLAN_PLACEMENT_H_
#define PLUMBLINE_PIPELINE_PLAN_PLACEMENT_H_

#include <plumbline/core/wall.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/pipeline/known_structure.h>

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace plumbline {

/// A line of a plan as a wall around its middle, seen from end to end. m, rad,
/// frame of the plan.
Wall MakePlanWall(const PlanLine& line);

/// Where a map lies in a plan.
struct PlanPlacement {
  /// Pose of the map in the frame of the plan, m and rad; none where no place
  /// is to be believed.
  std::optional<Pose2> map_in_plan;
  /// How much agrees, or why the plan is not used, for people: a sentence
  /// without a full stop. Empty when `stop` ended the search.
  std::string note;
};

/// Finds where a map lies in the plan of `known`, by the walls of the map that
/// are visible, map frame. Walls around a few long ones are looked for in the
/// plan at every turn that gives them directions of it; the place that most
/// walls of the whole map agree with counts, when KnownStructure's bounds let
/// it and no second place comes near, nor the plan's mirror image fits better.
/// A plan that is not used is tried in other units of length, so that the note
/// can name a wrong one. Where `plan_pose` is given it is tried as well, and
/// only places near it count. Asks `stop` between the steps, and ends when it
/// returns true.
PlanPlacement PlacePlan(const KnownStructure& known,
                        const std::vector<Wall>& walls,
                        const std::function<bool()>& stop = nullptr);

}  // namespace plumbline

#endif  // PLUMBLINE_PIPELINE_PLAN_PLACEMENT_H_
