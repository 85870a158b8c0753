#ifndef PLUMBLINE_FRONTEND_MATCH_DRIFT_H_
#define PLUMBLINE_FRONTEND_MATCH_DRIFT_H_

#include <plumbline/factors/pose2.h>

#include <Eigen/Core>
#include <vector>

namespace plumbline {

/// Errors of scan matching that the returns do not tell of: what neighbouring
/// matches share (bent surfaces, beams that are not quite where they should be)
/// adds up along the way like a random walk.
struct MatchDrift {
  /// Standard deviations after one metre: m, and rad.
  double translation_per_root_metre = 0.01;
  double rotation_per_root_metre = DegToRad(0.1);
  /// After a turn of one radian, rad.
  double rotation_per_root_radian = DegToRad(0.7);
};

/// Covariance of the drift over one motion (m, m, rad), in its own start frame.
Eigen::Matrix3d DriftCovariance(const Pose2& motion, const MatchDrift& drift);

/// The last of the poses of a track seen from the first, as uncertain as the
/// drift from each to the next makes it.
UncertainPose2 DriftAlong(const std::vector<Pose2>& poses,
                          const MatchDrift& drift);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_MATCH_DRIFT_H_
