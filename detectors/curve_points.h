#ifndef PLUMBLINE_DETECTORS_CURVE_POINTS_H_
#define PLUMBLINE_DETECTORS_CURVE_POINTS_H_

#include <plumbline/detectors/curve_search.h>
#include <plumbline/detectors/planar_curve.h>
#include <plumbline/detectors/point_graph.h>

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace plumbline {

/// Median of the differences of numbers in ascending order; 0 for fewer than
/// two.
double MedianGap(const std::vector<double>& along);

/// The points of a search for curves, which of them are free, and what every
/// part of the search asks of them.
class CurvePoints {
 public:
  /// Points and options are not owned. A claimed point is not free.
  CurvePoints(const PointGraph& points, const std::vector<bool>& is_claimed,
              const CurveSearchOptions& options);
  /// As they were given; points by their index in the PointGraph.
  const CurveSearchOptions& options() const { return options_; }
  int size() const { return points_.size(); }
  const Eigen::Vector2d& position(int i) const { return points_.position(i); }
  FeatureId id(int i) const { return points_.id(i); }
  PointGraph::Neighbors neighbors(int i) const { return points_.neighbors(i); }
  bool IsFree(int i) const { return is_free_[static_cast<std::size_t>(i)]; }

  /// Fewest points that support a curve of this kind.
  std::size_t MinPoints(CurveKind kind) const;
  /// Fits a curve of the same kind to points by least squares; false, and the
  /// curve as it was, when there is none or it is too large.
  bool Fit(const std::vector<int>& indices, PlanarCurve* curve) const;
  /// Longest part of a line without points, m; `along`: of its points,
  /// ascending.
  double GapLimit(const std::vector<double>& along) const;
  /// Leaves the part of a line between its longest gaps that has most of the
  /// points, in their order along it.
  void CutAtGaps(const PlanarCurve& line, std::vector<int>* indices) const;
  /// Sum of the points' squared distances from a curve, m^2.
  double SquaredSum(const PlanarCurve& curve,
                    const std::vector<int>& indices) const;

 private:
  const PointGraph& points_;
  const CurveSearchOptions& options_;
  std::vector<bool> is_free_;
};

/// Finds what is connected with a point past a gap, again and again.
class GapReach {
 public:
  /// The points are not owned.
  explicit GapReach(const CurvePoints& points);

  /// The point and those that are reached from it by at most one more step
  /// than there may be points in a gap (CurveSearchOptions::max_gap_points).
  /// Valid until the next call.
  const std::vector<int>& From(int point);

 private:
  const CurvePoints& points_;
  // Visited are those with the last stamp.
  int stamp_ = 0;
  std::vector<int> stamps_;
  std::vector<int> reached_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_CURVE_POINTS_H_
