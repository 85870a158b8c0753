#ifndef PLUMBLINE_FRONTEND_MAP_CHECK_H_
#define PLUMBLINE_FRONTEND_MAP_CHECK_H_

#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/scan.h>
#include <plumbline/frontend/scan_matcher.h>
#include <plumbline/frontend/scan_points.h>

#include <functional>
#include <vector>

namespace plumbline {

/// Options for when a part of a trajectory contradicts the rest.
struct MapCheckOptions {
  ScanPointsOptions points;
  ScanMatcherOptions matcher;
  /// Way between the scans that are looked at, m.
  double spacing = 1.2;
  /// A scan is compared with scans of other visits: within this distance, m,
  /// and at least this much way before or after it, m. The nearest ones, at
  /// most and at least this many.
  double radius = 4.0;
  double least_way = 15.0;
  int max_others = 12;
  int min_others = 4;
  /// Shares of the scan's returns that stand where the others have looked
  /// through, and of what the others saw that the scan looks through, from
  /// which on a scan contradicts them; doors and people do so with less. Shares
  /// of fewer returns than this, at least 0.15 m apart, say nothing.
  double max_intruders = 0.3;
  double max_seen_through = 0.4;
  int min_returns = 15;
  /// Contradicting scans in a row, gaps of one allowed, before they are
  /// reported.
  int min_scans = 3;
  int num_threads = 0;

  /// Adapts the distances to a laser noisier by this factor (RangeNoiseScale).
  void ScaleToNoise(double scale) {
    points.ScaleToNoise(scale);
    matcher.ScaleToNoise(scale);
  }
};

/// Scans that contradict what was seen on other visits.
struct MapContradiction {
  /// First and last one: indices into `scans`.
  int begin = 0;
  int end = 0;
};

/// The parts of a trajectory whose scans do not agree with those of other
/// visits about what is solid and what is free (core/method.md, section 7), in
/// the order of scans. `keys`: indices into `scans`, ascending; `poses`: of the
/// robot at these, map frame. `stop` (may be null) is asked now and then; once
/// it has returned true the result is empty. Throws Error when numbers differ.
/// Cost: linear in the way.
std::vector<MapContradiction> FindContradictions(
    const std::vector<Scan>& scans, const std::vector<int>& keys,
    const std::vector<Pose2>& poses, const MapCheckOptions& options,
    const std::function<bool()>& stop = nullptr);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_MAP_CHECK_H_
