#ifndef PLUMBLINE_FACTORS_SEGMENT_SEGMENT_THICKNESS_H_
#define PLUMBLINE_FACTORS_SEGMENT_SEGMENT_THICKNESS_H_

#include <ceres/autodiff_cost_function.h>
#include <ceres/cost_function.h>
#include <plumbline/factors/angle.h>
#include <plumbline/factors/blocks.h>
#include <plumbline/factors/thickness.h>

#include <Eigen/Core>
#include <cmath>

namespace plumbline {

/// How much farther than a thickness one face of a wall lies behind the other,
/// and how the two are turned against each other; nothing is said about the way
/// along the wall. Two parallel faces of one wall, each seen from its own side,
/// have the expected value (0, pi). Where nothing shall be said about the
/// directions, the information of row 1 is zero.
///
///   residual:   r = L (f (-) expected), with
///                 f0 = (x2 - x1) sin(t1) - (y2 - y1) cos(t1) - w
///                 f1 = t2 - t1
///               and row 1 of the difference in (-pi, pi]
///   blocks:     first face (x1, y1, t1), second face (x2, y2, t2), thickness
///               (w)
///   frames:     both faces in the map frame; the residual does not change when
///               the world is moved or turned, nor when the position of the
///               first face moves along its line
///   unit:       rows 0, 1: m, rad (before whitening)
///   chi-square: 2 degrees of freedom (the rank of L)
///   degenerate: the value jumps where the direction is off by pi: two faces
///               that are seen from the same side are not those of a wall. Far
///               apart along the wall the two rows depend on each other: L has
///               to carry the lever (CollinearityInformation with the distance
///               from the second face's position along its direction). Where
///               nothing holds the second face's position along its line, it
///               slides until f0 fits, however little the two are turned
///   source:     ours
class SegmentSegmentThickness {
 public:
  static constexpr char kName[] = "segment_segment_thickness";
  static constexpr char kG2oTag[] = "PLUMBLINE_SEGMENT_SEGMENT_THICKNESS";
  static constexpr char kDescription[] =
      "distance of the second segment behind the first minus the thickness, "
      "and angle between them, minus u; m, rad";
  static constexpr RelationRole kRole = RelationRole::kOther;
  static constexpr Quantity kRows[] = {
      Quantity::Length("excess", "thickness tolerance"),
      Quantity::Angle("turn", "angle tolerance")};
  using Blocks = BlockList<SegmentBlock, SegmentBlock, ThicknessBlock>;

  /// `expected`: f, m and rad; `sqrt_information`: L with L' L = information,
  /// in 1/m and 1/rad.
  SegmentSegmentThickness(const Eigen::Vector2d& expected,
                          const Eigen::Matrix2d& sqrt_information)
      : expected_(expected), sqrt_information_(sqrt_information) {}

  /// `first`, `second`: (x, y, theta), m and rad; `thickness`: (w), m.
  /// `residual`: 2 rows.
  template <typename T>
  bool operator()(const T* const first, const T* const second,
                  const T* const thickness, T* residual) const {
    using std::cos;
    using std::sin;
    const T error0 = (second[0] - first[0]) * sin(first[2]) -
                     (second[1] - first[1]) * cos(first[2]) - thickness[0] -
                     expected_[0];
    const T error1 = NormalizeAngle(T(second[2] - first[2] - expected_[1]));
    residual[0] =
        sqrt_information_(0, 0) * error0 + sqrt_information_(0, 1) * error1;
    residual[1] =
        sqrt_information_(1, 0) * error0 + sqrt_information_(1, 1) * error1;
    return true;
  }

  /// The caller (or the ceres::Problem) owns the cost function.
  static ceres::CostFunction* Create(const Eigen::Vector2d& expected,
                                     const Eigen::Matrix2d& sqrt_information) {
    return new ceres::AutoDiffCostFunction<SegmentSegmentThickness, 2, 3, 3, 1>(
        new SegmentSegmentThickness(expected, sqrt_information));
  }

 private:
  Eigen::Vector2d expected_;
  Eigen::Matrix2d sqrt_information_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_SEGMENT_SEGMENT_THICKNESS_H_
