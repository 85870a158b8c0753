#ifndef PLUMBLINE_DETECTORS_CURVE_JOINING_H_
#define PLUMBLINE_DETECTORS_CURVE_JOINING_H_

#include <plumbline/core/detector.h>
#include <plumbline/detectors/curve_points.h>
#include <plumbline/detectors/curve_search.h>
#include <plumbline/detectors/curve_selection.h>

#include <vector>

namespace plumbline {

/// Puts pieces of one curve that touch together where one curve fits them about
/// as well as each has its own (SearchCurves, 3): drift bends long walls, and a
/// piece with a small tolerance is more significant than the whole with a large
/// one. The order stays. Counts into `scope`.
std::vector<FoundCurve> JoinCurves(const CurvePoints& points,
                                   std::vector<SelectedCurve> curves,
                                   const DetectionScope& scope);

/// Takes out curves that are left over of a more significant one which they
/// touch, or of a known one, and lines that go on where another ends
/// (SearchCurves, 4). The most significant first. Counts into `scope`.
std::vector<FoundCurve> PruneCurves(const CurvePoints& points,
                                    std::vector<FoundCurve> curves,
                                    const std::vector<FoundCurve>& known,
                                    const DetectionScope& scope);

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_CURVE_JOINING_H_
