#ifndef PLUMBLINE_FACTORS_POSITION_PRIOR_H_
#define PLUMBLINE_FACTORS_POSITION_PRIOR_H_

#include <ceres/autodiff_cost_function.h>
#include <ceres/cost_function.h>
#include <plumbline/factors/blocks.h>

#include <Eigen/Core>

namespace plumbline {

/// A position as it is known beforehand (surveyed landmarks, satellite fixes).
///
///   residual:   r = L ((x, y) - expected)
///   blocks:     point, pose or circle (x, y, ...): only x, y count
///   frames:     the position, `expected` and the rows in the map frame; the
///               residual does not change when the world (`expected` included)
///               is moved, and turns with the world
///   unit:       rows 0, 1: m (before whitening)
///   chi-square: 2 degrees of freedom (the rank of L)
///   degenerate: nowhere
///   source:     EDGE_PRIOR_XY and EDGE_PRIOR_SE2_XY of g2o
class PositionPrior {
 public:
  static constexpr RelationRole kRole = RelationRole::kOther;
  static constexpr Quantity kRows[] = {
      Quantity::Length("x", "position tolerance"),
      Quantity::Length("y", "position tolerance")};

  /// `expected` in m; `sqrt_information`: L with L' L = information, in 1/m.
  PositionPrior(const Eigen::Vector2d& expected,
                const Eigen::Matrix2d& sqrt_information)
      : expected_(expected), sqrt_information_(sqrt_information) {}

  /// `position`: at least (x, y), m. `residual`: 2 rows.
  template <typename T>
  bool operator()(const T* const position, T* residual) const {
    const T dx = position[0] - expected_[0];
    const T dy = position[1] - expected_[1];
    residual[0] = sqrt_information_(0, 0) * dx + sqrt_information_(0, 1) * dy;
    residual[1] = sqrt_information_(1, 0) * dx + sqrt_information_(1, 1) * dy;
    return true;
  }

  /// Cost function for a block of the size N: 2 for a point, 3 for a pose or
  /// circle. The caller (or the ceres::Problem) owns it.
  template <int N = 2>
  static ceres::CostFunction* Create(const Eigen::Vector2d& expected,
                                     const Eigen::Matrix2d& sqrt_information) {
    static_assert(N >= 2, "the block must begin with x, y");
    return new ceres::AutoDiffCostFunction<PositionPrior, 2, N>(
        new PositionPrior(expected, sqrt_information));
  }

 private:
  Eigen::Vector2d expected_;
  Eigen::Matrix2d sqrt_information_;
};

/// PositionPrior of a point. In g2o text a tag stands for one kind of vertex,
/// so points and poses have relations of their own.
class PointPrior : public PositionPrior {
 public:
  static constexpr char kName[] = "point_prior";
  static constexpr char kG2oTag[] = "EDGE_PRIOR_XY";
  static constexpr char kDescription[] =
      "point minus u; m, m (EDGE_PRIOR_XY of g2o)";
  using Blocks = BlockList<PointBlock>;

  using PositionPrior::PositionPrior;
};

/// PositionPrior of a pose.
class PosePositionPrior : public PositionPrior {
 public:
  static constexpr char kName[] = "pose_position_prior";
  static constexpr char kG2oTag[] = "EDGE_PRIOR_SE2_XY";
  static constexpr char kDescription[] =
      "position of the pose minus u; m, m (EDGE_PRIOR_SE2_XY of g2o)";
  using Blocks = BlockList<PoseBlock>;

  using PositionPrior::PositionPrior;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_POSITION_PRIOR_H_
