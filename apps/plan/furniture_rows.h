#ifndef PLUMBLINE_PLAN_FURNITURE_ROWS_H_
#define PLUMBLINE_PLAN_FURNITURE_ROWS_H_

#include <plumbline/factors/pose2.h>
#include <plumbline/plan/arrangement.h>

#include <vector>

namespace plumbline {

/// Joins regions (FindRegions) that are parts of the room beside them: a way
/// leads from them into that room, which is no corridor, through two gaps and
/// more, near to each other, in what stands between, and no other way to what
/// that room leads to as well. A row of cupboards and screens across a room
/// looks like a partition with doors, but a room behind a partition has one
/// door to its neighbor, or one to the same corridor. `path`: poses of
/// the robot in the order of time, map frame; what it drove through is a way
/// out even where it looks like a crack.
void JoinAcrossFurniture(const Arrangement& arrangement,
                         const std::vector<DrawnLine>& drawn,
                         const std::vector<Pose2>& path,
                         std::vector<int>* region);

}  // namespace plumbline

#endif  // PLUMBLINE_PLAN_FURNITURE_ROWS_H_
