#include <ceres/iteration_callback.h>
#include <ceres/manifold.h>
#include <plumbline/core/flat_evaluator.h>
#include <plumbline/core/flat_problem.h>
#include <plumbline/core/normal_matrix.h>
#include <plumbline/core/resident_minimizer.h>
#include <plumbline/core/stopwatch.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

// Pivots of the scaled normal matrix, relative to the largest, below which they
// may be those of an undetermined direction and rounding.
constexpr double kLeastPivot = 1e-12;
// What a step may raise the cost to that is hoped to be made up for.
constexpr double kLargestRise = 2.0;
// Steps that promise less than this many times what ends a solve may be the
// last one.
constexpr double kMayBeLast = 2.0;
// What the last factorization promises of another step, over the change that
// ends a solve, below which none is made; how much of the cost the last step
// may have changed then, and how far from its promise.
constexpr double kNotWorthAStep = 0.5;
constexpr double kSmallChange = 0.1;
constexpr double kKeptPromise = 0.25;

using Variable = FlatProblem::Variable;

// Whether a step is good enough, also with respect to the last states when some
// may be worse (Conn, Gould, Toint, Trust Region Methods, algorithm 10.1.2).
class StepJudge {
 public:
  StepJudge(double cost, int max_uphill)
      : max_uphill_(max_uphill),
        minimum_(cost),
        current_(cost),
        reference_(cost),
        candidate_(cost) {}

  double Quality(double cost, double model_change) const {
    if (!(cost < std::numeric_limits<double>::max())) {
      return -std::numeric_limits<double>::max();
    }
    const double quality = (current_ - cost) / model_change;
    const double over_several =
        (reference_ - cost) / (since_reference_ + model_change);
    return std::max(quality, over_several);
  }

  void Accept(double cost, double model_change) {
    current_ = cost;
    since_candidate_ += model_change;
    since_reference_ += model_change;
    if (current_ < minimum_) {
      minimum_ = current_;
      uphill_ = 0;
      candidate_ = current_;
      since_candidate_ = 0.0;
    } else {
      ++uphill_;
      if (current_ > candidate_) {
        candidate_ = current_;
        since_candidate_ = 0.0;
      }
    }
    if (uphill_ == max_uphill_) {
      reference_ = candidate_;
      since_reference_ = since_candidate_;
    }
  }

 private:
  int max_uphill_;
  double minimum_;
  double current_;
  double reference_;
  double candidate_;
  double since_reference_ = 0.0;
  double since_candidate_ = 0.0;
  int uphill_ = 0;
};

}  // namespace

struct ResidentMinimizer::Impl {
  class Minimization;

  Impl(ceres::Problem* problem, bool may_have_bounds)
      : flat(problem, may_have_bounds), evaluator(&flat) {}

  // Reads the problem as it is now; empty when it can be solved, or why not.
  // What is as it was at the last solve is taken over.
  std::string Read(const ProblemChanges* changes) {
    std::string fault =
        flat.Read(matrix.is_analysed() && !is_forgotten, changes);
    if (flat.is_unchanged()) return fault;
    has_places =
        fault.empty() && flat.has_same_variables() && matrix.FindPlaces(flat);
    if (fault.empty() && flat.has_same_variables() && !has_places) {
      // What is analysed anew does not depend on what was before.
      fault = flat.ReadAnew();
    }
    if (!fault.empty()) {
      is_forgotten = true;
      return fault;
    }
    state.resize(flat.state_size());
    evaluator.MakeRoom();
    // Until it is analysed the matrix is that of another problem.
    is_forgotten = !has_places;
    return {};
  }

  // Normal matrix and gradient at the state, unscaled. The first time after the
  // problem was read, the matrix is analysed where it has to be.
  bool Linearize(double* cost) {
    is_too_large = false;
    const auto analyse = [this] {
      if (has_places) return true;
      is_undetermined = false;
      has_places = matrix.Analyse(flat);
      is_too_large = is_forgotten = !has_places;
      return has_places;
    };
    return evaluator.Linearize(state, analyse, &matrix, &gradient, cost);
  }

