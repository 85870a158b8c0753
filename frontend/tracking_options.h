#ifndef PLUMBLINE_FRONTEND_TRACKING_OPTIONS_H_
#define PLUMBLINE_FRONTEND_TRACKING_OPTIONS_H_

#include <plumbline/factors/angle.h>

namespace plumbline {

/// Options for when the track of the scans is lost, and how its tie to the
/// earlier track is found again.
struct TrackingOptions {
  /// Shares of the returns that stand where the reference has looked through,
  /// and of the reference's points that the scan looks through, from which on
  /// they contradict a match. After a gap in the log the second pair counts.
  double max_intruders = 0.2;
  double max_seen_through = 0.25;
  double max_intruders_after_gap = 0.15;
  double max_seen_through_after_gap = 0.15;
  /// Inlier ratio, of what is known, that a match needs that leaves odometry or
  /// follows a gap; both: OdometryRefinementOptions::good_inlier_ratio.
  double min_ratio_after_gap = 0.6;
  /// Chi-square of a match against odometry from which on contradictions count
  /// without a gap, too: people contradict, but odometry agrees.
  double max_innovation = 15.0;
  /// Scale of Cauchy's loss on that chi-square: how much better the returns
  /// must fit at a pose that odometry speaks against.
  double odometry_tail = 9.0;
  /// Returns that lie 0.15 m apart or more that a match which leaves odometry
  /// by more than that has to have on what the reference has seen. With fewer
  /// it may leave odometry by less, in proportion. At least 1.
  int min_hits = 15;
  /// A time between scans that is longer than this, s, and this many times the
  /// usual one is a gap.
  double gap_seconds = 1.0;
  double gap_factor = 4.0;
  /// Scans in a row that are refused, the last for contradicting, after which a
  /// track of its own begins where there was no gap.
  int min_contradictions = 3;
  /// Way (m) and turn (rad) without any match after which a track of its own
  /// begins.
  double max_blind_way = 1.5;
  double max_blind_turn = DegToRad(40.0);
  /// A tie by odometry alone is accepted when there was neither a gap nor a
  /// contradiction, or odometry went on over them, and its standard deviations,
  /// for odometry as it was on this log so far, are no larger than these, m and
  /// rad. A guess may be put into any place that looks alike.
  double max_odometry_sigma = 1.5;
  double max_odometry_angle = DegToRad(20.0);
  /// From this way without any match on it is reported, m.
  double max_silent_way = 3.0;
  /// What a tie needs: scans of the track, share of returns that lie on what
  /// the reference knows of all that do not lie in the unknown, the same by
  /// the directions of surfaces too, score of the search, largest share
  /// of the reference that is looked through, share of the returns that are
  /// not in the unknown, and returns a scan that lie on the reference.
  int min_tie_keys = 3;
  double min_tie_support = 0.85;
  double min_tie_inliers = 0.5;
  double min_tie_score = 0.4;
  double max_tie_seen_through = 0.15;
  double min_tie_known = 0.4;
  int min_tie_hits = 15;
  /// The same share for a single scan after a gap where odometry speaks of
  /// another place.
  double min_unexpected_support = 0.97;
  /// What a tie needs that was found in everything seen so far, where many
  /// places look alike and the right one need not be among them.
  double min_global_support = 0.96;
  double min_global_inliers = 0.65;
  /// A rival pose must be worse by this factor.
  double rival_share = 0.75;
  /// Speed at which the robot may have gone in a gap, m/s, and how far the
  /// search near the last pose goes at most, m. A match that asks for a faster
  /// move which odometry does not have, and which is longer than
  /// search_translation by that, does not count: wheels slip, but a robot does
  /// not leap. A scan may show another time than its stamp says.
  double gap_speed = 0.8;
  double max_local_search = 6.0;
  /// Key scans of the track at which the whole map is searched first, and after
  /// which the tie is given up.
  int first_global_keys = 10;
  int max_open_keys = 150;
  /// Pieces of a part that hangs loose in the end that are looked for in what
  /// the rest of the track saw.
  int max_late_windows = 12;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_TRACKING_OPTIONS_H_
