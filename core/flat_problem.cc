#include <ceres/cost_function.h>
#include <ceres/manifold.h>
#include <plumbline/core/flat_problem.h>

#include <limits>

namespace plumbline {
namespace {

// Residual blocks that may have gone between two that stayed.
constexpr std::size_t kLookAhead = 8;

}  // namespace

void AddressIndex::Clear(std::size_t expected_size) {
  std::size_t capacity = 16;
  shift_ = 60;
  while (capacity < 2 * expected_size) {
    capacity *= 2;
    --shift_;
  }
  slots_.assign(capacity, {nullptr, -1});
  size_ = 0;
}

int AddressIndex::FindOrAdd(const double* address, int next) {
  if (2 * (size_ + 1) > slots_.size()) Grow();
  std::pair<const double*, int>& slot = slots_[SlotOf(address)];
  if (slot.first == nullptr) {
    slot = {address, next};
    ++size_;
  }
  return slot.second;
}

void AddressIndex::Grow() {
  std::vector<std::pair<const double*, int>> old;
  old.swap(slots_);
  Clear(std::max<std::size_t>(old.size(), 16));
  for (const auto& [address, number] : old) {
    if (address != nullptr) FindOrAdd(address, number);
  }
}

std::string FlatProblem::Read(bool may_keep, const ProblemChanges* changes) {
  if (!may_keep) changes = nullptr;
  ids_.swap(last_ids_);
  problem_->GetResidualBlocks(&ids_);
  is_unchanged_ = changes != nullptr && !changes->parameter_blocks &&
                  changes->added.empty() && ids_ == last_ids_;
  if (is_unchanged_) return {};
  terms_.swap(old_terms_);
  arguments_.swap(old_arguments_);
  users_.swap(old_users_);
  ReadResiduals(may_keep, changes);
  keeps_terms_ = may_keep && FindBlocks(changes);
  has_same_variables_ = keeps_terms_;
  if (!keeps_terms_) {
    IndexBlocks();
    has_same_variables_ = may_keep && KeepVariables();
  }
  if (!has_same_variables_) {
    const std::string fault = MakeVariables();
    if (!fault.empty()) return fault;
  }
  ReadTerms();
  return {};
}

std::string FlatProblem::ReadAnew() {
  keeps_terms_ = has_same_variables_ = false;
  IndexBlocks();
  const std::string fault = MakeVariables();
  if (fault.empty()) ReadTerms();
  return fault;
}

// Residual blocks and the parameter blocks of each, and which term of the last
// reading each one is.
void FlatProblem::ReadResiduals(bool may_keep, const ProblemChanges* changes) {
  const auto address = [](ceres::ResidualBlockId id) {
    return reinterpret_cast<const double*>(id);
  };
  const bool has_added = changes != nullptr && !changes->added.empty();
  if (has_added) {
    added_.Clear(changes->added.size());
    for (const ceres::ResidualBlockId id : changes->added) {
      added_.FindOrAdd(address(id), 0);
    }
  }
  users_.clear();
  terms_.resize(ids_.size());
  old_of_.assign(ids_.size(), -1);
  std::size_t next = 0;
  for (std::size_t k = 0; k < ids_.size(); ++k) {
    Term& term = terms_[k];
    // Residuals that went are passed over where the others moved up.
    std::size_t old = next;
    const std::size_t last =
        may_keep ? std::min(next + kLookAhead, old_terms_.size()) : next;
    while (old < last && old_terms_[old].id != ids_[k]) ++old;
    // Another residual block may lie where an old one was.
    const bool is_known = old < last && changes != nullptr &&
                          (!has_added || added_.Find(address(ids_[k])) < 0);
    if (is_known) {
      term = old_terms_[old];
      term.begin = static_cast<int>(users_.size());
      for (int i = old_terms_[old].begin; i < old_terms_[old].end; ++i) {
        users_.push_back(old_users_[i]);
      }
      term.end = static_cast<int>(users_.size());
    } else {
      term.id = ids_[k];
      ReadResidual(&term);
    }
    if (is_known || (old < last && IsSame(term, old_terms_[old]))) {
      old_of_[k] = static_cast<int>(old);
      next = old;
    }
    ++next;
  }
  arguments_.resize(users_.size());
}

void FlatProblem::ReadResidual(Term* term) {
  term->cost = problem_->GetCostFunctionForResidualBlock(term->id);
  term->loss = problem_->GetLossFunctionForResidualBlock(term->id);
  term->rows = term->cost->num_residuals();
  problem_->GetParameterBlocksForResidualBlock(term->id, &read_);
  term->begin = static_cast<int>(users_.size());
  users_.insert(users_.end(), read_.begin(), read_.end());
  term->end = static_cast<int>(users_.size());
}

// Finds the blocks of the terms among those of the last reading; false when
// some block has come, gone, or changed.
bool FlatProblem::FindBlocks(const ProblemChanges* changes) {
  if (changes != nullptr && changes->parameter_blocks) return false;
  for (std::size_t k = 0; k < terms_.size(); ++k) {
    const Term& term = terms_[k];
    if (old_of_[k] >= 0) {
      const Term& old = old_terms_[old_of_[k]];
      std::copy(old_arguments_.begin() + old.begin,
                old_arguments_.begin() + old.end,
                arguments_.begin() + term.begin);
      continue;
    }
    for (int i = term.begin; i < term.end; ++i) {
      arguments_[i].block = block_index_.Find(users_[i]);
      if (arguments_[i].block < 0) return false;
    }
  }
  return changes != nullptr || HasSameBlocks();
}

// Whether each block of the last reading is there, and as it was.
bool FlatProblem::HasSameBlocks() const {
  std::vector<char> is_used(blocks_.size(), 0);
  for (const Argument& argument : arguments_) is_used[argument.block] = 1;
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    const Block& block = blocks_[b];
    if (is_used[b] == 0 ||
        problem_->IsParameterBlockConstant(block.user) != block.is_constant ||
        (block.variable >= 0 && problem_->GetManifold(block.user) !=
                                    variables_[block.variable].manifold)) {
      return false;
    }
  }
  return true;
}

