#ifndef PLUMBLINE_PLAN_FURNITURE_ROWS_H_
#define PLUMBLINE_PLAN_FURNITURE_ROWS_H_

#include <plumbline/plan/arrangement.h>

#include <vector>

namespace plumbline {

/// Joins regions (FindRegions) that are parts of the room beside them: no way
/// leads out of them but into that room, which is no corridor, through two gaps
/// and more, near to each other, in what stands between. A row of cupboards and
/// screens across a room looks like a partition with doors, but a room behind a
/// partition has one door to its neighbor, or one elsewhere.
void JoinAcrossFurniture(const Arrangement& arrangement,
                         const std::vector<DrawnLine>& drawn,
                         std::vector<int>* region);

}  // namespace plumbline

#endif  // PLUMBLINE_PLAN_FURNITURE_ROWS_H_