  // The same at another state, beside those of the state; exchanged for them by
  // SwapLinearization().
  bool LinearizeBeside(const Eigen::VectorXd& other, double* cost) {
    SwapLinearization();
    const bool is_done =
        evaluator.Linearize(other, nullptr, &matrix, &gradient, cost);
    SwapLinearization();
    return is_done;
  }

  void SwapLinearization() {
    matrix.SwapEntries();
    gradient.swap(other_gradient);
  }

  bool Plus(const Eigen::VectorXd& x, const Eigen::VectorXd& delta,
            Eigen::VectorXd* sum) const {
    for (std::size_t v = 0; v < flat.variables().size(); ++v) {
      const Variable& variable = flat.variables()[v];
      const double* const from = x.data() + variable.state;
      const double* const step =
          delta.data() + matrix.ColumnOf(static_cast<int>(v));
      double* const to = sum->data() + variable.state;
      if (variable.manifold != nullptr) {
        if (!variable.manifold->Plus(from, step, to)) return false;
      } else {
        for (int i = 0; i < variable.size; ++i) to[i] = from[i] + step[i];
      }
    }
    return true;
  }

  double GradientMaxNorm() {
    double norm = 0.0;
    for (std::size_t v = 0; v < flat.variables().size(); ++v) {
      const Variable& variable = flat.variables()[v];
      const double* const from = state.data() + variable.state;
      const double* const slope =
          gradient.data() + matrix.ColumnOf(static_cast<int>(v));
      moved.resize(static_cast<std::size_t>(variable.size));
      if (variable.manifold != nullptr) {
        step.assign(slope, slope + variable.manifold->TangentSize());
        for (double& component : step) component = -component;
        if (!variable.manifold->Plus(from, step.data(), moved.data())) {
          return gradient.lpNorm<Eigen::Infinity>();
        }
      } else {
        for (int i = 0; i < variable.size; ++i) moved[i] = from[i] - slope[i];
      }
      for (int i = 0; i < variable.size; ++i) {
        norm = std::max(norm, std::abs(moved[i] - from[i]));
      }
    }
    return norm;
  }

  void TakeState() {
    for (const Variable& variable : flat.variables()) {
      std::copy_n(variable.user, variable.size, state.data() + variable.state);
    }
  }

  void GiveState(const Eigen::VectorXd& x) const {
    for (const Variable& variable : flat.variables()) {
      std::copy_n(x.data() + variable.state, variable.size, variable.user);
    }
  }

  FlatProblem flat;
  FlatEvaluator evaluator;
  NormalMatrix matrix;
  bool is_forgotten = false;
  // Whether the matrix has a place for each product of the problem as it was
  // read last; whether it is too large for that.
  bool has_places = false;
  bool is_too_large = false;
  // Whether damping alone holds something; known until the next analysis.
  bool is_undetermined = false;

  Eigen::VectorXd state;
  // Of one variable, to measure the gradient by.
  std::vector<double> step;
  std::vector<double> moved;
  Eigen::VectorXd gradient;
  Eigen::VectorXd other_gradient;
};

// One solve: the loop of Ceres' trust region minimizer, by the same names.
class ResidentMinimizer::Impl::Minimization {
 public:
  // All must outlive it; `summary` is as it is made.
  Minimization(const ceres::Solver::Options& options, Damping damping,
               const ProblemChanges* changes, Impl* m,
               ceres::Solver::Summary* summary)
      : options_(options),
        damping_(damping),
        changes_(changes),
        m_(*m),
        summary_(*summary),
        radius_(options.initial_trust_region_radius) {}

  void Run() {
    if (Init()) {
      Minimize();
      Finish();
    }
    summary_.total_time_in_seconds = watch_.Seconds();
  }

