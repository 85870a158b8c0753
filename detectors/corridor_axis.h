#ifndef PLUMBLINE_DETECTORS_CORRIDOR_AXIS_H_
#define PLUMBLINE_DETECTORS_CORRIDOR_AXIS_H_

#include <plumbline/core/wall.h>
#include <plumbline/detectors/wall_faces.h>

#include <Eigen/Core>
#include <cmath>
#include <cstddef>
#include <optional>
#include <vector>

namespace plumbline {

/// The sides of a corridor, as one goes along its axis.
enum CorridorSide : std::size_t { kRightSide = 0, kLeftSide = 1 };

/// Direction of a face of a side, which is seen from within, from that of the
/// axis, rad: 0 on the right, pi on the left. What segment_corridor names its
/// sides by.
double CorridorSideDirection(CorridorSide side);

/// 1 for the right side, -1 for the left one: the sign of how far a point on
/// the side lies to the right of the axis.
double CorridorSideSign(CorridorSide side);

/// Axis and half width of a corridor, m and rad, map frame.
struct CorridorAxis {
  Eigen::Vector2d origin = Eigen::Vector2d::Zero();
  double angle = 0.0;
  double half_width = 0.0;

  Eigen::Vector2d direction() const {
    return {std::cos(angle), std::sin(angle)};
  }
  /// Coordinates of a point along the axis, from the origin, and to its left.
  Eigen::Vector2d Local(const Eigen::Vector2d& point) const;
  /// The part of the axis that the visible part of a wall lies beside.
  Interval IntervalOf(const Wall& wall) const;
  /// Whether the origin of this one lies between the sides of another corridor,
  /// within its interval, and they run the same way.
  bool IsWithin(const CorridorAxis& other, const Interval& interval) const;
};

/// The axis half way between two faces that look at each other, the first one
/// on its right, with its origin beside the middle of what they have in common.
/// The longer one decides its direction.
CorridorAxis AxisBetween(const WallFace& right, const WallFace& left);

/// A face as a side of a corridor sees it.
struct SideFace {
  /// Index of the face, as given.
  std::size_t face = 0;
  CorridorSide side = kRightSide;
  /// Of its visible part along the axis, and of its middle, m.
  Interval interval;
  double along = 0.0;
  /// How far its middle lies past its side, m, and how it is turned against it,
  /// rad.
  double past = 0.0;
  double turn = 0.0;
};

/// A face on the side that it belongs to by its direction.
SideFace OnSide(const CorridorAxis& axis, const WallFace& face,
                std::size_t index);

/// How far a corridor can go from a `part` of its axis: to the nearest walls of
/// its part of the graph that cross it. None when one crosses it within the
/// part.
std::optional<Interval> FreeReach(const CorridorAxis& axis,
                                  const Interval& part,
                                  const std::vector<WallFace>& faces,
                                  std::size_t graph_part);

/// Those of the faces that are joined on to a `part` of the axis, one after the
/// other, across openings of at most `max_opening` (m), in their order.
std::vector<SideFace> JoinedTo(const Interval& part,
                               const std::vector<SideFace>& faces,
                               double max_opening);

/// The smallest interval that contains all of these, of which there is one at
/// least.
Interval Hull(const std::vector<Interval>& intervals);

/// Length of the union of intervals, m.
double UnionLength(std::vector<Interval> intervals);

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_CORRIDOR_AXIS_H_
