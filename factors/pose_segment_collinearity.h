#ifndef PLUMBLINE_FACTORS_POSE_SEGMENT_COLLINEARITY_H_
#define PLUMBLINE_FACTORS_POSE_SEGMENT_COLLINEARITY_H_

#include <ceres/autodiff_cost_function.h>
#include <ceres/cost_function.h>
#include <ceres/jet.h>
#include <plumbline/factors/angle.h>
#include <plumbline/factors/blocks.h>

#include <Eigen/Core>
#include <cmath>

namespace plumbline {

/// Where a pose lies across a segment's line and how it is turned against it;
/// nothing is said about the way along the segment.
///
///   residual:   r = L (f (-) expected), with
///                 f0 = -(px - sx) sin(st) + (py - sy) cos(st)
///                 f1 = pt - st
///               and row 1 of the difference in (-pi, pi]
///   blocks:     pose (px, py, pt), segment (sx, sy, st)
///   frames:     both in the map frame; f0 is the pose's ordinate in the frame
///               of the segment. The residual does not change when the world is
///               moved or turned
///   unit:       rows 0, 1: m, rad (before whitening)
///   chi-square: 2 degrees of freedom (the rank of L)
///   degenerate: the value jumps where the heading is off by pi. A segment has
///               a direction (the side from which it was seen), so headings are
///               compared modulo 2 pi and not modulo pi
///   source:     de la Puente and Rodriguez-Losada 2014, Eq. 20, written with
///               differences so that it is accurate far from the origin
class PoseSegmentCollinearity {
 public:
  static constexpr char kName[] = "pose_segment_collinearity";
  static constexpr char kG2oTag[] = "PLUMBLINE_POSE_SEGMENT_COLLINEARITY";
  static constexpr char kDescription[] =
      "distance of the pose across the segment and angle between them, minus "
      "u; m, rad (Eq. 20)";
  static constexpr RelationRole kRole = RelationRole::kOther;
  static constexpr Quantity kRows[] = {
      Quantity::Length("offset", "offset tolerance"),
      Quantity::Angle("turn", "angle tolerance")};
  using Blocks = BlockList<FrameBlocks, SegmentBlock>;

  /// `expected`: f as observed, m and rad; `sqrt_information`: L with
  /// L' L = information, in 1/m and 1/rad.
  PoseSegmentCollinearity(const Eigen::Vector2d& expected,
                          const Eigen::Matrix2d& sqrt_information)
      : expected_(expected), sqrt_information_(sqrt_information) {}

  /// `pose`, `segment`: (x, y, theta), m and rad. `residual`: 2 rows.
  template <typename T>
  bool operator()(const T* const pose, const T* const segment,
                  T* residual) const {
    using std::cos;
    using std::sin;
    const T across = (pose[1] - segment[1]) * cos(segment[2]) -
                     (pose[0] - segment[0]) * sin(segment[2]) - expected_[0];
    const T turn = NormalizeAngle(T(pose[2] - segment[2] - expected_[1]));
    residual[0] =
        sqrt_information_(0, 0) * across + sqrt_information_(0, 1) * turn;
    residual[1] =
        sqrt_information_(1, 0) * across + sqrt_information_(1, 1) * turn;
    return true;
  }

  /// The caller (or the ceres::Problem) owns the cost function.
  static ceres::CostFunction* Create(const Eigen::Vector2d& expected,
                                     const Eigen::Matrix2d& sqrt_information) {
    return new ceres::AutoDiffCostFunction<PoseSegmentCollinearity, 2, 3, 3>(
        new PoseSegmentCollinearity(expected, sqrt_information));
  }

 private:
  Eigen::Vector2d expected_;
  Eigen::Matrix2d sqrt_information_;
};

/// PoseSegmentCollinearity for localization only: the same residual, but its
/// derivative with respect to the segment is zero, so that the segment pulls
/// the pose and the pose does not pull the segment.
///
///   residual, blocks, frames, unit, chi-square, degenerate: as
///               PoseSegmentCollinearity
///   source:     de la Puente and Rodriguez-Losada 2014, Eq. 21
class PoseSegmentCollinearityClamped {
 public:
  static constexpr char kName[] = "pose_segment_collinearity_clamped";
  static constexpr char kG2oTag[] =
      "PLUMBLINE_POSE_SEGMENT_COLLINEARITY_CLAMPED";
  static constexpr char kDescription[] =
      "pose_segment_collinearity that does not move the segment; m, rad (Eq. "
      "21)";
  static constexpr RelationRole kRole = RelationRole::kOther;
  static constexpr Quantity kRows[] = {
      Quantity::Length("offset", "offset tolerance"),
      Quantity::Angle("turn", "angle tolerance")};
  using Blocks = BlockList<FrameBlocks, SegmentBlock>;

  /// As PoseSegmentCollinearity.
  PoseSegmentCollinearityClamped(const Eigen::Vector2d& expected,
                                 const Eigen::Matrix2d& sqrt_information)
      : free_(expected, sqrt_information) {}

  /// As PoseSegmentCollinearity.
  template <typename T>
  bool operator()(const T* const pose, const T* const segment,
                  T* residual) const {
    const T clamped[3] = {Constant(segment[0]), Constant(segment[1]),
                          Constant(segment[2])};
    return free_(pose, clamped, residual);
  }

  /// The caller (or the ceres::Problem) owns the cost function.
  static ceres::CostFunction* Create(const Eigen::Vector2d& expected,
                                     const Eigen::Matrix2d& sqrt_information) {
    return new ceres::AutoDiffCostFunction<PoseSegmentCollinearityClamped, 2, 3,
                                           3>(
        new PoseSegmentCollinearityClamped(expected, sqrt_information));
  }

 private:
  // The value without its derivatives.
  static double Constant(double value) { return value; }
  template <typename T, int N>
  static ceres::Jet<T, N> Constant(const ceres::Jet<T, N>& value) {
    return ceres::Jet<T, N>(value.a);
  }

  PoseSegmentCollinearity free_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_POSE_SEGMENT_COLLINEARITY_H_
