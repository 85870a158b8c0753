#ifndef PLUMBLINE_FRONTEND_TRACK_PLACEMENT_H_
#define PLUMBLINE_FRONTEND_TRACK_PLACEMENT_H_

#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/scan.h>
#include <plumbline/frontend/scan_matcher.h>
#include <plumbline/frontend/scan_points.h>

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace plumbline {

/// What a key scan saw, and from where.
struct KeyView {
  /// Of the robot, in the frame of the map that the scan is in.
  Pose2 pose = Pose2::Zero();
  /// Position of the laser in the robot's frame, m.
  Eigen::Vector2d laser = Eigen::Vector2d::Zero();
  /// Returns in the robot's frame, thinned out.
  std::vector<ScanPoint> points;
};

/// The views of scans: `keys` are indices into `scans`, `poses` those of the
/// robot at these. Throws Error when their numbers differ.
std::vector<KeyView> MakeKeyViews(const std::vector<Scan>& scans,
                                  const std::vector<int>& keys,
                                  const std::vector<Pose2>& poses,
                                  const ScanPointsOptions& options);

/// Options of PlaceTrack: what it takes for two maps to be of one building.
struct TrackPlacementOptions {
  ScanPointsOptions points;
  ScanMatcherOptions matcher;
  /// Consecutive key scans that are looked for together: a window.
  int window_keys = 16;
  /// Windows that are looked for in the whole map at most, spread evenly over
  /// the track, and poses that each may have there.
  int max_searches = 24;
  int max_peaks = 8;
  /// Places of the track that are looked at closely at most for every few
  /// windows.
  int max_candidates = 8;
  /// A window is compared with what was seen from this near, m, by so many key
  /// scans at most.
  double radius = 6.0;
  int max_views = 60;
  /// A window may lie so far from where its neighbors place it, m and rad.
  double max_shift = 0.8;
  double max_turn = DegToRad(8.0);
  /// A window agrees with the map when this share of its returns is not in the
  /// unknown, this share of those lies on what the map has, no more than this
  /// share of what the map has there is looked through, and this share of
  /// returns finds a partner; it contradicts the map when more than these
  /// shares (of the known returns, of what the map has) say so.
  double min_known = 0.4;
  double min_support = 0.85;
  double max_seen_through = 0.2;
  double min_inliers = 0.6;
  double max_intruders = 0.3;
  double max_looked_through = 0.4;
  /// Windows that have to agree, the share of the windows that agree or
  /// contradict which may contradict, and the share of the best place's
  /// support that a rival may have.
  int min_agreeing = 3;
  double max_contradicting = 0.1;
  double rival_share = 0.6;
  /// What the returns say of the track's place in the direction that they say
  /// least of is at least this share of what they say across it.
  double min_information_share = 0.02;
  /// RMS distance, m, of the windows that agree from where the track as a whole
  /// has them, and what is added to it for each metre (RMS) that they lie from
  /// their middle: buildings of one kind may agree piece by piece where the
  /// track bends, but not as a whole.
  double max_misfit = 0.1;
  double max_misfit_per_metre = 0.003;
  /// Longest piece of wall, m, that two scans of one of both see and that those
  /// of the other look through, without the 0.3 m at either end that count for
  /// nothing: doors are opened and closed between two logs and furniture is
  /// moved, but walls of over 1.7 m are not. Corridors of two buildings may
  /// agree wherever both were seen, but for the mouth of a wing.
  double max_contradicting_stretch = 1.1;
  /// Shorter pieces are doors that were opened or shut, but where walls stand
  /// in openings of the map and the map's walls in openings of the track, it is
  /// another building, as its own mirror image is: either happens at two places
  /// at least, and on the average of both it does at this many, and at more
  /// than this share of the agreeing windows.
  int min_exchanged = 3;
  double max_exchanged_share = 0.15;
  /// Doors that stand elsewhere in the same wall (an opening and a wall in its
  /// place, up to 3 m from each other, either way): so many are another
  /// building. People shut one door and open the next, too, but a log that is
  /// kept apart without need does less harm than two buildings in one map.
  int min_moved_doors = 1;
  /// With a start that somebody gave: windows that have to agree, doors that
  /// stand elsewhere, and how far from it the track may start, m and rad.
  int min_agreeing_at_start = 1;
  int min_moved_doors_at_start = 2;
  double start_distance = 3.0;
  double start_turn = DegToRad(45.0);

  /// Makes distances fit ranges this many times as noisy as usual
  /// (range_noise.h).
  void ScaleToNoise(double scale) {
    points.ScaleToNoise(scale);
    matcher.ScaleToNoise(scale);
  }
};

/// Where a track lies in a map.
struct TrackPlacement {
  bool found = false;
  /// Pose of the track's frame in the map's.
  Pose2 pose = Pose2::Zero();
  /// Windows of the track, those of them that agree with the map at this pose,
  /// those that contradict it, those that do neither though they lie where the
  /// map is known, and the agreeing ones, less the contradicting ones, of the
  /// best other place.
  int windows = 0;
  int agreeing = 0;
  int contradicting = 0;
  int doubtful = 0;
  double rival = 0.0;
  /// How far the agreeing windows lie from where `pose` puts them: the RMS, m.
  double misfit = 0.0;
  /// Pieces of wall of the track that the map looks through, those of the map
  /// that the track looks through, and the length of all, m, without the 0.3 m
  /// at either end: doors that were opened or shut, or another building.
  int walls_through_map = 0;
  int walls_through_track = 0;
  double contradicting_length = 0.0;
  /// The views, of the map and of the track, between which the tie is best.
  int from = 0;
  int to = 0;
  /// Why it was not found, for people.
  std::string why_not;
  /// Why it may not be its place though it was found, for people: few parts
  /// speak for it, or places speak against it. Empty when it is clear.
  std::string doubt;
};

/// Finds where a track of scans lies in a map without a guess: a window of key
/// scans after the other is searched for in the whole map over the full circle
/// (ScanMatcher::Peaks, as a track that was lost is: OdometryRefiner), and each
/// place that a window speaks for is judged by all windows of the track: what
/// the track saw has to be solid and free where the map is, all along the way
/// that they share, and clearly more so than at every other place.
///
/// `map` and `track` are the views of either in its own frame, in the order of
/// the way. `start`: pose of the track's first view in the map's frame, if
/// somebody knows it roughly. `stop` (may be null) is asked now and then; once
/// it has returned true the search ends and finds nothing.
TrackPlacement PlaceTrack(const std::vector<KeyView>& map,
                          const std::vector<KeyView>& track,
                          const std::optional<Pose2>& start,
                          const TrackPlacementOptions& options,
                          const std::function<bool()>& stop = nullptr);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_TRACK_PLACEMENT_H_
