#ifndef PLUMBLINE_DETECTORS_DIRECTION_SCATTER_H_
#define PLUMBLINE_DETECTORS_DIRECTION_SCATTER_H_

#include <plumbline/detectors/direction_assignment.h>
#include <plumbline/detectors/direction_network.h>
#include <plumbline/factors/angle.h>

#include <cstddef>
#include <vector>

namespace plumbline {

/// Which pairs of walls say how parallel walls of a building are. Angles in
/// rad.
struct DirectionScatterOptions {
  /// Shorter walls are left out, m: their own errors are known to be large.
  double min_length = 2.5;
  /// At most this many of the longest walls make the pairs: bounds the cost.
  std::size_t max_walls = 120;
  /// Largest standard deviation with which the measurements know the difference
  /// of a pair, and its largest value modulo a right angle: beyond it is
  /// intended.
  double max_uncertainty = DegToRad(0.3);
  double max_difference = DegToRad(3.0);
  /// The share of the pairs, the most parallel ones, that speaks. The others
  /// may belong to two directions: with two corridors that meet at a small
  /// angle half of all pairs do.
  double share = 0.25;
  /// With fewer pairs the result is `prior`.
  std::size_t min_pairs = 6;
  double prior = DegToRad(0.2);
  /// Bounds of the result.
  double min_sigma = DegToRad(0.02);
  double max_sigma = DegToRad(0.6);
};

/// Standard deviation (rad) of the directions of long walls around those that
/// they share, from the walls themselves: what DirectionWall::own_sigma has to
/// contain whatever the length, as no building is exact, nor what a laser sees
/// of it. It is the scatter under which the differences of near walls, each
/// over its predicted deviation, have the quantile `share` of a normal
/// distribution: a quantile far below the median, since near walls may be of
/// two directions. `walls`: with the own_sigma that falls with the length.
///
/// `network` holds the measurements and is solved. Cost: a solve for each of
/// max_walls.
double EstimateDirectionScatter(const DirectionNetwork& network,
                                const std::vector<DirectionWall>& walls,
                                const DirectionScatterOptions& options);

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_DIRECTION_SCATTER_H_
