#ifndef PLUMBLINE_APPS_EVALUATION_CONSISTENCY_H_
#define PLUMBLINE_APPS_EVALUATION_CONSISTENCY_H_

#include <plumbline/apps/evaluation/map_truth.h>
#include <plumbline/apps/simulation/synthetic_worlds.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/session.h>
#include <plumbline/frontend/timed_pose.h>

#include <vector>

namespace plumbline {

/// Which walls of a map their covariances are tested on.
struct ConsistencyOptions {
  /// Shorter walls of the map are left out, m.
  double minimum_length = 1.0;
  /// A wall counts when all of it lies on one true wall, the nearest that it
  /// lies beside with any part: at most this far beside it (m), this far beyond
  /// its ends (m), and turned by this many degrees. What else it may be is a
  /// question of association.
  double maximum_offset = 0.25;
  double end_slack = 0.1;
  double maximum_angle_deg = 4.0;
  /// The next true wall (the other face of a thin one) is this much farther,
  /// m.
  double least_margin = 0.05;
};

/// Errors of a map against the covariances that its graph gives them.
struct Consistency {
  /// Walls that were compared.
  int walls = 0;
  /// Normalized estimation error squared of all walls together (offset across
  /// the middle, and direction), and its degrees of freedom: two a wall but for
  /// the three of the frame, which is fitted (generalized least squares). The
  /// ratio is 1 when covariances are right, below when they are too wide.
  double nees = 0.0;
  int degrees_of_freedom = 0;
  /// The mean of each wall's own ratio in the frame that was fitted:
  /// correlations between walls do not count.
  double mean_wall_ratio = 0.0;
  /// Root mean squares of the errors, and of the standard deviations given, in
  /// that frame: m, degrees.
  double offset_error = 0.0;
  double offset_sigma = 0.0;
  double direction_error_deg = 0.0;
  double direction_sigma_deg = 0.0;

  double ratio() const {
    return degrees_of_freedom > 0 ? nees / degrees_of_freedom : 0.0;
  }
};

/// Tests the covariances of the walls of a map (features of type segment, level
/// 0) on the truth of a simulated building: Bar-Shalom, Li, Kirubarajan 2001,
/// "Estimation with applications to tracking and navigation", section 5.4.
/// Which wall is which is told by the nearest pose that saw it, or the nearest
/// of the trajectory in front of it, so that the map may be as far off as it
/// is. Throws Error as Marginals and AlignTrajectory do.
Consistency EvaluateConsistency(
    const Graph& graph, const SolverSession& session, const MapTruth& truth,
    const std::vector<TimedPose>& trajectory,
    const ConsistencyOptions& options = ConsistencyOptions());

/// The same for a graph of points (features of type point, level 0) as
/// MakeSyntheticWorld makes them, against their true positions: two degrees of
/// freedom a point but for the three of the frame. `walls` counts points;
/// offset_error and offset_sigma are those of a coordinate in the frame that
/// fits best by least squares, as is mean_wall_ratio; directions are 0. Throws
/// Error as Marginals does.
Consistency EvaluatePointConsistency(const Graph& graph,
                                     const SolverSession& session,
                                     const SyntheticTruth& truth);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_EVALUATION_CONSISTENCY_H_
