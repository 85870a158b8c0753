#ifndef PLUMBLINE_FACTORS_POINT_POINT_COINCIDENCE_H_
#define PLUMBLINE_FACTORS_POINT_POINT_COINCIDENCE_H_

#include <ceres/autodiff_cost_function.h>
#include <ceres/cost_function.h>
#include <plumbline/factors/blocks.h>

#include <Eigen/Core>

namespace plumbline {

/// Displacement between two positions (points, poses, circle centres), as a
/// rule zero: they coincide.
///
///   residual:   r = L ((x2 - x1, y2 - y1) - expected)
///   blocks:     (x1, y1, ...), (x2, y2, ...); further entries of a block do
///               not enter
///   frames:     positions and the expected displacement in the map frame; for
///               an expected displacement other than zero the residual changes
///               when the world is turned
///   unit:       rows 0, 1: m, m (before whitening)
///   chi-square: 2 degrees of freedom (the rank of L)
///   degenerate: nowhere
///   source:     de la Puente and Rodriguez-Losada 2014, Sect. 4.1: in place of
///               Eq. 14 where the expected distance is zero
class PointPointCoincidence {
 public:
  static constexpr char kName[] = "point_point_coincidence";
  static constexpr char kG2oTag[] = "PLUMBLINE_POINT_POINT_COINCIDENCE";
  static constexpr char kDescription[] =
      "p2 - p1 - u; m, m (method.md, section 4)";
  static constexpr RelationRole kRole = RelationRole::kCoincidence;
  static constexpr Quantity kRows[] = {
      Quantity::Length("x", "position tolerance"),
      Quantity::Length("y", "position tolerance")};
  using Blocks = BlockList<PositionBlocks, PositionBlocks>;

  /// `expected` in m; `sqrt_information`: L with L' L = information, in 1/m.
  PointPointCoincidence(const Eigen::Vector2d& expected,
                        const Eigen::Matrix2d& sqrt_information)
      : expected_(expected), sqrt_information_(sqrt_information) {}

  /// `p1`, `p2`: at least (x, y), m. `residual`: 2 rows.
  template <typename T>
  bool operator()(const T* const p1, const T* const p2, T* residual) const {
    const T ex = p2[0] - p1[0] - expected_[0];
    const T ey = p2[1] - p1[1] - expected_[1];
    residual[0] = sqrt_information_(0, 0) * ex + sqrt_information_(0, 1) * ey;
    residual[1] = sqrt_information_(1, 0) * ex + sqrt_information_(1, 1) * ey;
    return true;
  }

  /// Cost function for blocks of the sizes N1 and N2: 2 for a point, 3 for a
  /// pose or circle. The caller (or the ceres::Problem) owns it.
  template <int N1 = 2, int N2 = 2>
  static ceres::CostFunction* Create(const Eigen::Vector2d& expected,
                                     const Eigen::Matrix2d& sqrt_information) {
    static_assert(N1 >= 2 && N2 >= 2, "blocks must begin with x, y");
    return new ceres::AutoDiffCostFunction<PointPointCoincidence, 2, N1, N2>(
        new PointPointCoincidence(expected, sqrt_information));
  }

 private:
  Eigen::Vector2d expected_;
  Eigen::Matrix2d sqrt_information_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_POINT_POINT_COINCIDENCE_H_
