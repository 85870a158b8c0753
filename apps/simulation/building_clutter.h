#ifndef PLUMBLINE_APPS_SIMULATION_BUILDING_CLUTTER_H_
#define PLUMBLINE_APPS_SIMULATION_BUILDING_CLUTTER_H_

#include <plumbline/apps/simulation/building.h>
#include <plumbline/apps/simulation/world.h>

#include <Eigen/Core>
#include <utility>
#include <vector>

namespace plumbline {

/// A room that furniture may stand in, m: its corner at the corridor's wall,
/// directions along and away from the corridor, and inner size.
struct BuildingRoom {
  Eigen::Vector2d corner = Eigen::Vector2d::Zero();
  Eigen::Vector2d along = Eigen::Vector2d::UnitX();
  Eigen::Vector2d away = Eigen::Vector2d::UnitY();
  double width = 0.0;
  double depth = 0.0;
};

/// Where clutter may stand, and doors, which stay free, m.
struct ClutterPlaces {
  std::vector<BuildingRoom> rooms;
  std::vector<Eigen::Vector2d> doors;
  /// Centre lines of corridors, and half their width.
  std::vector<std::pair<Eigen::Vector2d, Eigen::Vector2d>> corridors;
  double half_width = 0.0;
  /// Of the walls between rooms and corridors.
  double wall_thickness = 0.0;
};

/// Adds furniture to the rooms and cupboards to the corridors of a world with
/// walls and a path, as many as the options say; what would be in the way of
/// the robot, of a door or of something else is left out, and so are cupboards
/// without a wall behind them.
void AddClutter(const BuildingOptions& options, const ClutterPlaces& places,
                SimulationRandom* random, World* world);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_SIMULATION_BUILDING_CLUTTER_H_