 private:
  // Reads the problem and linearizes it where it is; false when there is
  // nothing to minimize, or it cannot be.
  bool Init() {
    summary_.num_successful_steps = 0;
    summary_.num_unsuccessful_steps = 0;
    summary_.num_linear_solves = 0;
    summary_.num_jacobian_evaluations = 0;
    summary_.num_residual_evaluations = 0;
    summary_.linear_solver_time_in_seconds = 0.0;
    summary_.residual_evaluation_time_in_seconds = 0.0;
    summary_.jacobian_evaluation_time_in_seconds = 0.0;
    std::string fault;
    m_.evaluator.SetNumThreads(options_.num_threads);
    if (options_.IsValid(&fault)) {
      fault = m_.Read(changes_);
    } else {
      // Whoever tells of changes takes them for read.
      m_.is_forgotten = true;
    }
    if (!fault.empty()) return End(ceres::FAILURE, fault);
    m_.TakeState();
    summary_.fixed_cost = 0.0;
    if (!m_.evaluator.Cost(/*is_fixed=*/true, m_.state, &summary_.fixed_cost)) {
      return End(ceres::FAILURE, "Evaluation of the fixed residuals failed.");
    }
    summary_.num_parameter_blocks_reduced =
        static_cast<int>(m_.flat.variables().size());
    summary_.num_residual_blocks_reduced = m_.flat.num_reduced_terms();
    summary_.num_effective_parameters_reduced = m_.flat.num_columns();
    summary_.initial_cost = summary_.final_cost = summary_.fixed_cost;
    summary_.preprocessor_time_in_seconds = watch_.Seconds();
    if (m_.flat.variables().empty()) {
      return End(ceres::CONVERGENCE, "No parameter block varies.");
    }
    if (!Linearize()) {
      return End(ceres::FAILURE, m_.is_too_large
                                     ? "The normal matrix is too large."
                                     : "Residual and Jacobian evaluation "
                                       "failed at the initial state.");
    }
    summary_.initial_cost = cost_ + summary_.fixed_cost;

    const int n = m_.flat.num_columns();
    scale_ = Eigen::VectorXd::Ones(n);
    if (options_.jacobi_scaling) {
      for (int c = 0; c < n; ++c) {
        scale_[c] = 1.0 / (1.0 + std::sqrt(m_.matrix.Diagonal(c)));
      }
    }
    normal_diagonal_.resize(n);
    Rescale();
    judge_.emplace(cost_, options_.use_nonmonotonic_steps
                              ? options_.max_consecutive_nonmonotonic_steps
                              : 0);
    best_cost_ = cost_;
    best_ = m_.state;
    candidate_ = m_.state;
    y_.resize(n);
    return true;
  }

  void Minimize() {
    StartIteration(0);
    NoteLinearization();
    while (FinalizeIterationAndCheckIfMinimizerCanContinue()) {
      if (IsAtTheEnd()) return;
      StartIteration(step_.iteration + 1);
      if (!ComputeStep()) {
        if (!HandleInvalidStep()) return;
        continue;
      }
      ComputeCandidate();
      if (excursion_ == 0 &&
          (ParameterToleranceReached() || FunctionToleranceReached())) {
        return;
      }
      step_.relative_decrease = judge_->Quality(candidate_cost_, model_change_);
      if (step_.relative_decrease > options_.min_relative_decrease ||
          MayLeadUphill()) {
        if (!HandleSuccessfulStep()) return;
      } else {
        HandleUnsuccessfulStep();
      }
    }
  }

  // Leaves the best state, or what there was before.
  void Finish() {
    if (is_usable_) {
      m_.GiveState(best_);
    } else {
      m_.TakeState();
    }
    summary_.final_cost = best_cost_ + summary_.fixed_cost;
    summary_.minimizer_time_in_seconds =
        watch_.Seconds() - summary_.preprocessor_time_in_seconds;
  }

  // The gradient is that of the iteration before until there is another one.
  void StartIteration(int iteration) {
    const double gradient_max_norm = step_.gradient_max_norm;
    const double gradient_norm = step_.gradient_norm;
    step_ = ceres::IterationSummary();
    step_.iteration = iteration;
    step_.gradient_max_norm = gradient_max_norm;
    step_.gradient_norm = gradient_norm;
    step_.cost = cost_ + summary_.fixed_cost;
    step_.cost_change = 0.0;
    step_.relative_decrease = 0.0;
    step_.step_is_valid = false;
    step_.step_is_successful = false;
    step_.linear_solver_iterations = iteration == 0 ? 0 : 1;
  }

