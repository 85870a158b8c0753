#ifndef PLUMBLINE_FACTORS_POSE_END_POINTS_H_
#define PLUMBLINE_FACTORS_POSE_END_POINTS_H_

#include <ceres/autodiff_cost_function.h>
#include <ceres/cost_function.h>
#include <plumbline/factors/blocks.h>
#include <plumbline/factors/pose2.h>

#include <Eigen/Core>
#include <cmath>

namespace plumbline {

/// Both ends of a wall seen from a pose.
///
///   residual:   r = L (f - expected), with (dxi, dyi) = (xi - px, yi - py) for
///               each end i,
///                 f0 =  cos(theta) dx1 + sin(theta) dy1
///                 f1 = -sin(theta) dx1 + cos(theta) dy1
///                 f2 =  cos(theta) dx2 + sin(theta) dy2
///                 f3 = -sin(theta) dx2 + cos(theta) dy2
///   blocks:     pose (px, py, theta), ends (x1, y1, x2, y2)
///   frames:     pose and ends in the map frame, `expected` and the rows in the
///               frame of the pose; the residual does not change when the world
///               is moved or turned
///   unit:       rows 0 to 3: m (before whitening)
///   chi-square: 4 degrees of freedom (the rank of L)
///   degenerate: nowhere; the ends are told apart by their order
///   source:     EDGE_SE2_SEGMENT2D of g2o
class PoseEndPoints {
 public:
  static constexpr char kName[] = "pose_end_points";
  static constexpr char kG2oTag[] = "EDGE_SE2_SEGMENT2D";
  static constexpr char kDescription[] =
      "both ends seen from the pose minus u; m, m, m, m (EDGE_SE2_SEGMENT2D of "
      "g2o)";
  static constexpr RelationRole kRole = RelationRole::kOther;
  static constexpr Quantity kRows[] = {
      Quantity::Length("x1", "position tolerance"),
      Quantity::Length("y1", "position tolerance"),
      Quantity::Length("x2", "position tolerance"),
      Quantity::Length("y2", "position tolerance")};
  using Blocks = BlockList<PoseBlock, EndPointsBlock>;

  /// `expected`: the ends (x1, y1, x2, y2) seen from the pose, m;
  /// `sqrt_information`: L with L' L = information, in 1/m.
  PoseEndPoints(const Eigen::Vector4d& expected,
                const Eigen::Matrix4d& sqrt_information)
      : expected_(expected), sqrt_information_(sqrt_information) {}

  /// `pose`: (x, y, theta), m and rad; `ends`: (x1, y1, x2, y2), m. `residual`:
  /// 4 rows.
  template <typename T>
  bool operator()(const T* const pose, const T* const ends, T* residual) const {
    using std::cos;
    using std::sin;
    const T c = cos(pose[2]);
    const T s = sin(pose[2]);
    T error[4];
    for (int i = 0; i < 4; i += 2) {
      const T dx = ends[i] - pose[0];
      const T dy = ends[i + 1] - pose[1];
      error[i] = c * dx + s * dy - expected_[i];
      error[i + 1] = c * dy - s * dx - expected_[i + 1];
    }
    for (int i = 0; i < 4; ++i) {
      residual[i] = sqrt_information_(i, 0) * error[0] +
                    sqrt_information_(i, 1) * error[1] +
                    sqrt_information_(i, 2) * error[2] +
                    sqrt_information_(i, 3) * error[3];
    }
    return true;
  }

  /// Sets the ends to where the pose sees them: the residual is zero.
  static void PlaceSecond(const double* expected, const double* pose,
                          const double* /*anchor*/, double* ends) {
    for (int i = 0; i < 4; i += 2) {
      Eigen::Map<Eigen::Vector2d>{ends + i} =
          TransformPoint(Pose2(pose), Eigen::Vector2d(expected + i));
    }
  }

  /// The caller (or the ceres::Problem) owns the cost function.
  static ceres::CostFunction* Create(const Eigen::Vector4d& expected,
                                     const Eigen::Matrix4d& sqrt_information) {
    return new ceres::AutoDiffCostFunction<PoseEndPoints, 4, 3, 4>(
        new PoseEndPoints(expected, sqrt_information));
  }

 private:
  Eigen::Vector4d expected_;
  Eigen::Matrix4d sqrt_information_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_POSE_END_POINTS_H_
