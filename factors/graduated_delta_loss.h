#ifndef PLUMBLINE_FACTORS_GRADUATED_DELTA_LOSS_H_
#define PLUMBLINE_FACTORS_GRADUATED_DELTA_LOSS_H_

#include <ceres/loss_function.h>
#include <ceres/problem.h>
#include <ceres/solver.h>
#include <plumbline/factors/delta_loss.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace plumbline {

/// ContinuousDeltaLoss with its tolerances widened c times, the way in from
/// starts that are many tolerances off:
///
///   loss:       rho(s) = rho_1(s / c^2)
///   derivative: rho'(s) = delta(s / c^2) / c^2
///   curvature:  rho''(s) = rho_1''(s / c^2) / c^4
///
/// with s the squared residual whitened by the narrow tolerance and rho_1
/// ContinuousDeltaLoss. With c = 1 it is that loss. c is read whenever the loss
/// is evaluated and must not change during a solve; SolveGraduated narrows it
/// between solves.
/// Source: ours; graduated non-convexity (Blake and Zisserman 1987) in the
/// tolerance, so that each stage is a problem of its own with a meaning.
class GraduatedDeltaLoss final : public ceres::LossFunction {
 public:
  /// `widening`, c >= 1: not null, must outlive the loss. Throws
  /// std::invalid_argument when it is null or `degrees_of_freedom` < 1.
  GraduatedDeltaLoss(int degrees_of_freedom, const double* widening)
      : loss_(degrees_of_freedom), widening_(widening) {
    if (widening == nullptr) {
      throw std::invalid_argument(
          "GraduatedDeltaLoss: expected the address of a widening, got null");
    }
  }

  /// As ceres::LossFunction says.
  void Evaluate(double s, double rho[3]) const override {
    const double scale = 1.0 / (*widening_ * *widening_);
    loss_.Evaluate(scale * s, rho);
    rho[1] *= scale;
    rho[2] *= scale * scale;
  }

 private:
  ContinuousDeltaLoss loss_;
  const double* widening_;
};

/// Solves a problem whose hypotheses have GraduatedDeltaLoss with this
/// `widening`: first `first` times as wide as they are, then half of that, and
/// so on down to 1, each solve from the last one's result. True hypotheses that
/// start within about `first` tolerances are drawn in, and false ones are let
/// go of as the tolerance comes to lie below what they are off; log2(first) + 1
/// solves. `first`: what the farthest start may be off, over the tolerance.
///
/// Returns the summary of the last solve, with `*widening` at 1; of the first
/// one that failed, with `*widening` where it did. Throws std::invalid_argument
/// unless 1 <= first < infinity.
inline ceres::Solver::Summary SolveGraduated(
    const ceres::Solver::Options& options, double first,
    ceres::Problem* problem, double* widening) {
  if (!(first >= 1.0) || !std::isfinite(first)) {
    throw std::invalid_argument(
        "SolveGraduated: expected a first widening of at least 1, got " +
        std::to_string(first));
  }
  *widening = first;
  ceres::Solver::Summary summary;
  while (true) {
    ceres::Solve(options, problem, &summary);
    if (*widening == 1.0 || !summary.IsSolutionUsable()) return summary;
    *widening = std::max(1.0, 0.5 * *widening);
  }
}

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_GRADUATED_DELTA_LOSS_H_
