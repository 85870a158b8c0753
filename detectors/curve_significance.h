#ifndef PLUMBLINE_DETECTORS_CURVE_SIGNIFICANCE_H_
#define PLUMBLINE_DETECTORS_CURVE_SIGNIFICANCE_H_

#include <plumbline/detectors/curve_points.h>
#include <plumbline/detectors/planar_curve.h>

#include <limits>
#include <vector>

namespace plumbline {

/// Tolerances that are tried, each smaller by the square root of two than the
/// one before. Hypotheses are drawn at every kCurveLevelsPerStart-th and
/// tightened in between: structure finer than the coarsest tolerance would be
/// lost in it.
constexpr int kCurveStarts = 3;
constexpr int kCurveLevelsPerStart = 3;

/// A curve with the free points around it.
struct CurveHypothesis {
  PlanarCurve curve;
  /// Largest distance of its inliers, m.
  double tolerance = 0.0;
  /// Connected points within the tolerance.
  std::vector<int> inliers;
  /// Connected points that are near the curve but not within the tolerance.
  std::vector<int> bystanders;
  /// Neighbours of inliers that are farther away.
  std::vector<int> strangers;
  /// As of the points that were free when it was made.
  double significance = -std::numeric_limits<double>::infinity();
};

/// Minus log10 of the expected number of curves like this one by chance
/// (SearchCurves, 2), by the points that nobody owns; minus infinity when these
/// are too few, cover too little, or a chain of lines explains them better than
/// the circle. `is_owned` may be null while curves are not told apart: then
/// strangers, which may well be on others, do not count.
double CurveSignificance(const CurvePoints& points,
                         const CurveHypothesis& hypothesis,
                         const std::vector<bool>* is_owned);

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_CURVE_SIGNIFICANCE_H_
