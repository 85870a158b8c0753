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
#include <iterator>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

using ConstVectorMap = Eigen::Map<const Eigen::VectorXd>;
using VectorMap = Eigen::Map<Eigen::VectorXd>;
using RowMajor =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// Pivots of the scaled normal matrix, relative to the largest, below which they
// may be those of an undetermined direction and rounding.
constexpr double kLeastPivot = 1e-12;
// What a step may raise the cost to that is hoped to be made up for.
constexpr double kLargestRise = 2.0;
// Residual blocks that may have gone between two that stayed.
constexpr std::size_t kLookAhead = 8;

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

// A parameter block of the problem.
struct Block {
  double* user = nullptr;
  bool is_constant = false;
  // -1: does not vary.
  int variable = -1;
};

// One parameter block of a residual block.
struct Argument {
  int block = 0;
  // -1: constant.
  int variable = -1;
  // In the array of Jacobians: with respect to the block, and to its tangent.
  int jacobian = 0;
  int size = 0;
};

// A residual block.
struct Term {
  ceres::ResidualBlockId id = nullptr;
  const ceres::CostFunction* cost = nullptr;
  const ceres::LossFunction* loss = nullptr;
  int rows = 0;
  // In the arguments.
  int begin = 0;
  int end = 0;
  // None: all its parameters are constant.
  int num_variables = 0;
  // In the destinations of the products of its Jacobians, for each pair of
  // variables one.
  int products = 0;

  int num_products() const { return num_variables * (num_variables + 1) / 2; }
};

// Numbers of addresses, in an open table: looked up for every parameter of
// every residual.
class AddressIndex {
 public:
  void Clear(std::size_t expected_size) {
    std::size_t capacity = 16;
    shift_ = 60;
    while (capacity < 2 * expected_size) {
      capacity *= 2;
      --shift_;
    }
    slots_.assign(capacity, {nullptr, -1});
    size_ = 0;
  }

  // The number of the address; a new one gets `next`.
  int FindOrAdd(const double* address, int next) {
    if (2 * (size_ + 1) > slots_.size()) Grow();
    std::pair<const double*, int>& slot = slots_[SlotOf(address)];
    if (slot.first == nullptr) {
      slot = {address, next};
      ++size_;
    }
    return slot.second;
  }

  // -1: not there.
  int Find(const double* address) const {
    return slots_.empty() ? -1 : slots_[SlotOf(address)].second;
  }

 private:
  std::size_t SlotOf(const double* address) const {
    constexpr std::uint64_t kGolden = 0x9E3779B97F4A7C15u;
    std::size_t slot =
        (reinterpret_cast<std::uintptr_t>(address) * kGolden) >> shift_;
    while (slots_[slot].first != nullptr && slots_[slot].first != address) {
      slot = (slot + 1) % slots_.size();
    }
    return slot;
  }

  void Grow() {
    std::vector<std::pair<const double*, int>> old;
    old.swap(slots_);
    Clear(std::max<std::size_t>(old.size(), 16));
    for (const auto& [address, number] : old) {
      if (address != nullptr) FindOrAdd(address, number);
    }
  }

  std::vector<std::pair<const double*, int>> slots_;
  std::size_t size_ = 0;
  int shift_ = 60;
};

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

template <int kRows>
bool AddUsualProduct(int size_a, int size_b, const double* a, const double* b,
                     double* destination, int stride) {
  if (size_a == 3 && size_b == 3) {
    AddProduct<kRows, 3, 3>(a, b, destination, stride);
  } else if (size_a == 3 && size_b == 2) {
    AddProduct<kRows, 3, 2>(a, b, destination, stride);
  } else if (size_a == 2 && size_b == 3) {
    AddProduct<kRows, 2, 3>(a, b, destination, stride);
  } else if (size_a == 2 && size_b == 2) {
    AddProduct<kRows, 2, 2>(a, b, destination, stride);
  } else {
    return false;
  }
  return true;
}