  // Tells the callbacks of the iteration, and whether to go on, asked in the
  // order in which Ceres asks.
  bool FinalizeIterationAndCheckIfMinimizerCanContinue() {
    step_.cumulative_time_in_seconds = watch_.Seconds();
    if (options_.update_state_every_iteration && step_.step_is_successful) {
      m_.GiveState(m_.state);
    }
    summary_.iterations.push_back(step_);
    ceres::CallbackReturnType answer = ceres::SOLVER_CONTINUE;
    for (ceres::IterationCallback* const callback : options_.callbacks) {
      answer = (*callback)(step_);
      if (answer != ceres::SOLVER_CONTINUE) break;
    }
    if (answer == ceres::SOLVER_ABORT) {
      is_usable_ = false;
      return End(ceres::USER_FAILURE, "User callback returned SOLVER_ABORT.");
    }
    if (answer == ceres::SOLVER_TERMINATE_SUCCESSFULLY) {
      return End(ceres::USER_SUCCESS,
                 "User callback returned SOLVER_TERMINATE_SUCCESSFULLY.");
    }
    if (watch_.Seconds() >= options_.max_solver_time_in_seconds) {
      return End(ceres::NO_CONVERGENCE, "Maximum solver time reached.");
    }
    if (step_.iteration >= options_.max_num_iterations) {
      return End(ceres::NO_CONVERGENCE,
                 "Maximum number of iterations reached.");
    }
    if ((step_.step_is_successful || step_.iteration == 0) && excursion_ == 0 &&
        step_.gradient_max_norm <= options_.gradient_tolerance) {
      return End(ceres::CONVERGENCE, "Gradient tolerance reached.");
    }
    if (radius_ <= options_.min_trust_region_radius) {
      return End(ceres::CONVERGENCE, "Minimum trust region radius reached.");
    }
    return true;
  }

  // Whether another step would change the cost by much less than what ends a
  // solve, by the last factorization: after a step that kept its promise the
  // matrix is nearly the same. It saves the factorization and the evaluation
  // that would find it out.
  bool IsAtTheEnd() {
    if (!step_.step_is_successful || excursion_ > 0 ||
        std::abs(step_.cost_change - model_change_) >
            kKeptPromise * model_change_ ||
        step_.cost_change > kSmallChange * cost_ ||
        !m_.matrix.SolveAgain(-scaled_gradient_, &y_)) {
      return false;
    }
    const double promised = -0.5 * scaled_gradient_.dot(y_);
    if (!(promised <= kNotWorthAStep * options_.function_tolerance * cost_)) {
      return false;
    }
    return !End(ceres::CONVERGENCE, "Function tolerance reached.");
  }

  // False when it leads nowhere.
  bool ComputeStep() {
    const ScopedTimer timer(&summary_.linear_solver_time_in_seconds);
    bool is_solved = false;
    if (step_.iteration == 1 && damping_ == Damping::kWhereNeeded &&
        !m_.is_undetermined) {
      const double given = radius_;
      radius_ = options_.max_trust_region_radius;
      is_solved = SolveDamped() && m_.matrix.LeastPivot() > kLeastPivot;
      if (!is_solved) {
        m_.is_undetermined = true;
        radius_ = given;
      }
    }
    if (!is_solved && !SolveDamped()) return false;
    // With (H + D) y = -g:  -g'y - y'Hy/2 = -g'y/2 + y'Dy/2.
    model_change_ = 0.5 * (y_.dot(normal_diagonal_.cwiseProduct(y_)) / radius_ -
                           scaled_gradient_.dot(y_));
    step_.step_is_valid = model_change_ > 0.0;
    return step_.step_is_valid;
  }

  bool SolveDamped() {
    ++summary_.num_linear_solves;
    return m_.matrix.SolveDamped(scale_, normal_diagonal_ / radius_,
                                 -scaled_gradient_, &y_);
  }

