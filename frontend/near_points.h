#ifndef PLUMBLINE_FRONTEND_NEAR_POINTS_H_
#define PLUMBLINE_FRONTEND_NEAR_POINTS_H_

#include <plumbline/frontend/scan_points.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <vector>

namespace plumbline {

/// The points of one scan, in order, to find those near a place.
class NearPoints {
 public:
  /// Points farther from a place than this are not near it, m.
  static constexpr double kGate = 0.3;

  /// Robot's frame.
  explicit NearPoints(const std::vector<ScanPoint>& points) {
    places_.reserve(points.size());
    for (const ScanPoint& point : points) places_.push_back(point.position);
    std::sort(places_.begin(), places_.end(),
              [](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
                return a[0] < b[0];
              });
  }

  /// Least distance from `place` along `normal` of points within the gate, m;
  /// along every direction where the normal is zero. The gate when there is
  /// none.
  double DistanceTo(const Eigen::Vector2d& place,
                    const Eigen::Vector2d& normal) const {
    double least = kGate;
    auto it = std::lower_bound(
        places_.begin(), places_.end(), place[0] - kGate,
        [](const Eigen::Vector2d& a, double x) { return a[0] < x; });
    for (; it != places_.end() && (*it)[0] <= place[0] + kGate; ++it) {
      const Eigen::Vector2d apart = *it - place;
      const double distance = apart.norm();
      if (distance > kGate) continue;
      least = std::min(
          least, normal.isZero() ? distance : std::abs(normal.dot(apart)));
    }
    return least;
  }

 private:
  std::vector<Eigen::Vector2d> places_;
};

/// How far apart, along its normal, a return is where its surface stands and
/// where it goes along with the robot, m: `was` is where the scan before would
/// have had it if it stood, and its own position (robot's frame) where it has
/// it if it goes along. Along every direction where the normal is zero.
inline double ShiftAlongNormal(const ScanPoint& point,
                               const Eigen::Vector2d& was) {
  const Eigen::Vector2d shift = was - point.position;
  return point.normal.isZero() ? shift.norm()
                               : std::abs(point.normal.dot(shift));
}

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_NEAR_POINTS_H_