void AddProduct(int rows, int size_a, int size_b, const double* a,
                const double* b, double* destination, int stride) {
  const auto usual = rows == 3   ? &AddUsualProduct<3>
                     : rows == 2 ? &AddUsualProduct<2>
                     : rows == 1 ? &AddUsualProduct<1>
                                 : nullptr;
  if (usual != nullptr && usual(size_a, size_b, a, b, destination, stride)) {
    return;
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

  // Reads the problem; empty when it can be solved, or why not. What is as it
  // was at the last solve is taken over.
  std::string Read() {
    terms.swap(old_terms);
    arguments.swap(old_arguments);
    places.swap(old_places);
    ReadResiduals();
    const bool may_keep = factor != nullptr && !is_forgotten;
    const bool has_same_blocks = may_keep && FindBlocks();
    bool has_same_variables = has_same_blocks;
    if (!has_same_blocks) {
      IndexBlocks();
      has_same_variables = may_keep && KeepVariables();
    }
    if (!has_same_variables) {
      const std::string fault = MakeVariables();
      if (!fault.empty()) return fault;
    }
    ReadTerms(has_same_blocks);
    if (has_same_variables && FindPlaces()) return {};
    if (has_same_variables) {
      // What is analysed anew does not depend on what was before.
      IndexBlocks();
      const std::string fault = MakeVariables();
      if (!fault.empty()) return fault;
      ReadTerms(/*has_same_blocks=*/false);
    }
    is_forgotten = false;
    if (variables.empty()) return {};
    return Analyse() ? std::string() : "The normal matrix is too large.";
  }

  // Residual blocks and the parameter blocks of each. Their order is that of
  // the calls that made them. (That of the problem's parameter blocks is the
  // order of their addresses, which differs from run to run.)
  void ReadResiduals() {
    problem->GetResidualBlocks(&ids);
    users.clear();
    terms.resize(ids.size());
    std::vector<double*> blocks;
    for (std::size_t k = 0; k < ids.size(); ++k) {
      Term& term = terms[k];
      term.id = ids[k];
      term.cost = problem->GetCostFunctionForResidualBlock(ids[k]);
      term.loss = problem->GetLossFunctionForResidualBlock(ids[k]);
      term.rows = term.cost->num_residuals();
      problem->GetParameterBlocksForResidualBlock(ids[k], &blocks);
      term.begin = static_cast<int>(users.size());
      users.insert(users.end(), blocks.begin(), blocks.end());
      term.end = static_cast<int>(users.size());
    }
    arguments.resize(users.size());
  }

  // Finds terms of the last solve, and blocks of the others; false when some
  // block has come, gone, or changed.
  bool FindBlocks() {
    old_of.assign(terms.size(), -1);
    std::vector<char> is_used(blocks.size(), 0);
    std::size_t next = 0;
    for (std::size_t k = 0; k < terms.size(); ++k) {
      const Term& term = terms[k];
      // Residuals that went are passed over where the others moved up.
      std::size_t old = next;
      const std::size_t last = std::min(next + kLookAhead, old_terms.size());
      while (old < last && old_terms[old].id != term.id) ++old;
      if (old < last && IsSame(term, old_terms[old])) {
        old_of[k] = static_cast<int>(old);
        next = old;
      }
      ++next;
      for (int i = term.begin; i < term.end; ++i) {
        const int block =
            old_of[k] >= 0
                ? old_arguments[old_terms[old].begin + i - term.begin].block
                : block_index.Find(users[i]);
        if (block < 0) return false;
        arguments[i].block = block;
        is_used[block] = 1;
      }
    }
    for (std::size_t b = 0; b < blocks.size(); ++b) {
      const Block& block = blocks[b];
      if (is_used[b] == 0 ||
          problem->IsParameterBlockConstant(block.user) != block.is_constant ||
          (block.variable >= 0 && problem->GetManifold(block.user) !=
                                      variables[block.variable].manifold)) {
        return false;
      }
    }
    return true;
  }

  bool IsSame(const Term& term, const Term& old) const {
    if (term.cost != old.cost || term.loss != old.loss ||
        term.rows != old.rows || term.end - term.begin != old.end - old.begin) {
      return false;
    }
    for (int i = 0; i < term.end - term.begin; ++i) {
      if (users[term.begin + i] !=
          blocks[old_arguments[old.begin + i].block].user) {
        return false;
      }
    }
    return true;
  }

  // Blocks in the order in which residuals name them; `old_blocks` are those of
  // the last solve.
  void IndexBlocks() {
    old_blocks.swap(blocks);
    std::swap(old_block_index, block_index);
    blocks.clear();
    block_index.Clear(std::max<std::size_t>(old_blocks.size(), 64));
    for (std::size_t i = 0; i < users.size(); ++i) {
      const int next = static_cast<int>(blocks.size());
      arguments[i].block = block_index.FindOrAdd(users[i], next);
      if (arguments[i].block == next) {
        Block block;
        block.user = users[i];
        block.is_constant = problem->IsParameterBlockConstant(users[i]);
        blocks.push_back(block);
      }
    }
  }

  bool IsVariable(const Block& block) const {
    return !block.is_constant &&
           problem->ParameterBlockTangentSize(block.user) > 0;
  }

  // Has the blocks that vary be the variables that there are; false when they
  // are not the same ones.
  bool KeepVariables() {
    std::size_t num_variables = 0;
    for (Block& block : blocks) {
      if (!IsVariable(block)) continue;
      const int old = old_block_index.Find(block.user);
      if (old < 0 || old_blocks[old].variable < 0) return false;
      Variable& variable = variables[old_blocks[old].variable];
      if (variable.tangent_size !=
              problem->ParameterBlockTangentSize(block.user) ||
          variable.manifold != problem->GetManifold(block.user)) {
        return false;
      }
      block.variable = old_blocks[old].variable;
      ++num_variables;
    }
    return num_variables == variables.size();
  }

  // Variables from the blocks that vary; why not, if they cannot be.
  std::string MakeVariables() {
    variables.clear();
    int state_size = 0;
    int plus_size = 0;
    num_columns = 0;
    for (Block& block : blocks) {
      block.variable = -1;
      if (!IsVariable(block)) continue;
      Variable variable;
      variable.user = block.user;
      variable.size = problem->ParameterBlockSize(block.user);
      variable.tangent_size = problem->ParameterBlockTangentSize(block.user);
      variable.manifold = problem->GetManifold(block.user);
      variable.state = state_size;
      if (variable.manifold != nullptr) {
        variable.plus_jacobian = plus_size;
        plus_size += variable.size * variable.tangent_size;
      }
      for (int i = 0; i < variable.size; ++i) {
        if (problem->GetParameterLowerBound(block.user, i) >
                -std::numeric_limits<double>::max() ||
            problem->GetParameterUpperBound(block.user, i) <
                std::numeric_limits<double>::max()) {
          variables.clear();
          is_forgotten = true;
          return "Bounds of parameters are not supported.";
        }
      }
      state_size += variable.size;
      num_columns += variable.tangent_size;
      block.variable = static_cast<int>(variables.size());
      variables.push_back(variable);
    }
    plus_jacobians.resize(plus_size);
    state.resize(state_size);
    return {};
  }

  // Arguments and products of terms. With the same blocks, those found among
  // the old ones are copied, places included.
  void ReadTerms(bool has_same_blocks) {
    num_products = 0;
    num_reduced_terms = 0;
    places.clear();
    places.reserve(old_places.size());
    unplaced.clear();
    for (std::size_t k = 0; k < terms.size(); ++k) {
      Term& term = terms[k];
      term.products = num_products;
      if (has_same_blocks && old_of[k] >= 0) {
        const Term& old = old_terms[old_of[k]];
        std::copy(old_arguments.begin() + old.begin,
                  old_arguments.begin() + old.end,
                  arguments.begin() + term.begin);
        term.num_variables = old.num_variables;
        places.insert(places.end(), old_places.begin() + old.products,
                      old_places.begin() + old.products + old.num_products());
      } else {
        ReadTerm(&term);
        places.resize(places.size() + term.num_products());
        unplaced.push_back(static_cast<int>(k));
      }
      num_products += term.num_products();
      if (term.num_variables > 0) ++num_reduced_terms;
    }
  }

  void ReadTerm(Term* term) {
    int jacobian = 0;
    term->num_variables = 0;
    for (int i = term->begin; i < term->end; ++i) {
      Argument& argument = arguments[i];
      argument.variable = blocks[argument.block].variable;
      if (argument.variable < 0) continue;
      argument.size = variables[argument.variable].size;
      argument.jacobian = jacobian;
      jacobian += term->rows * argument.size;
      ++term->num_variables;
    }
    const auto grow = [](auto* values, int size) {
      if (static_cast<int>(values->size()) < size) values->resize(size);
    };
    grow(&residual, term->rows);
    grow(&jacobians, jacobian);
    grow(&tangent_jacobians, jacobian);
    grow(&jacobian_pointers, term->end - term->begin);
    grow(&argument_pointers, term->end - term->begin);
  }

  // -- The normal matrix ------------------------------------------------------

  // Calls visit(product, a, b) with the pairs of variables of a term.
  template <typename Visit>
  void ForProducts(const Term& term, const Visit& visit) const {
    int product = term.products;
    for (int i = term.begin; i < term.end; ++i) {
      if (arguments[i].variable < 0) continue;
      for (int j = i; j < term.end; ++j) {
        if (arguments[j].variable < 0) continue;
        visit(product++, arguments[i].variable, arguments[j].variable);
      }
    }
  }

  // Whether the block of two variables has those of `a` as rows.
  bool IsRow(int a, int b) const {
    return a == b || (rank[a] < rank[b]) != is_lower;
  }

  // Where the block of two variables begins in `values`; -1: nowhere.
  int PlaceOf(int a, int b) const {
    const int row = IsRow(a, b) ? rank[a] : rank[b];
    const int column = IsRow(a, b) ? rank[b] : rank[a];
    const auto begin = block_rows.begin() + block_begin[column];
    const auto end = block_rows.begin() + block_begin[column + 1];
    const auto found = std::lower_bound(begin, end, row);
    if (found == end || *found != row) return -1;
    return block_places[found - block_rows.begin()];
  }

  // Looks up where products go that have no place yet; false when there is no
  // place for one.
  bool FindPlaces() {
    bool has_all = true;
    for (const int k : unplaced) {
      ForProducts(terms[k], [&](int product, int a, int b) {
        places[product] = PlaceOf(a, b);
        has_all = has_all && places[product] >= 0;
      });
    }
    return has_all;
  }

  // Pairs of variables that terms have in common, and each with itself, by
  // column, once and in order: the upper triangle of the blocks when variables
  // come in the order of `place`, the lower one on request.
  void BlockPattern(const std::vector<int>& place, bool has_lower,
                    std::vector<int>* begin, std::vector<int>* rows_of) const {
    const int n = static_cast<int>(variables.size());
    const auto column_of = [&](int a, int b) {
      return has_lower ? std::min(place[a], place[b])
                       : std::max(place[a], place[b]);
    };
    std::vector<int> next(n + 1, 0);
    for (int v = 0; v < n; ++v) next[v + 1] = 1;
    const auto for_pairs = [&](const auto& visit) {
      for (const Term& term : terms) {
        ForProducts(term, [&](int /*product*/, int a, int b) {
          if (a != b) visit(column_of(a, b), place[a] + place[b]);
        });
      }
    };
    for_pairs([&](int column, int /*sum*/) { ++next[column + 1]; });
    for (int v = 0; v < n; ++v) next[v + 1] += next[v];
    const std::vector<int> first = next;
    std::vector<int> all(next[n]);
    for (int v = 0; v < n; ++v) all[next[v]++] = v;
    for_pairs([&](int column, int sum) { all[next[column]++] = sum - column; });
    begin->assign(1, 0);
    rows_of->clear();
    rows_of->reserve(all.size());
    for (int v = 0; v < n; ++v) {
      std::sort(all.begin() + first[v], all.begin() + first[v + 1]);
      std::unique_copy(all.begin() + first[v], all.begin() + first[v + 1],
                       std::back_inserter(*rows_of));
      begin->push_back(static_cast<int>(rows_of->size()));
    }
  }

  // Orders variables so that little fills in, by blocks.
  bool OrderVariables() {
    const int n = static_cast<int>(variables.size());
    rank.resize(n);
    for (int v = 0; v < n; ++v) rank[v] = v;
    BlockPattern(rank, /*has_lower=*/false, &block_begin, &block_rows);
    cholmod_sparse blocks_matrix =
        Pattern(n, /*is_upper=*/true, &block_begin, &block_rows);
    common.nmethods = 1;
    common.method[0].ordering = CHOLMOD_AMD;
    common.postorder = 1;
    common.supernodal = CHOLMOD_SIMPLICIAL;
    cholmod_factor* ordered = cholmod_analyze(&blocks_matrix, &common);
    if (ordered == nullptr) return false;
    const int* const order = static_cast<const int*>(ordered->Perm);
    int column = 0;
    by_rank.assign(order, order + n);
    for (int r = 0; r < n; ++r) {
      Variable& variable = variables[by_rank[r]];
      rank[by_rank[r]] = r;
      variable.column = column;
      column += variable.tangent_size;
    }
    cholmod_free_factor(&ordered, &common);
    return true;
  }

  // Lays out one triangle by columns in the order of ranks, so that nothing has
  // to be permuted when it is factorized.
  void LayOut(bool has_lower) {
    is_lower = has_lower;
    BlockPattern(rank, is_lower, &block_begin, &block_rows);
    const int n = static_cast<int>(variables.size());
    block_places.resize(block_rows.size());
    column_begin.assign(1, 0);
    rows.clear();
    stride.assign(n, 0);
    diagonal.resize(num_columns);
    for (int r = 0; r < n; ++r) {
      const Variable& variable = variables[by_rank[r]];
      const int begin = column_begin.back();
      int length = 0;
      int on_diagonal = 0;
      for (int k = block_begin[r]; k < block_begin[r + 1]; ++k) {
        block_places[k] = begin + length;
        if (block_rows[k] == r) on_diagonal = begin + length;
        length += variables[by_rank[block_rows[k]]].tangent_size;
      }
      stride[by_rank[r]] = length;
      for (int c = 0; c < variable.tangent_size; ++c) {
        diagonal[variable.column + c] = on_diagonal + c * length + c;
        for (int k = block_begin[r]; k < block_begin[r + 1]; ++k) {
          const Variable& row = variables[by_rank[block_rows[k]]];
          for (int i = 0; i < row.tangent_size; ++i) {
            rows.push_back(row.column + i);
          }
        }
        column_begin.push_back(static_cast<int>(rows.size()));
      }
    }
    values.assign(rows.size(), 0.0);
    damped.resize(rows.size());
    unplaced.resize(terms.size());
    for (std::size_t k = 0; k < terms.size(); ++k) {
      unplaced[k] = static_cast<int>(k);
    }
    FindPlaces();
  }

  static cholmod_sparse Pattern(int size, bool is_upper,
                                std::vector<int>* begin,
                                std::vector<int>* rows_of) {
    cholmod_sparse matrix = {};
    matrix.nrow = size;
    matrix.ncol = size;
    matrix.nzmax = rows_of->size();
    matrix.p = begin->data();
    matrix.i = rows_of->data();
    matrix.stype = is_upper ? 1 : -1;
    matrix.itype = CHOLMOD_INT;
    matrix.xtype = CHOLMOD_PATTERN;
    matrix.dtype = CHOLMOD_DOUBLE;
    matrix.sorted = 1;
    matrix.packed = 1;
    return matrix;
  }

  cholmod_sparse Matrix() {
    cholmod_sparse matrix =
        Pattern(num_columns, !is_lower, &column_begin, &rows);
    matrix.xtype = CHOLMOD_REAL;
    matrix.x = damped.data();
    return matrix;
  }

  // Orders variables, lays out the matrix and analyses it.
  bool Analyse() {
    if (factor != nullptr) cholmod_free_factor(&factor, &common);
    is_undetermined = false;
    ++num_analyses;
    if (!OrderVariables()) return false;
    LayOut(/*has_lower=*/false);
    common.method[0].ordering = CHOLMOD_NATURAL;
    common.postorder = 0;
    common.supernodal = CHOLMOD_AUTO;
    cholmod_sparse matrix = Matrix();
    factor = cholmod_analyze(&matrix, &common);
    if (factor == nullptr) return false;
    // The triangle that CHOLMOD takes as it is.
    if (factor->is_super != 0) LayOut(/*has_lower=*/true);
    return true;
  }

  // Solves (scaled normal matrix + damping) y = right; false when the matrix is
  // not positive definite.
  bool SolveDamped(const Eigen::VectorXd& scale, const Eigen::VectorXd& damping,
                   const Eigen::VectorXd& right, Eigen::VectorXd* y) {
    for (int c = 0; c < num_columns; ++c) {
      for (int k = column_begin[c]; k < column_begin[c + 1]; ++k) {
        damped[k] = values[k] * scale[c] * scale[rows[k]];
      }
      damped[diagonal[c]] += damping[c];
    }
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

  // Of the last factorization, over the largest.
  double LeastPivot() { return cholmod_rcond(factor, &common); }

  // -- Evaluation -------------------------------------------------------------

  bool EvaluateTerm(const Term& term, const double* x, double** jacobian) {
    for (int i = term.begin; i < term.end; ++i) {
      const Argument& argument = arguments[i];
      argument_pointers[i - term.begin] =
          argument.variable < 0 ? blocks[argument.block].user
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

  // Of the terms that vary, or of those that do not.
  bool Cost(bool is_fixed, const Eigen::VectorXd& x, double* cost) {
    *cost = 0.0;
    if (is_fixed && num_reduced_terms == static_cast<int>(terms.size())) {
      return true;
    }
    for (const Term& term : terms) {
      if ((term.num_variables == 0) != is_fixed) continue;
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
      if (term.num_variables > 0 && !LinearizeTerm(term, cost)) return false;
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
        if (IsRow(first, second)) {
          AddProduct(term.rows, size, other_size, jacobian, other, place,
                     stride[second]);
        } else {
          AddProduct(term.rows, other_size, size, other, jacobian, place,
                     stride[first]);
        }
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
  // Residual blocks, the parameter blocks of all one after the other, and what
  // is known of them; the same of the last solve, while the problem is read,
  // and which of its terms each term is (-1: none).
  std::vector<ceres::ResidualBlockId> ids;
  std::vector<double*> users;
  std::vector<Term> terms;
  std::vector<Argument> arguments;
  std::vector<Term> old_terms;
  std::vector<Argument> old_arguments;
  std::vector<int> old_places;
  std::vector<int> old_of;
  // Blocks by address.
  std::vector<Block> blocks;
  std::vector<Block> old_blocks;
  AddressIndex block_index;
  AddressIndex old_block_index;
  std::vector<Variable> variables;
  int num_reduced_terms = 0;
  int num_columns = 0;
  int num_products = 0;

  // Variables in the order of elimination, and the place of each there.
  std::vector<int> by_rank;
  std::vector<int> rank;
  // The normal matrix: one triangle by columns, with whole blocks on the
  // diagonal; the blocks in it by ranks, where they begin in `values`, and how
  // far apart columns of a variable are.
  bool is_lower = false;
  std::vector<int> column_begin;
  std::vector<int> rows;
  std::vector<double> values;
  std::vector<double> damped;
  std::vector<int> diagonal;
  std::vector<int> block_begin;
  std::vector<int> block_rows;
  std::vector<int> block_places;
  std::vector<int> stride;
  // Where products begin in `values`, and the terms whose products are to be
  // looked up.
  std::vector<int> places;
  std::vector<int> unplaced;

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
  // Whether damping alone holds something; known until the next analysis.
  bool is_undetermined = false;
  bool is_forgotten = false;
  int num_analyses = 0;
};

// One solve: the loop of Ceres' trust region minimizer, by the same names.
class ResidentMinimizer::Impl::Minimization {
 public:
  // All must outlive it; `summary` is as it is made.
  Minimization(const ceres::Solver::Options& options, Damping damping, Impl* m,
               ceres::Solver::Summary* summary)
      : options_(options),
        damping_(damping),
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
    if (!m_.Cost(/*is_fixed=*/true, m_.state, &summary_.fixed_cost)) {
      return End(ceres::FAILURE, "Evaluation of the fixed residuals failed.");
    }
    summary_.num_parameter_blocks_reduced =
        static_cast<int>(m_.variables.size());
    summary_.num_residual_blocks_reduced = m_.num_reduced_terms;
    summary_.num_effective_parameters_reduced = m_.num_columns;
    summary_.initial_cost = summary_.final_cost = summary_.fixed_cost;
    summary_.preprocessor_time_in_seconds = watch_.Seconds();
    if (m_.variables.empty()) {
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

  // False when it leads nowhere.
  bool ComputeStep() {
    const ScopedTimer timer(&summary_.linear_solver_time_in_seconds);
    bool is_solved = false;
    if (step_.iteration == 1 && damping_ == Damping::kWhereNeeded &&
        !m_.is_undetermined) {
      const double given = radius_;
      radius_ = options_.max_trust_region_radius;
      is_solved = SolveDamped() && m_.LeastPivot() > kLeastPivot;
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
    return m_.SolveDamped(scale_, normal_diagonal_ / radius_, -scaled_gradient_,
                          &y_);
  }

  void ComputeCandidate() {
    invalid_steps_ = 0;
    const Eigen::VectorXd delta = scale_.cwiseProduct(y_);
    {
      const ScopedTimer timer(&summary_.residual_evaluation_time_in_seconds);
      if (!m_.Plus(m_.state, delta, &candidate_) || !candidate_.allFinite() ||
          !m_.Cost(/*is_fixed=*/false, candidate_, &candidate_cost_)) {
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
    if (!Linearize()) {
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
      decrease_factor_ = 2.0;
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
    for (int c = 0; c < m_.num_columns; ++c) {
      normal_diagonal_[c] =
          std::clamp(m_.values[m_.diagonal[c]] * scale_[c] * scale_[c],
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

  const ceres::Solver::Options& options_;
  const Damping damping_;
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
                              ceres::Solver::Summary* summary,
                              Damping damping) {
  *summary = ceres::Solver::Summary();
  Impl::Minimization(options, damping, impl_.get(), summary).Run();
}

}  // namespace plumbline
