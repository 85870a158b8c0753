#ifndef PLUMBLINE_CORE_WALL_H_
#define PLUMBLINE_CORE_WALL_H_

#include <plumbline/core/feature.h>
#include <plumbline/factors/pose2.h>

#include <Eigen/Core>
#include <algorithm>
#include <optional>
#include <utility>

namespace plumbline {

/// An interval along a wall, m: begin and end.
using Interval = std::pair<double, double>;

/// Length that two intervals have in common, m; negative for the gap between
/// them.
inline double Overlap(const Interval& a, const Interval& b) {
  return std::min(a.second, b.second) - std::max(a.first, b.first);
}

/// The point of a line (d, alpha) that is nearest to its anchor: d to the left
/// of the direction alpha (Eq. 12). m, rad, map frame.
Eigen::Vector2d FootPoint(const Eigen::Vector2d& anchor, double d,
                          double alpha);

/// Geometry of a straight wall in the plane: a point on it, its direction, and
/// the part of it that was seen. m, rad, any one frame.
struct Wall {
  Eigen::Vector2d position = Eigen::Vector2d::Zero();
  double angle = 0.0;
  /// (cos(angle), sin(angle)).
  Eigen::Vector2d direction = Eigen::Vector2d::UnitX();
  /// The visible part, along `direction` from `position`.
  double begin = 0.0;
  double end = 0.0;

  /// To the left of the direction: for a segment the side it was seen from.
  Eigen::Vector2d normal() const { return {-direction.y(), direction.x()}; }
  double length() const { return end - begin; }
  Pose2 pose() const { return Pose2(position.x(), position.y(), angle); }
  /// The point of the wall at `along`.
  Eigen::Vector2d At(double along) const {
    return position + along * direction;
  }
  Eigen::Vector2d Middle() const { return At(0.5 * (begin + end)); }
  /// Where a point lies along the wall, and how far to the left of it.
  double Along(const Eigen::Vector2d& point) const {
    return direction.dot(point - position);
  }
  double Across(const Eigen::Vector2d& point) const {
    return normal().dot(point - position);
  }
  /// Where the visible part of another wall lies along this one, begin <= end.
  /// Works on differences of positions, so nothing is lost far from the origin.
  Interval IntervalOf(const Wall& other) const {
    const Eigen::Vector2d relative = other.position - position;
    const double a = direction.dot(relative + other.begin * other.direction);
    const double b = direction.dot(relative + other.end * other.direction);
    return {std::min(a, b), std::max(a, b)};
  }
};

/// A wall through `position` in the direction `angle`.
Wall MakeWall(const Eigen::Vector2d& position, double angle, double begin,
              double end);

/// A pose on the wall, x along it.
Wall MakeWall(const Pose2& pose, double begin, double end);

/// The wall that a feature is; none for one without FeatureRole::kWall. The
/// visible part is the feature's extent as it stands, which may be empty or
/// infinite.
std::optional<Wall> WallOf(const Feature& feature);

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_WALL_H_
