#ifndef PLUMBLINE_FACTORS_DCS_LOSS_H_
#define PLUMBLINE_FACTORS_DCS_LOSS_H_

#include <ceres/loss_function.h>

#include <cmath>
#include <stdexcept>
#include <string>

namespace plumbline {

/// Dynamic covariance scaling:
///
///                 s <= phi   s > phi
///   loss:         s          phi (3 s - phi) / (phi + s)
///   derivative:   1          (2 phi / (phi + s))^2
///   curvature:    0          -8 phi^2 / (phi + s)^3
///
/// with s the squared whitened residual. Bounded by 3 phi. The derivative is
/// the square of the paper's scale min(1, 2 phi / (phi + s)), and the loss is
/// its integral; weighting s by the squared scale itself, as is sometimes done,
/// is not a loss: its derivative is negative beyond phi. All outputs are finite
/// for every s >= 0. Source: Agarwal, Tipaldi, Spinello, Stachniss, Burgard,
/// Robust map optimization using dynamic covariance scaling, ICRA 2013.
class DcsLoss final : public ceres::LossFunction {
 public:
  /// `phi`: squared whitened residual up to which the loss is quadratic. Throws
  /// std::invalid_argument unless positive and finite.
  explicit DcsLoss(double phi) : phi_(phi) {
    if (!(phi > 0.0) || !std::isfinite(phi)) {
      throw std::invalid_argument(
          "DcsLoss: expected a positive, finite phi, got " +
          std::to_string(phi));
    }
  }

  /// As ceres::LossFunction says.
  void Evaluate(double s, double rho[3]) const override {
    if (s <= phi_) {
      rho[0] = s;
      rho[1] = 1.0;
      rho[2] = 0.0;
      return;
    }
    const double w = phi_ / (phi_ + s);
    rho[0] = phi_ * (3.0 - 4.0 * w);
    rho[1] = 4.0 * w * w;
    rho[2] = -8.0 * w * w / (phi_ + s);
  }

 private:
  double phi_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_DCS_LOSS_H_
