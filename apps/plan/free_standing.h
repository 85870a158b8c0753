#ifndef PLUMBLINE_PLAN_FREE_STANDING_H_
#define PLUMBLINE_PLAN_FREE_STANDING_H_

#include <plumbline/plan/arrangement.h>
#include <plumbline/plan/space_grid.h>

#include <vector>

namespace plumbline {

/// Joins regions (FindRegions) that nothing keeps apart but what stands free:
/// pieces up to 5 m long with free floor all around them, as desks with
/// screens, pews and benches, while a wall beside a door is a part of the
/// building.
void JoinAcrossFreeStanding(const SpaceGrid& space,
                            const Arrangement& arrangement,
                            const std::vector<DrawnLine>& drawn,
                            std::vector<int>* region);

}  // namespace plumbline

#endif  // PLUMBLINE_PLAN_FREE_STANDING_H_
