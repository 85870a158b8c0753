#include <plumbline/core/error.h>
#include <plumbline/core/information_factor.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>

namespace plumbline {
namespace {

// Pivots below these fractions of the diagonal are rounding, and a prior of
// that size stands out from rounding.
constexpr double kPivotRounding = 1e-13;
constexpr double kPriorOverRounding = 10.0;
// Every pass over the pivots can only add priors, and few are needed.
constexpr int kMaxPasses = 20;

}  // namespace

void InformationFactor::Factorize(Eigen::SparseMatrix<double> information,
                                  double prior_variance) {
  const double prior_information = 1.0 / prior_variance;
  size_ = static_cast<int>(information.rows());
  const Eigen::VectorXd diagonal = information.diagonal();
  Eigen::VectorXd priors(size_);
  for (int i = 0; i < size_; ++i) {
    // Exact zeros would end a factorization early: this much is rounding.
    priors[i] = diagonal[i] > 0.0 ? 1e-2 * kPivotRounding * diagonal[i]
                                  : prior_information;
    information.coeffRef(i, i) += priors[i];
  }
  ldlt_.analyzePattern(information);
  for (int pass = 0; pass < kMaxPasses; ++pass) {
    ldlt_.factorize(information);
    bool is_determined = ldlt_.info() == Eigen::Success;
    const Eigen::VectorXd& pivots = ldlt_.vectorD();
    for (int k = 0; k < size_; ++k) {
      const int i = ldlt_.permutationPinv().indices()[k];
      const double rounding = kPivotRounding * diagonal[i];
      const double prior =
          std::max(prior_information, kPriorOverRounding * rounding);
      if (pivots[k] > std::max(rounding, 1e-2 * prior_information) ||
          priors[i] >= prior) {
        continue;
      }
      is_determined = false;
      information.coeffRef(i, i) += prior;
      priors[i] += prior;
      // Exactly zero: that is where the factorization ended.
      if (pivots[k] == 0.0) break;
    }
    if (is_determined) return;
  }
  if (ldlt_.info() != Eigen::Success) {
    throw PLUMBLINE_ERROR("the normal matrix cannot be factorized",
                          "information that is finite and not negative");
  }
}

template <typename Right>
Right InformationFactor::SolveAt(
    const Right& right, const std::vector<InformationRows>& sources,
    const std::vector<InformationRows>& wanted) const {
  constexpr int kColumns = Right::ColsAtCompileTime;
  using RowMajor =
      Eigen::Matrix<double, Eigen::Dynamic, kColumns, Eigen::RowMajor>;
  const auto& factor = ldlt_.matrixL().nestedExpression();
  const Eigen::VectorXd& pivots = ldlt_.vectorD();
  const auto& position = ldlt_.permutationP().indices();
  const int* starts = factor.outerIndexPtr();
  const int* rows = factor.innerIndexPtr();
  const double* values = factor.valuePtr();
  RowMajor x = RowMajor::Zero(size_, right.cols());
  std::vector<std::uint8_t> is_on_way(static_cast<std::size_t>(size_), 0);
  const auto climb = [&](const InformationRows& block) {
    for (int r = block.begin; r < block.begin + block.count; ++r) {
      for (int j = position[r]; j >= 0 && is_on_way[j] == 0;
           j = starts[j] < starts[j + 1] ? rows[starts[j]] : -1) {
        is_on_way[j] = 1;
      }
    }
  };
  // Ascending, without sorting: ways that join are the worst case of that.
  const auto columns_on_way = [&] {
    std::vector<int> way;
    for (int j = 0; j < size_; ++j) {
      if (is_on_way[j] != 0) way.push_back(j);
    }
    return way;
  };
  for (const InformationRows& block : sources) {
    for (int r = block.begin; r < block.begin + block.count; ++r) {
      x.row(position[r]) = right.row(r);
    }
    climb(block);
  }
  std::vector<int> way = columns_on_way();
  for (const int j : way) {
    for (int p = starts[j]; p < starts[j + 1]; ++p) {
      x.row(rows[p]) -= values[p] * x.row(j);
    }
  }
  for (const int j : way) x.row(j) /= pivots[j];
  for (const InformationRows& block : wanted) climb(block);
  way = columns_on_way();
  for (auto k = way.rbegin(); k != way.rend(); ++k) {
    const int j = *k;
    for (int p = starts[j]; p < starts[j + 1]; ++p) {
      x.row(j) -= values[p] * x.row(rows[p]);
    }
  }
  Right solved = Right::Zero(size_, right.cols());
  for (const auto* list : {&sources, &wanted}) {
    for (const InformationRows& block : *list) {
      for (int r = block.begin; r < block.begin + block.count; ++r) {
        solved.row(r) = x.row(position[r]);
      }
    }
  }
  return solved;
}

template Eigen::MatrixXd InformationFactor::SolveAt(
    const Eigen::MatrixXd&, const std::vector<InformationRows>&,
    const std::vector<InformationRows>&) const;
template Eigen::Matrix<double, Eigen::Dynamic, 3> InformationFactor::SolveAt(
    const Eigen::Matrix<double, Eigen::Dynamic, 3>&,
    const std::vector<InformationRows>&,
    const std::vector<InformationRows>&) const;

// Takahashi, Fagan and Chen 1973: from the last column to the first.
InformationFactor::InverseOnPattern InformationFactor::InvertOnPattern() const {
  const auto& factor = ldlt_.matrixL().nestedExpression();
  const Eigen::VectorXd& pivots = ldlt_.vectorD();
  const int* starts = factor.outerIndexPtr();
  const int* rows = factor.innerIndexPtr();
  const double* values = factor.valuePtr();
  InverseOnPattern inverse;
  inverse.below.assign(static_cast<std::size_t>(starts[size_]), 0.0);
  inverse.diagonal.resize(size_);
  // Of the column at hand: L by row, and what the entries of the inverse add
  // up to.
  struct OfRow {
    double l = 0.0;
    double sum = 0.0;
    // Whether the column has this row.
    bool is_in = false;
  };
  std::vector<OfRow> column(static_cast<std::size_t>(size_));
  for (int j = size_ - 1; j >= 0; --j) {
    for (int p = starts[j]; p < starts[j + 1]; ++p) {
      column[static_cast<std::size_t>(rows[p])] = {values[p], 0.0, true};
    }
    for (int p = starts[j]; p < starts[j + 1]; ++p) {
      const int k = rows[p];
      OfRow& own = column[static_cast<std::size_t>(k)];
      double sum = own.sum + inverse.diagonal[k] * own.l;
      for (int q = starts[k]; q < starts[k + 1]; ++q) {
        OfRow& other = column[static_cast<std::size_t>(rows[q])];
        if (!other.is_in) continue;
        const double z = inverse.below[static_cast<std::size_t>(q)];
        other.sum += z * own.l;
        sum += z * other.l;
      }
      own.sum = sum;
    }
    double z_jj = 1.0 / pivots[j];
    for (int p = starts[j]; p < starts[j + 1]; ++p) {
      OfRow& own = column[static_cast<std::size_t>(rows[p])];
      const double z = -own.sum;
      inverse.below[static_cast<std::size_t>(p)] = z;
      z_jj -= values[p] * z;
      own.is_in = false;
    }
    inverse.diagonal[j] = z_jj;
  }
  return inverse;
}

std::vector<Eigen::MatrixXd> InformationFactor::InverseBlocks(
    const std::vector<InformationRows>& blocks) const {
  const InverseOnPattern inverse = InvertOnPattern();
  const auto& factor = ldlt_.matrixL().nestedExpression();
  const auto& position = ldlt_.permutationP().indices();
  std::vector<Eigen::MatrixXd> found;
  found.reserve(blocks.size());
  for (const InformationRows& rows : blocks) {
    Eigen::MatrixXd block(rows.count, rows.count);
    for (int r = 0; r < rows.count; ++r) {
      for (int c = 0; c <= r; ++c) {
        const int a = position[rows.begin + r];
        const int b = position[rows.begin + c];
        if (a == b) {
          block(r, c) = inverse.diagonal[a];
          continue;
        }
        const int* begin =
            factor.innerIndexPtr() + factor.outerIndexPtr()[std::min(a, b)];
        const int* end =
            factor.innerIndexPtr() + factor.outerIndexPtr()[std::min(a, b) + 1];
        const int* entry = std::lower_bound(begin, end, std::max(a, b));
        block(r, c) = inverse.below[static_cast<std::size_t>(
            entry - factor.innerIndexPtr())];
        block(c, r) = block(r, c);
      }
    }
    found.push_back(std::move(block));
  }
  return found;
}

}  // namespace plumbline
