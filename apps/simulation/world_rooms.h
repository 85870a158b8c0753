#ifndef PLUMBLINE_APPS_SIMULATION_WORLD_ROOMS_H_
#define PLUMBLINE_APPS_SIMULATION_WORLD_ROOMS_H_

#include <plumbline/apps/simulation/world.h>
#include <plumbline/plan/polygon.h>

#include <Eigen/Core>
#include <vector>

namespace plumbline {

/// A door of a world as it stands during a drive, world frame, m.
struct TrueDoor {
  /// The jambs, in the middle of the wall.
  Eigen::Vector2d begin = Eigen::Vector2d::Zero();
  Eigen::Vector2d end = Eigen::Vector2d::Zero();
  /// Of the wall.
  double thickness = 0.0;
  /// A wall stands in it.
  bool is_shut = false;
};

/// The closed spaces of a world between the faces of its walls, with all doors
/// closed: those that the path or a door leads into, the largest first. A
/// corridor ends where it opens into a wider space (WorldDoor::is_opening).
/// Furniture and columns take nothing away. Curved walls become chords of 5
/// degrees.
std::vector<Polygon> WorldRooms(const World& world);

/// The doors of a world in their order, without openings.
std::vector<TrueDoor> WorldDoors(const World& world);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_SIMULATION_WORLD_ROOMS_H_
