#ifndef PLUMBLINE_OUTPUTS_FLOOR_PLAN_H_
#define PLUMBLINE_OUTPUTS_FLOOR_PLAN_H_

#include <plumbline/core/graph.h>
#include <plumbline/factors/angle.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/outputs/map_drawing.h>
#include <plumbline/outputs/occupancy_grid.h>
#include <plumbline/plan/building_plan.h>

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

namespace plumbline {

/// Options for which walls of a plan are one, and what is drawn.
struct FloorPlanOptions {
  /// Faces whose directions differ by more are never one, rad.
  double merge_angle = DegToRad(3.0);
  /// Two faces that look the same way and lie side by side cannot both be
  /// seen: no farther apart than this, m, they are one wall seen twice.
  double duplicate_offset = 0.15;
  /// Faces one behind the other are one when they are in line to this and the
  /// gap between them is no longer than that, m. Set-back doors and openings
  /// are farther.
  double in_line_offset = 0.03;
  double in_line_gap = 0.3;
  /// An end is drawn out or cut off by at most this to meet another wall, m ...
  double corner_gap = 0.3;
  /// ... whose direction differs by at least this, rad.
  double corner_angle = DegToRad(20.0);
  /// Two faces back to back, this far apart, m, are the sides of one wall.
  double min_thickness = 0.04;
  double max_thickness = 0.35;
  /// Walls that are shorter in the end are left out, m.
  double min_length = 0.3;
};

/// One face of a wall, m, map frame.
struct FloorPlanWall {
  /// The room is on the left on the way from begin to end, as far as the
  /// feature knows (segments do, lines do not).
  Eigen::Vector2d begin = Eigen::Vector2d::Zero();
  Eigen::Vector2d end = Eigen::Vector2d::Zero();
  /// Index into FloorPlan::directions, or -1 for none.
  int direction = -1;
  /// The features that were merged into it, ascending.
  std::vector<FeatureId> features;
};

/// A plan drawn from a map: clean lines and what stands between them.
struct FloorPlan {
  std::vector<FloorPlanWall> walls;
  /// Rooms, doors and walls; empty without scans (AddRooms).
  BuildingPlan building;
  /// Between two faces of one wall: corners in order, m, map frame.
  std::vector<std::array<Eigen::Vector2d, 4>> solids;
  /// Columns and other circles.
  std::vector<DrawnCircle> circles;
  /// Poses of the robot; what lies nearer than 5 cm to the one before is left
  /// out.
  std::vector<Pose2> path;
  /// Directions that walls share, rad in [0, pi), most wall first.
  std::vector<double> directions;
  /// "office.clf.gz"; may be empty.
  std::string title;
};

/// Makes a plan of the segments, lines and circles of a graph. Walls that share
/// an orientation get exactly its direction (turned about their middles), and
/// orientations at a known angle exactly that angle, counted from the one with
/// most wall: the tolerances are far below what a plan shows, and the drawing
/// is square. Then walls seen twice are merged, ends that meet are joined in
/// corners, and faces back to back are taken for the two sides of one wall.
/// What is not finite, lies over 10,000 km away, or is a single wall of over
/// 10 km, is passed over.
FloorPlan MakeFloorPlan(const Graph& graph, const std::vector<Pose2>& path,
                        const FloorPlanOptions& options = {});

/// Finds the rooms, doors and walls of a plan on the grid of the scans that it
/// was made of; `path`: poses of the robot. What is found depends little on the
/// resolution of the grid up to 0.1 m.
void AddRooms(const OccupancyGrid& grid, const std::vector<Pose2>& path,
              FloorPlan* plan);

/// Name of a direction's layer, the same in every file: "WALLS-1-62.1DEG"
/// (number of the direction from 1, degrees), and "WALLS-OTHER" for -1.
std::string FloorPlanLayerName(const FloorPlan& plan, int direction);

}  // namespace plumbline

#endif  // PLUMBLINE_OUTPUTS_FLOOR_PLAN_H_
