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
  /// on which the returns show how good it is: it is a poor robot's, and most
  /// are better by far.
  double odometry_sigma = 0.1;
  double scale_sigma = 0.05;
  double prior_way = 0.5;
  /// Uncertainty of the length of a way (standard deviation, m) from which on
  /// it is reported. Ways that odometry alone knows better, and that are as
  /// long in the map to within this, are not looked into.
  double told_sigma = 0.16;
  /// Shorter ways are not compared with odometry, m: over them it has another
  /// length where it comes late.
  double least_length = 4.0;
  /// The same of the distance between two places.
  double told_distance_sigma = 0.16;
  /// Distances are looked at between places with up to this much way between
  /// them, m: over more the map is held by other things than this way.
  double most_way = 60.0;
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

/// What is not known of how far places lie from each other.
struct UncertainLengths {
  /// FindOpenWays.
  std::vector<OpenWay> ways;
  /// How far those two places lie from each other, m, of which that is known
  /// worst, and its standard deviation, m, where it is reported; otherwise 0.
  double distance = 0.0;
  double distance_sigma = 0.0;

  /// Standard deviation of the most uncertain way's length, m; 0 without ways.
  double LargestSigma() const;
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
/// frame; `follows`: for each, whether odometry leads there from the one
/// before, which it does not where the robot was lost or another log begins
/// (the first one's is not asked). `stop` (may be null) is asked now and then;
/// once it has returned true the result is empty. Throws Error when numbers
/// differ. Cost: linear in the way but for one sparse factorization.
std::vector<OpenWay> FindOpenWays(const std::vector<Scan>& scans,
                                  const std::vector<int>& keys,
                                  const std::vector<Pose2>& poses,
                                  const std::vector<bool>& follows,
                                  const OpenWayOptions& options,
                                  const std::function<bool()>& stop = nullptr);

/// FindOpenWays, and what short ways of that kind add up to: along a corridor
/// that is seen 4 m far doors show the place every few metres, and odometry
/// carries it from one to the next. Of each one the length may be known well
/// enough, and that of all of them not. A distance counts along the line
/// between its places, with at most `most_way` between them and no jump; that
/// the map may bend between them is another matter and does not.
UncertainLengths FindUncertainLengths(
    const std::vector<Scan>& scans, const std::vector<int>& keys,
    const std::vector<Pose2>& poses, const std::vector<bool>& follows,
    const OpenWayOptions& options, const std::function<bool()>& stop = nullptr);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_OPEN_WAYS_H_
