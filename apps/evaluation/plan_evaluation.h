#ifndef PLUMBLINE_APPS_EVALUATION_PLAN_EVALUATION_H_
#define PLUMBLINE_APPS_EVALUATION_PLAN_EVALUATION_H_

#include <plumbline/apps/evaluation/map_truth.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/plan/building_plan.h>

#include <string>
#include <vector>

namespace plumbline {

/// Reads rooms, doors and walls of a floorplan.geojson
/// (outputs/floor_plan_geojson.h); features of other kinds are passed over.
/// Throws Error that names the file and the entry which is missing or wrong.
BuildingPlan ReadBuildingPlan(const std::string& path);
BuildingPlan ReadBuildingPlan(InputStream* input);

/// Rooms of a plan against true ones.
struct RoomEvaluation {
  /// True rooms that were asked for, and those of them that share at least half
  /// of their union with a room of the plan.
  int asked = 0;
  int found = 0;
  /// Rooms of the plan, and those of them that are not the one with the most in
  /// common with a true room, or of which less than half lies in it: invented
  /// or cut off another.
  int drawn = 0;
  int not_true = 0;
  /// Mean over the rooms that were asked for of overlap over union with the
  /// room of the plan that has most in common.
  double mean_iou = 0.0;
  /// Overlap of each room with its best partner over its own area, mean over
  /// the plan's rooms and over those that were asked for (Bormann et al., ICRA
  /// 2016).
  double precision = 0.0;
  double recall = 0.0;
  /// Rooms of the plan that `precision` is the mean over.
  int judged = 0;
  /// Overlap over union of every true room that was asked for.
  std::vector<double> iou;
};

/// Compares rooms; `asked` says which of the true ones (as many) should be
/// there. Rooms of the plan without anything in common with a true one that was
/// asked for count in `drawn` and `not_true`, not in `precision`.
RoomEvaluation EvaluateRooms(const std::vector<Polygon>& plan,
                             const std::vector<Polygon>& truth,
                             const std::vector<bool>& asked);

/// A plan against the truth of a simulated building.
struct PlanEvaluation {
  /// Rooms; those that the robot was in are asked for.
  RoomEvaluation rooms;
  /// Doors that the robot drove through, and those of them that the plan has
  /// within half a metre. Doors are paired, the nearest first, each with one.
  int doors_asked = 0;
  int doors_found = 0;
  /// Doors of the plan, and those where there is none, open or shut, or where
  /// the plan has one already.
  int doors_drawn = 0;
  int doors_false = 0;
  /// Mean error of the width of the doors found, m.
  double door_width_error = 0.0;
  /// Share of the walls that the laser saw within 10 cm of the plan's, and of
  /// the faces of the plan's walls within 10 cm of true ones (the measure of
  /// the ISPRS benchmark on indoor modelling).
  double wall_completeness = 1.0;
  double wall_correctness = 1.0;
  /// Whether there are walls that were seen, and walls in the plan: what these
  /// are shares of.
  bool has_seen_walls = false;
  bool has_walls = false;
  /// Ends of the plan's walls, and those that meet no other wall and no door.
  int ends = 0;
  int free_ends = 0;
  /// Pairs of the plan's walls that are drawn on each other.
  int double_walls = 0;
};

/// Compares a plan, moved by `alignment` into the world frame, with the truth.
PlanEvaluation EvaluatePlan(const BuildingPlan& plan, const MapTruth& truth,
                            const Pose2& alignment);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_EVALUATION_PLAN_EVALUATION_H_
