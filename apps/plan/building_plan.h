#ifndef PLUMBLINE_PLAN_BUILDING_PLAN_H_
#define PLUMBLINE_PLAN_BUILDING_PLAN_H_

#include <plumbline/factors/pose2.h>
#include <plumbline/plan/drawn_lines.h>
#include <plumbline/plan/polygon.h>
#include <plumbline/plan/regions.h>
#include <plumbline/plan/space_grid.h>
#include <plumbline/plan/unseen_walls.h>
#include <plumbline/plan/wall_lines.h>

#include <Eigen/Core>
#include <array>
#include <vector>

namespace plumbline {

/// Options for what makes a room, a door and a wall.
struct BuildingPlanOptions {
  WallLineOptions lines;
  DoorOptions doors;
  RegionOptions regions;
  UnseenWallOptions unseen;
  /// Lines with less wall than this, m, counting both faces, are furniture.
  double min_wall = 2.0;
  /// Lines of walls are drawn on by at most this to meet others, m.
  double reach = 6.0;
  /// ... which may end so far before they meet, m.
  double beyond = 1.5;
  /// Least width of a door, m.
  double min_door = 0.5;
  /// Least share of a room's area that was seen to be free.
  double min_free = 0.4;
  /// Least share of a room's border that is wall or door.
  double min_closed = 0.4;
  /// Largest share of the border that is neither and that the laser looked
  /// through: walls that face each other in the open enclose nothing.
  double max_open = 0.5;
};

/// A closed space.
struct PlanRoom {
  /// A corridor is long and narrow; one that leads to one room or none has 15
  /// m^2 and more.
  enum class Kind { kRoom, kCorridor };
  Kind kind = Kind::kRoom;
  /// Inner faces of its walls, m, map frame.
  Polygon outline;
  /// m^2, of the outline.
  double area = 0.0;
  /// The robot was in it.
  bool is_entered = false;
  /// Rooms that a door leads to, ascending: indices into BuildingPlan::rooms.
  std::vector<int> neighbors;
};

/// An opening in a wall.
struct PlanDoor {
  /// The jambs, in the middle of the wall, m, map frame.
  Eigen::Vector2d begin = Eigen::Vector2d::Zero();
  Eigen::Vector2d end = Eigen::Vector2d::Zero();
  /// Of the wall, m.
  double thickness = 0.0;
  /// Where it leads, left and right of begin to end: indices into
  /// BuildingPlan::rooms, -1 for no room.
  std::array<int, 2> rooms = {-1, -1};
  /// The robot drove through it.
  bool is_driven = false;

  /// m.
  double width() const { return (end - begin).norm(); }
  /// Wider than leaves are: drawn without one.
  bool is_passage() const { return width() > 1.3; }
};

/// A straight wall between two faces.
struct PlanWall {
  /// Ends in the middle of the wall, m, map frame.
  Eigen::Vector2d begin = Eigen::Vector2d::Zero();
  Eigen::Vector2d end = Eigen::Vector2d::Zero();
  /// Distance of the faces to the left and to the right of begin to end, m.
  double left = 0.0;
  double right = 0.0;
};

/// Corners of a wall, counterclockwise, m.
Ring BodyOf(const PlanWall& wall);

/// The walls without what two lines close together have twice: of walls with
/// nearly one direction whose lines, or the middles of whose bodies, lie within
/// 0.15 m of each other along 0.4 m and more, the longest keeps that part. In
/// the order given.
std::vector<PlanWall> WithoutDoubles(const std::vector<PlanWall>& walls);

/// "room" or "corridor", as files have it.
const char* RoomKindName(PlanRoom::Kind kind);

/// Rooms with their doors and walls.
struct BuildingPlan {
  /// The largest first.
  std::vector<PlanRoom> rooms;
  std::vector<PlanDoor> doors;
  std::vector<PlanWall> walls;
  /// How far the robot went outside of all rooms, m, in stretches of over 2 m:
  /// there is a space that is not on the plan.
  double way_outside = 0.0;
};

/// Makes the plan of a building from what a robot saw.
///
/// Lines of walls (FindWallLines) are drawn on to an arrangement of faces. A
/// minimum cut says which faces lie within the building: free and unknown space
/// against borders where there is no wall. Faces without a wall between them
/// are one room; a wall with an opening of the width of a door still separates
/// them.
///
/// `walls`: known faces; `directions`: of the building, rad, the most important
/// first, empty when there are none; `path`: poses of the robot in the order of
/// time, and one that is not finite where the way breaks off, as between two
/// logs. All in the map frame. A space without walls around it is not a room:
/// the plan of an open field is empty. Works on ThreadsHere() threads, on whose
/// number the plan does not depend.
///
/// Method: cells of an arrangement of wall lines with an energy minimization
/// after Ochmann et al., "Automatic reconstruction of parametric building
/// models from indoor point clouds", Computers & Graphics 54, 2016, and Oesau
/// et al., "Indoor scene reconstruction using feature sensitive primitive
/// extraction and graph-cut", ISPRS Journal 90, 2014, on a robot's grid.
BuildingPlan MakeBuildingPlan(const std::vector<KnownWall>& walls,
                              const std::vector<double>& directions,
                              const SpaceGrid& space,
                              const std::vector<Pose2>& path,
                              const BuildingPlanOptions& options = {});

}  // namespace plumbline

#endif  // PLUMBLINE_PLAN_BUILDING_PLAN_H_
