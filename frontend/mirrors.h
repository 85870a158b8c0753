#ifndef PLUMBLINE_FRONTEND_MIRRORS_H_
#define PLUMBLINE_FRONTEND_MIRRORS_H_

#include <plumbline/core/wall.h>
#include <plumbline/factors/angle.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/sampled_returns.h>
#include <plumbline/frontend/scan.h>

#include <algorithm>
#include <functional>
#include <vector>

namespace plumbline {

/// Options: what is taken for a mirror. Defaults hold for all logs.
struct MirrorOptions {
  SampledReturnsOptions returns;
  /// A return seen in a mirror lies this near, m, to what stands before it.
  double tolerance = 0.08;
  /// It lies at least so far behind the mirror, m.
  double min_depth = 0.15;
  /// Two walls that face each other, m apart, and turned by no more, rad, may
  /// be one and its image.
  double min_distance = 0.6;
  double max_distance = 30.0;
  double max_turn = DegToRad(3.0);
  /// Least width of a mirror, m, fewest returns seen in it, and from how many
  /// places.
  double min_width = 0.3;
  int min_returns = 150;
  int min_views = 5;
  /// Least share of the returns behind it that are images of what stands before
  /// it, and by how much smaller that share is for a mirror elsewhere: one with
  /// its image moved along it, or one that stands farther ahead or back.
  double min_share = 0.94;
  double min_drop_along = 0.05;
  double min_drop_across = 0.15;
  /// Largest share of them that was also seen otherwise than through it: rooms
  /// that are there.
  double max_confirmed = 0.4;
  /// The wall beside it stands no farther ahead of it, nor behind it, m. Of
  /// equal rooms on both sides of a wall each is the image of the other about
  /// the middle of the wall, half a wall behind its face.
  double max_recess = 0.03;
  double max_relief = 0.15;

  /// Adapts the distances to a laser noisier by this factor (RangeNoiseScale):
  /// as they are they have room for one 1.8 times as noisy as usual.
  void ScaleToNoise(double scale) {
    const double wider = std::max(1.0, scale / 1.8);
    tolerance *= wider;
    returns.cell_size *= wider;
    returns.wall_offset *= wider;
  }
};

/// A flat thing in which lasers see the room before it: a mirror, polished
/// metal, a window at night.
struct Mirror {
  /// Where it is, map frame, seen from its left.
  Wall wall;
  /// Of those that were looked at: returns seen in it, and the share of them
  /// that are images of what stands before it.
  int returns = 0;
  double share = 0.0;
};

/// Finds mirrors. What is seen in one looks like a room behind an opening: its
/// walls are images of walls before it. So each wall, and one that faces it and
/// would be its image, give a line where a mirror may be. It is one when
/// - nearly all that was seen through a part of that line, from its front, is
///   the image of what stands there, and would not be, were the line elsewhere
///   or the image moved along it;
/// - nothing was seen behind it but through it, nobody looked out of it, and
///   the robot did not pass it;
/// - beside it there is wall on both sides, in the same plane: in the opening
///   of a wall that is as thick as walls are, the plane lies behind the faces.
/// `walls`: all that are known (map frame); `poses`: one per scan. In the order
/// of the mirrors' returns, most first. Cost: linear in the scans, of which
/// SampledReturns takes few. Empty once `stop` (may be null) has returned true.
std::vector<Mirror> FindMirrors(const std::vector<Wall>& walls,
                                const std::vector<Scan>& scans,
                                const std::vector<Pose2>& poses,
                                const MirrorOptions& options,
                                const std::function<bool()>& stop = nullptr);

/// The scans as they would be were the mirrors plain walls: a beam that was
/// reflected ends at the mirror. `poses`: one per scan, map frame; scans
/// without one may follow, and stay as they are. Cost: linear in the returns.
std::vector<Scan> CutAtMirrors(const std::vector<Scan>& scans,
                               const std::vector<Pose2>& poses,
                               const std::vector<Mirror>& mirrors,
                               const MirrorOptions& options);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_MIRRORS_H_