  void ComputeCandidate() {
    invalid_steps_ = 0;
    const Eigen::VectorXd delta = scale_.cwiseProduct(y_);
    is_linearized_ = false;
    if (!m_.Plus(m_.state, delta, &candidate_) || !candidate_.allFinite()) {
      candidate_cost_ = std::numeric_limits<double>::max();
    } else {
      EvaluateCandidate();
    }
    step_.step_norm = (candidate_ - m_.state).norm();
    step_.cost_change = cost_ - candidate_cost_;
  }

  // Most steps are taken, and need the linearization as well as the cost: both
  // come at once unless the step may be the last one.
  void EvaluateCandidate() {
    if (decrease_factor_ == kFirstDecrease &&
        model_change_ > kMayBeLast * options_.function_tolerance * cost_) {
      const ScopedTimer timer(&summary_.jacobian_evaluation_time_in_seconds);
      ++summary_.num_jacobian_evaluations;
      is_linearized_ = m_.LinearizeBeside(candidate_, &candidate_cost_);
      if (is_linearized_) return;
    }
    const ScopedTimer timer(&summary_.residual_evaluation_time_in_seconds);
    ++summary_.num_residual_evaluations;
    if (!m_.evaluator.Cost(/*is_fixed=*/false, candidate_, &candidate_cost_)) {
      candidate_cost_ = std::numeric_limits<double>::max();
    }
  }

  bool ParameterToleranceReached() {
    // A candidate that is no number is none to stop at.
    if (!(step_.step_norm <=
          options_.parameter_tolerance *
              (m_.state.norm() + options_.parameter_tolerance))) {
      return false;
    }
    End(ceres::CONVERGENCE, "Parameter tolerance reached.");
    return true;
  }

  bool FunctionToleranceReached() {
    if (!(std::abs(step_.cost_change) <= options_.function_tolerance * cost_)) {
      return false;
    }
    End(ceres::CONVERGENCE, "Function tolerance reached.");
    return true;
  }

  // False when there were too many in a row.
  bool HandleInvalidStep() {
    if (++invalid_steps_ >= options_.max_num_consecutive_invalid_steps) {
      ++summary_.num_unsuccessful_steps;
      is_usable_ = false;
      return End(ceres::FAILURE,
                 "Number of consecutive invalid steps more than allowed.");
    }
    HandleUnsuccessfulStep();
    return true;
  }

  // Whether a step that is not good enough may be the first of some that come
  // to a lower cost (Chamberlain et al. 1982, "The watchdog technique"): what
  // one of them leaves, as where headings turn, the next one puts right. Once
  // they did not, there are no others.
  bool MayLeadUphill() {
    if (!options_.use_nonmonotonic_steps || has_returned_ ||
        !(candidate_cost_ <= kLargestRise * best_cost_)) {
      return false;
    }
    excursion_ = std::max(excursion_, 1);
    return true;
  }

  // Back to the best state, to go on from there with shorter steps; false when
  // nothing can be computed there.
  bool ReturnToBest() {
    has_returned_ = true;
    excursion_ = 0;
    m_.state = best_;
    if (!Linearize()) return false;
    Rescale();
    judge_.emplace(cost_, options_.max_consecutive_nonmonotonic_steps);
    radius_ /= decrease_factor_;
    decrease_factor_ *= 2.0;
    return true;
  }

  void HandleUnsuccessfulStep() {
    ++summary_.num_unsuccessful_steps;
    radius_ /= decrease_factor_;
    decrease_factor_ *= 2.0;
    step_.trust_region_radius = radius_;
  }

