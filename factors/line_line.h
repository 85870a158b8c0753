#ifndef PLUMBLINE_FACTORS_LINE_LINE_H_
#define PLUMBLINE_FACTORS_LINE_LINE_H_

#include <ceres/autodiff_cost_function.h>
#include <ceres/cost_function.h>
#include <plumbline/factors/angle.h>
#include <plumbline/factors/blocks.h>

#include <Eigen/Core>
#include <cmath>

namespace plumbline {

/// Difference of two directed lines: how far apart they are from the origin,
/// and the angle between them.
///
///   residual:   r = L (f - expected), with D = d - ax sin(alpha)
///               + ay cos(alpha), the line's signed distance from the origin of
///               the map frame,
///                 f0 = D2 - D1
///                 f1 = alpha2 - alpha1
///               and row 1 of the difference in (-pi, pi]
///   blocks:     lines (d1, alpha1), (d2, alpha2)
///   frames:     map frame, each line relative to its anchor (ax, ay). The
///               residual does not change when the world (anchors included) is
///               turned about the origin; when it is moved, row 0 stays the
///               same for parallel lines only
///   unit:       rows 0, 1: m, rad (before whitening)
///   chi-square: 2 degrees of freedom (the rank of L)
///   degenerate: the value jumps where the direction is off by pi. (d, alpha)
///               and (-d, alpha + pi) are the same line, but lines have a
///               direction here
///   source:     EDGE_LINE2D of g2o, which does not wrap the angle
class LineLine {
 public:
  static constexpr char kName[] = "line_line";
  static constexpr char kG2oTag[] = "PLUMBLINE_LINE_LINE";
  static constexpr char kDescription[] =
      "difference of distances from the origin and of directions, minus u; m, "
      "rad (EDGE_LINE2D of g2o)";
  static constexpr RelationRole kRole = RelationRole::kOther;
  static constexpr Quantity kRows[] = {
      Quantity::Length("offset", "offset tolerance"),
      Quantity::Angle("turn", "angle tolerance")};
  using Blocks = BlockList<LineBlock, LineBlock>;

  /// `expected`: f, m and rad; `anchor1`, `anchor2` in m; `sqrt_information`: L
  /// with L' L = information, in 1/m and 1/rad.
  LineLine(const Eigen::Vector2d& expected, const Eigen::Vector2d& anchor1,
           const Eigen::Vector2d& anchor2,
           const Eigen::Matrix2d& sqrt_information)
      : expected_(expected),
        anchor1_(anchor1),
        anchor2_(anchor2),
        sqrt_information_(sqrt_information) {}

  /// `line1`, `line2`: (d, alpha), m and rad. `residual`: 2 rows.
  template <typename T>
  bool operator()(const T* const line1, const T* const line2,
                  T* residual) const {
    const T e0 = FromOrigin(line2, anchor2_) - FromOrigin(line1, anchor1_) -
                 expected_[0];
    const T e1 = NormalizeAngle(T(line2[1] - line1[1] - expected_[1]));
    residual[0] = sqrt_information_(0, 0) * e0 + sqrt_information_(0, 1) * e1;
    residual[1] = sqrt_information_(1, 0) * e0 + sqrt_information_(1, 1) * e1;
    return true;
  }

  /// The caller (or the ceres::Problem) owns the cost function.
  static ceres::CostFunction* Create(const Eigen::Vector2d& expected,
                                     const Eigen::Vector2d& anchor1,
                                     const Eigen::Vector2d& anchor2,
                                     const Eigen::Matrix2d& sqrt_information) {
    return new ceres::AutoDiffCostFunction<LineLine, 2, 2, 2>(
        new LineLine(expected, anchor1, anchor2, sqrt_information));
  }

 private:
  template <typename T>
  static T FromOrigin(const T* const line, const Eigen::Vector2d& anchor) {
    using std::cos;
    using std::sin;
    return line[0] - anchor[0] * sin(line[1]) + anchor[1] * cos(line[1]);
  }

  Eigen::Vector2d expected_;
  Eigen::Vector2d anchor1_;
  Eigen::Vector2d anchor2_;
  Eigen::Matrix2d sqrt_information_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_LINE_LINE_H_
