#ifndef PLUMBLINE_PLAN_ROOMS_WITH_DOORS_H_
#define PLUMBLINE_PLAN_ROOMS_WITH_DOORS_H_

#include <plumbline/plan/arrangement.h>

#include <vector>

namespace plumbline {

/// The drawn lines from `first` to `last` (not included) that divide two
/// regions (FindRegions) along 1.5 m and more, each of which has a door to one
/// and the same third, as offices along a corridor have; ascending.
///
/// A row of cupboards between two rooms and one within a room look alike, and
/// how much of either was seen says little. Two doors to the corridor say that
/// there are two rooms.
std::vector<int> LinesBetweenRoomsWithDoors(const Arrangement& arrangement,
                                            const std::vector<int>& region,
                                            int first, int last);

}  // namespace plumbline

#endif  // PLUMBLINE_PLAN_ROOMS_WITH_DOORS_H_
