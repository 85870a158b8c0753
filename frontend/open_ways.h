#ifndef PLUMBLINE_FRONTEND_OPEN_WAYS_H_
#define PLUMBLINE_FRONTEND_OPEN_WAYS_H_

#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/match_drift.h>
#include <plumbline/frontend/scan.h>
#include <plumbline/frontend/scan_matcher.h>
#include <plumbline/frontend/scan_points.h>

#include <cstddef>
#include <functional>
#include <vector>

namespace plumbline {

/// Options for where nothing tells how far the robot went.
struct OpenWayOptions {
  ScanPointsOptions points;
  ScanMatcherOptions matcher;
  MatchDrift drift;
  /// Way between the places that are looked at, m.
  double spacing = 1.0;
  /// A place's scan is compared with what was seen on this much way before it,
  /// and on other visits that passed within this radius of it, m.
  double visit = 4.0;
  double radius = 2.0;
  /// A visit is another one after this much way, m.
  double least_way = 15.0;
  /// Scans that one is compared with at most.
  std::size_t max_others = 6;
  /// Odometry before anything is known of it: standard deviation after a metre,
  /// m, and of its scale. The first counts as much as this many metres of way
  /// on which the returns show how good it is.
  double odometry_sigma = 0.1;
  double scale_sigma = 0.05;
  double prior_way = 3.0;
  /// Uncertainty of the length of a way (standard deviation, m) from which on
  /// it is reported. Ways that odometry alone knows better, and that are as
  /// long in the map to within this, are not looked into.
  double told_sigma = 0.2;
  /// Shorter ways are not compared with odometry, m: over them it has another
  /// length where it comes late.
  double least_length = 4.0;
  int num_threads = 0;
};

/// A part of the way whose length hangs on odometry.
struct OpenWay {
  /// Its first and last scan: indices into `scans`.
  int begin = 0;
  int end = 0;
  /// Length, m, and its standard deviation.
  double length = 0.0;
  double sigma = 0.0;
};

/// The parts of the way along which the returns do not tell how far the robot
/// went, as in a corridor without anything in sight but its two walls, and
/// whose length is therefore uncertain by more than `told_sigma`
/// (core/method.md, section 7), in the order of scans.
///
/// What a match says of a displacement along the weakest direction is not taken
/// from the curvature of its cost: normals of returns scatter, and that looks
/// like knowledge. The scan is shifted by a quarter of a metre to a metre
/// instead, and by how much it then fits worse is what is known. All places,
/// bound by what is known so and by odometry, whose errors are estimated where
/// returns tell how far the robot went, give the covariance. Where the map has
/// another length than odometry, the part of it that what was seen does not
/// explain counts as well.
///
/// `keys`: indices into `scans`, ascending; `poses`: of the robot at these, map
/// frame. `stop` (may be null) is asked now and then; once it has returned true
/// the result is empty. Throws Error when numbers differ. Cost: linear in the
/// way but for one sparse factorization.
std::vector<OpenWay> FindOpenWays(const std::vector<Scan>& scans,
                                  const std::vector<int>& keys,
                                  const std::vector<Pose2>& poses,
                                  const OpenWayOptions& options,
                                  const std::function<bool()>& stop = nullptr);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_OPEN_WAYS_H_
