#ifndef PLUMBLINE_FRONTEND_POSE_RECOVERY_H_
#define PLUMBLINE_FRONTEND_POSE_RECOVERY_H_

#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/graph_builder.h>
#include <plumbline/frontend/odometry_refinement.h>

#include <vector>

namespace plumbline {

/// Options of the recovery of poses.
struct PoseRecoveryOptions {
  /// One in this many key scans is a place whose pose comes back; what was seen
  /// up to the next one is bound to it by refined odometry.
  int place_stride = 3;
  /// What refined odometry was made with: the parts of its covariance.
  OdometryNoise noise;
  MatchDrift drift;
  /// Chi-square (2 degrees of freedom) from which on a sighting is an outlier:
  /// it counts for no more than one at this.
  double outlier_chi_square = 9.21;
  /// Solves, each followed by taking variances and weights anew.
  int rounds = 10;
  /// The stated drift of matching counts as much as this many residuals when
  /// its factors are estimated.
  double prior_redundancy = 3.0;
  /// Bounds of the factors of variances.
  double min_variance_factor = 1e-4;
  double max_variance_factor = 25.0;
};

/// The poses that were brought back.
struct RecoveredPoses {
  /// The features of the places, in the order of the log; none when nothing was
  /// done.
  std::vector<FeatureId> places;
  /// Factors of the variances of matches, of their drift over the way and over
  /// turns (MatchDrift), and of sightings.
  double match_variance_factor = 1.0;
  double way_variance_factor = 1.0;
  double turn_variance_factor = 1.0;
  double sighting_variance_factor = 1.0;
};

/// Brings poses of key scans back into a graph of segments once all scans are
/// in (core/method.md, section 7, "What the front-end may claim"), in place of
/// the relations between segments that stood for them: these neglect what their
/// errors have in common. Poses are bound to each other by refined odometry and
/// to segments by what was seen of them (pose_segment_collinearity), everything
/// once. How good both are is estimated from their residuals without any
/// structure (variance components, Foerstner 1979). The first place is fixed:
/// it is the frame of the map. Structure constraints stay as they are.
///
/// `key_poses` (map frame, one per record) say where the poses begin. `robot`:
/// the pose that the front-end keeps in the graph, which leaves it (kNoId:
/// none). Sessions on the graph must be made anew. Does nothing without records
/// that saw segments. Throws Error when a solve fails.
RecoveredPoses RecoverPoses(const std::vector<KeyScanRecord>& records,
                            const std::vector<Pose2>& key_poses,
                            FeatureId robot, const PoseRecoveryOptions& options,
                            const Registry& registry, Graph* graph);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_POSE_RECOVERY_H_
