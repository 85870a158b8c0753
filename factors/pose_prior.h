#ifndef PLUMBLINE_FACTORS_POSE_PRIOR_H_
#define PLUMBLINE_FACTORS_POSE_PRIOR_H_

#include <ceres/autodiff_cost_function.h>
#include <ceres/cost_function.h>
#include <plumbline/factors/angle.h>
#include <plumbline/factors/blocks.h>
#include <plumbline/factors/pose2.h>

#include <Eigen/Core>
#include <cmath>

namespace plumbline {

/// A pose as it is known beforehand.
///
///   residual:   r = L (inverse(expected) (+) p), that is, with
///               (dx, dy) = (x - expected.x, y - expected.y) and
///               phi = expected.theta,
///                 e0 =  cos(phi) dx + sin(phi) dy
///                 e1 = -sin(phi) dx + cos(phi) dy
///                 e2 = theta - phi, in (-pi, pi]
///   blocks:     pose p = (x, y, theta)
///   frames:     p and `expected` in the map frame, the error in the frame
///               `expected`; the residual does not change when the world
///               (`expected` included) is moved or turned
///   unit:       rows 0, 1, 2: m, m, rad (before whitening)
///   chi-square: 3 degrees of freedom (the rank of L)
///   degenerate: the value jumps where the heading is off by pi
///   source:     EDGE_PRIOR_SE2 of g2o
class PosePrior {
 public:
  static constexpr char kName[] = "pose_prior";
  static constexpr char kG2oTag[] = "EDGE_PRIOR_SE2";
  static constexpr char kDescription[] =
      "inverse(u) (+) p; m, m, rad (EDGE_PRIOR_SE2 of g2o)";
  static constexpr RelationRole kRole = RelationRole::kPose;
  static constexpr Quantity kRows[] = {
      Quantity::Length("x", "position tolerance"),
      Quantity::Length("y", "position tolerance"),
      Quantity::Angle("theta", "angle tolerance")};
  using Blocks = BlockList<PoseBlock>;

  /// `expected`: (x, y, theta), m and rad; `sqrt_information`: L with
  /// L' L = information in the frame `expected`, in 1/m and 1/rad.
  PosePrior(const Pose2& expected, const Eigen::Matrix3d& sqrt_information)
      : expected_(expected),
        cos_(std::cos(expected[2])),
        sin_(std::sin(expected[2])),
        sqrt_information_(sqrt_information) {}

  /// `pose`: (x, y, theta), m and rad. `residual`: 3 rows.
  template <typename T>
  bool operator()(const T* const pose, T* residual) const {
    const T dx = pose[0] - expected_[0];
    const T dy = pose[1] - expected_[1];
    const T error[3] = {cos_ * dx + sin_ * dy, cos_ * dy - sin_ * dx,
                        NormalizeAngle(T(pose[2] - expected_[2]))};
    for (int i = 0; i < 3; ++i) {
      residual[i] = sqrt_information_(i, 0) * error[0] +
                    sqrt_information_(i, 1) * error[1] +
                    sqrt_information_(i, 2) * error[2];
    }
    return true;
  }

  /// The caller (or the ceres::Problem) owns the cost function.
  static ceres::CostFunction* Create(const Pose2& expected,
                                     const Eigen::Matrix3d& sqrt_information) {
    return new ceres::AutoDiffCostFunction<PosePrior, 3, 3>(
        new PosePrior(expected, sqrt_information));
  }

 private:
  Pose2 expected_;
  double cos_;
  double sin_;
  Eigen::Matrix3d sqrt_information_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_POSE_PRIOR_H_
