#include <ceres/cost_function.h>
#include <ceres/loss_function.h>
#include <ceres/manifold.h>
#include <plumbline/core/flat_evaluator.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <thread>

namespace plumbline {
namespace {

using VectorMap = Eigen::Map<Eigen::VectorXd>;
using RowMajor =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

using Argument = FlatProblem::Argument;
using Term = FlatProblem::Term;
using Variable = FlatProblem::Variable;

// Terms from which on it pays to wake other threads.
constexpr std::size_t kLargeProblem = 4096;
// Terms that a thread evaluates at a time, and how many are kept at most before
// they are summed up.
constexpr std::size_t kBlock = 256;
constexpr std::size_t kMostKept = 64 * kBlock;

// Terms ahead of the one that is evaluated whose costs are asked for: they are
// objects of their own, and waiting for them takes as long as evaluating them.
constexpr std::size_t kAhead = 4;

// The weight of residuals and the correction of Jacobians that make a robust
// loss a least squares problem (Triggs et al. 1999), as Ceres has it.
struct Correction {
  double residual = 1.0;
  double jacobian = 1.0;
  double alpha = 0.0;

  Correction(double squared, const double rho[3]) {
    jacobian = std::sqrt(rho[1]);
    residual = jacobian;
    if (squared == 0.0 || rho[2] <= 0.0) return;
    const double d = 1.0 + 2.0 * squared * rho[2] / rho[1];
    const double root = 1.0 - std::sqrt(std::max(d, 0.0));
    residual = jacobian / (1.0 - root);
    alpha = root / squared;
  }
};

// Has the processor fetch the cost of the term so far ahead of `t`.
void FetchAhead(const std::vector<Term>& terms, std::size_t t) {
  if (t + kAhead >= terms.size()) return;
  const char* const cost =
      reinterpret_cast<const char*>(terms[t + kAhead].cost);
  __builtin_prefetch(cost);
  __builtin_prefetch(cost + kCacheLine);
}

bool IsIdentity(const double* matrix, int rows, int columns) {
  if (rows != columns) return false;
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < columns; ++j) {
      if (matrix[i * columns + j] != (i == j ? 1.0 : 0.0)) return false;
    }
  }
  return true;
}

// The Jacobian of a residual with respect to the tangent of an argument, from
// that with respect to the argument and that of Plus.
void MakeTangent(int rows, const Argument& argument, const double* jacobian,
                 const double* plus, double* tangent) {
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < argument.tangent_size; ++c) {
      double sum = 0.0;
      for (int i = 0; i < argument.size; ++i) {
        sum += jacobian[r * argument.size + i] *
               plus[i * argument.tangent_size + c];
      }
      tangent[r * argument.tangent_size + c] = sum;
    }
  }
}

double TermCost(const Term& term, double squared, double rho[3]) {
  if (term.loss == nullptr) return 0.5 * squared;
  term.loss->Evaluate(squared, rho);
  return 0.5 * rho[0];
}

}  // namespace

void FlatEvaluator::SetNumThreads(int num_threads) {
  if (num_threads == num_threads_) return;
  num_threads_ = num_threads;
  team_.reset();
}

bool FlatEvaluator::IsLarge() const {
  return num_threads_ > 1 && problem_.terms().size() >= kLargeProblem;
}

void FlatEvaluator::MakeRoom() {
  const FlatProblem::TermSizes& largest = problem_.largest();
  if (IsLarge() && team_ == nullptr) {
    team_ = std::make_unique<ThreadTeam>(num_threads_);
  }
  scratch_.resize(
      static_cast<std::size_t>(IsLarge() ? std::max(1, num_threads_) : 1));
  for (Scratch& scratch : scratch_) {
    scratch.residual.resize(largest.rows);
    scratch.jacobians.resize(largest.jacobians);
    scratch.jacobian_pointers.resize(largest.arguments);
    scratch.argument_pointers.resize(largest.arguments);
  }
  added_pointers_.resize(largest.arguments);
  plus_jacobians_.resize(problem_.plus_size());
  is_identity_.resize(problem_.variables().size());
  stride_ = 1 + static_cast<std::size_t>(largest.rows + largest.jacobians);
}

bool FlatEvaluator::EvaluateTerm(const Term& term, const double* state,
                                 double* residual, double** jacobians,
                                 Scratch* scratch, double* squared) const {
  for (int i = term.begin; i < term.end; ++i) {
    const Argument& argument = problem_.arguments()[i];
    scratch->argument_pointers[i - term.begin] =
        argument.variable < 0
            ? problem_.blocks()[argument.block].user
            : state + problem_.variables()[argument.variable].state;
  }
  if (!term.cost->Evaluate(scratch->argument_pointers.data(), residual,
                           jacobians)) {
    return false;
  }
  *squared = 0.0;
  for (int r = 0; r < term.rows; ++r) *squared += residual[r] * residual[r];
  // Of numbers that are finite the square may still be none.
  return std::isfinite(*squared) || VectorMap(residual, term.rows).allFinite();
}

