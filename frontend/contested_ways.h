#ifndef PLUMBLINE_FRONTEND_CONTESTED_WAYS_H_
#define PLUMBLINE_FRONTEND_CONTESTED_WAYS_H_

#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/scan.h>
#include <plumbline/frontend/scan_points.h>

#include <vector>

namespace plumbline {

/// Options for where more goes along with the robot than goes by.
struct ContestedWayOptions {
  ScanPointsOptions points;
  /// Way by odometry between two scans that are compared, m; a longer one
  /// between two scans is a jump, which says nothing; neither does a turn of
  /// more than this, rad.
  double step = 0.5;
  double jump = 1.5;
  double max_turn = 0.5;
  /// Farthest returns that are looked at, m.
  double max_range = 10.0;
  /// A return tells whether its surface stands or goes along when the two lead
  /// to places this far apart, along its normal, m. It does the one that has a
  /// surface of the scan before this near, m, where the other has none.
  double least_shift = 0.25;
  double near = 0.15;
  /// Two scans contest the way when this many returns go along, and this many
  /// times as many as stand; ...
  int min_along = 3;
  double min_ratio = 2.0;
  /// ... so many in a row do, up to so many between them do not.
  int min_steps = 4;
  int max_gap = 2;
  /// The doubt from which on it is told, m: all of the way where no more than
  /// this share of what goes along stands; else how uncertain a length is that
  /// odometry alone has, in parts of it, and, from this length on, by how much
  /// map and odometry differ: over a shorter way they do where odometry comes
  /// late.
  double told = 0.2;
  double unopposed = 0.1;
  double scale_sigma = 0.03;
  double least_length = 4.0;
  int num_threads = 0;
};

/// A stretch of which odometry says that the robot went it, and what it saw
/// that it did not.
struct ContestedWay {
  /// First and last scan: indices.
  int begin = 0;
  int end = 0;
  /// m; by odometry in metres of the map's.
  double by_map = 0.0;
  double by_odometry = 0.0;
};

/// Finds where more of what the robot saw stayed where it was in the robot's
/// frame than went by as odometry says (core/method.md, section 7), in the
/// order of scans: wheels slip there, or people walk ahead of it who hide the
/// rest. Scans that are matched then stand still, wholly or in part, and
/// nothing else shows it. `trajectory` has the pose of every scan, map frame;
/// `scale`: a metre of odometry's in the map, m (OdometryAgreement). Throws
/// Error when numbers differ. Cost: linear in the way and in the returns of a
/// scan, times their logarithm.
std::vector<ContestedWay> FindContestedWays(
    const std::vector<Scan>& scans, const std::vector<Pose2>& trajectory,
    double scale, const ContestedWayOptions& options);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_CONTESTED_WAYS_H_
