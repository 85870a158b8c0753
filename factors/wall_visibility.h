#ifndef PLUMBLINE_FACTORS_WALL_VISIBILITY_H_
#define PLUMBLINE_FACTORS_WALL_VISIBILITY_H_

#include <ceres/autodiff_cost_function.h>
#include <ceres/cost_function.h>
#include <plumbline/factors/blocks.h>

#include <Eigen/Core>
#include <cmath>

namespace plumbline {

/// A wall does not stand where a sensor has looked through: the end of a sight
/// line lies on the sensor's side of the wall. An inequality: the residual is
/// zero as long as that holds, and grows with the distance by which the end
/// lies behind the wall.
///
/// The sight line belongs to a frame: the pose that the sensor had, or, where
/// poses are marginalized out, a wall that was seen in the same scan. Its end
/// is fixed in this frame, so that the line moves with what saw it. A margin m
/// is taken off the sight line beforehand (its end is q - m n, n the wall's
/// normal away from the sensor, or the line is cut so that it ends there): the
/// functor knows none. So the general form, with the wall n'x = d, the side s
/// of the sensor and the end q of the uncut line, is
/// max(0, -s (n'q - d) - m) / sigma.
///
///   residual:   r = L (f - expected), with the expected value (qx, qy, s), the
///               end of the sight line in the frame and the side of the sensor
///               (1: left of the segment's direction, -1: right), n = (-sin(st
///               - pt), cos(st - pt)) the normal of the wall in the frame,
///                 c = -(px - sx) sin(st) + (py - sy) cos(st) + n . q
///                 v = max(0, -s c)
///                 f = (qx + s v nx, qy + s v ny, s)
///               that is, f is the point on the sensor's side of the wall that
///               is nearest to the end
///   blocks:     pose (px, py, pt), segment (sx, sy, st)
///   frames:     pose and segment in the map frame, f in the pose's. The
///               residual does not change when the world is moved or turned
///   unit:       rows 0, 1: m, row 2: none, its error is always zero (before
///               whitening)
///   chi-square: 1 degree of freedom for the information of
///               WallVisibilityInformation: |r| = v / sigma as long as the wall
///               has its direction in the frame. As an inequality that holds
///               has no residual, the p-value is that of the violation alone
///   degenerate: zero, and so are its derivatives, where the inequality holds;
///               at v = 0 the derivative is that from this side. Nothing is
///               said about the way along the wall, whose ends do not enter: a
///               line that passes the wall beside its ends is no sight line for
///               this relation, and one that runs parallel to the wall says
///               what any other with this end does. The side is given and not
///               that of the pose, so that nothing jumps where the pose crosses
///               the wall
///   source:     ours; de la Puente and Rodriguez-Losada 2014, Sect. 7, name
///               inequality constraints for visibility as future work
class WallVisibility {
 public:
  static constexpr char kName[] = "wall_visibility";
  static constexpr char kG2oTag[] = "PLUMBLINE_WALL_VISIBILITY";
  static constexpr char kDescription[] =
      "how far the end (u0, u1) of a sight line lies behind the segment, seen "
      "from its side u2 (1 or -1), 0 where it does not; m, m, -";
  static constexpr RelationRole kRole = RelationRole::kOther;
  static constexpr Quantity kRows[] = {
      Quantity::Length("end_x", "end tolerance"),
      Quantity::Length("end_y", "end tolerance"),
      Quantity::Number("side", "side tolerance")};
  using Blocks = BlockList<FrameBlocks, SegmentBlock>;

  /// `expected`: end of the sight line in the frame of the pose, m, and the
  /// side of the sensor, 1 or -1; `sqrt_information`: L with L' L =
  /// information.
  WallVisibility(const Eigen::Vector3d& expected,
                 const Eigen::Matrix3d& sqrt_information)
      : expected_(expected), sqrt_information_(sqrt_information) {}

  /// `pose`, `segment`: (x, y, theta), m and rad. `residual`: 3 rows.
  template <typename T>
  bool operator()(const T* const pose, const T* const segment,
                  T* residual) const {
    using std::cos;
    using std::sin;
    const T turn = segment[2] - pose[2];
    const T normal_x = -sin(turn);
    const T normal_y = cos(turn);
    // To the left of the segment.
    const T across = (pose[1] - segment[1]) * cos(segment[2]) -
                     (pose[0] - segment[0]) * sin(segment[2]) +
                     normal_x * expected_[0] + normal_y * expected_[1];
    // f - expected is shift times the normal.
    const T shift = expected_[2] * across < 0.0 ? T(-across) : T(0.0);
    for (int row = 0; row < 3; ++row) {
      residual[row] = shift * (sqrt_information_(row, 0) * normal_x +
                               sqrt_information_(row, 1) * normal_y);
    }
    return true;
  }

  /// The caller (or the ceres::Problem) owns the cost function.
  static ceres::CostFunction* Create(const Eigen::Vector3d& expected,
                                     const Eigen::Matrix3d& sqrt_information) {
    return new ceres::AutoDiffCostFunction<WallVisibility, 3, 3, 3>(
        new WallVisibility(expected, sqrt_information));
  }

 private:
  Eigen::Vector3d expected_;
  Eigen::Matrix3d sqrt_information_;
};

/// Information of a WallVisibility whose sight line ends with the standard
/// deviation `sigma` (m, above 0) across the wall. `normal`: the wall's unit
/// normal in the frame of the sight line, either of the two.
inline Eigen::Matrix3d WallVisibilityInformation(const Eigen::Vector2d& normal,
                                                 double sigma) {
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  information.topLeftCorner<2, 2>() =
      normal * normal.transpose() / (sigma * sigma);
  return information;
}

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_WALL_VISIBILITY_H_