bool FlatEvaluator::CostOf(const Term& term, const double* state,
                           Scratch* scratch, double* cost) const {
  double squared = 0.0;
  if (!EvaluateTerm(term, state, scratch->residual.data(), nullptr, scratch,
                    &squared)) {
    return false;
  }
  double rho[3];
  *cost = TermCost(term, squared, rho);
  return true;
}

bool FlatEvaluator::Cost(bool is_fixed, const Eigen::VectorXd& state,
                         double* cost) {
  *cost = 0.0;
  const std::vector<Term>& terms = problem_.terms();
  if (is_fixed &&
      problem_.num_reduced_terms() == static_cast<int>(terms.size())) {
    return true;
  }
  if (IsLarge() && !is_fixed) return ParallelCost(state, cost);
  for (std::size_t t = 0; t < terms.size(); ++t) {
    FetchAhead(terms, t);
    if ((terms[t].num_variables == 0) != is_fixed) continue;
    double share = 0.0;
    if (!CostOf(terms[t], state.data(), &scratch_[0], &share)) return false;
    *cost += share;
  }
  return std::isfinite(*cost);
}

bool FlatEvaluator::ParallelCost(const Eigen::VectorXd& state, double* cost) {
  const std::vector<Term>& terms = problem_.terms();
  costs_.assign(terms.size(), 0.0);
  std::atomic<std::size_t> next{0};
  std::atomic<bool> has_failed{false};
  team_->For(scratch_.size(), [&](std::size_t thread) {
    for (std::size_t k = next.fetch_add(kBlock); k < terms.size();
         k = next.fetch_add(kBlock)) {
      const std::size_t end = std::min(terms.size(), k + kBlock);
      for (std::size_t t = k; t < end; ++t) {
        FetchAhead(terms, t);
        if (terms[t].num_variables == 0) continue;
        if (!CostOf(terms[t], state.data(), &scratch_[thread], &costs_[t])) {
          has_failed = true;
          return;
        }
      }
    }
  });
  if (has_failed) return false;
  for (std::size_t t = 0; t < terms.size(); ++t) {
    if (terms[t].num_variables > 0) *cost += costs_[t];
  }
  return std::isfinite(*cost);
}

bool FlatEvaluator::FindPlusJacobians(const Eigen::VectorXd& state) {
  const std::vector<Variable>& variables = problem_.variables();
  for (std::size_t v = 0; v < variables.size(); ++v) {
    const Variable& variable = variables[v];
    is_identity_[v] = 1;
    if (variable.manifold == nullptr) continue;
    double* const jacobian = plus_jacobians_.data() + variable.plus_jacobian;
    if (!variable.manifold->PlusJacobian(state.data() + variable.state,
                                         jacobian)) {
      return false;
    }
    is_identity_[v] =
        IsIdentity(jacobian, variable.size, variable.tangent_size);
  }
  return true;
}

bool FlatEvaluator::LinearizeTerm(const Term& term, const double* state,
                                  double* linearized, Scratch* scratch) const {
  double* const residual = linearized + 1;
  double* const jacobians = residual + term.rows;
  const int count = term.end - term.begin;
  for (int k = 0; k < count; ++k) {
    const Argument& argument = problem_.arguments()[term.begin + k];
    scratch->jacobian_pointers[k] =
        argument.variable < 0 ? nullptr
        : is_identity_[argument.variable] != 0
            ? jacobians + argument.jacobian
            : scratch->jacobians.data() + argument.jacobian;
  }
  double squared = 0.0;
  if (!EvaluateTerm(term, state, residual, scratch->jacobian_pointers.data(),
                    scratch, &squared)) {
    return false;
  }
  double rho[3];
  linearized[0] = TermCost(term, squared, rho);
  for (int k = 0; k < count; ++k) {
    const Argument& argument = problem_.arguments()[term.begin + k];
    if (argument.variable < 0 || is_identity_[argument.variable] != 0) continue;
    MakeTangent(term.rows, argument, scratch->jacobian_pointers[k],
                plus_jacobians_.data() +
                    problem_.variables()[argument.variable].plus_jacobian,
                jacobians + argument.jacobian);
  }
  if (term.loss == nullptr) return true;
  VectorMap r(residual, term.rows);
  const Correction correction(squared, rho);
  for (int k = 0; k < count; ++k) {
    const Argument& argument = problem_.arguments()[term.begin + k];
    if (argument.variable < 0) continue;
    Eigen::Map<RowMajor> jacobian(jacobians + argument.jacobian, term.rows,
                                  argument.tangent_size);
    if (correction.alpha != 0.0) {
      jacobian -= correction.alpha * r * (r.transpose() * jacobian).eval();
    }
    jacobian *= correction.jacobian;
  }
  r *= correction.residual;
  return true;
}

