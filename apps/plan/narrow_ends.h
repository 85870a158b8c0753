#ifndef PLUMBLINE_PLAN_NARROW_ENDS_H_
#define PLUMBLINE_PLAN_NARROW_ENDS_H_

#include <plumbline/factors/pose2.h>
#include <plumbline/plan/arrangement.h>

#include <vector>

namespace plumbline {

/// Joins regions (FindRegions) that are narrow, dead ends, and open in their
/// whole width to one other region, to that one: what lies between two parked
/// cars, or between two racks that stand at a wall, is a part of the hall. Not
/// what the robot was in.
///
/// `path`: poses of the robot, map frame.
void JoinNarrowEnds(const Arrangement& arrangement,
                    const std::vector<Pose2>& path, std::vector<int>* region);

}  // namespace plumbline

#endif  // PLUMBLINE_PLAN_NARROW_ENDS_H_
