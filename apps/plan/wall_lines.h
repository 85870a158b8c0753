#ifndef PLUMBLINE_PLAN_WALL_LINES_H_
#define PLUMBLINE_PLAN_WALL_LINES_H_

#include <plumbline/core/wall.h>
#include <plumbline/factors/angle.h>
#include <plumbline/plan/polygon.h>
#include <plumbline/plan/space_grid.h>

#include <Eigen/Core>
#include <vector>

namespace plumbline {

/// A face of a wall that is known from elsewhere, m, map frame.
struct KnownWall {
  Eigen::Vector2d begin = Eigen::Vector2d::Zero();
  Eigen::Vector2d end = Eigen::Vector2d::Zero();
};

/// Options for what makes a line of walls.
struct WallLineOptions {
  /// Directions that differ by less are one, rad.
  double same_direction = DegToRad(3.0);
  /// A row of occupied cells is a piece of wall from this length on, m, ...
  double min_length = 0.5;
  /// ... with no gap longer than this, m.
  double max_gap = 0.3;
  /// A piece explains cells within this distance of it, m.
  double cell_distance = 0.1;
  /// Faces of one wall are no farther apart, m: the thickest wall.
  double max_thickness = 0.3;
  /// The same for two faces that are each seen from outside of it only, along
  /// most of the shorter one, with nothing seen between them, m.
  double thickest_solid = 0.8;
  /// Pieces in line with a longer gap than this, m, are on lines of their own.
  double in_line_gap = 4.0;
};

/// Pieces of wall in one straight line, with both faces; map frame, m.
struct WallLine {
  /// In the middle of the wall.
  Eigen::Vector2d origin = Eigen::Vector2d::Zero();
  Eigen::Vector2d along = Eigen::Vector2d::UnitX();
  /// First and last wall, along the line from the origin.
  double begin = 0.0;
  double end = 0.0;
  /// Where the faces lie to the left of the line: low <= 0 <= high.
  double low = 0.0;
  double high = 0.0;
  /// Metres of wall.
  double weight = 0.0;
  /// False: drawn from the end of another line to close a space, without any
  /// evidence of a wall.
  bool is_wall = true;
  /// Its direction is exactly one of the building's.
  bool is_aligned = false;
  /// The curved wall that it is an edge of, -1 for none. The edges of one
  /// follow each other, each from where the one before ends.
  int curve = -1;
  /// Another edge of that wall begins there: the line ends in that corner.
  bool begins_in_corner = false;
  bool ends_in_corner = false;

  /// Unit vector to the left of `along`.
  Eigen::Vector2d normal() const { return {-along[1], along[0]}; }
  /// The point t metres along from the origin, m, map frame.
  Eigen::Vector2d At(double t) const { return origin + t * along; }
  /// Where a point (m, map frame) lies along the line, from its origin, m.
  double Along(const Eigen::Vector2d& p) const { return along.dot(p - origin); }
  /// How far a point lies to the left of the line, m.
  double Across(const Eigen::Vector2d& p) const {
    return normal().dot(p - origin);
  }
};

/// Lines of walls from pieces that are known and from rows of occupied cells
/// along `directions` (rad, modulo pi, the most important first) and across
/// them. Pieces within WallLineOptions::same_direction of one of these get
/// exactly that direction. Edges of curved walls (curved_walls.h) come last.
std::vector<WallLine> FindWallLines(const std::vector<KnownWall>& pieces,
                                    const std::vector<double>& directions,
                                    const SpaceGrid& space,
                                    const WallLineOptions& options = {});

/// Metres of wall in the chain that each line belongs to. Lines with less than
/// `longest` metres of wall that go on from end to end, with a bend between
/// them, are the chords of one curved wall.
std::vector<double> WallOfChains(const std::vector<WallLine>& lines,
                                 double longest);

}  // namespace plumbline

#endif  // PLUMBLINE_PLAN_WALL_LINES_H_
