#ifndef PLUMBLINE_FRONTEND_WALL_KINKS_H_
#define PLUMBLINE_FRONTEND_WALL_KINKS_H_

#include <plumbline/factors/angle.h>

#include <cstddef>
#include <vector>

namespace plumbline {

/// Options for where one line of returns is two walls.
struct WallKinkOptions {
  /// Least turn at a kink, rad, and in standard deviations of that turn.
  double min_turn = DegToRad(0.5);
  double min_sigmas = 4.0;
  /// Least length of a wall with a direction of its own, m.
  double min_length = 0.5;
  /// Least length (m) and largest share of the whole of an end that turns away
  /// and is too short for that.
  double min_end = 0.3;
  double max_end_share = 0.34;
  /// Least offset of two walls that follow each other side by side, a door set
  /// back in its wall for one, m; 0 looks for none. `min_sigmas` hold for it,
  /// too. Neither is shorter than `min_end`.
  double min_step = 0.0;
};

/// A point along and across a line, m, with a number of the caller's.
struct WallSample {
  double along = 0.0;
  double across = 0.0;
  int index = -1;
};

/// Finds where one line of points is better explained by two walls that meet at
/// a small angle, or by two parallel ones a step apart: the index of the first
/// sample of the second wall, 0 where a straight line will do. Of walls that
/// meet either both have a direction of their own, or an end turns away that is
/// too short for one. `samples` are ascending along the line. Cost: linear in
/// the samples.
std::size_t FindWallKink(const std::vector<WallSample>& samples,
                         const WallKinkOptions& options);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_WALL_KINKS_H_
