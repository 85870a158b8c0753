#ifndef PLUMBLINE_FACTORS_POSE_POINT_BEARING_H_
#define PLUMBLINE_FACTORS_POSE_POINT_BEARING_H_

#include <ceres/autodiff_cost_function.h>
#include <ceres/cost_function.h>
#include <plumbline/factors/angle.h>
#include <plumbline/factors/blocks.h>

#include <cmath>

namespace plumbline {

/// Direction in which a pose sees a point.
///
///   residual:   r = L (atan2(y - py, x - px) - theta - expected), the error in
///               (-pi, pi]
///   blocks:     pose (px, py, theta), point (x, y)
///   frames:     pose and point in the map frame, `expected` in the frame of
///               the pose; the residual does not change when the world is moved
///               or turned
///   unit:       row 0: rad (before whitening)
///   chi-square: 1 degree of freedom
///   degenerate: where the point is nearer to the pose than kNearest there is
///               no direction: the residual and its derivatives are zero there.
///               The value jumps where the error is pi
///   source:     EDGE_BEARING_SE2_XY of g2o
class PosePointBearing {
 public:
  static constexpr char kName[] = "pose_point_bearing";
  static constexpr char kG2oTag[] = "EDGE_BEARING_SE2_XY";
  static constexpr char kDescription[] =
      "direction in which the pose sees the point minus u; rad "
      "(EDGE_BEARING_SE2_XY of g2o)";
  static constexpr RelationRole kRole = RelationRole::kOther;
  static constexpr Quantity kRows[] = {
      Quantity::Angle("bearing", "angle tolerance")};
  using Blocks = BlockList<PoseBlock, PointBlock>;

  /// m
  static constexpr double kNearest = 1e-9;

  /// `expected` in rad, `sqrt_information` in 1/rad.
  PosePointBearing(double expected, double sqrt_information)
      : expected_(expected), sqrt_information_(sqrt_information) {}

  /// `pose`: (x, y, theta), m and rad; `point`: (x, y), m. `residual`: 1 row.
  template <typename T>
  bool operator()(const T* const pose, const T* const point,
                  T* residual) const {
    using std::atan2;
    const T dx = point[0] - pose[0];
    const T dy = point[1] - pose[1];
    if (dx * dx + dy * dy < T(kNearest * kNearest)) {
      residual[0] = T(0.0);
      return true;
    }
    residual[0] = sqrt_information_ *
                  NormalizeAngle(T(atan2(dy, dx) - pose[2] - expected_));
    return true;
  }

  /// The caller (or the ceres::Problem) owns the cost function.
  static ceres::CostFunction* Create(double expected, double sqrt_information) {
    return new ceres::AutoDiffCostFunction<PosePointBearing, 1, 3, 2>(
        new PosePointBearing(expected, sqrt_information));
  }

 private:
  double expected_;
  double sqrt_information_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_POSE_POINT_BEARING_H_