void FlatEvaluator::AddTerm(const Term& term, const double* linearized,
                            NormalMatrix* matrix, Eigen::VectorXd* gradient,
                            double* cost) {
  *cost += linearized[0];
  const double* const residual = linearized + 1;
  const double* const jacobians = residual + term.rows;
  for (int i = term.begin; i < term.end; ++i) {
    added_pointers_[i - term.begin] =
        jacobians + problem_.arguments()[i].jacobian;
  }
  matrix->Add(problem_, term, added_pointers_.data(), residual,
              gradient->data());
}

// Terms from `begin` to `end`: threads linearize blocks of them as they come,
// while one prepares what is needed to sum them up, and does that in order. It
// linearizes the next block itself when the one that it needs is not ready.
class FlatEvaluator::Pipeline {
 public:
  Pipeline(std::size_t begin, std::size_t end, const Eigen::VectorXd& state,
           FlatEvaluator* evaluator)
      : begin_(begin),
        end_(end),
        state_(state),
        evaluator_(*evaluator),
        is_done_((end - begin + kBlock - 1) / kBlock) {}

  // Whether all could be linearized. `prepare` returns whether the terms are to
  // be summed up, `add(term, linearized)` sums one up.
  template <typename Prepare, typename Add>
  bool Run(const Prepare& prepare, const Add& add) {
    evaluator_.team_->For(evaluator_.scratch_.size(), [&](std::size_t thread) {
      Scratch* const scratch = &evaluator_.scratch_[thread];
      if (thread > 0) {
        while (LinearizeNext(scratch)) {
        }
        return;
      }
      if (!prepare()) has_failed_ = true;
      for (std::size_t b = 0; b < is_done_.size(); ++b) {
        while (!has_failed_ && !is_done_[b].load(std::memory_order_acquire)) {
          if (!LinearizeNext(scratch)) std::this_thread::yield();
        }
        if (has_failed_) return;
        ForTerms(b, add);
      }
    });
    return !has_failed_;
  }

 private:
  // Calls visit(term, linearized) for the terms of a block that vary.
  template <typename Visit>
  void ForTerms(std::size_t block, const Visit& visit) {
    const std::size_t first = begin_ + block * kBlock;
    const std::size_t last = std::min(end_, first + kBlock);
    const std::vector<Term>& terms = evaluator_.problem_.terms();
    for (std::size_t t = first; t < last; ++t) {
      const Term& term = terms[t];
      if (term.num_variables == 0) continue;
      visit(term, &evaluator_.linearized_[(t - begin_) * evaluator_.stride_]);
    }
  }

  // False when there is no block left.
  bool LinearizeNext(Scratch* scratch) {
    if (has_failed_) return false;
    const std::size_t block = next_++;
    if (block >= is_done_.size()) return false;
    try {
      ForTerms(block, [&](const Term& term, double* linearized) {
        FetchAhead(evaluator_.problem_.terms(),
                   &term - evaluator_.problem_.terms().data());
        if (!evaluator_.LinearizeTerm(term, state_.data(), linearized,
                                      scratch)) {
          has_failed_ = true;
        }
      });
    } catch (...) {
      // Nobody waits for this block.
      has_failed_ = true;
      throw;
    }
    is_done_[block].store(true, std::memory_order_release);
    return true;
  }

  const std::size_t begin_;
  const std::size_t end_;
  const Eigen::VectorXd& state_;
  FlatEvaluator& evaluator_;
  std::vector<std::atomic<bool>> is_done_;
  std::atomic<std::size_t> next_{0};
  std::atomic<bool> has_failed_{false};
};

bool FlatEvaluator::Linearize(const Eigen::VectorXd& state,
                              const std::function<bool()>& prepare,
                              NormalMatrix* matrix, Eigen::VectorXd* gradient,
                              double* cost) {
  *cost = 0.0;
  if (!FindPlusJacobians(state)) return false;
  const auto begin = [&] {
    if (prepare && !prepare()) return false;
    matrix->SetZero();
    gradient->setZero(problem_.num_columns());
    return true;
  };
  const auto add = [&](const Term& term, double* linearized) {
    AddTerm(term, linearized, matrix, gradient, cost);
  };
  const std::vector<Term>& terms = problem_.terms();
  if (IsLarge()) {
    linearized_.resize(std::min(kMostKept, terms.size()) * stride_);
    for (std::size_t k = 0; k < terms.size(); k += kMostKept) {
      Pipeline pipeline(k, std::min(terms.size(), k + kMostKept), state, this);
      if (!pipeline.Run([&] { return k > 0 || begin(); }, add)) return false;
    }
  } else {
    if (!begin()) return false;
    linearized_.resize(stride_);
    for (std::size_t t = 0; t < terms.size(); ++t) {
      FetchAhead(terms, t);
      const Term& term = terms[t];
      if (term.num_variables == 0) continue;
      if (!LinearizeTerm(term, state.data(), linearized_.data(),
                         &scratch_[0])) {
        return false;
      }
      add(term, linearized_.data());
    }
  }
  return std::isfinite(*cost) && gradient->allFinite();
}

}  // namespace plumbline
