#ifndef PLUMBLINE_FACTORS_ANGLE_H_
#define PLUMBLINE_FACTORS_ANGLE_H_

#include <ceres/jet.h>

#include <cmath>

namespace plumbline {

constexpr double kPi = 3.14159265358979323846;

/// Degrees to radians.
constexpr double DegToRad(double degrees) { return degrees * (kPi / 180.0); }

/// Radians to degrees.
constexpr double RadToDeg(double radians) { return radians * (180.0 / kPi); }

/// Wraps `angle` (radians) to the half-open interval (-period/2, period/2],
/// without rounding error whatever the size of the angle. A non-finite angle
/// gives NaN.
inline double WrapAngle(double angle, double period) {
  const double half = 0.5 * period;
  if (angle > -half && angle <= half) return angle;
  const double wrapped = std::remainder(angle, period);  // [-half, half]
  return wrapped > -half ? wrapped : wrapped + period;
}

/// WrapAngle inside automatically differentiated residuals: the derivative is 1
/// everywhere, the value jumps by `period` at the cut.
template <typename T, int N>
ceres::Jet<T, N> WrapAngle(const ceres::Jet<T, N>& angle, double period) {
  ceres::Jet<T, N> wrapped = angle;
  wrapped.a = WrapAngle(angle.a, period);
  return wrapped;
}

/// Wraps a directed angle (radians) to (-pi, pi].
template <typename T>
T NormalizeAngle(const T& angle) {
  return WrapAngle(angle, 2.0 * kPi);
}

/// Wraps an undirected (axial) angle (radians) to (-pi/2, pi/2]: a wall seen
/// from both sides has directions that differ by pi.
template <typename T>
T NormalizeAxial(const T& angle) {
  return WrapAngle(angle, kPi);
}

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_ANGLE_H_
