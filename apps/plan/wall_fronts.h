#ifndef PLUMBLINE_PLAN_WALL_FRONTS_H_
#define PLUMBLINE_PLAN_WALL_FRONTS_H_

#include <plumbline/plan/arrangement.h>

#include <vector>

namespace plumbline {

/// Gives what lies between two rows of wall close together, with a region
/// (FindRegions) on either side, to the region before the row that is wall for
/// less of its length: the front of cupboards ends where they do, while the
/// wall that they stand before goes on, also beyond other rooms. Each row is
/// judged as a whole, so that no piece of it is given to the other side.
void GiveFrontsToRooms(const Arrangement& arrangement,
                       const std::vector<DrawnLine>& drawn,
                       std::vector<int>* region);

}  // namespace plumbline

#endif  // PLUMBLINE_PLAN_WALL_FRONTS_H_
