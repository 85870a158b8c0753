#ifndef PLUMBLINE_PLAN_CURVED_WALLS_H_
#define PLUMBLINE_PLAN_CURVED_WALLS_H_

#include <plumbline/plan/space_grid.h>
#include <plumbline/plan/wall_lines.h>

#include <Eigen/Core>
#include <vector>

namespace plumbline {

/// Options for what makes a curved wall.
struct CurvedWallOptions {
  /// Of the circle that a wall, or a part of it, lies on, m. What is smaller
  /// is a column or a table.
  double min_radius = 1.5;
  /// What bends less is a straight wall, m.
  double max_radius = 60.0;
  /// Faces lie on a circle to this, m.
  double on_circle = 0.08;
  /// Metres of wall on a circle, and the share of its arc that is wall.
  double min_wall = 2.0;
  double min_share = 0.5;
  /// How far the middle of an arc lies from the chord between its ends, m, and
  /// by how much it turns, rad: two walls that meet at a corner are no arc.
  double min_sagitta = 0.2;
  double min_turn = DegToRad(15.0);
  /// Faces with a longer gap between them are on arcs of their own, m.
  double max_gap = 1.5;
};

/// A wall along a circle, or along several that go on from each other, as a
/// polyline.
struct CurvedWall {
  /// Corners in the middle of the wall, m, map frame. The last one of a closed
  /// curve is the first one. An opening lies within one edge, with a piece of
  /// wall before and after it.
  std::vector<Eigen::Vector2d> corners;
  /// Where the faces lie to the left of the edges, m: low <= 0 <= high.
  double low = 0.0;
  double high = 0.0;

  /// The first corner is the last one.
  bool is_closed() const { return corners.front() == corners.back(); }
};

/// Walls along circles among known faces: at least three faces of different
/// directions, which meet nearly, all of them on the circle. Two faces of one
/// wall make one. Known faces that
/// lie on one are taken from `pieces`. Deterministic; places that are far apart
/// cost nothing together.
///
/// Method: circles through pairs of neighbouring faces, grown by what lies on
/// them (a geometric least squares fit of the circle), the one with most wall
/// first.
std::vector<CurvedWall> TakeCurvedWalls(const SpaceGrid& space,
                                        const WallLineOptions& line_options,
                                        const CurvedWallOptions& options,
                                        std::vector<KnownWall>* pieces);

}  // namespace plumbline

#endif  // PLUMBLINE_PLAN_CURVED_WALLS_H_
