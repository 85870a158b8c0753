#ifndef PLUMBLINE_FRONTEND_TRACK_WINDOWS_H_
#define PLUMBLINE_FRONTEND_TRACK_WINDOWS_H_

#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/key_views.h>
#include <plumbline/frontend/scan_points.h>
#include <plumbline/frontend/track_placement_options.h>

#include <Eigen/Core>
#include <cstddef>
#include <vector>

namespace plumbline {

/// Consecutive views of a track, which are looked for together.
struct TrackWindow {
  /// The first one, and the one behind the last.
  std::size_t begin = 0;
  std::size_t end = 0;
  /// Of the view in the middle, in the track's frame.
  Pose2 middle = Pose2::Zero();
  /// Of each view in the frame of the middle.
  std::vector<Pose2> relative;
  /// Points in the frame of the middle: few, and those with a normal.
  std::vector<Eigen::Vector2d> sparse;
  std::vector<ScanPoint> dense;
};

/// Cuts a track into windows of `size` views (at least 1); what is left over
/// makes the last ones longer.
std::vector<TrackWindow> MakeTrackWindows(const std::vector<KeyView>& track,
                                          std::size_t size);

/// What the map says of a window at a place: nothing, as too little of it is
/// known there; neither yes nor no; yes; no.
enum class WindowVerdict { kUnknown, kDoubtful, kAgrees, kContradicts };

/// What one window says of a place of the track.
struct WindowJudgement {
  WindowVerdict verdict = WindowVerdict::kUnknown;
  /// Of the window's middle, in the map's frame, matched where it agrees.
  Pose2 pose = Pose2::Zero();
  /// How clearly it agrees, 0 to 1.
  double quality = 0.0;
  /// Returns of the window, and of the map where the window sees, that are
  /// known to the other; those of either that the other contradicts, standing
  /// where it is free or looked through.
  int compared = 0;
  int contradicted = 0;
  /// What the returns say of the middle's position, map's frame.
  Eigen::Matrix2d information = Eigen::Matrix2d::Zero();
};

/// Judges a window of the track where `guess` puts its middle in the map: it is
/// matched with what was seen from near there, and then what it saw has to be
/// solid and free where the map is (TrackPlacementOptions).
WindowJudgement JudgeWindow(const std::vector<KeyView>& map,
                            const std::vector<KeyView>& track,
                            const TrackWindow& window, const Pose2& guess,
                            const TrackPlacementOptions& options);

/// What a window says of its position (1/m^2, map's frame) when it is known to
/// `sigma`, m, where its returns say most: along a bare corridor next to
/// nothing. At least 1 % of that, so that it can be solved for.
Eigen::Matrix2d PositionWeight(const WindowJudgement& judgement, double sigma);

/// Pose of the track's frame in the map's that suits the windows which agree
/// best: least squares of directions, and of positions with what the returns
/// say of them across walls and along them. At least one must agree.
Pose2 FitTrack(const std::vector<TrackWindow>& windows,
               const std::vector<WindowJudgement>& judgements);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_TRACK_WINDOWS_H_
