#ifndef PLUMBLINE_APPS_SIMULATION_BUILDING_H_
#define PLUMBLINE_APPS_SIMULATION_BUILDING_H_

#include <plumbline/apps/simulation/world.h>

#include <cstdint>
#include <string>
#include <vector>

namespace plumbline {

/// Closed interval that a dimension is drawn from, m.
struct WorldInterval {
  double low = 0.0;
  double high = 0.0;
};

/// A building whose corridors run along a right-angled grid, with rooms on both
/// sides of the horizontal ones. The defaults are those of an office.
struct BuildingOptions {
  /// Blocks between corridors: columns + 1 vertical and rows + 1 horizontal
  /// corridors, so columns times rows small loops.
  int columns = 2;
  int rows = 1;
  /// Distance between the centre lines of neighbouring corridors.
  WorldInterval block_length{12.0, 14.0};
  WorldInterval block_height{10.5, 12.0};
  WorldInterval corridor_width{1.9, 2.4};
  WorldInterval room_width{3.2, 4.6};
  WorldInterval room_depth{4.0, 5.0};
  double door_width = 0.9;
  double wall_thickness = 0.15;
  double outer_wall_thickness = 0.3;
  /// Share of the rooms that the robot drives into, and of the others whose
  /// doors are shut.
  double visited_share = 0.2;
  double shut_share = 0.4;
  /// Distance between shut doors in the walls of vertical corridors; 0: none.
  double vertical_door_spacing = 0.0;
  /// Length of the open hall with round columns that takes the end of the last
  /// block of the lowest row; 0: none.
  double hall_length = 5.5;
  int hall_columns = 4;
  /// A wing off the right-most corridor: its direction against the building
  /// (5 to 60 degrees) and length; 0: none.
  double wing_angle_deg = 30.0;
  double wing_length = 14.0;
  /// Pieces of furniture tried in every room, and cupboards tried per 10 m of
  /// corridor (those that would be in the robot's way are left out).
  int furniture = 3;
  double corridor_clutter = 0.6;
  /// Every block is like every other, with the same rooms open, shut and
  /// visited, so that one place looks like several: a building that invites
  /// wrong loop closures. Clutter still differs.
  bool identical_blocks = false;
};

/// Options of very long corridors with shut doors, without rooms to enter:
/// loops of hundreds of metres and a way of more than a kilometre.
BuildingOptions KillianLikeOptions();

/// An office whose wing stands at 15 to 55 degrees, drawn from the seed.
BuildingOptions ObliqueOptions(std::uint64_t seed);

/// Three by two identical blocks with rooms and nothing else.
BuildingOptions SymmetricOptions();

/// Five identical long blocks one above the other: six corridors side by side.
BuildingOptions ParallelOptions();

/// Builds it; `seed` draws all dimensions. The path covers every corridor and
/// drives through the loops several times. Throws Error when the options
/// leave no space for the corridors or the wing.
World MakeBuilding(const BuildingOptions& options, std::uint64_t seed);

/// Names that MakeWorld knows.
const std::vector<std::string>& BuiltInWorlds();

/// A built-in world by name (BuiltInWorlds). `size` multiplies the
/// number of blocks both ways (at least one stays). Throws Error on another
/// name or a size outside (0, 100].
World MakeWorld(const std::string& name, std::uint64_t seed, double size);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_SIMULATION_BUILDING_H_
