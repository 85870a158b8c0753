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

/// Wraps `angle` (radians) to the half-open interval (-period/2, period/2].
/// The derivative is 1 everywhere, so it is safe inside automatically
/// differentiated residuals; the value jumps by `period` at the cut.
/// A non-finite angle is returned as NaN.
template <typename T>
T WrapAngle(const T& angle, double period) {
  using std::ceil;
  // ceil's derivative is zero almost everywhere (Ceres' jets agree), so only
  // the subtraction carries derivatives.
  T wrapped = angle - period * ceil(angle / period - 0.5);
  // One rounding step away from the cut the quotient can be off by one.
  if (wrapped <= T(-period / 2)) wrapped += T(period);
  if (wrapped > T(period / 2)) wrapped -= T(period);
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
