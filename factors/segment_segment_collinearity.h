#ifndef PLUMBLINE_FACTORS_SEGMENT_SEGMENT_COLLINEARITY_H_
#define PLUMBLINE_FACTORS_SEGMENT_SEGMENT_COLLINEARITY_H_

#include <ceres/autodiff_cost_function.h>
#include <ceres/cost_function.h>
#include <plumbline/factors/blocks.h>
#include <plumbline/factors/pose_segment_collinearity.h>

#include <Eigen/Core>

namespace plumbline {

/// How far the second segment's reference point lies beside the first segment's
/// line, and how the second is turned against the first; nothing is said about
/// the way along them. Two segments that are one wall, seen from the same side,
/// have the expected value zero.
///
///   residual:   r = L (f (-) expected), with
///                 f0 = -(x2 - x1) sin(t1) + (y2 - y1) cos(t1)
///                 f1 = t2 - t1
///               and row 1 of the difference in (-pi, pi]
///   blocks:     first segment (x1, y1, t1), second segment (x2, y2, t2)
///   frames:     both in the map frame; f0 is an ordinate in the frame of the
///               first. The residual does not change when the world is moved or
///               turned, nor when the first segment's reference point moves
///               along its line
///   unit:       rows 0, 1: m, rad (before whitening)
///   chi-square: 2 degrees of freedom (the rank of L)
///   degenerate: the value jumps where the directions differ by pi: segments
///               have a direction (the side from which they were seen), so two
///               faces of one wall are not collinear in this sense. Far apart
///               along the line the two rows depend on each other: L has to
///               carry the lever (CollinearityInformation)
///   source:     de la Puente and Rodriguez-Losada 2014, Eq. 20, between two
///               segments; written with differences so that it is accurate far
///               from the origin
class SegmentSegmentCollinearity {
 public:
  static constexpr char kName[] = "segment_segment_collinearity";
  static constexpr char kG2oTag[] = "PLUMBLINE_SEGMENT_SEGMENT_COLLINEARITY";
  static constexpr char kDescription[] =
      "distance of the second segment across the first and angle between them, "
      "minus u; m, rad (Eq. 20)";
  static constexpr RelationRole kRole = RelationRole::kSameWall;
  static constexpr Quantity kRows[] = {
      Quantity::Length("offset", "offset tolerance"),
      Quantity::Angle("turn", "angle tolerance")};
  using Blocks = BlockList<SegmentBlock, SegmentBlock>;

  /// `expected`: f, m and rad; `sqrt_information`: L with L' L = information,
  /// in 1/m and 1/rad.
  SegmentSegmentCollinearity(const Eigen::Vector2d& expected,
                             const Eigen::Matrix2d& sqrt_information)
      : second_on_first_(expected, sqrt_information) {}

  /// `first`, `second`: (x, y, theta), m and rad. `residual`: 2 rows.
  template <typename T>
  bool operator()(const T* const first, const T* const second,
                  T* residual) const {
    return second_on_first_(second, first, residual);
  }

  /// The caller (or the ceres::Problem) owns the cost function.
  static ceres::CostFunction* Create(const Eigen::Vector2d& expected,
                                     const Eigen::Matrix2d& sqrt_information) {
    return new ceres::AutoDiffCostFunction<SegmentSegmentCollinearity, 2, 3, 3>(
        new SegmentSegmentCollinearity(expected, sqrt_information));
  }

 private:
  PoseSegmentCollinearity second_on_first_;
};

/// SegmentSegmentCollinearity between two walls that stay two: the same
/// residual, for what is said of how walls lie to each other (parallel, at
/// right angles, a distance apart, in line on both sides of a door), of which
/// nobody may make one.
///
///   residual, blocks, frames, unit, chi-square, degenerate: as
///               SegmentSegmentCollinearity
///   source:     ours; de la Puente and Rodriguez-Losada 2014, Eq. 20, with an
///               expected value of any size
class SegmentSegmentOffset : public SegmentSegmentCollinearity {
 public:
  static constexpr char kName[] = "segment_segment_offset";
  static constexpr char kG2oTag[] = "PLUMBLINE_SEGMENT_SEGMENT_OFFSET";
  static constexpr char kDescription[] =
      "segment_segment_collinearity of two segments that are not one wall; m, "
      "rad (Eq. 20)";
  static constexpr RelationRole kRole = RelationRole::kOther;

  /// As SegmentSegmentCollinearity.
  using SegmentSegmentCollinearity::SegmentSegmentCollinearity;
};

/// Information of a SegmentSegmentCollinearity whose offset and direction are
/// independent at the point that lies `lever` (m) from the second segment's
/// reference point along its direction: standard deviations `sigma_offset` (m)
/// across and `sigma_angle` (rad), both > 0. To first order the offset there is
/// f0 + lever f1.
inline Eigen::Matrix2d CollinearityInformation(double sigma_offset,
                                               double sigma_angle,
                                               double lever) {
  const double offset = 1.0 / (sigma_offset * sigma_offset);
  const double angle = 1.0 / (sigma_angle * sigma_angle);
  Eigen::Matrix2d information;
  information << offset, lever * offset, lever * offset,
      lever * lever * offset + angle;
  return information;
}

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_SEGMENT_SEGMENT_COLLINEARITY_H_
