#ifndef PLUMBLINE_DETECTORS_RECTANGLE_FIT_H_
#define PLUMBLINE_DETECTORS_RECTANGLE_FIT_H_

#include <plumbline/core/feature.h>
#include <plumbline/core/wall.h>
#include <plumbline/detectors/visible_wall.h>
#include <plumbline/factors/angle.h>

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <vector>

namespace plumbline {

/// A rectangle with the walls on its sides. m, rad, map frame.
struct WalledRectangle {
  /// The sides as the relations name them, counterclockwise: their directions
  /// against that of the rectangle, rad.
  static constexpr int kNumSides = 4;
  static constexpr std::array<double, kNumSides> kSides = {0.0, 0.5 * kPi, kPi,
                                                           -0.5 * kPi};

  /// Middle, and direction of its sides.
  Eigen::Vector2d center = Eigen::Vector2d::Zero();
  double theta = 0.0;
  /// Half its size along theta and across.
  double a = 0.0;
  double b = 0.0;
  /// kNoId for one that is not in the graph yet.
  FeatureId id = kNoId;
  /// A wall on a side: its feature, and where it lies along it from the side's
  /// middle.
  struct Member {
    const Feature* feature = nullptr;
    Interval interval;
    bool is_new = false;
  };
  std::array<std::vector<Member>, kNumSides> sides;

  double area() const { return 4.0 * a * b; }
  /// Of a side, counterclockwise.
  Eigen::Vector2d Direction(int side) const {
    const double angle = theta + kSides[static_cast<std::size_t>(side)];
    return {std::cos(angle), std::sin(angle)};
  }
  /// Of a side, outward.
  Eigen::Vector2d Normal(int side) const {
    const Eigen::Vector2d along = Direction(side);
    return {along.y(), -along.x()};
  }
  double HalfLength(int side) const { return side % 2 == 0 ? a : b; }
  Eigen::Vector2d Middle(int side) const {
    return center + (side % 2 == 0 ? b : a) * Normal(side);
  }
};

/// Area that two rectangles have in common, when their sides are parallel; m^2.
double CommonArea(const WalledRectangle& first, const WalledRectangle& second);

/// The walls of each side, counterclockwise, at least one each.
using WallsOfSides =
    std::array<std::vector<const VisibleWall*>, WalledRectangle::kNumSides>;

/// The rectangle whose sides run through these walls; its direction is within
/// 45 degrees of the map's x axis, so that the same one is written in the same
/// way again. All its members are new, their intervals are not set.
WalledRectangle FitRectangle(const WallsOfSides& walls);

/// Where a wall lies along a side, when it is on it: within `gate` of it across
/// and within `gate_angle` in direction, for half of the shorter of the two.
std::optional<Interval> IntervalOnSide(const VisibleWall& wall,
                                       const WalledRectangle& rectangle,
                                       int side, double gate,
                                       double gate_angle);

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_RECTANGLE_FIT_H_
