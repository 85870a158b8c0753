#ifndef PLUMBLINE_PIPELINE_PLACEMENT_TIE_H_
#define PLUMBLINE_PIPELINE_PLACEMENT_TIE_H_

#include <plumbline/factors/pose2.h>

namespace plumbline {

/// The motion `mean` (m, rad) from one track to another one that was placed in
/// it (PlaceTrack), where `way` (m) lies between its ends and where the two
/// were compared. Its covariance is wide, 0.1 m and 1 degree and 0.02 m and 0.1
/// degrees for each metre of the way: a weak pull, since matches of scans hold
/// the tracks once they are near.
UncertainPose2 PlacementTie(const Pose2& mean, double way);

}  // namespace plumbline

#endif  // PLUMBLINE_PIPELINE_PLACEMENT_TIE_H_
