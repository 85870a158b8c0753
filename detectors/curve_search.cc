#include <plumbline/detectors/curve_hypotheses.h>
#include <plumbline/detectors/curve_joining.h>
#include <plumbline/detectors/curve_points.h>
#include <plumbline/detectors/curve_search.h>
#include <plumbline/detectors/curve_selection.h>

#include <algorithm>

namespace plumbline {

std::vector<FoundCurve> SearchCurves(const PointGraph& graph,
                                     const std::vector<bool>& is_claimed,
                                     const std::vector<FoundCurve>& known,
                                     std::uint64_t seed,
                                     const CurveSearchOptions& options,
                                     const DetectionScope& scope) {
  const CurvePoints points(graph, is_claimed, options);
  std::vector<FoundCurve> curves = JoinCurves(
      points,
      SelectCurves(points, DrawCurveHypotheses(points, seed, scope), scope),
      scope);
  curves = PruneCurves(points, std::move(curves), known, scope);
  for (FoundCurve& found : curves) {
    points.Fit(found.support, &found.curve);
    std::sort(found.support.begin(), found.support.end());
  }
  return curves;
}

}  // namespace plumbline
