#ifndef PLUMBLINE_FRONTEND_WALL_CONTRADICTIONS_H_
#define PLUMBLINE_FRONTEND_WALL_CONTRADICTIONS_H_

#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/key_views.h>
#include <plumbline/frontend/track_placement_options.h>
#include <plumbline/frontend/track_windows.h>

#include <Eigen/Core>
#include <cstddef>
#include <vector>

namespace plumbline {

/// A straight run of returns of one scan that stand where others have looked
/// through.
struct WallStretch {
  /// The view that sees it.
  std::size_t view = 0;
  /// Of the run, map's frame, m, and a unit vector across.
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  Eigen::Vector2d normal = Eigen::Vector2d::Zero();
  /// m.
  double length = 0.0;
};

/// What stands where the other looks through, of what a track has and of what
/// the map has: pieces of wall that two scans of one of both see, the longest
/// first.
struct WallContradictions {
  std::vector<WallStretch> of_track;
  std::vector<WallStretch> of_map;

  /// Of pieces in all.
  std::size_t number() const { return of_track.size() + of_map.size(); }
  /// Of all pieces, and of the longest, m.
  double length() const;
  double longest() const;
};

/// Doors that stand elsewhere in the same wall: an opening and a wall in the
/// place of one, up to `reach` from each other, m, either way. People shut one
/// door and open another, but hardly twice in neighbouring ones.
int CountMovedDoors(const WallContradictions& contradictions,
                    double reach = 3.0);

/// What the windows of a track that agree with a map (`judgements`, one for
/// each) say of it, and the map of them. Cost: linear in the returns of the
/// windows that agree and of the views near them.
WallContradictions FindWallContradictions(
    const std::vector<KeyView>& map, const std::vector<KeyView>& track,
    const std::vector<TrackWindow>& windows,
    const std::vector<WindowJudgement>& judgements,
    const TrackPlacementOptions& options);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_WALL_CONTRADICTIONS_H_
