#ifndef PLUMBLINE_DETECTORS_WALL_CORNERS_H_
#define PLUMBLINE_DETECTORS_WALL_CORNERS_H_

#include <plumbline/detectors/visible_wall.h>

#include <Eigen/Core>
#include <map>
#include <utility>
#include <vector>

namespace plumbline {

/// What makes a corner, and which walls lie in line. m, rad.
struct WallCornerOptions {
  /// A corner is met when the wall on each side begins this near to it.
  double corner_gap = 0.5;
  /// Widest opening between two walls in line, and how far they may be apart
  /// across.
  double max_opening = 3.0;
  double gate = 0.1;
  /// How far from square a corner may be, and from parallel walls in line.
  double gate_angle = 0.0;
};

/// A place where two walls meet at a right angle. Indices of walls, the smaller
/// first.
struct WallCorner {
  int first = -1;
  int second = -1;
  Eigen::Vector2d position = Eigen::Vector2d::Zero();

  /// The one of the two that is not `wall`.
  int Other(int wall) const { return wall == first ? second : first; }
};

/// The corners of some walls, and the walls that are in line with each other.
class WallCorners {
 public:
  /// `walls` must outlive it; `grid` has them all under their indices and is
  /// asked `reach` past their ends.
  WallCorners(const std::vector<VisibleWall>& walls,
              const VisibleWallGrid& grid, double reach,
              const WallCornerOptions& options);

  /// The corners: in the order of the first wall, then of the second.
  int size() const { return static_cast<int>(corners_.size()); }
  const WallCorner& corner(int i) const {
    return corners_[static_cast<std::size_t>(i)];
  }
  /// The corner that two walls make; -1 for none.
  int Between(int wall, int other) const;
  /// Walls in line with a wall: itself first, then ascending.
  const std::vector<int>& InLineWith(int wall) const {
    return in_line_[static_cast<std::size_t>(wall)];
  }
  /// A corner and the wall that it is on.
  struct OnWall {
    int corner = -1;
    int wall = -1;
  };
  /// Corners on a wall or one in line with it, in both directions from one of
  /// them and between these distances: the nearest ones, no more than a
  /// constant number, so that cost does not grow with the square of the rooms
  /// along a corridor.
  std::vector<OnWall> Along(int from, int wall, double min_distance,
                            double max_distance) const;

 private:
  const VisibleWall& wall(int i) const {
    return walls_[static_cast<std::size_t>(i)];
  }
  bool AreInLine(const VisibleWall& first, const VisibleWall& second) const;
  void AddCorner(int i, int j);

  const std::vector<VisibleWall>& walls_;
  const WallCornerOptions options_;
  std::vector<WallCorner> corners_;
  // Corners of each wall.
  std::vector<std::vector<int>> corners_of_;
  std::vector<std::vector<int>> in_line_;
  std::map<std::pair<int, int>, int> between_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_WALL_CORNERS_H_
