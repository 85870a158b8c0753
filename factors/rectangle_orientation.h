#ifndef PLUMBLINE_FACTORS_RECTANGLE_ORIENTATION_H_
#define PLUMBLINE_FACTORS_RECTANGLE_ORIENTATION_H_

#include <ceres/autodiff_cost_function.h>
#include <ceres/cost_function.h>
#include <plumbline/factors/angle.h>
#include <plumbline/factors/blocks.h>

namespace plumbline {

/// Angle from a rectangle's direction to an orientation, modulo pi.
///
///   residual:   r = L (o - theta - expected), the error in (-pi/2, pi/2].
///               expected = 0 ties the sides along theta, pi/2 those across
///   blocks:     rectangle (cx, cy, theta, a, b), orientation (o)
///   frames:     angles in the map frame; the residual does not change when the
///               world is moved or turned
///   unit:       row 0: rad (before whitening)
///   chi-square: 1 degree of freedom
///   degenerate: the value jumps where the error is pi/2. The period is pi and
///               not pi/2: an orientation is the direction of one family of
///               parallel walls, and a rectangle has two of them
///   source:     ours, as Eq. 22 of de la Puente and Rodriguez-Losada 2014 with
///               a rectangle in place of the line
class RectangleOrientation {
 public:
  static constexpr char kName[] = "rectangle_orientation";
  static constexpr char kG2oTag[] = "PLUMBLINE_RECTANGLE_ORIENTATION";
  static constexpr char kDescription[] =
      "o - theta - u modulo pi; rad (Table 1, #4)";
  static constexpr RelationRole kRole = RelationRole::kDirection;
  static constexpr Quantity kRows[] = {
      Quantity::Angle("turn", "angle tolerance")};
  using Blocks = BlockList<RectangleBlock, OrientationBlock>;

  /// `expected` in rad, `sqrt_information` in 1/rad.
  RectangleOrientation(double expected, double sqrt_information)
      : expected_(expected), sqrt_information_(sqrt_information) {}

  /// `rectangle`: (x, y, theta, a, b), m and rad; `orientation`: (o), rad.
  /// `residual`: 1 row.
  template <typename T>
  bool operator()(const T* const rectangle, const T* const orientation,
                  T* residual) const {
    residual[0] = sqrt_information_ *
                  NormalizeAxial(T(orientation[0] - rectangle[2] - expected_));
    return true;
  }

  /// The caller (or the ceres::Problem) owns the cost function.
  static ceres::CostFunction* Create(double expected, double sqrt_information) {
    return new ceres::AutoDiffCostFunction<RectangleOrientation, 1, 5, 1>(
        new RectangleOrientation(expected, sqrt_information));
  }

 private:
  double expected_;
  double sqrt_information_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_RECTANGLE_ORIENTATION_H_
