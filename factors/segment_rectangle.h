#ifndef PLUMBLINE_FACTORS_SEGMENT_RECTANGLE_H_
#define PLUMBLINE_FACTORS_SEGMENT_RECTANGLE_H_

#include <ceres/autodiff_cost_function.h>
#include <ceres/cost_function.h>
#include <plumbline/factors/angle.h>
#include <plumbline/factors/blocks.h>

#include <Eigen/Core>
#include <cmath>

namespace plumbline {

/// How far a segment lies past a side of a rectangle and how it is turned
/// against it; nothing is said about the way along the side.
///
///   residual:   r = L (f (-) expected), with the expected value (u0, phi),
///               n = (sin(theta + phi), -cos(theta + phi)) the outward normal
///               of the side and h = a |sin(phi)| + b |cos(phi)| its distance
///               from the centre,
///                 f0 = (s - c) . n - h
///                 f1 = st - theta
///               and row 1 of the difference in (-pi/2, pi/2]. The side is the
///               one that runs in the direction theta + phi with the rectangle
///               on its left: phi = 0 is below, pi/2 right, pi above, -pi/2
///               left, seen with theta to the right. Any other phi means the
///               line in that direction that touches the rectangle
///   blocks:     segment (sx, sy, st), rectangle (cx, cy, theta, a, b) with the
///               half sizes a along theta and b across
///   frames:     both in the map frame; the residual does not change when the
///               world is moved or turned
///   unit:       rows 0, 1: m, rad (before whitening)
///   chi-square: 2 degrees of freedom (the rank of L)
///   degenerate: the value of row 1 jumps where the segment stands across the
///               side. A wall seen from inside and from outside gives the same
///               residual; a rectangle turned by pi/2 with a and b exchanged is
///               the same, with phi less by pi/2
///   source:     ours; Table 1, row 4 of de la Puente and Rodriguez-Losada 2014
///               names rectangles without a formula. Collinearity as in Eq. 20
class SegmentRectangle {
 public:
  static constexpr char kName[] = "segment_rectangle";
  static constexpr char kG2oTag[] = "PLUMBLINE_SEGMENT_RECTANGLE";
  static constexpr char kDescription[] =
      "distance past the side in the direction u1 of the rectangle minus u0, "
      "and angle between them minus u1 modulo pi; m, rad (Table 1, #4)";
  static constexpr RelationRole kRole = RelationRole::kSide;
  static constexpr Quantity kRows[] = {
      Quantity::Length("offset", "offset tolerance"),
      Quantity::Angle("turn", "angle tolerance")};
  using Blocks = BlockList<SegmentBlock, RectangleBlock>;

  /// `expected`: (u0, phi), m and rad; `sqrt_information`: L with
  /// L' L = information, in 1/m and 1/rad.
  SegmentRectangle(const Eigen::Vector2d& expected,
                   const Eigen::Matrix2d& sqrt_information)
      : expected_(expected),
        abs_sin_(std::abs(std::sin(expected[1]))),
        abs_cos_(std::abs(std::cos(expected[1]))),
        sqrt_information_(sqrt_information) {}

  /// `segment`: (x, y, theta), m, m, rad; `rectangle`: (x, y, theta, a, b), m,
  /// m, rad, m, m. `residual`: 2 rows.
  template <typename T>
  bool operator()(const T* const segment, const T* const rectangle,
                  T* residual) const {
    using std::cos;
    using std::sin;
    const T direction = rectangle[2] + expected_[1];
    const T error0 = (segment[0] - rectangle[0]) * sin(direction) -
                     (segment[1] - rectangle[1]) * cos(direction) -
                     rectangle[3] * abs_sin_ - rectangle[4] * abs_cos_ -
                     expected_[0];
    const T error1 = NormalizeAxial(T(segment[2] - direction));
    residual[0] =
        sqrt_information_(0, 0) * error0 + sqrt_information_(0, 1) * error1;
    residual[1] =
        sqrt_information_(1, 0) * error0 + sqrt_information_(1, 1) * error1;
    return true;
  }

  /// The caller (or the ceres::Problem) owns the cost function.
  static ceres::CostFunction* Create(const Eigen::Vector2d& expected,
                                     const Eigen::Matrix2d& sqrt_information) {
    return new ceres::AutoDiffCostFunction<SegmentRectangle, 2, 3, 5>(
        new SegmentRectangle(expected, sqrt_information));
  }

 private:
  Eigen::Vector2d expected_;
  double abs_sin_;
  double abs_cos_;
  Eigen::Matrix2d sqrt_information_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_SEGMENT_RECTANGLE_H_
