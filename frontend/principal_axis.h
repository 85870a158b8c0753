#ifndef PLUMBLINE_FRONTEND_PRINCIPAL_AXIS_H_
#define PLUMBLINE_FRONTEND_PRINCIPAL_AXIS_H_

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

namespace plumbline {

/// The direction in which points of the plane scatter most, and how much they
/// do so along and across it.
struct PrincipalAxis {
  /// Of length 1, at an angle of (-pi/2, pi/2] from x.
  Eigen::Vector2d direction = Eigen::Vector2d::UnitX();
  /// Moments along the direction and across it, in the units of those given.
  double along = 0.0;
  double across = 0.0;  ///< See along; at least 0.
};

/// Of central second moments. The angle is half of atan2(2 xy, xx - yy); its
/// cosine and sine follow from those of the whole by roots alone, to rounding,
/// as this is done for every return.
inline PrincipalAxis PrincipalAxisOf(double xx, double xy, double yy) {
  PrincipalAxis axis;
  const double half_trace = 0.5 * (xx + yy);
  const double half_difference = 0.5 * (xx - yy);
  const double radical = std::sqrt(half_difference * half_difference + xy * xy);
  axis.along = half_trace + radical;
  axis.across = std::max(0.0, half_trace - radical);
  if (!(radical > 0.0)) return axis;
  // The larger of the two first: the other by the double angle's sine.
  const double larger =
      std::sqrt(0.5 * (1.0 + std::abs(half_difference) / radical));
  const double smaller = 0.5 * xy / (radical * larger);
  axis.direction =
      half_difference >= 0.0
          ? Eigen::Vector2d(larger, smaller)
          : Eigen::Vector2d(std::abs(smaller), std::copysign(larger, xy));
  return axis;
}

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_PRINCIPAL_AXIS_H_
