#ifndef PLUMBLINE_FACTORS_POSE_LINE_H_
#define PLUMBLINE_FACTORS_POSE_LINE_H_

#include <ceres/autodiff_cost_function.h>
#include <ceres/cost_function.h>
#include <plumbline/factors/angle.h>
#include <plumbline/factors/blocks.h>

#include <Eigen/Core>
#include <cmath>

namespace plumbline {

/// A directed line seen from a pose: its signed distance and direction in the
/// frame of the pose.
///
///   residual:   r = L (f - expected), with
///                 f0 = d + (px - ax) sin(alpha) - (py - ay) cos(alpha)
///                 f1 = alpha - theta
///               and row 1 of the difference in (-pi, pi]
///   blocks:     pose (px, py, theta), line (d, alpha)
///   frames:     pose and anchor (ax, ay) in the map frame, the line relative
///               to its anchor (see PointLineDistance); `expected` in the frame
///               of the pose, the signed distance of the line from it. The
///               residual does not change when the world (anchor included) is
///               moved or turned
///   unit:       rows 0, 1: m, rad (before whitening)
///   chi-square: 2 degrees of freedom (the rank of L)
///   degenerate: the value jumps where the direction is off by pi. (d, alpha)
///               and (-d, alpha + pi) are the same line, but lines have a
///               direction here: the observation must have the line's
///   source:     EDGE_SE2_LINE2D of g2o, which gives a line by its normal
///               (theta, rho): theta = alpha + pi/2, rho = d
class PoseLine {
 public:
  static constexpr char kName[] = "pose_line";
  static constexpr char kG2oTag[] = "PLUMBLINE_POSE_LINE";
  static constexpr char kDescription[] =
      "line (d, alpha) seen from the pose minus u; m, rad (EDGE_SE2_LINE2D of "
      "g2o)";
  static constexpr RelationRole kRole = RelationRole::kOther;
  static constexpr Quantity kRows[] = {
      Quantity::Length("d", "offset tolerance"),
      Quantity::Angle("alpha", "angle tolerance")};
  using Blocks = BlockList<PoseBlock, LineBlock>;

  /// `expected`: (d, alpha) of the line in the frame of the pose, m and rad;
  /// `anchor` in m; `sqrt_information`: L with L' L = information, in 1/m and
  /// 1/rad.
  PoseLine(const Eigen::Vector2d& expected, const Eigen::Vector2d& anchor,
           const Eigen::Matrix2d& sqrt_information)
      : expected_(expected),
        anchor_(anchor),
        sqrt_information_(sqrt_information) {}

  /// `pose`: (x, y, theta), m and rad; `line`: (d, alpha), m and rad.
  /// `residual`: 2 rows.
  template <typename T>
  bool operator()(const T* const pose, const T* const line, T* residual) const {
    using std::cos;
    using std::sin;
    const T e0 = line[0] + (pose[0] - anchor_[0]) * sin(line[1]) -
                 (pose[1] - anchor_[1]) * cos(line[1]) - expected_[0];
    const T e1 = NormalizeAngle(T(line[1] - pose[2] - expected_[1]));
    residual[0] = sqrt_information_(0, 0) * e0 + sqrt_information_(0, 1) * e1;
    residual[1] = sqrt_information_(1, 0) * e0 + sqrt_information_(1, 1) * e1;
    return true;
  }

  /// Sets the line, relative to its anchor, to where the pose sees it: the
  /// residual is zero.
  static void PlaceSecond(const double* expected, const double* pose,
                          const double* anchor, double* line) {
    const double alpha = NormalizeAngle(pose[2] + expected[1]);
    line[0] = expected[0] - (pose[0] - anchor[0]) * std::sin(alpha) +
              (pose[1] - anchor[1]) * std::cos(alpha);
    line[1] = alpha;
  }

  /// The caller (or the ceres::Problem) owns the cost function.
  static ceres::CostFunction* Create(const Eigen::Vector2d& expected,
                                     const Eigen::Vector2d& anchor,
                                     const Eigen::Matrix2d& sqrt_information) {
    return new ceres::AutoDiffCostFunction<PoseLine, 2, 3, 2>(
        new PoseLine(expected, anchor, sqrt_information));
  }

 private:
  Eigen::Vector2d expected_;
  Eigen::Vector2d anchor_;
  Eigen::Matrix2d sqrt_information_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_POSE_LINE_H_
