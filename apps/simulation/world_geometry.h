#ifndef PLUMBLINE_APPS_SIMULATION_WORLD_GEOMETRY_H_
#define PLUMBLINE_APPS_SIMULATION_WORLD_GEOMETRY_H_

#include <plumbline/apps/simulation/world.h>
#include <plumbline/factors/angle.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <vector>

/// Points and segments of worlds, m.
namespace plumbline::world_geometry {

/// Unit vector in a direction, degrees.
inline Eigen::Vector2d Direction(double degrees) {
  return {std::cos(DegToRad(degrees)), std::sin(DegToRad(degrees))};
}

/// A quarter turn to the left.
inline Eigen::Vector2d LeftOf(const Eigen::Vector2d& v) {
  return {-v.y(), v.x()};
}

/// Of a point from a segment, m.
inline double DistanceToSegment(const Eigen::Vector2d& point,
                                const Eigen::Vector2d& begin,
                                const Eigen::Vector2d& end) {
  const Eigen::Vector2d along = end - begin;
  const double squared = along.squaredNorm();
  const double t =
      squared > 0.0 ? std::clamp((point - begin).dot(along) / squared, 0.0, 1.0)
                    : 0.0;
  return (point - begin - t * along).norm();
}

/// Whether the segments a b and c d cross.
inline bool SegmentsCross(const Eigen::Vector2d& a, const Eigen::Vector2d& b,
                          const Eigen::Vector2d& c, const Eigen::Vector2d& d) {
  const auto side = [](const Eigen::Vector2d& p, const Eigen::Vector2d& q,
                       const Eigen::Vector2d& r) {
    return (q - p).dot(-LeftOf(r - p)) > 0.0;
  };
  return side(a, b, c) != side(a, b, d) && side(c, d, a) != side(c, d, b);
}

/// Of the segments a b and c d, m; 0 where they cross.
inline double SegmentDistance(const Eigen::Vector2d& a,
                              const Eigen::Vector2d& b,
                              const Eigen::Vector2d& c,
                              const Eigen::Vector2d& d) {
  if (SegmentsCross(a, b, c, d)) return 0.0;
  return std::min(
      std::min(DistanceToSegment(a, c, d), DistanceToSegment(b, c, d)),
      std::min(DistanceToSegment(c, a, b), DistanceToSegment(d, a, b)));
}

/// Counterclockwise.
inline std::vector<Eigen::Vector2d> Corners(const WorldBox& box) {
  const Eigen::Vector2d u = Direction(box.angle_deg) * (box.length / 2);
  const Eigen::Vector2d v = LeftOf(Direction(box.angle_deg)) * (box.width / 2);
  return {box.center - u - v, box.center + u - v, box.center + u + v,
          box.center - u + v};
}

}  // namespace plumbline::world_geometry

#endif  // PLUMBLINE_APPS_SIMULATION_WORLD_GEOMETRY_H_
