#include <ceres/cost_function.h>
#include <ceres/iteration_callback.h>
#include <ceres/loss_function.h>
#include <ceres/manifold.h>
#include <plumbline/core/resident_minimizer.h>
#include <plumbline/core/stopwatch.h>
#include <suitesparse/cholmod.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <unordered_map>
#include <unordered_set>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

using ConstVectorMap = Eigen::Map<const Eigen::VectorXd>;
using VectorMap = Eigen::Map<Eigen::VectorXd>;
using RowMajor =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// A parameter block of the problem that varies.
struct Variable {
  double* user = nullptr;
  const ceres::Manifold* manifold = nullptr;
  int size = 0;
  int tangent_size = 0;
  // In the state, and in the tangent space.
  int state = 0;
  int column = 0;
  // In the array of Jacobians of Plus; -1 where that is the identity.
  int plus_jacobian = -1;
};

// One parameter block of a residual block.
struct Argument {
  // -1: constant.
  int variable = -1;
  const double* constant = nullptr;
  // In the array of Jacobians: with respect to the block, and to its tangent.
  int jacobian = 0;
  int size = 0;
};

struct Term {
  const ceres::CostFunction* cost = nullptr;
  const ceres::LossFunction* loss = nullptr;
  int rows = 0;
  // In the arguments.
  int begin = 0;
  int end = 0;
  // In the destinations of the products of its Jacobians.
  int products = 0;
};

std::uint64_t PairKey(int a, int b) {
  return static_cast<std::uint64_t>(static_cast<std::uint32_t>(a)) << 32 |
         static_cast<std::uint32_t>(b);
}

// destination (columns `stride` apart) += a' b for row-major Jacobians.
template <int kRows, int kA, int kB>
void AddProduct(const double* a, const double* b, double* destination,
                int stride) {
  for (int j = 0; j < kB; ++j) {
    for (int i = 0; i < kA; ++i) {
      double sum = 0.0;
      for (int r = 0; r < kRows; ++r) sum += a[r * kA + i] * b[r * kB + j];
      destination[j * stride + i] += sum;
    }
  }
}

void AddProduct(int rows, int size_a, int size_b, const double* a,
                const double* b, double* destination, int stride) {
  if (size_a == 3 && size_b == 3) {
    if (rows == 3) return AddProduct<3, 3, 3>(a, b, destination, stride);
    if (rows == 2) return AddProduct<2, 3, 3>(a, b, destination, stride);
    if (rows == 1) return AddProduct<1, 3, 3>(a, b, destination, stride);
  }
  for (int j = 0; j < size_b; ++j) {
    for (int i = 0; i < size_a; ++i) {
      double sum = 0.0;
      for (int r = 0; r < rows; ++r) {
        sum += a[r * size_a + i] * b[r * size_b + j];
      }
      destination[j * stride + i] += sum;
    }
  }
}

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

