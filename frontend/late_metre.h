#ifndef PLUMBLINE_FRONTEND_LATE_METRE_H_
#define PLUMBLINE_FRONTEND_LATE_METRE_H_

#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/odometry_refinement.h>

#include <vector>

namespace plumbline {

/// A change of the motion to a key scan (its index), in the frame of the key
/// scan before, m and rad.
struct MotionCorrection {
  int scan = 0;
  Pose2 change = Pose2::Zero();
};

/// When motions are corrected by what was known of odometry's metre only later.
struct LateMetreOptions {
  /// Some stretch of this length, m, gets longer or shorter by more than this,
  /// m: less is lost among what matches err by.
  double window = 50.0;
  double least_change = 0.1;
};

/// What a log's motions lack by what was known of odometry's metre only later.
struct LateMetre {
  /// In the order of the log; none when too little would change.
  std::vector<MotionCorrection> corrections;
  /// By how much a stretch of LateMetreOptions::window would change at most, m.
  double largest_change = 0.0;
};

/// In corridors of bare walls the metre is learnt over a hundred metres and
/// more, and the way out is as much longer than the way back. The metre of all
/// times is estimated from all that was learnt (Rauch, Tung and Striebel 1965).
/// `uses` come in the order of the log.
LateMetre FindLateMetre(const std::vector<MetreUse>& uses,
                        const LateMetreOptions& options);

/// Changes motions, each by its share those of the scans on the way to its key
/// scan, and moves the poses of all along. Where a track begins its place to
/// the scan before stays.
void CorrectMotions(const std::vector<MotionCorrection>& corrections,
                    std::vector<RefinedScan>* refined);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_LATE_METRE_H_
