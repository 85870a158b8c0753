#ifndef PLUMBLINE_FRONTEND_SCAN_SWEEP_H_
#define PLUMBLINE_FRONTEND_SCAN_SWEEP_H_

#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/scan.h>

#include <vector>

namespace plumbline {

/// Undoes the motion of the laser during a scan: a laser that sweeps its beam
/// round sees each return from another place. `places`: poses of the laser, in
/// the frame of where it was at Scan::timestamp, at times that divide the sweep
/// evenly from the first beam to the last; at least two. Fills Scan::bearings
/// and changes ranges, so that the returns lie where they are seen from that
/// frame. Does nothing, and returns false, where the laser did not move
/// noticeably.
bool UndoSweep(const std::vector<Pose2>& places, Scan* scan);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_SCAN_SWEEP_H_
