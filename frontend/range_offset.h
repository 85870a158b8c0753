#ifndef PLUMBLINE_FRONTEND_RANGE_OFFSET_H_
#define PLUMBLINE_FRONTEND_RANGE_OFFSET_H_

#include <plumbline/frontend/scan.h>

#include <vector>

namespace plumbline {

/// By how much the ranges of a laser are all too long, as pairs of scans show.
struct RangeOffset {
  /// m; negative: too short. 0 where it is not significant.
  double offset = 0.0;
  /// What the pairs say at first, significant or not, and its standard
  /// deviation from how parts of the log differ, m. Steps by which ranges are
  /// rounded make it smaller than the offset is.
  double first = 0.0;
  double sigma = 0.0;
  /// Pairs of scans that were compared.
  int pairs = 0;

  /// Smaller offsets are left alone, m: neither are walls that flat, nor does
  /// matching tell them from errors that depend on the distance.
  static constexpr double kLeast = 0.015;
  /// An offset is significant from this many standard deviations on.
  static constexpr double kSigmas = 4.0;
};

/// Finds the offset of one laser's ranges (core/method.md, section 7). A range
/// that is too long by b puts a return b cos(incidence) behind its wall: all of
/// b abreast of the robot, next to nothing far ahead. So a wall that was ahead
/// in one scan and is abreast in one taken a metre later does not lie on
/// itself, and no motion between the scans mends that on both sides of a
/// corridor. b is what takes out the most of it, in least squares with the
/// motions free; recesses and clutter look the same in both scans and say
/// nothing.
///
/// Odometry says which scans to compare: those that a straight way of a metre
/// lies between, some hundreds of them. Logs with few of them, and logs
/// without odometry, have an offset of 0. Cost: some hundred matchings of two
/// scans, whatever the length of the log.
RangeOffset FindRangeOffset(const std::vector<Scan>& scans);

/// Takes `offset`, m, out of the ranges. What is no return stays so; a return
/// that would end behind the laser becomes none.
void TakeOutRangeOffset(double offset, Scan* scan);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_RANGE_OFFSET_H_
