#ifndef PLUMBLINE_FRONTEND_RELOCALIZATION_H_
#define PLUMBLINE_FRONTEND_RELOCALIZATION_H_

#include <plumbline/core/graph.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/graph_builder.h>
#include <plumbline/frontend/odometry_refinement.h>

#include <vector>

namespace plumbline {

/// Options of finding scans again on the final map.
struct RelocalizationOptions {
  /// Uncertainty of the map's walls: offset (m) and direction (rad),
  /// added to each observation's own covariance.
  double feature_offset_sigma = 0.03;
  double feature_angle_sigma = DegToRad(0.7);
  /// Uncertainty of the map's points, m.
  double point_sigma = 0.03;
  /// Scale of the Cauchy loss on an observation, in sigmas.
  double loss_scale = 2.0;
  /// Uncertainty of the first key scan's recorded pose, m and rad; zero: it is
  /// not used. Corridors without ends do not tell how far along them the robot
  /// is: their walls are parallel to some hundredths of a degree only, and
  /// where they are as far apart as they look may be half a kilometre away.
  double start_position_sigma = 0.5;
  double start_angle_sigma = DegToRad(10.0);
  int max_iterations = 30;
  int num_threads = 1;
};

/// Finds every key scan's pose again on the final map: refined odometry from
/// key to key, and each recognized segment or point on its feature, whose place
/// is held constant. Returns the poses (map frame) in the order of records.
/// Throws Error when the solve fails.
std::vector<Pose2> RelocalizeKeyScans(const Graph& graph,
                                      const std::vector<KeyScanRecord>& records,
                                      const RelocalizationOptions& options);

/// Poses of all scans: key scans as given, the scans between them by refined
/// odometry, with what is missing at the next key spread over the way.
/// `refined` has one entry per scan of the log.
std::vector<Pose2> InterpolateScans(const std::vector<RefinedScan>& refined,
                                    const std::vector<KeyScanRecord>& records,
                                    const std::vector<Pose2>& key_poses);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_RELOCALIZATION_H_
