#ifndef PLUMBLINE_DETECTORS_CURVE_SEARCH_REGION_H_
#define PLUMBLINE_DETECTORS_CURVE_SEARCH_REGION_H_

#include <plumbline/detectors/curve_search.h>
#include <plumbline/detectors/point_graph.h>
#include <plumbline/detectors/supported_curves.h>

#include <vector>

namespace plumbline {

/// The points among which a search for curves may find something that the last
/// one did not: a large graph needs many rounds, each for a few places.
class CurveSearchRegion {
 public:
  /// Both must outlive it. All points are in the first region.
  CurveSearchRegion(const PointGraph& points,
                    const CurveSearchOptions& options);

  /// A search may find something else near the support of a curve that came,
  /// grew or went.
  void Touch(const SupportedCurve& curve);

  /// Ends a region, which is searched then, and begins the next. Returns for
  /// each point whether it is out: it supports a curve, is left over of one or
  /// its outlier, or nothing near it was touched since the last region.
  std::vector<bool> Take(const SupportedCurves& curves);

 private:
  template <typename Visit>
  void Spread(int reach, std::vector<int>* queue, const Visit& visit);
  void UpdateClaimed(const SupportedCurves& curves);
  void UpdateUnsearched();

  const PointGraph& points_;
  const CurveSearchOptions& options_;
  // Scratch: points that were visited are those with the last stamp, and in how
  // many steps.
  std::vector<int> stamps_;
  std::vector<int> steps_;
  int stamp_ = 0;
  // Points that support a curve or are left over of one, as of the last search.
  std::vector<bool> is_claimed_;
  // Points that no search has looked at since something changed near them.
  std::vector<bool> is_unsearched_;
  // Support of curves that changed since the last search.
  std::vector<int> touched_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_CURVE_SEARCH_REGION_H_