  // Goes there; false when nothing can be computed there.
  bool HandleSuccessfulStep() {
    step_.step_is_successful = true;
    step_.step_is_nonmonotonic = candidate_cost_ >= best_cost_;
    ++summary_.num_successful_steps;
    m_.state = candidate_;
    judge_->Accept(candidate_cost_, model_change_);
    if (is_linearized_) {
      m_.SwapLinearization();
      cost_ = candidate_cost_;
    } else if (!Linearize()) {
      is_usable_ = false;
      return End(ceres::FAILURE,
                 "Residual and Jacobian evaluation failed after a step.");
    }
    Rescale();
    if (step_.relative_decrease > options_.min_relative_decrease) {
      radius_ = std::min(
          options_.max_trust_region_radius,
          radius_ /
              std::max(1.0 / 3.0,
                       1.0 - std::pow(2.0 * step_.relative_decrease - 1.0, 3)));
      decrease_factor_ = kFirstDecrease;
    }
    if (cost_ < best_cost_) {
      best_cost_ = cost_;
      best_ = m_.state;
      excursion_ = 0;
    } else if (excursion_ > 0 &&
               excursion_++ == options_.max_consecutive_nonmonotonic_steps &&
               !ReturnToBest()) {
      is_usable_ = false;
      return End(ceres::FAILURE,
                 "Residual and Jacobian evaluation failed at the best state.");
    }
    NoteLinearization();
    return true;
  }

  bool Linearize() {
    const ScopedTimer timer(&summary_.jacobian_evaluation_time_in_seconds);
    ++summary_.num_jacobian_evaluations;
    return m_.Linearize(&cost_);
  }

  void Rescale() {
    scaled_gradient_ = scale_.cwiseProduct(m_.gradient);
    for (int c = 0; c < m_.flat.num_columns(); ++c) {
      normal_diagonal_[c] =
          std::clamp(m_.matrix.Diagonal(c) * scale_[c] * scale_[c],
                     options_.min_lm_diagonal, options_.max_lm_diagonal);
    }
  }

  void NoteLinearization() {
    step_.cost = cost_ + summary_.fixed_cost;
    step_.gradient_max_norm = m_.GradientMaxNorm();
    step_.gradient_norm = m_.gradient.norm();
    step_.trust_region_radius = radius_;
  }

  // How the solve ends; false, for whoever asks whether it goes on.
  bool End(ceres::TerminationType type, std::string message) {
    summary_.termination_type = type;
    summary_.message = std::move(message);
    return false;
  }

  // By what the radius is divided after a step that is not taken; after another
  // one by its double, and so on.
  static constexpr double kFirstDecrease = 2.0;

  const ceres::Solver::Options& options_;
  const Damping damping_;
  const ProblemChanges* const changes_;
  Impl& m_;
  ceres::Solver::Summary& summary_;
  const Stopwatch watch_;

  // Of the present state, and of the lowest so far: steps may lead uphill.
  double cost_ = 0.0;
  double best_cost_ = 0.0;
  Eigen::VectorXd best_;
  bool is_usable_ = true;
  std::optional<StepJudge> judge_;
  // Steps since the best state, of those that may lead uphill; whether some
  // have led nowhere.
  int excursion_ = 0;
  bool has_returned_ = false;

  // Of the columns: Jacobi scaling, gradient, diagonal of the normal matrix
  // within bounds.
  Eigen::VectorXd scale_;
  Eigen::VectorXd scaled_gradient_;
  Eigen::VectorXd normal_diagonal_;

  double radius_;
  double decrease_factor_ = kFirstDecrease;
  int invalid_steps_ = 0;

  // The step under way.
  ceres::IterationSummary step_;
  Eigen::VectorXd y_;
  double model_change_ = 0.0;
  Eigen::VectorXd candidate_;
  double candidate_cost_ = 0.0;
  // Whether the linearization at the candidate is there, beside the other one.
  bool is_linearized_ = false;
};

ResidentMinimizer::ResidentMinimizer(ceres::Problem* problem,
                                     bool may_have_bounds)
    : impl_(std::make_unique<Impl>(problem, may_have_bounds)) {}

ResidentMinimizer::~ResidentMinimizer() = default;

void ResidentMinimizer::Forget() { impl_->is_forgotten = true; }

int ResidentMinimizer::num_analyses() const {
  return impl_->matrix.num_analyses();
}

void ResidentMinimizer::Solve(const ceres::Solver::Options& options,
                              ceres::Solver::Summary* summary, Damping damping,
                              const ProblemChanges* changes) {
  *summary = ceres::Solver::Summary();
  Impl::Minimization(options, damping, changes, impl_.get(), summary).Run();
}

}  // namespace plumbline
