#ifndef PLUMBLINE_FACTORS_POINT_LINE_DISTANCE_H_
#define PLUMBLINE_FACTORS_POINT_LINE_DISTANCE_H_

#include <ceres/autodiff_cost_function.h>
#include <ceres/cost_function.h>
#include <plumbline/factors/blocks.h>

#include <Eigen/Core>
#include <cmath>

namespace plumbline {

/// Signed orthogonal distance from a line to a point, positive to the left of
/// the line's direction.
///
///   residual:   r = L (-d - (x - ax) sin(alpha) + (y - ay) cos(alpha)
///                      - distance)
///   blocks:     point (x, y, ...) and line (d, alpha)
///   frames:     point and anchor (ax, ay) in the map frame. The line is given
///               relative to its anchor, a constant near its support, so that
///               turning the line by a small angle moves it little where the
///               points are, and the residual is accurate far from the origin.
///               It does not change when the world (anchor included) is moved
///               or turned
///   unit:       row 0: m (before whitening)
///   chi-square: 1 degree of freedom
///   degenerate: nowhere; (d, alpha) and (-d, alpha + pi) are the same line but
///               give distances of opposite sign, which matters only when the
///               expected distance is not zero
///   source:     de la Puente and Rodriguez-Losada 2014, Eq. 12, 13, 16; the
///               anchor is ours
class PointLineDistance {
 public:
  static constexpr char kName[] = "point_line_distance";
  static constexpr char kG2oTag[] = "PLUMBLINE_POINT_LINE_DISTANCE";
  static constexpr char kDescription[] =
      "-d - x sin(alpha) + y cos(alpha) - u, x and y from the line's anchor; m "
      "(Eq. 16)";
  static constexpr RelationRole kRole = RelationRole::kOnCurve;
  static constexpr Quantity kRows[] = {
      Quantity::Length("distance", "distance tolerance")};
  using Blocks = BlockList<PositionBlocks, LineBlock>;

  /// `distance` in m, `anchor` in m, `sqrt_information` in 1/m.
  PointLineDistance(double distance, const Eigen::Vector2d& anchor,
                    double sqrt_information)
      : distance_(distance),
        anchor_(anchor),
        sqrt_information_(sqrt_information) {}

  /// `point`: at least (x, y), m; `line`: (d, alpha), m and rad. `residual`: 1
  /// row.
  template <typename T>
  bool operator()(const T* const point, const T* const line,
                  T* residual) const {
    using std::cos;
    using std::sin;
    const T dx = point[0] - anchor_[0];
    const T dy = point[1] - anchor_[1];
    residual[0] = sqrt_information_ *
                  (dy * cos(line[1]) - dx * sin(line[1]) - line[0] - distance_);
    return true;
  }

  /// Cost function for a first block of the size N1: 2 for a point, 3 for a
  /// pose or circle centre. The caller (or the ceres::Problem) owns it.
  template <int N1 = 2>
  static ceres::CostFunction* Create(double distance,
                                     const Eigen::Vector2d& anchor,
                                     double sqrt_information) {
    static_assert(N1 >= 2, "the first block must begin with x, y");
    return new ceres::AutoDiffCostFunction<PointLineDistance, 1, N1, 2>(
        new PointLineDistance(distance, anchor, sqrt_information));
  }

 private:
  double distance_;
  Eigen::Vector2d anchor_;
  double sqrt_information_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_POINT_LINE_DISTANCE_H_
