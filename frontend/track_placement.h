#ifndef PLUMBLINE_FRONTEND_TRACK_PLACEMENT_H_
#define PLUMBLINE_FRONTEND_TRACK_PLACEMENT_H_

#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/key_views.h>
#include <plumbline/frontend/track_placement_options.h>
#include <plumbline/frontend/wall_contradictions.h>

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace plumbline {

/// A window that contradicts a place speaks against it like so many that agree
/// speak for it.
constexpr double kContradictionWeight = 2.0;

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
  /// The same of the best other place of whose returns not clearly more
  /// contradict the map, or are contradicted by it.
  double clean_rival = 0.0;
  /// It may as well be in another place, which nothing speaks against, as in a
  /// building that looks the same from its other end: which one it is the other
  /// way round cannot tell, either.
  bool has_twin = false;
  /// How far the agreeing windows lie from where `pose` puts them: the RMS, m.
  double misfit = 0.0;
  /// Returns of either that are known to the other, in all windows, and those
  /// of them that the other contradicts.
  int compared = 0;
  int contradicted = 0;
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
  /// It was not found, but `pose` is where it may lie: what speaks for it does
  /// not tell the building from others like it, or the place from another one.
  /// Whoever knows that it is its place gives that as the start.
  bool is_candidate = false;
  /// It was not found, and is no candidate, only for a piece of wall that one
  /// of both does not have: a wall was put up or taken down, or it is another
  /// building. With `pose` as the start it is found.
  bool needs_start = false;
  /// What is to be said of the place though it was found, for people: few parts
  /// speak for it, or doors were opened or shut; with a start also what would
  /// have made it a mere candidate. Empty when it is clear.
  std::string doubt;
};

/// Finds where a track of scans lies in a map without a guess: a window of key
/// scans after the other is searched for in the whole map over the full circle
/// (ScanMatcher::Peaks, as a track that was lost is: OdometryRefiner), and each
/// place that a window speaks for is judged by all windows of the track: what
/// the track saw has to be solid and free where the map is, all along the way
/// that they share, and clearly more so than at every other place.
/// What is not certain is not found: two buildings in one map do more harm than
/// one in two maps, which whoever knows it can mend (`start`).
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

/// What the windows of a track say of its place.
struct PlaceSupport {
  int agreeing = 0;
  int contradicting = 0;
};

/// Judges each window of a track (JudgeWindow) where `pose`, of the track's
/// frame in the map's, puts it.
PlaceSupport JudgePlace(const std::vector<KeyView>& map,
                        const std::vector<KeyView>& track, const Pose2& pose,
                        const TrackPlacementOptions& options);

/// Wall of one in openings of the other where `pose`, of the track's frame in
/// the map's, puts the track: of the windows that agree there.
WallContradictions ContradictionsOfPlace(const std::vector<KeyView>& map,
                                         const std::vector<KeyView>& track,
                                         const Pose2& pose,
                                         const TrackPlacementOptions& options);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_TRACK_PLACEMENT_H_
