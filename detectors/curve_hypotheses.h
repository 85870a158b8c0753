#ifndef PLUMBLINE_DETECTORS_CURVE_HYPOTHESES_H_
#define PLUMBLINE_DETECTORS_CURVE_HYPOTHESES_H_

#include <plumbline/core/detector.h>
#include <plumbline/detectors/curve_points.h>
#include <plumbline/detectors/curve_significance.h>

#include <cstdint>
#include <vector>

namespace plumbline {

/// Draws lines and circles among the free points, extends them over connected
/// points and keeps those that are significant on their own (SearchCurves, 1).
/// What is drawn at a point depends on the seed and its id alone. Points that
/// several hypotheses explain are not grown from any more. Counts what it does
/// into `scope` and returns at once with what it has when that says stop.
std::vector<CurveHypothesis> DrawCurveHypotheses(const CurvePoints& points,
                                                 std::uint64_t seed,
                                                 const DetectionScope& scope);

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_CURVE_HYPOTHESES_H_
