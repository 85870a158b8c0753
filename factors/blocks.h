#ifndef PLUMBLINE_FACTORS_BLOCKS_H_
#define PLUMBLINE_FACTORS_BLOCKS_H_

#include <plumbline/factors/angle_manifold.h>
#include <plumbline/factors/line_manifold.h>
#include <plumbline/factors/quantity.h>
#include <plumbline/factors/roles.h>

#include <Eigen/Core>
#include <cmath>
#include <iterator>

namespace plumbline {

/// Self-description of a kind of parameter block: the base of the structs
/// below, which override what differs. Each has to define
///
///   kName         its name in files and flags
///   kG2oTag       the tag of its vertex in g2o text
///   kDescription  what it is, in a line
///   kParameters   its parameters, in order
struct DescribedBlock {
  static constexpr FeatureTraits kTraits = {};
  /// Number of coordinates of Feature::anchor that the parameters refer to.
  static constexpr int kAnchorSize = 0;
  /// The manifold on which the parameters live; void when they are Euclidean.
  using Manifold = void;
};

/// Number of parameters of a block.
template <typename BlockType>
constexpr int kBlockSize = static_cast<int>(std::size(BlockType::kParameters));

// Poses and segments have no manifold: their residuals wrap angles, a solve
// wraps headings when it is done, and Jacobians stay cheap.

/// A point of the plane.
struct PointBlock : DescribedBlock {
  static constexpr char kName[] = "point";
  static constexpr char kG2oTag[] = "VERTEX_XY";
  static constexpr char kDescription[] =
      "Point of the plane: laser points, trees, common centres";
  static constexpr FeatureTraits kTraits = {FeatureRole::kPoint,
                                            Leading::kPosition};
  static constexpr Quantity kParameters[] = {Quantity::Length("x"),
                                             Quantity::Length("y")};
};

/// A pose of the robot.
struct PoseBlock : DescribedBlock {
  static constexpr char kName[] = "pose";
  static constexpr char kG2oTag[] = "VERTEX_SE2";
  static constexpr char kDescription[] = "Pose of the robot";
  static constexpr FeatureTraits kTraits = {FeatureRole::kPose,
                                            Leading::kFrame};
  static constexpr Quantity kParameters[] = {
      Quantity::Length("x"), Quantity::Length("y"), Quantity::Angle("theta")};
};

/// A wall as it was seen: a pose on it, x along the wall, the side from which
/// it was seen to the left.
struct SegmentBlock : DescribedBlock {
  static constexpr char kName[] = "segment";
  static constexpr char kG2oTag[] = "PLUMBLINE_SEGMENT";
  static constexpr char kDescription[] =
      "Wall segment: a pose on it, x along the wall";
  static constexpr FeatureTraits kTraits = {FeatureRole::kWall, Leading::kFrame,
                                            /*is_one_sided=*/true};
  static constexpr Quantity kParameters[] = {
      Quantity::Length("x"), Quantity::Length("y"), Quantity::Angle("theta")};
};

/// A directed line, relative to an anchor (see PointLineDistance).
struct LineBlock : DescribedBlock {
  static constexpr char kName[] = "line";
  static constexpr char kG2oTag[] = "PLUMBLINE_LINE";
  static constexpr char kDescription[] =
      "Line: signed distance from its anchor and direction";
  static constexpr FeatureTraits kTraits = {FeatureRole::kWall};
  static constexpr Quantity kParameters[] = {Quantity::Length("d"),
                                             Quantity::Angle("alpha")};
  static constexpr int kAnchorSize = 2;
  using Manifold = LineManifold;

  /// The foot point of the anchor on the line and the line's direction:
  /// (x, y, theta), m and rad, in the map frame. `line`: (d, alpha).
  static Eigen::Vector3d Frame(const double* line, const double* anchor) {
    return Eigen::Vector3d(anchor[0] - line[0] * std::sin(line[1]),
                           anchor[1] + line[0] * std::cos(line[1]), line[1]);
  }

  /// Where a point (x, y) lies along the line, m from the foot point.
  static double Along(const double* line, const double* anchor,
                      const double* point) {
    return std::cos(line[1]) * (point[0] - anchor[0]) +
           std::sin(line[1]) * (point[1] - anchor[1]);
  }
};

/// A wall given by both its ends, as g2o has it.
struct EndPointsBlock : DescribedBlock {
  static constexpr char kName[] = "end_points";
  static constexpr char kG2oTag[] = "VERTEX_SEGMENT2D";
  static constexpr char kDescription[] = "Wall given by both its ends";
  static constexpr Quantity kParameters[] = {
      Quantity::Length("x1"), Quantity::Length("y1"), Quantity::Length("x2"),
      Quantity::Length("y2")};
};

/// A circle.
struct CircleBlock : DescribedBlock {
  static constexpr char kName[] = "circle";
  static constexpr char kG2oTag[] = "PLUMBLINE_CIRCLE";
  static constexpr char kDescription[] = "Circle: centre and radius";
  static constexpr FeatureTraits kTraits = {FeatureRole::kCircle,
                                            Leading::kPosition};
  static constexpr Quantity kParameters[] = {
      Quantity::Length("x"), Quantity::Length("y"), Quantity::Length("R")};
};

/// A rectangle.
struct RectangleBlock : DescribedBlock {
  static constexpr char kName[] = "rectangle";
  static constexpr char kG2oTag[] = "PLUMBLINE_RECTANGLE";
  static constexpr char kDescription[] =
      "Rectangle: centre, direction, half its size along it and across";
  static constexpr FeatureTraits kTraits = {FeatureRole::kRectangle,
                                            Leading::kFrame};
  static constexpr Quantity kParameters[] = {
      Quantity::Length("x"), Quantity::Length("y"), Quantity::Angle("theta"),
      Quantity::Length("half_length"), Quantity::Length("half_width")};
};

/// A direction shared by walls.
struct OrientationBlock : DescribedBlock {
  static constexpr char kName[] = "orientation";
  static constexpr char kG2oTag[] = "PLUMBLINE_ORIENTATION";
  static constexpr char kDescription[] = "Direction shared by walls, modulo pi";
  static constexpr FeatureTraits kTraits = {FeatureRole::kDirection};
  static constexpr Quantity kParameters[] = {Quantity::Angle("theta")};
  using Manifold = AngleManifold;
};

/// Kinds of block that fit in one place of a relation.
template <typename... BlockTypes>
struct AnyOf {};

/// Blocks that a relation takes, in order: for each of them the kind, or AnyOf
/// several. Kinds that fit in one place have anchors of one size.
template <typename... Places>
struct BlockList {};

/// Blocks that begin with a position.
using PositionBlocks = AnyOf<PointBlock, PoseBlock, CircleBlock>;
/// Blocks that are a frame.
using FrameBlocks = AnyOf<PoseBlock, SegmentBlock>;

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_BLOCKS_H_
