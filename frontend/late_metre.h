#ifndef PLUMBLINE_FRONTEND_LATE_METRE_H_
#define PLUMBLINE_FRONTEND_LATE_METRE_H_

#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/odometry_refinement.h>

#include <vector>

namespace plumbline {

/// A change of the motion to a key scan, in the frame of the key scan before.
struct MotionCorrection {
  int scan = 0;
  Pose2 change = Pose2::Zero();
};

/// What a log's motions lack by what was known of odometry's metre only later:
/// in corridors of bare walls it is learnt over a hundred metres and more, and
/// the way out is as much longer than the way back. The metre of all times is
/// estimated from all that was learnt (Rauch, Tung and Striebel 1965). Empty
/// when no stretch of `window`, m, gets longer or shorter by more than `least`,
/// m. `uses` come in the order of the log; `largest` (may be null) gets the
/// largest change of such a stretch, m.
std::vector<MotionCorrection> LateMetre(const std::vector<MetreUse>& uses,
                                        double window, double least,
                                        double* largest = nullptr);

/// Changes motions, each by its share those of the scans on the way to its key
/// scan, and moves the poses of all along. Where a track begins its place to
/// the scan before stays.
void CorrectMotions(const std::vector<MotionCorrection>& corrections,
                    std::vector<RefinedScan>* refined);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_LATE_METRE_H_
