#ifndef PLUMBLINE_FACTORS_LINE_RECTANGLE_H_
#define PLUMBLINE_FACTORS_LINE_RECTANGLE_H_

#include <ceres/autodiff_cost_function.h>
#include <ceres/cost_function.h>
#include <plumbline/factors/angle.h>
#include <plumbline/factors/blocks.h>

#include <Eigen/Core>
#include <cmath>

namespace plumbline {

/// Distance of a line past a side of a rectangle, at the middle of the side,
/// and its angle to the side.
///
///   residual:   r = L (f (-) expected), with the expected value (u0, phi),
///               n = (sin(theta + phi), -cos(theta + phi)) the outward normal
///               of the side, m = c + (a |sin(phi)| + b |cos(phi)|) n its
///               middle and l = (-sin(alpha), cos(alpha)) the line's normal,
///                 f0 = (d - (m - anchor) . l) sign(n . l)
///                 f1 = alpha - theta
///               and row 1 of the difference in (-pi/2, pi/2]. phi names the
///               side as in SegmentRectangle
///   blocks:     line (d, alpha), rectangle (cx, cy, theta, a, b) with the half
///               sizes a along theta and b across
///   frames:     the rectangle and the line's anchor in the map frame; the line
///               is given relative to its anchor. The residual does not change
///               when the world (anchor included) is moved or turned, nor with
///               the choice of the anchor
///   unit:       rows 0, 1: m, rad (before whitening)
///   chi-square: 2 degrees of freedom (the rank of L)
///   degenerate: both rows jump where the line stands across the side.
///               (d, alpha) and (-d, alpha + pi) are the same line and give the
///               same residual
///   source:     ours, with the distance of Eq. 16 of de la Puente and
///               Rodriguez-Losada 2014
class LineRectangle {
 public:
  static constexpr char kName[] = "line_rectangle";
  static constexpr char kG2oTag[] = "PLUMBLINE_LINE_RECTANGLE";
  static constexpr char kDescription[] =
      "segment_rectangle with a line, its distance taken at the middle of the "
      "side; m, rad (Table 1, #4)";
  static constexpr RelationRole kRole = RelationRole::kSide;
  static constexpr Quantity kRows[] = {
      Quantity::Length("offset", "offset tolerance"),
      Quantity::Angle("turn", "angle tolerance")};
  using Blocks = BlockList<LineBlock, RectangleBlock>;

  /// `expected`: (u0, phi), m and rad; `anchor` of the line, m;
  /// `sqrt_information`: L with L' L = information, in 1/m and 1/rad.
  LineRectangle(const Eigen::Vector2d& expected, const Eigen::Vector2d& anchor,
                const Eigen::Matrix2d& sqrt_information)
      : expected_(expected),
        abs_sin_(std::abs(std::sin(expected[1]))),
        abs_cos_(std::abs(std::cos(expected[1]))),
        anchor_(anchor),
        sqrt_information_(sqrt_information) {}

  /// `line`: (d, alpha), m, rad; `rectangle`: (x, y, theta, a, b), m, m, rad,
  /// m, m. `residual`: 2 rows.
  template <typename T>
  bool operator()(const T* const line, const T* const rectangle,
                  T* residual) const {
    using std::cos;
    using std::sin;
    const T direction = rectangle[2] + expected_[1];
    const T nx = sin(direction);
    const T ny = -cos(direction);
    const T half = rectangle[3] * abs_sin_ + rectangle[4] * abs_cos_;
    const T mx = rectangle[0] - anchor_[0] + half * nx;
    const T my = rectangle[1] - anchor_[1] + half * ny;
    const T lx = -sin(line[1]);
    const T ly = cos(line[1]);
    T error0 = line[0] - mx * lx - my * ly;
    if (nx * lx + ny * ly < T(0.0)) error0 = -error0;
    error0 -= expected_[0];
    const T error1 = NormalizeAxial(T(line[1] - direction));
    residual[0] =
        sqrt_information_(0, 0) * error0 + sqrt_information_(0, 1) * error1;
    residual[1] =
        sqrt_information_(1, 0) * error0 + sqrt_information_(1, 1) * error1;
    return true;
  }

  /// The caller (or the ceres::Problem) owns the cost function.
  static ceres::CostFunction* Create(const Eigen::Vector2d& expected,
                                     const Eigen::Vector2d& anchor,
                                     const Eigen::Matrix2d& sqrt_information) {
    return new ceres::AutoDiffCostFunction<LineRectangle, 2, 2, 5>(
        new LineRectangle(expected, anchor, sqrt_information));
  }

 private:
  Eigen::Vector2d expected_;
  double abs_sin_;
  double abs_cos_;
  Eigen::Vector2d anchor_;
  Eigen::Matrix2d sqrt_information_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_LINE_RECTANGLE_H_
