#ifndef PLUMBLINE_CORE_FLAT_PROBLEM_H_
#define PLUMBLINE_CORE_FLAT_PROBLEM_H_

#include <ceres/cost_function.h>
#include <ceres/loss_function.h>
#include <ceres/manifold.h>
#include <ceres/problem.h>
#include <plumbline/core/problem_changes.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {

/// Numbers of addresses, in an open table: looked up for every parameter of
/// every residual.
class AddressIndex {
 public:
  /// Forgets everything, with room for this many.
  void Clear(std::size_t expected_size);

  /// The number of the address; a new one gets `next`.
  int FindOrAdd(const double* address, int next);

  /// -1: not there.
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
  void Grow();

  std::vector<std::pair<const double*, int>> slots_;
  std::size_t size_ = 0;
  int shift_ = 60;
};

/// A ceres::Problem in flat arrays, read before every solve; what is as it was
/// at the last reading is taken over.
class FlatProblem {
 public:
  /// A parameter block of the problem that varies.
  struct Variable {
    double* user = nullptr;
    const ceres::Manifold* manifold = nullptr;
    int size = 0;
    int tangent_size = 0;
    /// In the state, which has the values of all variables one after the other.
    int state = 0;
    /// In the array of Jacobians of Plus; -1 where that is the identity.
    int plus_jacobian = -1;
  };

  /// A parameter block of the problem.
  struct Block {
    double* user = nullptr;
    int size = 0;
    bool is_constant = false;
    /// -1: does not vary.
    int variable = -1;
  };

  /// One parameter block of a residual block.
  struct Argument {
    int block = 0;
    /// -1: constant.
    int variable = -1;
    /// In the array of Jacobians of one term: with respect to the block, and to
    /// its tangent.
    int jacobian = 0;
    int size = 0;
    int tangent_size = 0;
  };

  /// A residual block.
  struct Term {
    ceres::ResidualBlockId id = nullptr;
    const ceres::CostFunction* cost = nullptr;
    const ceres::LossFunction* loss = nullptr;
    int rows = 0;
    /// In the arguments.
    int begin = 0;
    int end = 0;
    /// None: all its parameters are constant.
    int num_variables = 0;
    /// The first of the products of its Jacobians among those of all terms, one
    /// for each pair of its variables.
    int products = 0;

    /// Pairs of its variables, each with itself among them.
    int num_products() const { return num_variables * (num_variables + 1) / 2; }
  };

  /// The largest numbers of one term so far.
  struct TermSizes {
    int rows = 0;
    int arguments = 0;
    int jacobians = 0;
  };

  /// The problem is not owned and must outlive this. `may_have_bounds`: whether
  /// parameters are to be asked for theirs.
  explicit FlatProblem(ceres::Problem* problem, bool may_have_bounds = true)
      : problem_(problem), may_have_bounds_(may_have_bounds) {}

  /// Reads the problem; empty when it can be solved, or why not. With
  /// `may_keep` variables are those of the last reading, in their order, where
  /// the same parameter blocks vary. `changes` since the last reading may be
  /// null: anything may have changed.
  std::string Read(bool may_keep, const ProblemChanges* changes = nullptr);

  /// Reads it once more after Read(), and keeps nothing: what is found does not
  /// depend on what was before.
  std::string ReadAnew();

  /// Whether nothing has changed since the last reading: all of it is as it
  /// was.
  bool is_unchanged() const { return is_unchanged_; }

  /// Whether variables are those of the last reading.
  bool has_same_variables() const { return has_same_variables_; }

  /// What a term was at the last reading, with the same variables; null when it
  /// is new.
  const Term* KeptFrom(std::size_t term) const {
    return keeps_terms_ && old_of_[term] >= 0 ? &old_terms_[old_of_[term]]
                                              : nullptr;
  }

  /// In the order of the calls that made them. (That of the problem's parameter
  /// blocks is the order of their addresses, which differs from run to run.)
  const std::vector<Term>& terms() const { return terms_; }
  /// Of all terms, one after the other.
  const std::vector<Argument>& arguments() const { return arguments_; }
  /// In the order in which terms name them.
  const std::vector<Block>& blocks() const { return blocks_; }
  /// In the order of the blocks, or that of the last reading.
  const std::vector<Variable>& variables() const { return variables_; }

  /// Terms with variables.
  int num_reduced_terms() const { return num_reduced_terms_; }
  /// Size of the tangent space.
  int num_columns() const { return num_columns_; }
  /// Size of the state.
  int state_size() const { return state_size_; }
  /// Size of the array of Jacobians of Plus.
  int plus_size() const { return plus_size_; }
  /// Products of all terms.
  int num_products() const { return num_products_; }
  /// The largest numbers of one term so far.
  const TermSizes& largest() const { return largest_; }

 private:
  void ReadResiduals(bool may_keep, const ProblemChanges* changes);
  void ReadResidual(Term* term);
  bool FindBlocks(const ProblemChanges* changes);
  bool HasSameBlocks() const;
  bool IsSame(const Term& term, const Term& old) const;
  void IndexBlocks();
  Variable VariableOf(const Block& block) const;
  bool HasBounds(const Variable& variable) const;
  bool KeepVariables();
  std::string MakeVariables();
  void ReadTerms();
  void ReadTerm(Term* term);

  ceres::Problem* problem_;
  bool may_have_bounds_;
  // Residual blocks, the parameter blocks of all one after the other, and what
  // is known of them; the same of the last reading, and which of its terms each
  // term is (-1: none).
  std::vector<ceres::ResidualBlockId> ids_;
  std::vector<double*> users_;
  std::vector<double*> old_users_;
  std::vector<Term> terms_;
  std::vector<Argument> arguments_;
  std::vector<Term> old_terms_;
  std::vector<Argument> old_arguments_;
  std::vector<int> old_of_;
  bool keeps_terms_ = false;
  bool is_unchanged_ = false;
  std::vector<ceres::ResidualBlockId> last_ids_;
  AddressIndex added_;
  std::vector<double*> read_;
  bool has_same_variables_ = false;
  // Blocks by address.
  std::vector<Block> blocks_;
  std::vector<Block> old_blocks_;
  AddressIndex block_index_;
  AddressIndex old_block_index_;
  std::vector<Variable> variables_;
  int num_reduced_terms_ = 0;
  int num_columns_ = 0;
  int state_size_ = 0;
  int plus_size_ = 0;
  int num_products_ = 0;
  TermSizes largest_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_FLAT_PROBLEM_H_
