#ifndef PLUMBLINE_FACTORS_SEGMENT_CORRIDOR_H_
#define PLUMBLINE_FACTORS_SEGMENT_CORRIDOR_H_

#include <ceres/autodiff_cost_function.h>
#include <ceres/cost_function.h>
#include <plumbline/factors/angle.h>
#include <plumbline/factors/blocks.h>
#include <plumbline/factors/corridor.h>

#include <Eigen/Core>
#include <cmath>

namespace plumbline {

/// How far the line of a segment lies past a side of a corridor, at the
/// corridor's anchor, and how it is turned against it; nothing is said about
/// the way along the side.
///
///   residual:   r = L (f (-) expected), with the expected value (u0, phi) and
///               q = 1 for cos(phi) >= 0 (the right side), else -1 (the left
///               side),
///                 f0 = -(ax - sx) sin(st) + (ay - sy) cos(st) + q d - w
///                 f1 = st - alpha
///               and row 1 of the difference in (-pi, pi]. phi is the direction
///               of a segment of that side, which is seen from within, from
///               that of the axis: 0 on the right, pi on the left
///   blocks:     segment (sx, sy, st), corridor (d, alpha, w) with half the
///               width w
///   frames:     the segment and the corridor's anchor (ax, ay) in the map
///               frame; the axis is given relative to the anchor, a constant
///               near it. The residual does not change when the world (anchor
///               included) is moved or turned, nor when the segment's position
///               moves along its line
///   unit:       rows 0, 1: m, rad (before whitening)
///   chi-square: 2 degrees of freedom (the rank of L)
///   degenerate: the value jumps where the direction is off by pi: a wall seen
///               from outside is not one of the corridor's. (-d, alpha + pi, w)
///               is the same corridor with phi more by pi. The residual does
///               not keep w positive. Far from the anchor along the axis the
///               two rows depend on each other: L has to carry the lever
///               (CorridorInformation)
///   source:     ours; Sect. 7 of de la Puente and Rodriguez-Losada 2014 names
///               corridors as future work. Distance of Eq. 20
class SegmentCorridor {
 public:
  static constexpr char kName[] = "segment_corridor";
  static constexpr char kG2oTag[] = "PLUMBLINE_SEGMENT_CORRIDOR";
  static constexpr char kDescription[] =
      "distance past the side (u1 = 0: right, pi: left of the axis) at the "
      "corridor's anchor minus u0, and direction from that of the axis minus "
      "u1; m, rad";
  static constexpr RelationRole kRole = RelationRole::kOther;
  static constexpr Quantity kRows[] = {
      Quantity::Length("offset", "offset tolerance"),
      Quantity::Angle("turn", "angle tolerance")};
  using Blocks = BlockList<SegmentBlock, CorridorBlock>;

  /// `expected`: (u0, phi), m and rad; `anchor` of the corridor, m;
  /// `sqrt_information`: L with L' L = information, in 1/m and 1/rad.
  SegmentCorridor(const Eigen::Vector2d& expected,
                  const Eigen::Vector2d& anchor,
                  const Eigen::Matrix2d& sqrt_information)
      : expected_(expected),
        side_(std::cos(expected[1]) >= 0.0 ? 1.0 : -1.0),
        anchor_(anchor),
        sqrt_information_(sqrt_information) {}

  /// `segment`: (x, y, theta), m, m, rad; `corridor`: (d, alpha, w), m, rad, m.
  /// `residual`: 2 rows.
  template <typename T>
  bool operator()(const T* const segment, const T* const corridor,
                  T* residual) const {
    using std::cos;
    using std::sin;
    const T error0 = (anchor_[1] - segment[1]) * cos(segment[2]) -
                     (anchor_[0] - segment[0]) * sin(segment[2]) +
                     side_ * corridor[0] - corridor[2] - expected_[0];
    const T error1 = NormalizeAngle(T(segment[2] - corridor[1] - expected_[1]));
    residual[0] =
        sqrt_information_(0, 0) * error0 + sqrt_information_(0, 1) * error1;
    residual[1] =
        sqrt_information_(1, 0) * error0 + sqrt_information_(1, 1) * error1;
    return true;
  }

  /// The caller (or the ceres::Problem) owns the cost function.
  static ceres::CostFunction* Create(const Eigen::Vector2d& expected,
                                     const Eigen::Vector2d& anchor,
                                     const Eigen::Matrix2d& sqrt_information) {
    return new ceres::AutoDiffCostFunction<SegmentCorridor, 2, 3, 3>(
        new SegmentCorridor(expected, anchor, sqrt_information));
  }

 private:
  Eigen::Vector2d expected_;
  // 1 for the right side, -1 for the left one.
  double side_;
  Eigen::Vector2d anchor_;
  Eigen::Matrix2d sqrt_information_;
};

/// Information of a SegmentCorridor whose offset and direction are independent
/// at the point that lies `along` (m) from the anchor in the direction of the
/// axis: standard deviations `sigma_offset` (m) across and `sigma_angle` (rad),
/// both > 0. `phi` names the side. To first order the offset there is
/// f0 - q along f1.
inline Eigen::Matrix2d CorridorInformation(double sigma_offset,
                                           double sigma_angle, double phi,
                                           double along) {
  const double lever = std::cos(phi) >= 0.0 ? -along : along;
  const double offset = 1.0 / (sigma_offset * sigma_offset);
  const double angle = 1.0 / (sigma_angle * sigma_angle);
  Eigen::Matrix2d information;
  information << offset, lever * offset, lever * offset,
      lever * lever * offset + angle;
  return information;
}

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_SEGMENT_CORRIDOR_H_