bool IsIdentity(const double* matrix, int rows, int columns) {
  if (rows != columns) return false;
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < columns; ++j) {
      if (matrix[i * columns + j] != (i == j ? 1.0 : 0.0)) return false;
    }
  }
  return true;
}

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

  explicit Impl(ceres::Problem* problem_in) : problem(problem_in) {
    cholmod_start(&common);
    common.print = 0;
    common.quick_return_if_not_posdef = 1;
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  ~Impl() {
    if (factor != nullptr) cholmod_free_factor(&factor, &common);
    cholmod_finish(&common);
  }

  // -- The problem as it is now -----------------------------------------------

  // Reads the problem; empty when it can be solved, or why not.
  std::string Read() {
    ReadBlocks();
    bool has_same_variables = false;
    std::vector<double*> order = ActiveBlocks();
    if (!is_forgotten) has_same_variables = KeepOrder(&order);
    std::string fault = ReadVariables(order);
    if (!fault.empty()) return fault;
    ReadTerms();
    std::vector<std::pair<int, int>> pairs;
    if (has_same_variables && FindPlaces(&pairs)) return {};
    if (has_same_variables) {
      // What is analysed anew does not depend on what was before.
      ReadVariables(ActiveBlocks());
      ReadTerms();
    }
    MakePattern(&pairs);
    needs_analysis = true;
    is_forgotten = false;
    return {};
  }

  // Residual blocks of the problem with the parameter blocks of each. Their
  // order is that of the calls that made them. (That of the problem's parameter
  // blocks is the order of their addresses, which differs from run to run.)
  void ReadBlocks() {
    problem->GetResidualBlocks(&ids);
    block_ends.clear();
    block_ends.reserve(ids.size());
    all_blocks.clear();
    std::vector<double*> blocks;
    for (const ceres::ResidualBlockId id : ids) {
      problem->GetParameterBlocksForResidualBlock(id, &blocks);
      all_blocks.insert(all_blocks.end(), blocks.begin(), blocks.end());
      block_ends.push_back(all_blocks.size());
    }
  }

  // Blocks that vary and that residuals depend on, in the order of these.
  std::vector<double*> ActiveBlocks() const {
    std::vector<double*> active;
    std::unordered_set<const double*> seen;
    seen.reserve(2 * variables.size());
    for (double* const block : all_blocks) {
      if (seen.insert(block).second &&
          !problem->IsParameterBlockConstant(block) &&
          problem->ParameterBlockTangentSize(block) > 0) {
        active.push_back(block);
      }
    }
    return active;
  }

  // Makes the blocks the variables, in their order; why not, if they cannot be.
  std::string ReadVariables(const std::vector<double*>& blocks) {
    index.clear();
    index.reserve(2 * blocks.size());
    variables.clear();
    int state_size = 0;
    int plus_size = 0;
    num_columns = 0;
    for (double* const block : blocks) {
      Variable variable;
      variable.user = block;
      variable.size = problem->ParameterBlockSize(block);
      variable.tangent_size = problem->ParameterBlockTangentSize(block);
      variable.manifold = problem->GetManifold(block);
      variable.state = state_size;
      variable.column = num_columns;
      if (variable.manifold != nullptr) {
        variable.plus_jacobian = plus_size;
        plus_size += variable.size * variable.tangent_size;
      }
      for (int i = 0; i < variable.size; ++i) {
        if (problem->GetParameterLowerBound(block, i) >
                -std::numeric_limits<double>::max() ||
            problem->GetParameterUpperBound(block, i) <
                std::numeric_limits<double>::max()) {
          return "Bounds of parameters are not supported.";
        }
      }
      state_size += variable.size;
      num_columns += variable.tangent_size;
      index.emplace(block, static_cast<int>(variables.size()));
      variables.push_back(variable);
    }
    plus_jacobians.resize(plus_size);
    state.resize(state_size);
    return {};
  }

  // Puts the blocks into the order that the variables have; false, and leaves
  // them, when they are not the same ones.
  bool KeepOrder(std::vector<double*>* blocks) const {
    if (blocks->size() != variables.size()) return false;
    for (double* const block : *blocks) {
      const auto found = index.find(block);
      if (found == index.end() ||
          variables[found->second].tangent_size !=
              problem->ParameterBlockTangentSize(block)) {
        return false;
      }
    }
    for (std::size_t v = 0; v < variables.size(); ++v) {
      (*blocks)[v] = variables[v].user;
    }
    return true;
  }

  void ReadTerms() {
    terms.clear();
    arguments.clear();
    terms.reserve(ids.size());
    arguments.reserve(all_blocks.size());
    int most_rows = 0;
    int most_values = 0;
    std::size_t most_arguments = 0;
    num_products = 0;
    fixed_terms.clear();
    std::size_t begin = 0;
    for (std::size_t k = 0; k < ids.size(); ++k) {
      Term term;
      term.cost = problem->GetCostFunctionForResidualBlock(ids[k]);
      term.loss = problem->GetLossFunctionForResidualBlock(ids[k]);
      term.rows = term.cost->num_residuals();
      term.begin = static_cast<int>(arguments.size());
      int num_variables = 0;
      int jacobian = 0;
      for (std::size_t b = begin; b < block_ends[k]; ++b) {
        Argument argument;
        const auto found = index.find(all_blocks[b]);
        if (found == index.end()) {
          argument.constant = all_blocks[b];
        } else {
          argument.variable = found->second;
          argument.size = variables[found->second].size;
          argument.jacobian = jacobian;
          jacobian += term.rows * argument.size;
          ++num_variables;
        }
        arguments.push_back(argument);
      }
      term.end = static_cast<int>(arguments.size());
      term.products = num_products;
      num_products += num_variables * (num_variables + 1) / 2;
      most_rows = std::max(most_rows, term.rows);
      most_values = std::max(most_values, jacobian);
      most_arguments = std::max(most_arguments, block_ends[k] - begin);
      begin = block_ends[k];
      (num_variables > 0 ? terms : fixed_terms).push_back(term);
    }
    residual.resize(most_rows);
    jacobians.resize(most_values);
    tangent_jacobians.resize(most_values);
    jacobian_pointers.resize(most_arguments);
    argument_pointers.resize(most_arguments);
  }

  // -- The normal matrix ------------------------------------------------------

  // Calls visit(product, a, b) with the pairs of variables, a <= b, of terms.
  template <typename Visit>
  void ForProducts(const Visit& visit) const {
    for (const Term& term : terms) {
      int product = term.products;
      for (int i = term.begin; i < term.end; ++i) {
        if (arguments[i].variable < 0) continue;
        for (int j = i; j < term.end; ++j) {
          if (arguments[j].variable < 0) continue;
          visit(product++,
                std::min(arguments[i].variable, arguments[j].variable),
                std::max(arguments[i].variable, arguments[j].variable));
        }
      }
    }
  }

  // Looks up where products go; false when some have no place yet.
  bool FindPlaces(std::vector<std::pair<int, int>>* missing) {
    places.resize(num_products);
    ForProducts([&](int product, int a, int b) {
      const auto found = place_of.find(PairKey(a, b));
      if (found == place_of.end()) {
        missing->emplace_back(a, b);
      } else {
        places[product] = found->second;
      }
    });
    return missing->empty();
  }

  // Upper triangle by block columns, each with its blocks by row.
  void MakePattern(std::vector<std::pair<int, int>>* pairs) {
    pairs->clear();
    const int n = static_cast<int>(variables.size());
    for (int v = 0; v < n; ++v) pairs->emplace_back(v, v);
    ForProducts([&](int, int a, int b) {
      if (a != b) pairs->emplace_back(a, b);
    });
    std::sort(pairs->begin(), pairs->end(), [](const auto& p, const auto& q) {
      return p.second != q.second ? p.second < q.second : p.first < q.first;
    });
    pairs->erase(std::unique(pairs->begin(), pairs->end()), pairs->end());
    place_of.clear();
    place_of.reserve(pairs->size());
    block_begin.assign(1, 0);
    block_rows.clear();
    column_begin.assign(1, 0);
    rows.clear();
    stride.assign(n, 0);
    std::size_t k = 0;
    for (int v = 0; v < n; ++v) {
      const std::size_t first = k;
      int length = 0;
      for (; k < pairs->size() && (*pairs)[k].second == v; ++k) {
        const int row = (*pairs)[k].first;
        place_of.emplace(PairKey(row, v), column_begin.back() + length);
        block_rows.push_back(row);
        length += variables[row].tangent_size;
      }
      block_begin.push_back(static_cast<int>(block_rows.size()));
      stride[v] = length;
      for (int c = 0; c < variables[v].tangent_size; ++c) {
        for (std::size_t p = first; p < k; ++p) {
          const Variable& row = variables[(*pairs)[p].first];
          for (int r = 0; r < row.tangent_size; ++r) {
            rows.push_back(row.column + r);
          }
        }
        column_begin.push_back(static_cast<int>(rows.size()));
      }
    }
    values.assign(rows.size(), 0.0);
    diagonal.resize(num_columns);
    for (int v = 0; v < n; ++v) {
      const int place = place_of.at(PairKey(v, v));
      for (int c = 0; c < variables[v].tangent_size; ++c) {
        diagonal[variables[v].column + c] = place + c * stride[v] + c;
      }
    }
    pairs->clear();
    FindPlaces(pairs);
  }

  cholmod_sparse Matrix() {
    cholmod_sparse matrix = {};
    matrix.nrow = num_columns;
    matrix.ncol = num_columns;
    matrix.nzmax = rows.size();
    matrix.p = column_begin.data();
    matrix.i = rows.data();
    matrix.x = damped.data();
    matrix.stype = 1;
    matrix.itype = CHOLMOD_INT;
    matrix.xtype = CHOLMOD_REAL;
    matrix.dtype = CHOLMOD_DOUBLE;
    matrix.sorted = 1;
    matrix.packed = 1;
    return matrix;
  }

  // Orders blocks, then analyses the matrix in that order.
  bool Analyse() {
    if (factor != nullptr) cholmod_free_factor(&factor, &common);
    ++num_analyses;
    const int n = static_cast<int>(variables.size());
    std::vector<double> ones(block_rows.size(), 1.0);
    cholmod_sparse blocks = {};
    blocks.nrow = n;
    blocks.ncol = n;
    blocks.nzmax = block_rows.size();
    blocks.p = block_begin.data();
    blocks.i = block_rows.data();
    blocks.x = ones.data();
    blocks.stype = 1;
    blocks.itype = CHOLMOD_INT;
    blocks.xtype = CHOLMOD_REAL;
    blocks.dtype = CHOLMOD_DOUBLE;
    blocks.sorted = 1;
    blocks.packed = 1;
    std::vector<int> block_order(n);
    if (cholmod_amd(&blocks, nullptr, 0, block_order.data(), &common) == 0) {
      return false;
    }
    std::vector<int> order;
    order.reserve(num_columns);
    for (const int v : block_order) {
      for (int c = 0; c < variables[v].tangent_size; ++c) {
        order.push_back(variables[v].column + c);
      }
    }
    common.nmethods = 1;
    common.method[0].ordering = CHOLMOD_GIVEN;
    damped.resize(values.size());
    cholmod_sparse matrix = Matrix();
    factor = cholmod_analyze_p(&matrix, order.data(), nullptr, 0, &common);
    needs_analysis = factor == nullptr;
    return factor != nullptr;
  }

  // Solves (scaled normal matrix + damping) y = right; false when the matrix is
  // not positive definite.
  bool SolveDamped(const Eigen::VectorXd& damping, const Eigen::VectorXd& right,
                   Eigen::VectorXd* y) {
    if (needs_analysis && !Analyse()) return false;
    damped = values;
    for (int c = 0; c < num_columns; ++c) damped[diagonal[c]] += damping[c];
    cholmod_sparse matrix = Matrix();
    common.status = CHOLMOD_OK;
    if (cholmod_factorize(&matrix, factor, &common) == 0 ||
        common.status != CHOLMOD_OK) {
      return false;
    }
    cholmod_dense b = {};
    b.nrow = num_columns;
    b.ncol = 1;
    b.nzmax = num_columns;
    b.d = num_columns;
    b.x = const_cast<double*>(right.data());
    b.xtype = CHOLMOD_REAL;
    b.dtype = CHOLMOD_DOUBLE;
    cholmod_dense* const x = cholmod_solve(CHOLMOD_A, factor, &b, &common);
    if (x == nullptr) return false;
    *y = ConstVectorMap(static_cast<const double*>(x->x), num_columns);
    cholmod_dense* freed = x;
    cholmod_free_dense(&freed, &common);
    return y->allFinite();
  }

  // -- Evaluation -------------------------------------------------------------

  bool EvaluateTerm(const Term& term, const double* x, double** jacobian) {
    for (int i = term.begin; i < term.end; ++i) {
      const Argument& argument = arguments[i];
      argument_pointers[i - term.begin] =
          argument.variable < 0 ? argument.constant
                                : x + variables[argument.variable].state;
    }
    return term.cost->Evaluate(argument_pointers.data(), residual.data(),
                               jacobian) &&
           VectorMap(residual.data(), term.rows).allFinite();
  }

  static double TermCost(const Term& term, double squared, double rho[3]) {
    if (term.loss == nullptr) return 0.5 * squared;
    term.loss->Evaluate(squared, rho);
    return 0.5 * rho[0];
  }

  bool Cost(const std::vector<Term>& of, const Eigen::VectorXd& x,
            double* cost) {
    *cost = 0.0;
    for (const Term& term : of) {
      if (!EvaluateTerm(term, x.data(), nullptr)) return false;
      double rho[3];
      *cost += TermCost(
          term, VectorMap(residual.data(), term.rows).squaredNorm(), rho);
    }
    return std::isfinite(*cost);
  }

  // Normal matrix and gradient at the state, unscaled.
  bool Linearize(double* cost) {
    for (const Variable& variable : variables) {
      if (variable.manifold == nullptr) continue;
      if (!variable.manifold->PlusJacobian(
              state.data() + variable.state,
              plus_jacobians.data() + variable.plus_jacobian)) {
        return false;
      }
    }
    is_identity.resize(variables.size());
    for (std::size_t v = 0; v < variables.size(); ++v) {
      const Variable& variable = variables[v];
      is_identity[v] =
          variable.manifold == nullptr ||
          IsIdentity(plus_jacobians.data() + variable.plus_jacobian,
                     variable.size, variable.tangent_size);
    }
    std::fill(values.begin(), values.end(), 0.0);
    gradient.setZero(num_columns);
    *cost = 0.0;
    for (const Term& term : terms) {
      if (!LinearizeTerm(term, cost)) return false;
    }
    return std::isfinite(*cost) && gradient.allFinite();
  }

  bool LinearizeTerm(const Term& term, double* cost) {
    const int count = term.end - term.begin;
    for (int k = 0; k < count; ++k) {
      const Argument& argument = arguments[term.begin + k];
      jacobian_pointers[k] = argument.variable < 0
                                 ? nullptr
                                 : jacobians.data() + argument.jacobian;
    }
    if (!EvaluateTerm(term, state.data(), jacobian_pointers.data())) {
      return false;
    }
    VectorMap r(residual.data(), term.rows);
    const double squared = r.squaredNorm();
    double rho[3];
    *cost += TermCost(term, squared, rho);
    // Jacobians with respect to tangents.
    for (int k = 0; k < count; ++k) {
      const Argument& argument = arguments[term.begin + k];
      if (argument.variable < 0 || is_identity[argument.variable] != 0) {
        continue;
      }
      const Variable& variable = variables[argument.variable];
      Eigen::Map<RowMajor>(tangent_jacobians.data() + argument.jacobian,
                           term.rows, variable.tangent_size)
          .noalias() = Eigen::Map<const RowMajor>(jacobian_pointers[k],
                                                  term.rows, variable.size) *
                       Eigen::Map<const RowMajor>(
                           plus_jacobians.data() + variable.plus_jacobian,
                           variable.size, variable.tangent_size);
      jacobian_pointers[k] = tangent_jacobians.data() + argument.jacobian;
    }
    if (term.loss != nullptr) {
      const Correction correction(squared, rho);
      for (int k = 0; k < count; ++k) {
        const Argument& argument = arguments[term.begin + k];
        if (argument.variable < 0) continue;
        Eigen::Map<RowMajor> jacobian(
            jacobian_pointers[k], term.rows,
            variables[argument.variable].tangent_size);
        if (correction.alpha != 0.0) {
          jacobian -= correction.alpha * r * (r.transpose() * jacobian).eval();
        }
        jacobian *= correction.jacobian;
      }
      r *= correction.residual;
    }
    AddToNormalMatrix(term);
    return true;
  }

  void AddToNormalMatrix(const Term& term) {
    int product = term.products;
    for (int i = term.begin; i < term.end; ++i) {
      const int first = arguments[i].variable;
      if (first < 0) continue;
      const double* const jacobian = jacobian_pointers[i - term.begin];
      const int size = variables[first].tangent_size;
      double* const g = gradient.data() + variables[first].column;
      for (int r = 0; r < term.rows; ++r) {
        for (int c = 0; c < size; ++c) {
          g[c] += jacobian[r * size + c] * residual[r];
        }
      }
      for (int j = i; j < term.end; ++j) {
        const int second = arguments[j].variable;
        if (second < 0) continue;
        const double* const other = jacobian_pointers[j - term.begin];
        const int other_size = variables[second].tangent_size;
        double* const place = values.data() + places[product++];
        if (first <= second) {
          AddProduct(term.rows, size, other_size, jacobian, other, place,
                     stride[second]);
        } else {
          AddProduct(term.rows, other_size, size, other, jacobian, place,
                     stride[first]);
        }
      }
    }
  }

  // values <- S values S.
  void Scale(const Eigen::VectorXd& scale) {
    for (int c = 0; c < num_columns; ++c) {
      for (int k = column_begin[c]; k < column_begin[c + 1]; ++k) {
        values[k] *= scale[c] * scale[rows[k]];
      }
    }
  }

  bool Plus(const Eigen::VectorXd& x, const Eigen::VectorXd& delta,
            Eigen::VectorXd* sum) const {
    for (const Variable& variable : variables) {
      const double* const from = x.data() + variable.state;
      const double* const step = delta.data() + variable.column;
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
    moved = state;
    if (!Plus(state, -gradient, &moved)) {
      return gradient.lpNorm<Eigen::Infinity>();
    }
    return (moved - state).lpNorm<Eigen::Infinity>();
  }

  void TakeState() {
    for (const Variable& variable : variables) {
      std::copy_n(variable.user, variable.size, state.data() + variable.state);
    }
  }

  void GiveState(const Eigen::VectorXd& x) const {
    for (const Variable& variable : variables) {
      std::copy_n(x.data() + variable.state, variable.size, variable.user);
    }
  }

  ceres::Problem* problem;
  // Residual blocks, and the parameter blocks of each up to its end.
  std::vector<ceres::ResidualBlockId> ids;
  std::vector<double*> all_blocks;
  std::vector<std::size_t> block_ends;
  std::vector<Variable> variables;
  // Of the variables, by address.
  std::unordered_map<const double*, int> index;
  std::vector<Argument> arguments;
  std::vector<Term> terms;
  // Those of which all parameters are constant.
  std::vector<Term> fixed_terms;
  int num_columns = 0;
  int num_products = 0;

  // The normal matrix: upper triangle by columns, with whole blocks on the
  // diagonal; where blocks begin in `values`, by pair of variables and by
  // product; and how far apart columns of a variable are.
  std::vector<int> column_begin;
  std::vector<int> rows;
  std::vector<double> values;
  std::vector<double> damped;
  std::vector<int> diagonal;
  std::unordered_map<std::uint64_t, int> place_of;
  std::vector<int> places;
  std::vector<int> stride;
  // The same by blocks.
  std::vector<int> block_begin;
  std::vector<int> block_rows;

  Eigen::VectorXd state;
  Eigen::VectorXd moved;
  Eigen::VectorXd gradient;
  std::vector<double> plus_jacobians;
  std::vector<char> is_identity;
  // Of one term.
  std::vector<double> residual;
  std::vector<double> jacobians;
  std::vector<double> tangent_jacobians;
  std::vector<double*> jacobian_pointers;
  std::vector<const double*> argument_pointers;

  cholmod_common common = {};
  cholmod_factor* factor = nullptr;
  bool needs_analysis = true;
  bool is_forgotten = false;
  int num_analyses = 0;
};

// One solve: the loop of Ceres' trust region minimizer, by the same names.
class ResidentMinimizer::Impl::Minimization {
 public:
  // All must outlive it; `summary` is as it is made.
  Minimization(const ceres::Solver::Options& options, Impl* m,
               ceres::Solver::Summary* summary)
      : options_(options),
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
    if (options_.IsValid(&fault)) fault = m_.Read();
    if (!fault.empty()) return End(ceres::FAILURE, fault);
    m_.TakeState();
    summary_.fixed_cost = 0.0;
    if (!m_.Cost(m_.fixed_terms, m_.state, &summary_.fixed_cost)) {
      return End(ceres::FAILURE, "Evaluation of the fixed residuals failed.");
    }
    summary_.num_parameter_blocks_reduced =
        static_cast<int>(m_.variables.size());
    summary_.num_residual_blocks_reduced = static_cast<int>(m_.terms.size());
    summary_.num_effective_parameters_reduced = m_.num_columns;
    summary_.initial_cost = summary_.final_cost = summary_.fixed_cost;
    summary_.preprocessor_time_in_seconds = watch_.Seconds();
    if (m_.variables.empty() || m_.terms.empty()) {
      return End(ceres::CONVERGENCE, "No parameter block varies.");
    }
    if (!Linearize()) {
      return End(
          ceres::FAILURE,
          "Residual and Jacobian evaluation failed at the initial state.");
    }
    summary_.initial_cost = cost_ + summary_.fixed_cost;

    const int n = m_.num_columns;
    scale_ = Eigen::VectorXd::Ones(n);
    if (options_.jacobi_scaling) {
      for (int c = 0; c < n; ++c) {
        scale_[c] = 1.0 / (1.0 + std::sqrt(m_.values[m_.diagonal[c]]));
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
      StartIteration(step_.iteration + 1);
      if (!ComputeStep()) {
        if (!HandleInvalidStep()) return;
        continue;
      }
      ComputeCandidate();
      if (ParameterToleranceReached() || FunctionToleranceReached()) return;
      step_.relative_decrease = judge_->Quality(candidate_cost_, model_change_);
      if (step_.relative_decrease > options_.min_relative_decrease) {
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
    if ((step_.step_is_successful || step_.iteration == 0) &&
        step_.gradient_max_norm <= options_.gradient_tolerance) {
      return End(ceres::CONVERGENCE, "Gradient tolerance reached.");
    }
    if (radius_ <= options_.min_trust_region_radius) {
      return End(ceres::CONVERGENCE, "Minimum trust region radius reached.");
    }
    return true;
  }

  // False when it leads nowhere.
  bool ComputeStep() {
    const Eigen::VectorXd damping = normal_diagonal_ / radius_;
    const ScopedTimer timer(&summary_.linear_solver_time_in_seconds);
    ++summary_.num_linear_solves;
    if (!m_.SolveDamped(damping, -scaled_gradient_, &y_)) return false;
    // With (H + D) y = -g:  -g'y - y'Hy/2 = -g'y/2 + y'Dy/2.
    model_change_ =
        0.5 * (y_.dot(damping.cwiseProduct(y_)) - scaled_gradient_.dot(y_));
    step_.step_is_valid = model_change_ > 0.0;
    return step_.step_is_valid;
  }

  void ComputeCandidate() {
    invalid_steps_ = 0;
    const Eigen::VectorXd delta = scale_.cwiseProduct(y_);
    {
      const ScopedTimer timer(&summary_.residual_evaluation_time_in_seconds);
      if (!m_.Plus(m_.state, delta, &candidate_) || !candidate_.allFinite() ||
          !m_.Cost(m_.terms, candidate_, &candidate_cost_)) {
        candidate_cost_ = std::numeric_limits<double>::max();
      }
      ++summary_.num_residual_evaluations;
    }
    step_.step_norm = (candidate_ - m_.state).norm();
    step_.cost_change = cost_ - candidate_cost_;
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
    if (!Linearize()) {
      is_usable_ = false;
      return End(ceres::FAILURE,
                 "Residual and Jacobian evaluation failed after a step.");
    }
    Rescale();
    if (cost_ < best_cost_) {
      best_cost_ = cost_;
      best_ = m_.state;
    }
    radius_ = std::min(
        options_.max_trust_region_radius,
        radius_ /
            std::max(1.0 / 3.0,
                     1.0 - std::pow(2.0 * step_.relative_decrease - 1.0, 3)));
    decrease_factor_ = 2.0;
    NoteLinearization();
    return true;
  }

  bool Linearize() {
    const ScopedTimer timer(&summary_.jacobian_evaluation_time_in_seconds);
    ++summary_.num_jacobian_evaluations;
    return m_.Linearize(&cost_);
  }

  void Rescale() {
    m_.Scale(scale_);
    scaled_gradient_ = scale_.cwiseProduct(m_.gradient);
    for (int c = 0; c < m_.num_columns; ++c) {
      normal_diagonal_[c] =
          std::clamp(m_.values[m_.diagonal[c]], options_.min_lm_diagonal,
                     options_.max_lm_diagonal);
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

  const ceres::Solver::Options& options_;
  Impl& m_;
  ceres::Solver::Summary& summary_;
  const Stopwatch watch_;

  // Of the present state, and of the lowest so far: steps may lead uphill.
  double cost_ = 0.0;
  double best_cost_ = 0.0;
  Eigen::VectorXd best_;
  bool is_usable_ = true;
  std::optional<StepJudge> judge_;

  // Of the columns: Jacobi scaling, gradient, diagonal of the normal matrix
  // within bounds.
  Eigen::VectorXd scale_;
  Eigen::VectorXd scaled_gradient_;
  Eigen::VectorXd normal_diagonal_;

  double radius_;
  double decrease_factor_ = 2.0;
  int invalid_steps_ = 0;

  // The step under way.
  ceres::IterationSummary step_;
  Eigen::VectorXd y_;
  double model_change_ = 0.0;
  Eigen::VectorXd candidate_;
  double candidate_cost_ = 0.0;
};

ResidentMinimizer::ResidentMinimizer(ceres::Problem* problem)
    : impl_(std::make_unique<Impl>(problem)) {}

ResidentMinimizer::~ResidentMinimizer() = default;

void ResidentMinimizer::Forget() { impl_->is_forgotten = true; }

int ResidentMinimizer::num_analyses() const { return impl_->num_analyses; }

void ResidentMinimizer::Solve(const ceres::Solver::Options& options,
                              ceres::Solver::Summary* summary) {
  *summary = ceres::Solver::Summary();
  Impl::Minimization(options, impl_.get(), summary).Run();
}

}  // namespace plumbline
