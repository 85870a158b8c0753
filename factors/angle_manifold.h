#ifndef PLUMBLINE_FACTORS_ANGLE_MANIFOLD_H_
#define PLUMBLINE_FACTORS_ANGLE_MANIFOLD_H_

#include <ceres/manifold.h>
#include <plumbline/factors/angle.h>

#include <algorithm>

namespace plumbline {

/// Manifold of a block of kSize parameters of which one, at the index kAngle,
/// is an angle on the circle; the others are Euclidean. Angles are in radians.
///
///   Plus(x, delta) = x + delta, the angle in (-pi, pi]
///   Minus(y, x)    = y - x, the difference of angles in (-pi, pi]
///
/// Both Jacobians are the identity.
template <int kSize, int kAngle>
class WrappedAngleManifold : public ceres::Manifold {
 public:
  static_assert(0 <= kAngle && kAngle < kSize, "no such parameter");

  /// Number of parameters, as they are and as steps.
  int AmbientSize() const override { return kSize; }
  int TangentSize() const override { return kSize; }

  /// x with delta added, the angle in (-pi, pi].
  bool Plus(const double* x, const double* delta,
            double* x_plus_delta) const override {
    for (int i = 0; i < kSize; ++i) x_plus_delta[i] = x[i] + delta[i];
    x_plus_delta[kAngle] = NormalizeAngle(x_plus_delta[kAngle]);
    return true;
  }

  /// The identity.
  bool PlusJacobian(const double* /*x*/, double* jacobian) const override {
    SetIdentity(jacobian);
    return true;
  }

  /// Copies the matrix.
  bool RightMultiplyByPlusJacobian(const double* /*x*/, const int num_rows,
                                   const double* ambient_matrix,
                                   double* tangent_matrix) const override {
    std::copy(ambient_matrix, ambient_matrix + num_rows * kSize,
              tangent_matrix);
    return true;
  }

  /// y - x, the difference of angles in (-pi, pi].
  bool Minus(const double* y, const double* x,
             double* y_minus_x) const override {
    for (int i = 0; i < kSize; ++i) y_minus_x[i] = y[i] - x[i];
    y_minus_x[kAngle] = NormalizeAngle(y_minus_x[kAngle]);
    return true;
  }

  /// The identity.
  bool MinusJacobian(const double* /*x*/, double* jacobian) const override {
    SetIdentity(jacobian);
    return true;
  }

 private:
  static void SetIdentity(double* jacobian) {
    std::fill(jacobian, jacobian + kSize * kSize, 0.0);
    for (int i = 0; i < kSize; ++i) jacobian[i * kSize + i] = 1.0;
  }
};

/// The circle: one angle, rad. For orientations.
class AngleManifold final : public WrappedAngleManifold<1, 0> {};

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_ANGLE_MANIFOLD_H_
