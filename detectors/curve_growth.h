#ifndef PLUMBLINE_DETECTORS_CURVE_GROWTH_H_
#define PLUMBLINE_DETECTORS_CURVE_GROWTH_H_

#include <plumbline/detectors/curve_search.h>
#include <plumbline/detectors/point_graph.h>
#include <plumbline/detectors/supported_curves.h>

#include <cstddef>
#include <vector>

namespace plumbline {

/// Extends curves over connected points near them.
class CurveGrowth {
 public:
  /// Both must outlive it.
  CurveGrowth(const PointGraph& points, const CurveSearchOptions& options);

  /// Adds to the support of a curve the points that are connected with it, past
  /// no more than max_gap_points and no farther than its gap limit, and near
  /// it: within the gate; a point that supports another curve already within
  /// half the gate where they run alongside. Where they cross a virtual point
  /// is on both, within sigma; another one on that alone which it has neighbors
  /// on to both sides, and at the ends of both on neither: it leaves the other,
  /// when that is of the same kind. False when nothing changed. Costs the
  /// points near the curve only.
  bool Extend(std::size_t curve, SupportedCurves* curves);

 private:
  const PointGraph& points_;
  const CurveSearchOptions& options_;
  // Scratch: points that were visited are those with the last stamp.
  std::vector<int> stamps_;
  int stamp_ = 0;
};

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_CURVE_GROWTH_H_
