#ifndef PLUMBLINE_DETECTORS_CURVE_DETECTION_H_
#define PLUMBLINE_DETECTORS_CURVE_DETECTION_H_

#include <plumbline/core/detector.h>
#include <plumbline/core/registry.h>
#include <plumbline/detectors/curve_search.h>
#include <plumbline/detectors/parameters.h>

#include <string>

namespace plumbline {

/// Common part of line_ransac and circle_ransac. Both look for lines and
/// circles, so that neither takes one for the other, and propose their own.
///
/// Points that support a curve of the graph (tied by a live structure
/// constraint), its leftovers and its outliers (tied by a broken one) start no
/// further curve, but may join one. A point that is connected with the support
/// of a curve of the detector's kind joins it when it is within the gate; when
/// it supports another curve already, within half the gate where they run
/// alongside (less than min_corner apart); where they cross a virtual point is
/// on both, within sigma (the corner of two rows of columns), and another one
/// on that alone which it has neighbors on to both sides, at the ends of both
/// on neither. A curve of the detector's kind whose points all lie on
/// another one goes (pieces that the solver has brought together). Only virtual
/// curves without measurements do. This is repeated until nothing is found, so
/// applying the result and detecting again gives an empty transaction.
Transaction DetectCurves(const Graph& graph, const Registry& registry,
                         const DetectionScope& scope, CurveKind kind,
                         const std::string& source,
                         const CurveSearchOptions& options);

/// The parameters that both detectors have.
void BindCurveSearch(ParameterBinder* parameters, CurveSearchOptions* options);

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_CURVE_DETECTION_H_
