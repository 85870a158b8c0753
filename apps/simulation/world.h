#ifndef PLUMBLINE_APPS_SIMULATION_WORLD_H_
#define PLUMBLINE_APPS_SIMULATION_WORLD_H_

#include <Eigen/Core>
#include <cstdint>
#include <istream>
#include <ostream>
#include <random>
#include <string>
#include <vector>

namespace plumbline {

/// Random draws that are the same on every platform: only the raw output of
/// std::mt19937_64 is used, which the standard specifies, unlike that of its
/// distributions.
class SimulationRandom {
 public:
  explicit SimulationRandom(std::uint64_t seed) : engine_(seed) {}

  /// Uniform in [low, high).
  double Uniform(double low, double high);

  /// Standard normal to within an excess kurtosis of -0.1 and |value| <= 6: the
  /// sum of twelve uniform draws, which needs no logarithm or cosine and so
  /// does not depend on the mathematical library.
  double Gaussian();

  /// True with the given probability.
  bool Chance(double probability) { return Uniform(0.0, 1.0) < probability; }

 private:
  std::mt19937_64 engine_;
};

/// A straight wall by its centre line, m. A thickness of 0 is a plain segment;
/// otherwise the wall is a rectangle with two sides and two ends.
struct WorldWall {
  Eigen::Vector2d begin = Eigen::Vector2d::Zero();
  Eigen::Vector2d end = Eigen::Vector2d::Zero();
  double thickness = 0.0;
};

/// A round column, or a curved wall when `sweep` is less than a full turn.
struct WorldCircle {
  /// m.
  Eigen::Vector2d center = Eigen::Vector2d::Zero();
  double radius = 0.0;
  /// Direction of the first point of the arc as seen from the centre, and how
  /// far the arc goes on counter-clockwise, degrees, 0 < sweep <= 360.
  double begin_deg = 0.0;
  double sweep_deg = 360.0;
};

/// A rectangular piece of furniture or other clutter: an obstacle that is not
/// part of the building's structure.
struct WorldBox {
  /// m.
  Eigen::Vector2d center = Eigen::Vector2d::Zero();
  double length = 0.0;
  double width = 0.0;
  /// Direction of the length, degrees.
  double angle_deg = 0.0;
};

/// A doorway: the gap between two jambs of a wall, m, by its centre line. It
/// stops no beam, and tells where a room ends.
struct WorldDoor {
  /// Where a corridor ends in a wider space: as wide as itself, no door.
  bool is_opening = false;
  Eigen::Vector2d begin = Eigen::Vector2d::Zero();
  Eigen::Vector2d end = Eigen::Vector2d::Zero();
  /// Of the wall.
  double thickness = 0.0;
};

/// A building and the way of the robot through it. Frame: x to the right, y up,
/// m. Doors are gaps in walls (see CutDoor).
struct World {
  /// What errors call it: the file or the built-in name.
  std::string name = "world";
  std::vector<WorldWall> walls;
  std::vector<WorldCircle> circles;
  std::vector<WorldBox> boxes;
  std::vector<WorldDoor> doors;
  /// Way points of the robot; it starts on the first, looking at the second.
  std::vector<Eigen::Vector2d> path;
};

/// A straight surface that a laser can hit.
struct WorldFace {
  Eigen::Vector2d begin = Eigen::Vector2d::Zero();
  Eigen::Vector2d end = Eigen::Vector2d::Zero();
  /// Index into WorldSurfaces::orientations_deg; -1 for clutter.
  int orientation = -1;
};

/// What is left of a world for a laser: plain segments and arcs.
struct WorldSurfaces {
  /// The sides of all walls come first, then their ends, then the clutter; of
  /// two faces that coincide the first counts.
  std::vector<WorldFace> faces;
  std::vector<WorldCircle> circles;
  /// The directions that walls have, degrees in (-90, 90], ascending, those
  /// within 0.01 degrees taken as one. The ends of walls do not add to it
  /// unless they are at least 0.5 m long.
  std::vector<double> orientations_deg;
};

/// The surfaces of `world`. An end of a wall gets the orientation of the walls
/// in its direction, or -1 where there is none.
WorldSurfaces MakeSurfaces(const World& world);

/// Cuts a gap of `width` (m), centred at the point nearest to `position`, into
/// every wall whose body passes through `position` (to within 1 cm), and adds a
/// door for the thickest of them. Returns how many walls were cut.
int CutDoor(const Eigen::Vector2d& position, double width, World* world);

/// Turns everything by `degrees` around the origin.
void RotateWorld(double degrees, World* world);

/// Reads the text format of world files. `name` is what errors call the file.
/// A line is empty, a comment from `#` on, or one of (m, degrees)
///
///     wall x1 y1 x2 y2 [thickness]      centre line; thickness 0 if not given
///     door x y width                    gap in the walls that pass through x y
///     doorway x1 y1 x2 y2 [thickness]   gap that is there already, by its
///     jambs circle x y radius                 round column arc x y radius
///     begin_deg end_deg  curved wall, counter-clockwise box x y length width
///     angle_deg    furniture, clutter path x1 y1 [x2 y2 ...]            way
///     points; lines add up
///
/// Doors apply to all walls of the file wherever they stand. Throws Error with
/// the line on anything else, and on a door that meets no wall.
World ReadWorld(std::istream& input, const std::string& name);

/// Writes the format of ReadWorld, with doors as doorways between walls and 6
/// digits after the point.
void WriteWorld(const World& world, std::ostream& output);

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

#endif  // PLUMBLINE_APPS_SIMULATION_WORLD_H_
