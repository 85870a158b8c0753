#include <ceres/cost_function.h>
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

std::string FlatProblem::Read(bool may_keep) {
  terms_.swap(old_terms_);
  arguments_.swap(old_arguments_);
  ReadResiduals();
  keeps_terms_ = may_keep && FindBlocks();
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

// Residual blocks and the parameter blocks of each.
void FlatProblem::ReadResiduals() {
  problem_->GetResidualBlocks(&ids_);
  users_.clear();
  terms_.resize(ids_.size());
  std::vector<double*> blocks;
  for (std::size_t k = 0; k < ids_.size(); ++k) {
    Term& term = terms_[k];
    term.id = ids_[k];
    term.cost = problem_->GetCostFunctionForResidualBlock(ids_[k]);
    term.loss = problem_->GetLossFunctionForResidualBlock(ids_[k]);
    term.rows = term.cost->num_residuals();
    problem_->GetParameterBlocksForResidualBlock(ids_[k], &blocks);
    term.begin = static_cast<int>(users_.size());
    users_.insert(users_.end(), blocks.begin(), blocks.end());
    term.end = static_cast<int>(users_.size());
  }
  arguments_.resize(users_.size());
}

// Finds terms of the last reading, and blocks of the others; false when some
// block has come, gone, or changed.
bool FlatProblem::FindBlocks() {
  old_of_.assign(terms_.size(), -1);
  std::vector<char> is_used(blocks_.size(), 0);
  std::size_t next = 0;
  for (std::size_t k = 0; k < terms_.size(); ++k) {
    const Term& term = terms_[k];
    // Residuals that went are passed over where the others moved up.
    std::size_t old = next;
    const std::size_t last = std::min(next + kLookAhead, old_terms_.size());
    while (old < last && old_terms_[old].id != term.id) ++old;
    if (old < last && IsSame(term, old_terms_[old])) {
      old_of_[k] = static_cast<int>(old);
      next = old;
    }
    ++next;
    for (int i = term.begin; i < term.end; ++i) {
      const int block =
          old_of_[k] >= 0
              ? old_arguments_[old_terms_[old].begin + i - term.begin].block
              : block_index_.Find(users_[i]);
      if (block < 0) return false;
      arguments_[i].block = block;
      is_used[block] = 1;
    }
  }
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
  for (int i = 0; i < term.end - term.begin; ++i) {
    if (users_[term.begin + i] !=
        blocks_[old_arguments_[old.begin + i].block].user) {
      return false;
    }
  }
  return true;
}

// Blocks in the order in which residuals name them; the old ones are those of
// the last reading.
void FlatProblem::IndexBlocks() {
  old_blocks_.swap(blocks_);
  std::swap(old_block_index_, block_index_);
  blocks_.clear();
  block_index_.Clear(std::max<std::size_t>(old_blocks_.size(), 64));
  for (std::size_t i = 0; i < users_.size(); ++i) {
    const int next = static_cast<int>(blocks_.size());
    arguments_[i].block = block_index_.FindOrAdd(users_[i], next);
    if (arguments_[i].block == next) {
      Block block;
      block.user = users_[i];
      block.is_constant = problem_->IsParameterBlockConstant(users_[i]);
      blocks_.push_back(block);
    }
  }
}

bool FlatProblem::IsVariable(const Block& block) const {
  return !block.is_constant &&
         problem_->ParameterBlockTangentSize(block.user) > 0;
}

// Has the blocks that vary be the variables that there are; false when they are
// not the same ones.
bool FlatProblem::KeepVariables() {
  std::size_t num_variables = 0;
  for (Block& block : blocks_) {
    if (!IsVariable(block)) continue;
    const int old = old_block_index_.Find(block.user);
    if (old < 0 || old_blocks_[old].variable < 0) return false;
    Variable& variable = variables_[old_blocks_[old].variable];
    if (variable.tangent_size !=
            problem_->ParameterBlockTangentSize(block.user) ||
        variable.manifold != problem_->GetManifold(block.user)) {
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
    if (!IsVariable(block)) continue;
    Variable variable;
    variable.user = block.user;
    variable.size = problem_->ParameterBlockSize(block.user);
    variable.tangent_size = problem_->ParameterBlockTangentSize(block.user);
    variable.manifold = problem_->GetManifold(block.user);
    variable.state = state_size_;
    if (variable.manifold != nullptr) {
      variable.plus_jacobian = plus_size_;
      plus_size_ += variable.size * variable.tangent_size;
    }
    for (int i = 0; i < variable.size; ++i) {
      if (problem_->GetParameterLowerBound(block.user, i) >
              -std::numeric_limits<double>::max() ||
          problem_->GetParameterUpperBound(block.user, i) <
              std::numeric_limits<double>::max()) {
        variables_.clear();
        return "Bounds of parameters are not supported.";
      }
    }
    state_size_ += variable.size;
    num_columns_ += variable.tangent_size;
    block.variable = static_cast<int>(variables_.size());
    variables_.push_back(variable);
  }
  return {};
}

// Arguments and products of terms; those that are kept are copied.
void FlatProblem::ReadTerms() {
  num_products_ = 0;
  num_reduced_terms_ = 0;
  for (std::size_t k = 0; k < terms_.size(); ++k) {
    Term& term = terms_[k];
    term.products = num_products_;
    if (const Term* const old = KeptFrom(k)) {
      std::copy(old_arguments_.begin() + old->begin,
                old_arguments_.begin() + old->end,
                arguments_.begin() + term.begin);
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
    argument.jacobian = jacobian;
    jacobian += term->rows * argument.size;
    ++term->num_variables;
  }
  largest_.rows = std::max(largest_.rows, term->rows);
  largest_.arguments = std::max(largest_.arguments, term->end - term->begin);
  largest_.jacobians = std::max(largest_.jacobians, jacobian);
}

}  // namespace plumbline
