#ifndef PLUMBLINE_FACTORS_GEMAN_MCCLURE_LOSS_H_
#define PLUMBLINE_FACTORS_GEMAN_MCCLURE_LOSS_H_

#include <ceres/loss_function.h>

#include <cmath>
#include <stdexcept>
#include <string>

namespace plumbline {

/// Geman-McClure kernel:
///
///   loss:       rho(s) = a^2 s / (a^2 + s)
///   derivative: rho'(s) = (a^2 / (a^2 + s))^2
///   curvature:  rho''(s) = -2 a^4 / (a^2 + s)^3
///
/// with s the squared whitened residual. Bounded by a^2; the weight is 1/4 at
/// |r| = a. All outputs are finite for every s >= 0.
/// Source: Geman and McClure 1985, scaled so that rho'(0) = 1 (Zhang 1997).
class GemanMcClureLoss final : public ceres::LossFunction {
 public:
  /// `a`: scale of the residual in standard deviations. Throws
  /// std::invalid_argument unless positive and finite.
  explicit GemanMcClureLoss(double a) : squared_scale_(a * a) {
    if (!(a > 0.0) || !std::isfinite(squared_scale_) || squared_scale_ == 0.0) {
      throw std::invalid_argument(
          "GemanMcClureLoss: expected a positive, finite scale, got " +
          std::to_string(a));
    }
  }

  /// As ceres::LossFunction says.
  void Evaluate(double s, double rho[3]) const override {
    const double b = squared_scale_;
    const double w = b / (b + s);
    // Neither form overflows, cancels or divides infinities where it is used.
    rho[0] = s < b ? s * w : b * (1.0 - w);
    rho[1] = w * w;
    rho[2] = -2.0 * w * w / (b + s);
  }

 private:
  double squared_scale_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_GEMAN_MCCLURE_LOSS_H_
