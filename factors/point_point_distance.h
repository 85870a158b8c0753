#ifndef PLUMBLINE_FACTORS_POINT_POINT_DISTANCE_H_
#define PLUMBLINE_FACTORS_POINT_POINT_DISTANCE_H_

#include <ceres/autodiff_cost_function.h>
#include <ceres/cost_function.h>
#include <plumbline/factors/blocks.h>
#include <plumbline/factors/planar_norm.h>

namespace plumbline {

/// Distance between two positions: points, poses, circle centres, in any pair.
///
///   residual:   r = L (sqrt((x2 - x1)^2 + (y2 - y1)^2) - distance)
///   blocks:     (x1, y1, ...), (x2, y2, ...); further entries of a block (a
///               heading, a radius) do not enter
///   frames:     both positions in the map frame; the residual does not change
///               when the world is moved or turned
///   unit:       row 0: m (before whitening)
///   chi-square: 1 degree of freedom
///   degenerate: at zero distance the direction is undefined; the derivative is
///               that of x2 - x1 there (PlanarNorm). For an expected distance
///               of zero use PointPointCoincidence: this one is not smooth at
///               its own solution
///   source:     de la Puente and Rodriguez-Losada 2014, Eq. 14, 15
class PointPointDistance {
 public:
  static constexpr char kName[] = "point_point_distance";
  static constexpr char kG2oTag[] = "PLUMBLINE_POINT_POINT_DISTANCE";
  static constexpr char kDescription[] = "|p2 - p1| - u; m (Eq. 14)";
  static constexpr RelationRole kRole = RelationRole::kOther;
  static constexpr Quantity kRows[] = {
      Quantity::Length("distance", "distance tolerance")};
  using Blocks = BlockList<PositionBlocks, PositionBlocks>;

  /// `distance` in m, `sqrt_information` in 1/m.
  PointPointDistance(double distance, double sqrt_information)
      : distance_(distance), sqrt_information_(sqrt_information) {}

  /// `p1`, `p2`: at least (x, y), m. `residual`: 1 row.
  template <typename T>
  bool operator()(const T* const p1, const T* const p2, T* residual) const {
    const T dx = p2[0] - p1[0];
    const T dy = p2[1] - p1[1];
    residual[0] = sqrt_information_ * (PlanarNorm(dx, dy) - distance_);
    return true;
  }

  /// Cost function for blocks of the sizes N1 and N2: 2 for a point, 3 for a
  /// pose or circle. The caller (or the ceres::Problem) owns it.
  template <int N1 = 2, int N2 = 2>
  static ceres::CostFunction* Create(double distance, double sqrt_information) {
    static_assert(N1 >= 2 && N2 >= 2, "blocks must begin with x, y");
    return new ceres::AutoDiffCostFunction<PointPointDistance, 1, N1, N2>(
        new PointPointDistance(distance, sqrt_information));
  }

 private:
  double distance_;
  double sqrt_information_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_POINT_POINT_DISTANCE_H_
