#ifndef PLUMBLINE_FACTORS_POSE_SEGMENT_POINTS_H_
#define PLUMBLINE_FACTORS_POSE_SEGMENT_POINTS_H_

#include <ceres/autodiff_cost_function.h>
#include <ceres/cost_function.h>
#include <plumbline/factors/blocks.h>

#include <Eigen/Core>
#include <cmath>

namespace plumbline {

/// The line of a segment as a pose sees it: its unit normal in the pose's frame
/// and the pose's distance from it. Any number of points p_i of the pose's
/// frame that lie on the segment, with weights w_i, make one constraint of it,
/// exactly: the information sum w_i (p_i, 1)(p_i, 1)' gives
/// |r|^2 = sum w_i (distance of p_i from the line)^2, wherever the pose and the
/// segment move, and its cost does not depend on how many points there are.
///
///   residual:   r = L (f - expected), with
///                 f0 = -sin(st - pt)
///                 f1 = cos(st - pt)
///                 f2 = -(px - sx) sin(st) + (py - sy) cos(st)
///   blocks:     pose (px, py, pt), segment (sx, sy, st)
///   frames:     pose and segment in the map frame, (f0, f1) and the points in
///               the pose's. The residual does not change when the world is
///               moved or turned
///   unit:       rows 0, 1: none, row 2: m (before whitening)
///   chi-square: 2 degrees of freedom for expected = 0 (a line has two, the
///               normal is a unit vector), 1 for points on one spot
///   degenerate: nothing is said about the way along the segment; points on one
///               spot say nothing about the direction
///   source:     point to line distance (Eq. 16) summed over points; the
///               condensation is this project's
class PoseSegmentPoints {
 public:
  static constexpr char kName[] = "pose_segment_points";
  static constexpr char kG2oTag[] = "PLUMBLINE_POSE_SEGMENT_POINTS";
  static constexpr char kDescription[] =
      "normal of the segment in the pose's frame and distance of the pose from "
      "it, minus u: points seen on it; -, -, m (Eq. 16)";
  static constexpr RelationRole kRole = RelationRole::kOther;
  static constexpr Quantity kRows[] = {
      Quantity::Number("normal_x", "normal tolerance"),
      Quantity::Number("normal_y", "normal tolerance"),
      Quantity::Length("distance", "distance tolerance")};
  using Blocks = BlockList<FrameBlocks, SegmentBlock>;

  /// `expected`: zero for points on the segment; `sqrt_information`: L with
  /// L' L = information.
  PoseSegmentPoints(const Eigen::Vector3d& expected,
                    const Eigen::Matrix3d& sqrt_information)
      : expected_(expected), sqrt_information_(sqrt_information) {}

  /// `pose`, `segment`: (x, y, theta), m and rad. `residual`: 3 rows.
  template <typename T>
  bool operator()(const T* const pose, const T* const segment,
                  T* residual) const {
    using std::cos;
    using std::sin;
    const T turn = segment[2] - pose[2];
    const T e0 = -sin(turn) - expected_[0];
    const T e1 = cos(turn) - expected_[1];
    const T e2 = (pose[1] - segment[1]) * cos(segment[2]) -
                 (pose[0] - segment[0]) * sin(segment[2]) - expected_[2];
    for (int row = 0; row < 3; ++row) {
      residual[row] = sqrt_information_(row, 0) * e0 +
                      sqrt_information_(row, 1) * e1 +
                      sqrt_information_(row, 2) * e2;
    }
    return true;
  }

  /// The caller (or the ceres::Problem) owns the cost function.
  static ceres::CostFunction* Create(const Eigen::Vector3d& expected,
                                     const Eigen::Matrix3d& sqrt_information) {
    return new ceres::AutoDiffCostFunction<PoseSegmentPoints, 3, 3, 3>(
        new PoseSegmentPoints(expected, sqrt_information));
  }

 private:
  Eigen::Vector3d expected_;
  Eigen::Matrix3d sqrt_information_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_POSE_SEGMENT_POINTS_H_
