#ifndef PLUMBLINE_FACTORS_POINT_CIRCLE_DISTANCE_H_
#define PLUMBLINE_FACTORS_POINT_CIRCLE_DISTANCE_H_

#include <ceres/autodiff_cost_function.h>
#include <ceres/cost_function.h>
#include <plumbline/factors/blocks.h>
#include <plumbline/factors/planar_norm.h>

namespace plumbline {

/// Signed distance from a circle to a point, positive outside.
///
///   residual:   r = L (sqrt((x - cx)^2 + (y - cy)^2) - R - distance)
///   blocks:     point (x, y, ...) and circle (cx, cy, R)
///   frames:     point and centre in the map frame; the residual does not
///               change when the world is moved or turned
///   unit:       row 0: m (before whitening)
///   chi-square: 1 degree of freedom
///   degenerate: a point at the centre has no direction to the circle; the
///               derivative is that of x - cx there (PlanarNorm). The residual
///               does not keep R positive
///   source:     de la Puente and Rodriguez-Losada 2014, Eq. 18
class PointCircleDistance {
 public:
  static constexpr char kName[] = "point_circle_distance";
  static constexpr char kG2oTag[] = "PLUMBLINE_POINT_CIRCLE_DISTANCE";
  static constexpr char kDescription[] = "|p - c| - R - u; m (Eq. 18)";
  static constexpr RelationRole kRole = RelationRole::kOnCurve;
  static constexpr Quantity kRows[] = {
      Quantity::Length("distance", "distance tolerance")};
  using Blocks = BlockList<AnyOf<PointBlock, PoseBlock>, CircleBlock>;

  /// `distance` in m, `sqrt_information` in 1/m.
  PointCircleDistance(double distance, double sqrt_information)
      : distance_(distance), sqrt_information_(sqrt_information) {}

  /// `point`: at least (x, y), m; `circle`: (x, y, R), m. `residual`: 1 row.
  template <typename T>
  bool operator()(const T* const point, const T* const circle,
                  T* residual) const {
    const T dx = point[0] - circle[0];
    const T dy = point[1] - circle[1];
    residual[0] =
        sqrt_information_ * (PlanarNorm(dx, dy) - circle[2] - distance_);
    return true;
  }

  /// Cost function for a first block of the size N1: 2 for a point, 3 for a
  /// pose. The caller (or the ceres::Problem) owns it.
  template <int N1 = 2>
  static ceres::CostFunction* Create(double distance, double sqrt_information) {
    static_assert(N1 >= 2, "the first block must begin with x, y");
    return new ceres::AutoDiffCostFunction<PointCircleDistance, 1, N1, 3>(
        new PointCircleDistance(distance, sqrt_information));
  }

 private:
  double distance_;
  double sqrt_information_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_POINT_CIRCLE_DISTANCE_H_
