#ifndef PLUMBLINE_FACTORS_POSE_POSE_H_
#define PLUMBLINE_FACTORS_POSE_POSE_H_

#include <ceres/autodiff_cost_function.h>
#include <ceres/cost_function.h>
#include <plumbline/factors/angle.h>
#include <plumbline/factors/blocks.h>
#include <plumbline/factors/pose2.h>

#include <Eigen/Core>
#include <cmath>

namespace plumbline {

/// Relative pose between two poses, a pose and a segment, or two segments.
///
///   residual:   r = L ((inverse(p1) (+) p2) (-) relative), that is, with
///               (dx, dy) = (x2 - x1, y2 - y1),
///                 e0 =  cos(theta1) dx + sin(theta1) dy - relative.x
///                 e1 = -sin(theta1) dx + cos(theta1) dy - relative.y
///                 e2 = theta2 - theta1 - relative.theta, in (-pi, pi]
///   blocks:     p1 = (x1, y1, theta1), p2 = (x2, y2, theta2)
///   frames:     p1, p2 in the map frame, `relative` and rows 0, 1 in the frame
///               p1; the residual does not change when the world is moved or
///               turned
///   unit:       rows 0, 1, 2: m, m, rad (before whitening)
///   chi-square: 3 degrees of freedom (the rank of L)
///   degenerate: the value jumps where the heading is off by pi
///   source:     de la Puente and Rodriguez-Losada 2014, Eq. 19; differences of
///               positions come first, so that it is accurate far from the
///               origin
class PosePose {
 public:
  static constexpr char kName[] = "pose_pose";
  static constexpr char kG2oTag[] = "EDGE_SE2";
  static constexpr char kDescription[] =
      "inverse(p1) (+) p2 (-) u; m, m, rad (Eq. 19)";
  static constexpr RelationRole kRole = RelationRole::kPose;
  static constexpr Quantity kRows[] = {
      Quantity::Length("x", "position tolerance"),
      Quantity::Length("y", "position tolerance"),
      Quantity::Angle("theta", "angle tolerance")};
  using Blocks = BlockList<FrameBlocks, FrameBlocks>;

  /// `relative`: p2 seen from p1 (m, m, rad); `sqrt_information`: L with
  /// L' L = information, in 1/m and 1/rad.
  PosePose(const Pose2& relative, const Eigen::Matrix3d& sqrt_information)
      : relative_(relative), sqrt_information_(sqrt_information) {}

  /// `p1`, `p2`: (x, y, theta), m and rad. `residual`: 3 rows.
  template <typename T>
  bool operator()(const T* const p1, const T* const p2, T* residual) const {
    using std::cos;
    using std::sin;
    const T c = cos(p1[2]);
    const T s = sin(p1[2]);
    const T dx = p2[0] - p1[0];
    const T dy = p2[1] - p1[1];
    const T error[3] = {c * dx + s * dy - relative_[0],
                        c * dy - s * dx - relative_[1],
                        NormalizeAngle(T(p2[2] - p1[2] - relative_[2]))};
    for (int i = 0; i < 3; ++i) {
      residual[i] = sqrt_information_(i, 0) * error[0] +
                    sqrt_information_(i, 1) * error[1] +
                    sqrt_information_(i, 2) * error[2];
    }
    return true;
  }

  /// Sets p2 to where `relative` puts it, seen from p1: the residual is zero.
  static void PlaceSecond(const double* relative, const double* p1,
                          const double* /*anchor2*/, double* p2) {
    Eigen::Map<Pose2>{p2} = Compose(Pose2(p1), Pose2(relative));
  }

  /// The caller (or the ceres::Problem) owns the cost function.
  static ceres::CostFunction* Create(const Pose2& relative,
                                     const Eigen::Matrix3d& sqrt_information) {
    return new ceres::AutoDiffCostFunction<PosePose, 3, 3, 3>(
        new PosePose(relative, sqrt_information));
  }

 private:
  Pose2 relative_;
  Eigen::Matrix3d sqrt_information_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_POSE_POSE_H_
