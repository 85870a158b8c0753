#ifndef PLUMBLINE_FACTORS_ROLES_H_
#define PLUMBLINE_FACTORS_ROLES_H_

namespace plumbline {

/// Meaning of a feature, whatever its type is called: detectors, drawings
/// and reports ask for this. Each role but kOther says what the parameters
/// begin with; a type may have more after that. The roles are those of the
/// plane; a type of space is kOther until there is code that asks for it.
enum class FeatureRole {
  kOther,
  /// A point: x, y.
  kPoint,
  /// Where the robot was: x, y, theta.
  kPose,
  /// A straight wall: a frame on it (FeatureType::frame), and a visible part
  /// along the x axis of this frame (Feature::extent_begin, extent_end).
  kWall,
  /// A circle: x, y, radius.
  kCircle,
  /// A rectangle: x, y, theta, half its size along theta and across.
  kRectangle,
  /// A direction that others share, modulo pi: theta.
  kDirection
};

/// Parameters that those of a feature begin with.
enum class Leading {
  kOther,
  /// A position of the plane: x, y.
  kPosition,
  /// A frame of the plane: x, y, theta.
  kFrame
};

/// Traits of a feature type that other code relies on.
struct FeatureTraits {
  FeatureRole role = FeatureRole::kOther;
  Leading leading = Leading::kOther;
  /// A wall that knows the side from which it was seen: the left of its
  /// direction.
  bool is_one_sided = false;
};

/// Meaning of a relation, whatever it is called: detectors look up the relation
/// with this meaning between the types of features that they have.
enum class RelationRole {
  kOther,
  /// The expected value is where the last feature is, in the frame of the first
  /// or, when it is the only one, in the map: x, y, theta. A start of the whole
  /// graph takes poses from these (core/initial_guess.h), which is planar.
  kPose,
  /// The expected value is the position of the second feature in the frame of
  /// the first: x, y. Planar as well.
  kPosition,
  /// Both features are at the same place: their positions differ by the
  /// expected value.
  kCoincidence,
  /// The first feature, a point, is the expected distance away from the second,
  /// a line or a circle.
  kOnCurve,
  /// Both features are one wall.
  kSameWall,
  /// The first feature has the direction of the second, a direction, but for
  /// the expected value.
  kDirection,
  /// The expected value is the angle from the first direction to the second.
  kAngle,
  /// The first feature, a wall, is on a side of the second, a rectangle: row 1
  /// of the expected value is the direction of the side from that of the
  /// rectangle, counterclockwise.
  kSide
};

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_ROLES_H_
