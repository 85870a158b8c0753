#ifndef PLUMBLINE_PLAN_UNSEEN_WALLS_H_
#define PLUMBLINE_PLAN_UNSEEN_WALLS_H_

#include <plumbline/plan/arrangement.h>
#include <plumbline/plan/drawn_lines.h>
#include <plumbline/plan/space_grid.h>
#include <plumbline/plan/wall_lines.h>

#include <vector>

namespace plumbline {

/// Options for where a wall must be that left no trace.
struct UnseenWallOptions {
  /// At least so much was seen on both of its sides, m^2.
  double min_area = 2.0;
  /// Largest share of its length that may look free: laser points go astray.
  double most_free = 0.05;
  /// Metres of wall on the border of a region that make a direction its own.
  double min_wall = 1.0;
  /// Faces of one wall are no farther apart, m.
  double max_thickness = 0.3;
};

/// Walls that must stand within regions (FindRegions) though nothing was seen
/// of them: in a direction of the region's own walls, from one side of it to
/// the other, nothing was seen free, but there was on both sides. Each side was
/// looked into from elsewhere, as two rooms through a door each, and
/// nobody looked from one into the other.
std::vector<WallLine> FindUnseenWalls(const Arrangement& arrangement,
                                      const std::vector<int>& region,
                                      const std::vector<DrawnLine>& drawn,
                                      const SpaceGrid& space,
                                      const UnseenWallOptions& options = {});

}  // namespace plumbline

#endif  // PLUMBLINE_PLAN_UNSEEN_WALLS_H_
