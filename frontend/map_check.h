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
  /// What it takes to believe that two parts of a track lie right to each other
  /// (JudgeTies): at least this many scans of either, one for each
  /// `spacing`, that agree with the other, this share of all that can be
  /// compared, and no larger share that contradicts it. Their places have at
  /// least this standard deviation in every direction, m: along a corridor all
  /// agrees.
  int min_confirming = 20;
  double min_confirming_share = 0.8;
  double max_contradicting_share = 0.05;
  double min_confirming_spread = 1.0;
  /// Comparisons that are enough for two parts that see much of each other.
  int enough_compared = 100;
  /// Odometry that is off by more over a cut, m, says where the scans next to
  /// it may be, too.
  double open_way = 0.5;
  /// Shares as above, up to which a scan agrees, and share of its returns that
  /// do not lie in the unknown.
  double agreeing_intruders = 0.1;
  double agreeing_seen_through = 0.2;
  double agreeing_known = 0.5;
  int num_threads = 0;

  /// Adapts the distances to a laser noisier by this factor (RangeNoiseScale).
  void ScaleToNoise(double scale) {
    points.ScaleToNoise(scale);
    matcher.ScaleToNoise(scale);
  }
};

/// What a scan says of the place that it was compared at.
enum class ScanVerdict {
  /// It shares too little with what was seen there.
  kUnknown,
  kAgrees,
  kContradicts,
};

/// By the options' shares and least number of returns.
ScanVerdict JudgeScan(const ScanAgreement& agreement,
                      const MapCheckOptions& options);

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

/// How scans along the way, one for each MapCheckOptions::spacing, agree with
/// what was seen on other visits to their places.
struct MapAgreement {
  int agreeing = 0;
  int contradicting = 0;

  /// Whether a map in which they agree so is better than one of the same scans
  /// in which they agree as in `other`. One that has come apart contradicts
  /// itself less, too: nothing of it may agree less.
  bool IsBetterThan(const MapAgreement& other) const {
    return contradicting < other.contradicting && agreeing >= other.agreeing;
  }

  /// Whether so much less of it contradicts than in `other` that a little less
  /// may agree, if what was measured speaks for it, too: three times as much.
  bool ContradictsFarLessThan(const MapAgreement& other) const {
    return contradicting < other.contradicting &&
           other.contradicting - contradicting >=
               3 * (other.agreeing - agreeing);
  }
};

/// Counts them. Arguments, cost and Error as of FindContradictions; none once
/// `stop` has returned true.
MapAgreement CountAgreement(const std::vector<Scan>& scans,
                            const std::vector<int>& keys,
                            const std::vector<Pose2>& poses,
                            const MapCheckOptions& options,
                            const std::function<bool()>& stop = nullptr);

/// Where a track was cut, and goes on with what one match or a guess says.
struct TrackCut {
  /// The last scan that is sure, and the first one of what follows; scans
  /// between them belong to neither.
  int begin = 0;
  int end = 0;
};

/// What is seen of a tie over a cut.
enum class TieVerdict {
  /// Nothing shows that the parts before and behind it lie right to each other.
  kUnconfirmed,
  /// They do, but the scans next to it fit as well where odometry has them,
  /// seen from the other side, and that is elsewhere: somewhere between, as
  /// along a corridor while wheels were not read.
  kOpen,
  /// They do.
  kConfirmed,
};

/// Says of each cut (in the order of scans) whether the parts of the track
/// before and behind it are seen to lie right to each other by what they have
/// seen of the same places on the way, directly or by way of other parts, and
/// the scans between them fit, too. `trajectory` has the pose of each scan, map
/// frame; `keys`, `stop` and Error as above. Once `stop` has returned true no
/// cut is confirmed.
std::vector<TieVerdict> JudgeTies(const std::vector<Scan>& scans,
                                  const std::vector<int>& keys,
                                  const std::vector<Pose2>& trajectory,
                                  const std::vector<TrackCut>& cuts,
                                  const MapCheckOptions& options,
                                  const std::function<bool()>& stop = nullptr);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_MAP_CHECK_H_
