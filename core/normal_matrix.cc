#include <plumbline/core/normal_matrix.h>
#include <suitesparse/cholmod.h>

#include <algorithm>
#include <array>
#include <iterator>

namespace plumbline {
namespace {

using Argument = FlatProblem::Argument;
using Term = FlatProblem::Term;
using Variable = FlatProblem::Variable;

// gradient += a' residual for a row-major Jacobian.
template <int kRows, int kA>
void AddGradient(const double* a, const double* residual, double* gradient) {
  for (int r = 0; r < kRows; ++r) {
    for (int i = 0; i < kA; ++i) gradient[i] += a[r * kA + i] * residual[r];
  }
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

// destination += a' a.
template <int kRows, int kA>
void AddSquare(const double* a, double* destination, int stride) {
  for (int j = 0; j < kA; ++j) {
    for (int i = 0; i <= j; ++i) {
      double sum = 0.0;
      for (int r = 0; r < kRows; ++r) sum += a[r * kA + i] * a[r * kA + j];
      destination[j * stride + i] += sum;
      if (i != j) destination[i * stride + j] += sum;
    }
  }
}

// What a term of two variables adds: its Jacobians, and where the squares and
// the product go.
struct PairSums {
  const double* a;
  const double* b;
  const double* residual;
  double* gradient_a;
  double* gradient_b;
  double* square_a;
  double* square_b;
  double* product;
  int stride_a;
  int stride_b;
  int stride;
  bool is_turned;
};

template <int kRows, int kA, int kB>
void AddPair(const PairSums& sums) {
  AddGradient<kRows, kA>(sums.a, sums.residual, sums.gradient_a);
  AddGradient<kRows, kB>(sums.b, sums.residual, sums.gradient_b);
  AddSquare<kRows, kA>(sums.a, sums.square_a, sums.stride_a);
  if (sums.is_turned) {
    AddProduct<kRows, kB, kA>(sums.b, sums.a, sums.product, sums.stride);
  } else {
    AddProduct<kRows, kA, kB>(sums.a, sums.b, sums.product, sums.stride);
  }
  AddSquare<kRows, kB>(sums.b, sums.square_b, sums.stride_b);
}

// Sizes for which loops are of fixed length.
constexpr int kUsualSize = 3;
using AddPairFunction = void (*)(const PairSums&);

template <int kRows, int kA>
constexpr std::array<AddPairFunction, kUsualSize> PairsOf() {
  return {&AddPair<kRows, kA, 1>, &AddPair<kRows, kA, 2>,
          &AddPair<kRows, kA, 3>};
}

template <int kRows>
constexpr std::array<std::array<AddPairFunction, kUsualSize>, kUsualSize>
PairsOfRows() {
  return {PairsOf<kRows, 1>(), PairsOf<kRows, 2>(), PairsOf<kRows, 3>()};
}

// By rows and by the sizes of both tangents, from one on.
constexpr std::array<
    std::array<std::array<AddPairFunction, kUsualSize>, kUsualSize>, kUsualSize>
    kAddPair = {PairsOfRows<1>(), PairsOfRows<2>(), PairsOfRows<3>()};

void AddProduct(int rows, int size_a, int size_b, const double* a,
                const double* b, double* destination, int stride) {
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

// Calls visit(product, a, b) with the pairs of variables of a term.
template <typename Visit>
void ForProducts(const FlatProblem& problem, const Term& term,
                 const Visit& visit) {
  const std::vector<Argument>& arguments = problem.arguments();
  int product = term.products;
  for (int i = term.begin; i < term.end; ++i) {
    if (arguments[i].variable < 0) continue;
    for (int j = i; j < term.end; ++j) {
      if (arguments[j].variable < 0) continue;
      visit(product++, arguments[i].variable, arguments[j].variable);
    }
  }
}

cholmod_sparse Pattern(int size, bool is_upper, std::vector<int>* begin,
                       std::vector<int>* rows) {
  cholmod_sparse matrix = {};
  matrix.nrow = size;
  matrix.ncol = size;
  matrix.nzmax = rows->size();
  matrix.p = begin->data();
  matrix.i = rows->data();
  matrix.stype = is_upper ? 1 : -1;
  matrix.itype = CHOLMOD_INT;
  matrix.xtype = CHOLMOD_PATTERN;
  matrix.dtype = CHOLMOD_DOUBLE;
  matrix.sorted = 1;
  matrix.packed = 1;
  return matrix;
}

}  // namespace

struct NormalMatrix::Factorization {
  Factorization() {
    cholmod_start(&common);
    common.print = 0;
    common.quick_return_if_not_posdef = 1;
  }
  Factorization(const Factorization&) = delete;
  Factorization& operator=(const Factorization&) = delete;
  ~Factorization() {
    Clear();
    cholmod_finish(&common);
  }

  void Clear() {
    if (factor != nullptr) cholmod_free_factor(&factor, &common);
  }

  // The order in which little fills in; empty when there is not enough memory.
  std::vector<int> OrderOf(cholmod_sparse pattern) {
    common.nmethods = 1;
    common.method[0].ordering = CHOLMOD_AMD;
    common.postorder = 1;
    common.supernodal = CHOLMOD_SIMPLICIAL;
    cholmod_factor* ordered = cholmod_analyze(&pattern, &common);
    if (ordered == nullptr) return {};
    const int* const order = static_cast<const int*>(ordered->Perm);
    std::vector<int> result(order, order + pattern.nrow);
    cholmod_free_factor(&ordered, &common);
    return result;
  }

  // Analyses a matrix whose columns come in the order of elimination.
  bool Analyse(cholmod_sparse matrix) {
    common.method[0].ordering = CHOLMOD_NATURAL;
    common.postorder = 0;
    common.supernodal = CHOLMOD_AUTO;
    factor = cholmod_analyze(&matrix, &common);
    return factor != nullptr;
  }

  bool Factorize(cholmod_sparse matrix) {
    common.status = CHOLMOD_OK;
    return cholmod_factorize(&matrix, factor, &common) != 0 &&
           common.status == CHOLMOD_OK;
  }

  bool Solve(const Eigen::VectorXd& right, Eigen::VectorXd* y) {
    const auto n = static_cast<std::size_t>(right.size());
    cholmod_dense b = {};
    b.nrow = n;
    b.ncol = 1;
    b.nzmax = n;
    b.d = n;
    b.x = const_cast<double*>(right.data());
    b.xtype = CHOLMOD_REAL;
    b.dtype = CHOLMOD_DOUBLE;
    cholmod_dense* x = cholmod_solve(CHOLMOD_A, factor, &b, &common);
    if (x == nullptr) return false;
    *y = Eigen::Map<const Eigen::VectorXd>(static_cast<const double*>(x->x),
                                           right.size());
    cholmod_free_dense(&x, &common);
    return y->allFinite();
  }

  cholmod_common common = {};
  cholmod_factor* factor = nullptr;
};

NormalMatrix::NormalMatrix()
    : factorization_(std::make_unique<Factorization>()) {}

NormalMatrix::~NormalMatrix() = default;

bool NormalMatrix::is_analysed() const {
  return factorization_->factor != nullptr;
}

// Of the products of two variables.
NormalMatrix::Place NormalMatrix::PlaceOf(int a, int b) const {
  Place place;
  place.is_turned = a != b && (rank_[a] < rank_[b]) == is_lower_;
  place.stride = stride_[place.is_turned ? a : b];
  const int row = rank_[place.is_turned ? b : a];
  const int column = rank_[place.is_turned ? a : b];
  const auto begin = block_rows_.begin() + block_begin_[column];
  const auto end = block_rows_.begin() + block_begin_[column + 1];
  const auto found = std::lower_bound(begin, end, row);
  if (found != end && *found == row) {
    place.begin = block_places_[found - block_rows_.begin()];
  }
  return place;
}

// Finds the places of a term's products.
bool NormalMatrix::LookUp(const FlatProblem& problem, const Term& term) {
  bool has_all = true;
  ForProducts(problem, term, [&](int product, int a, int b) {
    places_[product] = PlaceOf(a, b);
    has_all = has_all && places_[product].begin >= 0;
  });
  return has_all;
}

bool NormalMatrix::FindPlaces(const FlatProblem& problem) {
  places_.swap(old_places_);
  places_.resize(problem.num_products());
  const std::vector<Term>& terms = problem.terms();
  bool has_all = true;
  for (std::size_t k = 0; k < terms.size(); ++k) {
    if (const Term* const old = problem.KeptFrom(k)) {
      std::copy_n(old_places_.begin() + old->products, old->num_products(),
                  places_.begin() + terms[k].products);
    } else if (!LookUp(problem, terms[k])) {
      has_all = false;
    }
  }
  return has_all;
}

// Pairs of variables that terms have in common, and each with itself, by
// column, once and in order: the upper triangle of the blocks when variables
// come in the order of ranks, the lower one on request.
void NormalMatrix::BlockPattern(const FlatProblem& problem, bool has_lower) {
  const int n = static_cast<int>(problem.variables().size());
  const auto column_of = [&](int a, int b) {
    return has_lower ? std::min(rank_[a], rank_[b])
                     : std::max(rank_[a], rank_[b]);
  };
  std::vector<int> next(n + 1, 0);
  for (int v = 0; v < n; ++v) next[v + 1] = 1;
  const auto for_pairs = [&](const auto& visit) {
    for (const Term& term : problem.terms()) {
      ForProducts(problem, term, [&](int /*product*/, int a, int b) {
        if (a != b) visit(column_of(a, b), rank_[a] + rank_[b]);
      });
    }
  };
  for_pairs([&](int column, int /*sum*/) { ++next[column + 1]; });
  for (int v = 0; v < n; ++v) next[v + 1] += next[v];
  const std::vector<int> first = next;
  std::vector<int> all(next[n]);
  for (int v = 0; v < n; ++v) all[next[v]++] = v;
  for_pairs([&](int column, int sum) { all[next[column]++] = sum - column; });
  block_begin_.assign(1, 0);
  block_rows_.clear();
  block_rows_.reserve(all.size());
  for (int v = 0; v < n; ++v) {
    std::sort(all.begin() + first[v], all.begin() + first[v + 1]);
    std::unique_copy(all.begin() + first[v], all.begin() + first[v + 1],
                     std::back_inserter(block_rows_));
    block_begin_.push_back(static_cast<int>(block_rows_.size()));
  }
}

// Orders variables so that little fills in, by blocks.
bool NormalMatrix::Order(const FlatProblem& problem) {
  const std::vector<Variable>& variables = problem.variables();
  const int n = static_cast<int>(variables.size());
  rank_.resize(n);
  for (int v = 0; v < n; ++v) rank_[v] = v;
  BlockPattern(problem, /*has_lower=*/false);
  by_rank_ = factorization_->OrderOf(
      Pattern(n, /*is_upper=*/true, &block_begin_, &block_rows_));
  if (by_rank_.empty()) return false;
  int column = 0;
  column_.resize(n);
  for (int r = 0; r < n; ++r) {
    const int v = by_rank_[r];
    rank_[v] = r;
    column_[v] = column;
    column += variables[v].tangent_size;
  }
  return true;
}

// Lays out one triangle by columns in the order of ranks, so that nothing has
// to be permuted when it is factorized.
void NormalMatrix::LayOut(const FlatProblem& problem, bool has_lower) {
  const std::vector<Variable>& variables = problem.variables();
  is_lower_ = has_lower;
  BlockPattern(problem, is_lower_);
  const int n = static_cast<int>(variables.size());
  block_places_.resize(block_rows_.size());
  column_begin_.assign(1, 0);
  rows_.clear();
  stride_.assign(n, 0);
  diagonal_.resize(problem.num_columns());
  for (int r = 0; r < n; ++r) {
    const int v = by_rank_[r];
    const int begin = column_begin_.back();
    int length = 0;
    int on_diagonal = 0;
    for (int k = block_begin_[r]; k < block_begin_[r + 1]; ++k) {
      block_places_[k] = begin + length;
      if (block_rows_[k] == r) on_diagonal = begin + length;
      length += variables[by_rank_[block_rows_[k]]].tangent_size;
    }
    stride_[v] = length;
    for (int c = 0; c < variables[v].tangent_size; ++c) {
      diagonal_[column_[v] + c] = on_diagonal + c * length + c;
      for (int k = block_begin_[r]; k < block_begin_[r + 1]; ++k) {
        const int row = by_rank_[block_rows_[k]];
        for (int i = 0; i < variables[row].tangent_size; ++i) {
          rows_.push_back(column_[row] + i);
        }
      }
      column_begin_.push_back(static_cast<int>(rows_.size()));
    }
  }
  values_.assign(rows_.size(), 0.0);
  other_values_.resize(rows_.size());
  damped_.resize(rows_.size());
  places_.resize(problem.num_products());
  for (const Term& term : problem.terms()) LookUp(problem, term);
}

bool NormalMatrix::Analyse(const FlatProblem& problem) {
  factorization_->Clear();
  ++num_analyses_;
  if (!Order(problem)) return false;
  LayOut(problem, /*has_lower=*/false);
  if (!factorization_->Analyse(Pattern(problem.num_columns(),
                                       /*is_upper=*/true, &column_begin_,
                                       &rows_))) {
    return false;
  }
  // The triangle that CHOLMOD takes as it is.
  if (factorization_->factor->is_super != 0) {
    LayOut(problem, /*has_lower=*/true);
  }
  return true;
}

void NormalMatrix::SetZero() { std::fill(values_.begin(), values_.end(), 0.0); }

void NormalMatrix::Add(const FlatProblem& problem, const Term& term,
                       const double* const* jacobians, const double* residual,
                       double* gradient) {
  const Argument* const arguments = &problem.arguments()[term.begin];
  const Place* const places = &places_[term.products];
  const int count = term.end - term.begin;
  if (count == 2 && term.num_variables == 2 && term.rows <= kUsualSize &&
      arguments[0].tangent_size <= kUsualSize &&
      arguments[1].tangent_size <= kUsualSize) {
    PairSums sums;
    sums.a = jacobians[0];
    sums.b = jacobians[1];
    sums.residual = residual;
    sums.gradient_a = gradient + column_[arguments[0].variable];
    sums.gradient_b = gradient + column_[arguments[1].variable];
    sums.square_a = &values_[places[0].begin];
    sums.product = &values_[places[1].begin];
    sums.square_b = &values_[places[2].begin];
    sums.stride_a = places[0].stride;
    sums.stride = places[1].stride;
    sums.stride_b = places[2].stride;
    sums.is_turned = places[1].is_turned;
    kAddPair[term.rows - 1][arguments[0].tangent_size - 1]
            [arguments[1].tangent_size - 1](sums);
    return;
  }
  int product = 0;
  for (int i = 0; i < count; ++i) {
    if (arguments[i].variable < 0) continue;
    const double* const jacobian = jacobians[i];
    const int size = arguments[i].tangent_size;
    double* const g = gradient + column_[arguments[i].variable];
    for (int r = 0; r < term.rows; ++r) {
      for (int c = 0; c < size; ++c) {
        g[c] += jacobian[r * size + c] * residual[r];
      }
    }
    for (int j = i; j < count; ++j) {
      if (arguments[j].variable < 0) continue;
      const int other_size = arguments[j].tangent_size;
      const Place& place = places[product++];
      double* const begin = &values_[place.begin];
      if (place.is_turned) {
        AddProduct(term.rows, other_size, size, jacobians[j], jacobian, begin,
                   place.stride);
      } else {
        AddProduct(term.rows, size, other_size, jacobian, jacobians[j], begin,
                   place.stride);
      }
    }
  }
}

bool NormalMatrix::SolveDamped(const Eigen::VectorXd& scale,
                               const Eigen::VectorXd& damping,
                               const Eigen::VectorXd& right,
                               Eigen::VectorXd* y) {
  const int n = static_cast<int>(right.size());
  for (int c = 0; c < n; ++c) {
    for (int k = column_begin_[c]; k < column_begin_[c + 1]; ++k) {
      damped_[k] = values_[k] * scale[c] * scale[rows_[k]];
    }
    damped_[diagonal_[c]] += damping[c];
  }
  cholmod_sparse matrix = Pattern(n, !is_lower_, &column_begin_, &rows_);
  matrix.xtype = CHOLMOD_REAL;
  matrix.x = damped_.data();
  return factorization_->Factorize(matrix) && factorization_->Solve(right, y);
}

bool NormalMatrix::SolveAgain(const Eigen::VectorXd& right,
                              Eigen::VectorXd* y) {
  return factorization_->Solve(right, y);
}

double NormalMatrix::LeastPivot() {
  return cholmod_rcond(factorization_->factor, &factorization_->common);
}

}  // namespace plumbline
