#ifndef PLUMBLINE_FACTORS_POSE_POINT_H_
#define PLUMBLINE_FACTORS_POSE_POINT_H_

#include <ceres/autodiff_cost_function.h>
#include <ceres/cost_function.h>
#include <plumbline/factors/blocks.h>
#include <plumbline/factors/pose2.h>

#include <Eigen/Core>
#include <cmath>

namespace plumbline {

/// Position of a point seen from a pose.
///
///   residual:   r = L (f - expected), with (dx, dy) = (x - px, y - py),
///                 f0 =  cos(theta) dx + sin(theta) dy
///                 f1 = -sin(theta) dx + cos(theta) dy
///   blocks:     pose (px, py, theta), point (x, y)
///   frames:     pose and point in the map frame, `expected` and the rows in
///               the frame of the pose; the residual does not change when the
///               world is moved or turned
///   unit:       rows 0, 1: m (before whitening)
///   chi-square: 2 degrees of freedom (the rank of L)
///   degenerate: nowhere
///   source:     EDGE_SE2_XY of g2o; differences of positions come first, so
///               that it is accurate far from the origin
class PosePoint {
 public:
  static constexpr char kName[] = "pose_point";
  static constexpr char kG2oTag[] = "EDGE_SE2_XY";
  static constexpr char kDescription[] =
      "point seen from the pose minus u; m, m (EDGE_SE2_XY of g2o)";
  static constexpr RelationRole kRole = RelationRole::kPosition;
  static constexpr Quantity kRows[] = {
      Quantity::Length("x", "position tolerance"),
      Quantity::Length("y", "position tolerance")};
  using Blocks = BlockList<PoseBlock, PointBlock>;

  /// `expected`: the point seen from the pose, m; `sqrt_information`: L with
  /// L' L = information, in 1/m.
  PosePoint(const Eigen::Vector2d& expected,
            const Eigen::Matrix2d& sqrt_information)
      : expected_(expected), sqrt_information_(sqrt_information) {}

  /// `pose`: (x, y, theta), m and rad; `point`: (x, y), m. `residual`: 2 rows.
  template <typename T>
  bool operator()(const T* const pose, const T* const point,
                  T* residual) const {
    using std::cos;
    using std::sin;
    const T c = cos(pose[2]);
    const T s = sin(pose[2]);
    const T dx = point[0] - pose[0];
    const T dy = point[1] - pose[1];
    const T e0 = c * dx + s * dy - expected_[0];
    const T e1 = c * dy - s * dx - expected_[1];
    residual[0] = sqrt_information_(0, 0) * e0 + sqrt_information_(0, 1) * e1;
    residual[1] = sqrt_information_(1, 0) * e0 + sqrt_information_(1, 1) * e1;
    return true;
  }

  /// Sets the point to where the pose sees it: the residual is zero.
  static void PlaceSecond(const double* expected, const double* pose,
                          const double* /*anchor*/, double* point) {
    Eigen::Map<Eigen::Vector2d>{point} =
        TransformPoint(Pose2(pose), Eigen::Vector2d(expected));
  }

  /// The caller (or the ceres::Problem) owns the cost function.
  static ceres::CostFunction* Create(const Eigen::Vector2d& expected,
                                     const Eigen::Matrix2d& sqrt_information) {
    return new ceres::AutoDiffCostFunction<PosePoint, 2, 3, 2>(
        new PosePoint(expected, sqrt_information));
  }

 private:
  Eigen::Vector2d expected_;
  Eigen::Matrix2d sqrt_information_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_POSE_POINT_H_
