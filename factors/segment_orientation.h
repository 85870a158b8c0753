#ifndef PLUMBLINE_FACTORS_SEGMENT_ORIENTATION_H_
#define PLUMBLINE_FACTORS_SEGMENT_ORIENTATION_H_

#include <ceres/autodiff_cost_function.h>
#include <ceres/cost_function.h>
#include <plumbline/factors/angle.h>
#include <plumbline/factors/blocks.h>

namespace plumbline {

/// Angle from a segment's direction to an orientation, modulo pi.
///
///   residual:   r = L (o - theta - expected), the error in (-pi/2, pi/2]
///   blocks:     segment (x, y, theta), orientation (o)
///   frames:     angles in the map frame; the residual does not change when the
///               world is moved or turned
///   unit:       row 0: rad (before whitening)
///   chi-square: 1 degree of freedom
///   degenerate: the value jumps where the error is pi/2. A wall seen from the
///               other side gives the same residual
///   source:     de la Puente and Rodriguez-Losada 2014, Eq. 22 with a segment
///               in place of the line; modulo pi is ours
class SegmentOrientation {
 public:
  static constexpr char kName[] = "segment_orientation";
  static constexpr char kG2oTag[] = "PLUMBLINE_SEGMENT_ORIENTATION";
  static constexpr char kDescription[] =
      "o - theta - u modulo pi; rad (Eq. 22)";
  static constexpr RelationRole kRole = RelationRole::kDirection;
  static constexpr Quantity kRows[] = {
      Quantity::Angle("turn", "angle tolerance")};
  using Blocks = BlockList<SegmentBlock, OrientationBlock>;

  /// `expected` in rad, `sqrt_information` in 1/rad.
  SegmentOrientation(double expected, double sqrt_information)
      : expected_(expected), sqrt_information_(sqrt_information) {}

  /// `segment`: (x, y, theta), m and rad; `orientation`: (o), rad. `residual`:
  /// 1 row.
  template <typename T>
  bool operator()(const T* const segment, const T* const orientation,
                  T* residual) const {
    residual[0] = sqrt_information_ *
                  NormalizeAxial(T(orientation[0] - segment[2] - expected_));
    return true;
  }

  /// The caller (or the ceres::Problem) owns the cost function.
  static ceres::CostFunction* Create(double expected, double sqrt_information) {
    return new ceres::AutoDiffCostFunction<SegmentOrientation, 1, 3, 1>(
        new SegmentOrientation(expected, sqrt_information));
  }

 private:
  double expected_;
  double sqrt_information_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_SEGMENT_ORIENTATION_H_
