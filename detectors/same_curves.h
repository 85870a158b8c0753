#ifndef PLUMBLINE_DETECTORS_SAME_CURVES_H_
#define PLUMBLINE_DETECTORS_SAME_CURVES_H_

#include <plumbline/detectors/curve_search.h>
#include <plumbline/detectors/planar_curve.h>
#include <plumbline/detectors/point_graph.h>
#include <plumbline/detectors/supported_curves.h>

#include <vector>

namespace plumbline {

/// Takes out curves of a kind that have become the same as another one with
/// more support and may go, and returns them: pieces that the solver has
/// brought together. The points of such a curve would all join the other, and
/// lines do not end before the other begins. Compares
/// what is marked as changed (SupportedCurve::is_dirty) with what touches it,
/// and marks what touches those that went: their points are free to join.
std::vector<SupportedCurve> TakeOutSameCurves(const PointGraph& points,
                                              CurveKind kind,
                                              const CurveSearchOptions& options,
                                              SupportedCurves* curves);

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_SAME_CURVES_H_
