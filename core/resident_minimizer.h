#ifndef PLUMBLINE_CORE_RESIDENT_MINIMIZER_H_
#define PLUMBLINE_CORE_RESIDENT_MINIMIZER_H_

#include <ceres/problem.h>
#include <ceres/solver.h>
#include <plumbline/core/problem_changes.h>

#include <memory>

namespace plumbline {

/// Levenberg-Marquardt on a ceres::Problem that is solved again and again.
///
/// What does not change between solves is kept: the pattern of the normal
/// matrix, its ordering and its symbolic factorization (CHOLMOD). A residual
/// block that has been removed leaves its place in the pattern empty; new
/// residual blocks between parameter blocks that had one in common find theirs.
/// Only variables that come or go, and pairs that had nothing in common, cause
/// a new analysis. Residuals and Jacobians go into flat arrays; the normal
/// matrix is summed up from them directly.
///
/// Cost functions, losses, manifolds and constant parameter blocks are those of
/// the problem, steps, radii and reasons to stop those of ceres::Solve() with
/// LEVENBERG_MARQUARDT and SPARSE_NORMAL_CHOLESKY: both come to the same
/// minimum. A last step that would but find out that nothing is left is not
/// made where the factorization before it tells so: it would have been
/// evaluated and not taken.
class ResidentMinimizer {
 public:
  /// The problem is not owned and must outlive the minimizer. It may change
  /// between solves. `may_have_bounds`: false where it is known that no
  /// parameter has bounds, which are then not looked for.
  explicit ResidentMinimizer(ceres::Problem* problem,
                             bool may_have_bounds = true);
  ResidentMinimizer(const ResidentMinimizer&) = delete;
  ResidentMinimizer& operator=(const ResidentMinimizer&) = delete;
  ~ResidentMinimizer();

  /// How steps are damped to begin with.
  enum class Damping {
    /// By the initial trust region radius.
    kAsGiven,
    /// By the largest radius, and by the initial one only where the first
    /// factorization finds something that is undetermined or next to it: what
    /// residuals tie weakly, as the far end of a long chain, damping would hold
    /// back for many steps.
    kWhereNeeded,
  };

  /// Optimizes the parameters in place, as ceres::Solve() does; they stay as
  /// they were when the solve fails. Of `options` it heeds the limits of
  /// iterations, time and invalid steps, tolerances, trust region radii, bounds
  /// of the diagonal, jacobi_scaling, use_nonmonotonic_steps with
  /// max_consecutive_nonmonotonic_steps (as Ceres has them; besides, once in a
  /// solve as many steps may be taken without regard to what they cost, up to
  /// twice the lowest cost, to see whether they come to a lower one; ended at
  /// the best state), callbacks and update_state_every_iteration. On
  /// num_threads threads residuals of large problems are evaluated, with the
  /// same result for any number of them; it writes no log. Bounds of parameters
  /// and evaluation callbacks are not supported: the solve fails and says so
  /// (bounds that are set between two solves, when variables stay the same, are
  /// not noticed). Of `summary` it fills in what says how the solve ended:
  /// termination_type, message, costs, iterations, counts of steps and linear
  /// solves, and times. `changes` since the last call may be null: then the
  /// whole problem is read anew.
  void Solve(const ceres::Solver::Options& options,
             ceres::Solver::Summary* summary,
             Damping damping = Damping::kAsGiven,
             const ProblemChanges* changes = nullptr);

  /// Has the next solve analyse the problem anew. To be called when a parameter
  /// block has been freed: another one may come to lie at its address, and
  /// would be taken for it. (The minimum would be the same, but its last digits
  /// would depend on where memory happens to be free.)
  void Forget();

  /// Symbolic analyses so far.
  int num_analyses() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_RESIDENT_MINIMIZER_H_
