#ifndef PLUMBLINE_FACTORS_ORIENTATION_ORIENTATION_H_
#define PLUMBLINE_FACTORS_ORIENTATION_ORIENTATION_H_

#include <ceres/autodiff_cost_function.h>
#include <ceres/cost_function.h>
#include <plumbline/factors/angle.h>
#include <plumbline/factors/blocks.h>

namespace plumbline {

/// Angle from one orientation to another, modulo pi.
///
///   residual:   r = L (o2 - o1 - expected), the error in (-pi/2, pi/2]
///   blocks:     orientations (o1), (o2)
///   frames:     angles in the map frame; the residual does not change when the
///               world is moved or turned
///   unit:       row 0: rad (before whitening)
///   chi-square: 1 degree of freedom
///   degenerate: the value jumps where the error is pi/2. Orientations have no
///               sense of direction: 0 and pi are the same
///   source:     de la Puente and Rodriguez-Losada 2014, Eq. 23; modulo pi is
///               ours
class OrientationOrientation {
 public:
  static constexpr char kName[] = "orientation_orientation";
  static constexpr char kG2oTag[] = "PLUMBLINE_ORIENTATION_ORIENTATION";
  static constexpr char kDescription[] = "o2 - o1 - u modulo pi; rad (Eq. 23)";
  static constexpr RelationRole kRole = RelationRole::kAngle;
  static constexpr Quantity kRows[] = {
      Quantity::Angle("angle", "angle tolerance")};
  using Blocks = BlockList<OrientationBlock, OrientationBlock>;

  /// `expected` in rad, `sqrt_information` in 1/rad.
  OrientationOrientation(double expected, double sqrt_information)
      : expected_(expected), sqrt_information_(sqrt_information) {}

  /// `o1`, `o2`: rad. `residual`: 1 row.
  template <typename T>
  bool operator()(const T* const o1, const T* const o2, T* residual) const {
    residual[0] =
        sqrt_information_ * NormalizeAxial(T(o2[0] - o1[0] - expected_));
    return true;
  }

  /// The caller (or the ceres::Problem) owns the cost function.
  static ceres::CostFunction* Create(double expected, double sqrt_information) {
    return new ceres::AutoDiffCostFunction<OrientationOrientation, 1, 1, 1>(
        new OrientationOrientation(expected, sqrt_information));
  }

 private:
  double expected_;
  double sqrt_information_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_ORIENTATION_ORIENTATION_H_
