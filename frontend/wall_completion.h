#ifndef PLUMBLINE_FRONTEND_WALL_COMPLETION_H_
#define PLUMBLINE_FRONTEND_WALL_COMPLETION_H_

#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/transaction.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/scan.h>
#include <plumbline/frontend/scan_points.h>

#include <functional>
#include <vector>

namespace plumbline {

/// Options: what counts as a wall among returns that no wall explains.
struct WallCompletionOptions {
  ScanPointsOptions points;
  /// Returns this near to a wall of the map (across, and beyond its ends, m)
  /// are explained by it.
  double explained_offset = 0.12;
  double explained_gap = 0.3;
  /// Way of the robot over which returns are looked at together before all are,
  /// m.
  double stretch = 20.0;
  /// Of a stretch only returns up to this range count, m: farther away what a
  /// pose is turned by smears walls more than they turn at small angles. What
  /// nobody saw from nearer is looked for in all returns in the end.
  double near_range = 15.0;
  /// Returns are gathered in cells of this size, m.
  double cell_size = 0.05;
  /// Neighbourhood in which a cell's direction is fitted, m.
  double normal_radius = 0.3;
  /// Scatter of a wall's returns (standard deviation, m), and turn of a cell's
  /// direction off the wall's, rad.
  double max_scatter = 0.015;
  double max_turn = DegToRad(15.0);
  /// Where a wall turns by at least this (rad) at one place, and by this many
  /// standard deviations of that turn, it is two walls: corridors that meet at
  /// a small angle.
  double min_kink = DegToRad(0.5);
  double kink_sigmas = 4.0;
  /// Where it steps aside by at least this (m), and by `kink_sigmas`, it is two
  /// walls as well: a door set back in its wall.
  double min_step = 0.03;
  /// Least length (m) and largest share of an end that turns away and is not
  /// the wall's: the beginning of another corridor's wall, however short it is
  /// up to its next niche.
  double min_end = 0.3;
  double max_end_share = 0.34;
  /// Its ends swing by no more across it, as its direction is that uncertain
  /// (standard deviation over the whole length, m).
  double max_end_sigma = 0.0065;
  /// Least length of a wall (m), fewest returns, longest gap between them (m),
  /// and least share of its length that has returns (in pieces
  /// of 0.1 m).
  double min_length = 0.5;
  int min_returns = 20;
  double max_gap = 0.4;
  double min_coverage = 0.75;
  /// Where walls explain less than this share of all returns, many returns may
  /// be strays, which cheap lasers have around all that stands there: walls are
  /// looked for once more without the cells that have less than `stray_share`
  /// of the returns of one in their neighbourhood.
  double least_explained = 0.4;
  double stray_share = 0.1;
  /// Number of walls of the map, the nearest, that a wall is bound to, and
  /// standard deviations of that: m across and along, rad.
  int links = 3;
  double link_offset_sigma = 0.03;
  double link_angle_sigma = DegToRad(0.7);
  /// Threads that look at scans and grow walls; what is found does not depend
  /// on their number.
  int num_threads = 1;

  /// Adapts the distances to a laser noisier by this factor (RangeNoiseScale).
  void ScaleToNoise(double scale);
};

/// Finds walls that no single scan saw well enough: glimpsed through doors, a
/// few beams at a time. Gathers the returns of all scans, at their final
/// poses, that no wall of the map explains, and grows straight pieces in them.
/// Returns the transaction that adds them as segments of level 0, bound to
/// their neighbours by measurements; the graph is not changed. One pose per
/// scan (map frame). Cost: linear in the returns. Empty once `stop` (asked now
/// and then; may be null) has returned true.
Transaction FindGlimpsedWalls(const Graph& graph, const Registry& registry,
                              const std::vector<Scan>& scans,
                              const std::vector<Pose2>& poses,
                              const WallCompletionOptions& options,
                              const std::function<bool()>& stop = nullptr);

/// Share of all returns within usable range that lie on a wall of the map, as
/// near as FindGlimpsedWalls takes them for explained; 1 without returns. One
/// pose per scan (map frame). Cost: linear in the returns.
double ExplainedShare(const Graph& graph, const std::vector<Scan>& scans,
                      const std::vector<Pose2>& poses,
                      const WallCompletionOptions& options);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_WALL_COMPLETION_H_