bool FlatProblem::IsSame(const Term& term, const Term& old) const {
  if (term.cost != old.cost || term.loss != old.loss || term.rows != old.rows ||
      term.end - term.begin != old.end - old.begin) {
    return false;
  }
  return std::equal(users_.begin() + term.begin, users_.begin() + term.end,
                    old_users_.begin() + old.begin);
}

// Blocks in the order in which residuals name them; the old ones are those of
// the last reading.
void FlatProblem::IndexBlocks() {
  old_blocks_.swap(blocks_);
  std::swap(old_block_index_, block_index_);
  blocks_.clear();
  block_index_.Clear(std::max<std::size_t>(old_blocks_.size(), 64));
  for (const Term& term : terms_) {
    for (int i = term.begin; i < term.end; ++i) {
      const int next = static_cast<int>(blocks_.size());
      arguments_[i].block = block_index_.FindOrAdd(users_[i], next);
      if (arguments_[i].block == next) {
        Block block;
        block.user = users_[i];
        block.size = term.cost->parameter_block_sizes()[i - term.begin];
        block.is_constant = problem_->IsParameterBlockConstant(users_[i]);
        blocks_.push_back(block);
      }
    }
  }
}

// What the block is where it varies; of no tangent size where it does not.
FlatProblem::Variable FlatProblem::VariableOf(const Block& block) const {
  Variable variable;
  if (block.is_constant) return variable;
  variable.user = block.user;
  variable.manifold = problem_->GetManifold(block.user);
  variable.size = block.size;
  variable.tangent_size = variable.manifold == nullptr
                              ? block.size
                              : variable.manifold->TangentSize();
  return variable;
}

bool FlatProblem::HasBounds(const Variable& variable) const {
  for (int i = 0; i < variable.size; ++i) {
    if (problem_->GetParameterLowerBound(variable.user, i) >
            -std::numeric_limits<double>::max() ||
        problem_->GetParameterUpperBound(variable.user, i) <
            std::numeric_limits<double>::max()) {
      return true;
    }
  }
  return false;
}

// Has the blocks that vary be the variables that there are; false when they are
// not the same ones.
bool FlatProblem::KeepVariables() {
  std::size_t num_variables = 0;
  for (Block& block : blocks_) {
    const Variable variable = VariableOf(block);
    if (variable.tangent_size == 0) continue;
    const int old = old_block_index_.Find(block.user);
    if (old < 0 || old_blocks_[old].variable < 0) return false;
    const Variable& kept = variables_[old_blocks_[old].variable];
    if (variable.tangent_size != kept.tangent_size ||
        variable.manifold != kept.manifold) {
      return false;
    }
    block.variable = old_blocks_[old].variable;
    ++num_variables;
  }
  return num_variables == variables_.size();
}

// Variables from the blocks that vary; why not, if they cannot be.
std::string FlatProblem::MakeVariables() {
  variables_.clear();
  state_size_ = 0;
  plus_size_ = 0;
  num_columns_ = 0;
  for (Block& block : blocks_) {
    block.variable = -1;
    Variable variable = VariableOf(block);
    if (variable.tangent_size == 0) continue;
    variable.state = state_size_;
    if (variable.manifold != nullptr) {
      variable.plus_jacobian = plus_size_;
      plus_size_ += variable.size * variable.tangent_size;
    }
    if (may_have_bounds_ && HasBounds(variable)) {
      variables_.clear();
      return "Bounds of parameters are not supported.";
    }
    state_size_ += variable.size;
    num_columns_ += variable.tangent_size;
    block.variable = static_cast<int>(variables_.size());
    variables_.push_back(variable);
  }
  return {};
}

// Arguments and products of terms; those that are kept have their arguments.
void FlatProblem::ReadTerms() {
  num_products_ = 0;
  num_reduced_terms_ = 0;
  for (std::size_t k = 0; k < terms_.size(); ++k) {
    Term& term = terms_[k];
    term.products = num_products_;
    if (const Term* const old = KeptFrom(k)) {
      term.num_variables = old->num_variables;
    } else {
      ReadTerm(&term);
    }
    num_products_ += term.num_products();
    if (term.num_variables > 0) ++num_reduced_terms_;
  }
}

void FlatProblem::ReadTerm(Term* term) {
  int jacobian = 0;
  term->num_variables = 0;
  for (int i = term->begin; i < term->end; ++i) {
    Argument& argument = arguments_[i];
    argument.variable = blocks_[argument.block].variable;
    if (argument.variable < 0) continue;
    argument.size = variables_[argument.variable].size;
    argument.tangent_size = variables_[argument.variable].tangent_size;
    argument.jacobian = jacobian;
    jacobian += term->rows * argument.size;
    ++term->num_variables;
  }
  largest_.rows = std::max(largest_.rows, term->rows);
  largest_.arguments = std::max(largest_.arguments, term->end - term->begin);
  largest_.jacobians = std::max(largest_.jacobians, jacobian);
}

}  // namespace plumbline
