#ifndef PLUMBLINE_DETECTORS_CURVE_SELECTION_H_
#define PLUMBLINE_DETECTORS_CURVE_SELECTION_H_

#include <plumbline/core/detector.h>
#include <plumbline/detectors/curve_points.h>
#include <plumbline/detectors/curve_search.h>
#include <plumbline/detectors/curve_significance.h>

#include <vector>

namespace plumbline {

/// A curve that was selected.
struct SelectedCurve {
  FoundCurve found;
  /// Index of its hypothesis: among equals, the one made first comes first.
  int hypothesis = -1;
};

/// Selects between hypotheses on the same points (SearchCurves, 3). The most
/// significant takes its points, the others are judged by what is left; each
/// gives way to others on its points when they are more significant together;
/// and in the end each point goes to the curve near it that has most of its
/// neighbours. No point supports two of the result. Counts into `scope`.
std::vector<SelectedCurve> SelectCurves(const CurvePoints& points,
                                        std::vector<CurveHypothesis> hypotheses,
                                        const DetectionScope& scope);

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_CURVE_SELECTION_H_
