#ifndef PLUMBLINE_PLAN_REGIONS_H_
#define PLUMBLINE_PLAN_REGIONS_H_

#include <plumbline/plan/arrangement.h>

#include <vector>

namespace plumbline {

/// Options for what makes a region of a building.
struct RegionOptions {
  /// What the border of the building costs for each metre without a wall, in
  /// m^2 of unknown or free space on the wrong side of it.
  double border_cost = 0.3;
  /// Regions are joined when their border separates them by less than this
  /// (WallProfile::holds, mean over the border).
  double holds_apart = 0.3;
  /// The same for regions that have a door each to one and the same third.
  double doors_hold_apart = 0.1;
  /// Regions with a lower share of wall than this between them are one: an
  /// opening as wide as a corridor is no door.
  double least_wall_share = 0.2;
  /// A corridor is no wider than this, m; where it opens into a space that is
  /// wider by this factor, it ends.
  double corridor_width = 3.0;
  double widening = 1.5;
  /// What is smaller, m^2, or narrower, m, is not a region of its own and goes
  /// to the neighbor that it is least separated from.
  double min_area = 2.0;
  double min_width = 0.8;
  /// The same goes for unseen spaces behind furniture narrower than this, m.
  double pocket_width = 0.9;
  /// ... or than up to this, m, where a part of them was seen beside it: a
  /// tenth and more.
  double glimpsed_width = 1.5;
};

/// The region of each face of an arrangement: the number of one of its faces;
/// -1 outside of the building.
///
/// A minimum cut says which faces are inside: free and unknown space against
/// borders where there is no wall. Then faces join across the most open borders
/// first, and corridors are cut off from the wide spaces that they lead to.
std::vector<int> FindRegions(const Arrangement& arrangement,
                             const RegionOptions& options = {});

}  // namespace plumbline

#endif  // PLUMBLINE_PLAN_REGIONS_H_
