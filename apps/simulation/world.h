#ifndef PLUMBLINE_APPS_SIMULATION_WORLD_H_
#define PLUMBLINE_APPS_SIMULATION_WORLD_H_

#include <Eigen/Core>
#include <cstdint>
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

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_SIMULATION_WORLD_H_
