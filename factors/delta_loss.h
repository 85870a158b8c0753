#ifndef PLUMBLINE_FACTORS_DELTA_LOSS_H_
#define PLUMBLINE_FACTORS_DELTA_LOSS_H_

#include <ceres/loss_function.h>
#include <plumbline/factors/chi_square.h>

#include <cmath>
#include <stdexcept>
#include <string>

namespace plumbline {

/// The weight of a structure constraint, held during a solve:
///
///   loss:       rho(s) = delta s
///   derivative: rho'(s) = delta
///   curvature:  rho''(s) = 0
///
/// with s the squared whitened residual and delta in [0, 1] the p-value found
/// in the last E-step. It is read from where it is kept whenever the loss is
/// evaluated, so weights change between solves without touching the problem.
/// They must not change during a solve: Ceres needs a constant objective.
/// Source: de la Puente and Rodriguez-Losada 2014, Eq. 8, 9.
class FrozenDeltaLoss final : public ceres::LossFunction {
 public:
  /// `delta`: not null, must outlive the loss.
  explicit FrozenDeltaLoss(const double* delta) : delta_(delta) {
    if (delta == nullptr) {
      throw std::invalid_argument(
          "FrozenDeltaLoss: expected the address of a weight, got null");
    }
  }

  /// As ceres::LossFunction says.
  void Evaluate(double s, double rho[3]) const override {
    rho[0] = *delta_ * s;
    rho[1] = *delta_;
    rho[2] = 0.0;
  }

 private:
  const double* delta_;
};

/// The p-value of a structure constraint as an M-estimator, re-weighted at
/// every step of a solve:
///
///   loss:       rho(s) = s Q(k/2, s/2) + k P(k/2 + 1, s/2)
///   derivative: rho'(s) = Q(k/2, s/2), the p-value delta(s)
///   curvature:  rho''(s) = -f(s; k), f the chi-square density
///
/// with s the squared whitened residual and k the degrees of freedom of the
/// residual: the rank of its information, not its number of rows. Bounded
/// (rho(inf) = k), redescending, without a tuning constant; for k = 2 it is the
/// Welsch kernel with a^2 = 2. The weight at s = k is 0.32, 0.37, 0.39 for
/// k = 1, 2, 3, and a half on average over true constraints: the covariances
/// should be tolerances, not noise levels. All outputs are finite for every
/// s >= 0.
///
/// It works from starts within about three tolerances. Farther away the weight
/// is next to nothing (k = 1: 0.003 at three tolerances, 6e-7 at five, 2e-19 at
/// nine, zero from 39 on): a solve that starts there leaves the hypothesis
/// where it is and reports convergence. GraduatedDeltaLoss is the way in.
/// Source: ours; the p-value of de la Puente and Rodriguez-Losada 2014, Sect.
/// 3, integrated by parts.
class ContinuousDeltaLoss final : public ceres::LossFunction {
 public:
  /// Throws std::invalid_argument when `degrees_of_freedom` < 1.
  explicit ContinuousDeltaLoss(int degrees_of_freedom)
      : degrees_of_freedom_(degrees_of_freedom) {
    internal::CheckDegreesOfFreedom(degrees_of_freedom);
  }

  /// As ceres::LossFunction says.
  void Evaluate(double s, double rho[3]) const override {
    const int k = degrees_of_freedom_;
    const double p_value = ChiSquarePValue(s, k);
    const double density = ChiSquarePdf(s, k);
    if (p_value == 0.0) {
      rho[0] = k;  // Also where s p_value would be infinity times zero.
    } else if (s < k) {
      rho[0] = s * p_value + k * RegularizedGammaP(0.5 * k + 1.0, 0.5 * s);
    } else {
      // P(a + 1, x) = P(a, x) - x^a exp(-x) / Gamma(a + 1): the same without
      // another series; below k the difference would cancel.
      rho[0] = s * p_value + k * (1.0 - p_value) - 2.0 * s * density;
    }
    rho[1] = p_value;
    rho[2] = -density;
  }

 private:
  int degrees_of_freedom_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_DELTA_LOSS_H_
