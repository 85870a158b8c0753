#ifndef PLUMBLINE_CORE_FLAT_EVALUATOR_H_
#define PLUMBLINE_CORE_FLAT_EVALUATOR_H_

#include <plumbline/core/flat_problem.h>
#include <plumbline/core/normal_matrix.h>
#include <plumbline/core/parallel_for.h>

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <memory>
#include <vector>

namespace plumbline {

/// Evaluates the terms of a FlatProblem: their cost, and their linearization,
/// summed up in a normal matrix and a gradient. Of large problems several
/// threads evaluate; terms are summed up in their order by one of them, so that
/// results do not depend on the number of threads.
class FlatEvaluator {
 public:
  /// The problem is not owned and must outlive this.
  explicit FlatEvaluator(const FlatProblem* problem) : problem_(*problem) {}

  /// 1 until it is set.
  void SetNumThreads(int num_threads);

  /// Takes note of what the problem is since it was read.
  void MakeRoom();

  /// Half the sum of the squares at a state, each with its loss, over the terms
  /// that vary, or with `is_fixed` over those that do not; false when a term
  /// cannot be evaluated or the sum is no number.
  bool Cost(bool is_fixed, const Eigen::VectorXd& state, double* cost);

  /// Cost of the terms that vary, with the normal matrix and the gradient with
  /// respect to tangents, in the columns of the matrix; robust losses correct
  /// residuals and Jacobians as Ceres has it (Triggs et al. 1999). Threads
  /// begin to evaluate while `prepare` (may be null) makes the matrix ready for
  /// the problem; what it returns is whether it could. False when it could not,
  /// or as for Cost.
  bool Linearize(const Eigen::VectorXd& state,
                 const std::function<bool()>& prepare, NormalMatrix* matrix,
                 Eigen::VectorXd* gradient, double* cost);

 private:
  // What a thread needs while it evaluates a term.
  struct alignas(kCacheLine) Scratch {
    std::vector<double> residual;
    std::vector<double> jacobians;
    std::vector<double*> jacobian_pointers;
    std::vector<const double*> argument_pointers;
  };
  class Pipeline;

  // Residual, its squared norm and its Jacobians (may be null).
  bool EvaluateTerm(const FlatProblem::Term& term, const double* state,
                    double* residual, double** jacobians, Scratch* scratch,
                    double* squared) const;
  bool CostOf(const FlatProblem::Term& term, const double* state,
              Scratch* scratch, double* cost) const;
  bool ParallelCost(const Eigen::VectorXd& state, double* cost);
  bool FindPlusJacobians(const Eigen::VectorXd& state);
  bool LinearizeTerm(const FlatProblem::Term& term, const double* state,
                     double* linearized, Scratch* scratch) const;
  void AddTerm(const FlatProblem::Term& term, const double* linearized,
               NormalMatrix* matrix, Eigen::VectorXd* gradient, double* cost);
  bool IsLarge() const;

  const FlatProblem& problem_;
  int num_threads_ = 1;
  std::unique_ptr<ThreadTeam> team_;
  std::vector<Scratch> scratch_;
  // Jacobians of Plus at the state, and of which variables they are the
  // identity.
  std::vector<double> plus_jacobians_;
  std::vector<char> is_identity_;
  // Numbers of a linearized term: its cost, its residual and its Jacobians with
  // respect to tangents, each where the FlatProblem has that of the block.
  std::size_t stride_ = 0;
  std::vector<double> linearized_;
  std::vector<const double*> added_pointers_;
  // Of single terms, to be summed up in order.
  std::vector<double> costs_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_FLAT_EVALUATOR_H_
