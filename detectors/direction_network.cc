#include <plumbline/core/disjoint_sets.h>
#include <plumbline/detectors/direction_network.h>
#include <plumbline/factors/angle.h>

#include <algorithm>

namespace plumbline {

std::size_t DirectionNetwork::AddNode(double angle) {
  initial_.push_back(angle);
  estimate_.push_back(angle);
  degree_.push_back(0);
  is_analyzed_ = false;
  return initial_.size() - 1;
}

void DirectionNetwork::AddLink(std::size_t from, std::size_t to, double angle,
                               double variance, bool axial, int group) {
  links_.push_back({from, to, angle, 1.0 / variance, axial, group});
  ++degree_[from];
  ++degree_[to];
  is_analyzed_ = false;
}

template <typename Predicate>
void DirectionNetwork::RemoveLinks(Predicate goes) {
  for (const Link& link : links_) {
    if (!goes(link)) continue;
    --degree_[link.from];
    --degree_[link.to];
  }
  links_.erase(std::remove_if(links_.begin(), links_.end(), goes),
               links_.end());
  is_analyzed_ = false;
}

void DirectionNetwork::RemoveLinksOf(std::size_t node) {
  RemoveLinks([node](const Link& link) {
    return link.from == node || link.to == node;
  });
}

void DirectionNetwork::RemoveLinksBetween(
    std::size_t node, const std::vector<std::size_t>& others) {
  std::vector<char> is_other(size(), 0);
  for (const std::size_t other : others) is_other[other] = 1;
  RemoveLinks([&](const Link& link) {
    return (link.from == node && is_other[link.to] != 0) ||
           (link.to == node && is_other[link.from] != 0);
  });
}

void DirectionNetwork::ScaleVariances(int group, double factor, double floor) {
  for (Link& link : links_) {
    if (link.group != group) continue;
    link.information = 1.0 / std::max(factor / link.information, floor);
  }
}

double DirectionNetwork::Residual(const Link& link) const {
  const double error = initial_[link.to] - initial_[link.from] - link.angle;
  return link.is_axial ? NormalizeAxial(error) : NormalizeAngle(error);
}

void DirectionNetwork::Solve() {
  if (size() == 0) return;
  SolveAngles();
  ComputeVariances();
}

void DirectionNetwork::SolveAngles() {
  if (size() == 0) return;
  const auto n = static_cast<Eigen::Index>(size());
  std::vector<Eigen::Triplet<double>> triplets;
  triplets.reserve(3 * links_.size() + size());
  Eigen::VectorXd gradient = Eigen::VectorXd::Zero(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    triplets.emplace_back(i, i, 1.0 / kUnknownVariance);
  }
  for (const Link& link : links_) {
    const auto a = static_cast<Eigen::Index>(link.from);
    const auto b = static_cast<Eigen::Index>(link.to);
    triplets.emplace_back(a, a, link.information);
    triplets.emplace_back(b, b, link.information);
    triplets.emplace_back(std::max(a, b), std::min(a, b), -link.information);
    const double pull = link.information * Residual(link);
    gradient[a] -= pull;
    gradient[b] += pull;
  }
  Eigen::SparseMatrix<double> normal(n, n);
  normal.setFromTriplets(triplets.begin(), triplets.end());
  if (!is_analyzed_) {
    ldlt_ = std::make_unique<SymmetricFactor<double>>();
    ldlt_->analyzePattern(normal);
    is_analyzed_ = true;
  }
  ldlt_->factorize(normal);
  const Eigen::VectorXd step = ldlt_->solve(gradient);
  for (Eigen::Index i = 0; i < n; ++i) {
    estimate_[static_cast<std::size_t>(i)] =
        initial_[static_cast<std::size_t>(i)] - step[i];
  }
}

// The entries of the inverse where the factor has entries, from the last column
// to the first (Takahashi, Fagan and Chen 1973).
void DirectionNetwork::ComputeVariances() {
  const Eigen::SparseMatrix<double>& lower =
      ldlt_->matrixL().nestedExpression();
  const Eigen::VectorXd& pivots = ldlt_->vectorD();
  const int n = static_cast<int>(lower.cols());
  // Rows below the diagonal of every column, with the factor's value and the
  // inverse's.
  struct Entry {
    int row;
    double factor, inverse;
  };
  std::vector<std::vector<Entry>> columns(static_cast<std::size_t>(n));
  for (int j = 0; j < n; ++j) {
    for (Eigen::SparseMatrix<double>::InnerIterator it(lower, j); it; ++it) {
      if (it.row() > j) {
        columns[static_cast<std::size_t>(j)].push_back(
            {static_cast<int>(it.row()), it.value(), 0.0});
      }
    }
    std::sort(columns[static_cast<std::size_t>(j)].begin(),
              columns[static_cast<std::size_t>(j)].end(),
              [](const Entry& a, const Entry& b) { return a.row < b.row; });
  }
  std::vector<double> diagonal(static_cast<std::size_t>(n));
  // Place of a row in the present column, -1 elsewhere.
  std::vector<int> place(static_cast<std::size_t>(n), -1);
  std::vector<double> sums;
  for (int j = n - 1; j >= 0; --j) {
    std::vector<Entry>& column = columns[static_cast<std::size_t>(j)];
    sums.assign(column.size(), 0.0);
    for (std::size_t i = 0; i < column.size(); ++i) {
      place[static_cast<std::size_t>(column[i].row)] = static_cast<int>(i);
    }
    for (std::size_t k = 0; k < column.size(); ++k) {
      const auto row = static_cast<std::size_t>(column[k].row);
      sums[k] += column[k].factor * diagonal[row];
      for (const Entry& entry : columns[row]) {
        const int i = place[static_cast<std::size_t>(entry.row)];
        if (i < 0) continue;
        sums[static_cast<std::size_t>(i)] += column[k].factor * entry.inverse;
        sums[k] += column[static_cast<std::size_t>(i)].factor * entry.inverse;
      }
    }
    double variance = 1.0 / pivots[j];
    for (std::size_t i = 0; i < column.size(); ++i) {
      place[static_cast<std::size_t>(column[i].row)] = -1;
      column[i].inverse = -sums[i];
      variance += column[i].factor * sums[i];
    }
    diagonal[static_cast<std::size_t>(j)] = variance;
  }
  variance_.resize(size());
  for (int i = 0; i < n; ++i) {
    const int original = ldlt_->permutationPinv().indices()[i];
    variance_[static_cast<std::size_t>(original)] =
        diagonal[static_cast<std::size_t>(i)];
  }
}

Eigen::VectorXd DirectionNetwork::CovarianceColumn(std::size_t node) const {
  Eigen::VectorXd unit =
      Eigen::VectorXd::Zero(static_cast<Eigen::Index>(size()));
  unit[static_cast<Eigen::Index>(node)] = 1.0;
  return ldlt_->solve(unit);
}

Eigen::VectorXd DirectionNetwork::Covary(const Eigen::VectorXd& vector) const {
  return ldlt_->solve(vector);
}

double DirectionNetwork::VarianceFactor(int group) const {
  DisjointSets parts(size());
  std::size_t tree = 0;
  std::size_t members = 0;
  double sum = 0.0;
  for (const Link& link : links_) {
    if (parts.Join(link.from, link.to)) ++tree;
    if (link.group != group) continue;
    ++members;
    const double step = (estimate_[link.to] - initial_[link.to]) -
                        (estimate_[link.from] - initial_[link.from]);
    const double residual = Residual(link) + step;
    sum += link.information * residual * residual;
  }
  if (members == 0) return 1.0;
  const double redundancy = static_cast<double>(links_.size() - tree) *
                            static_cast<double>(members) /
                            static_cast<double>(links_.size());
  return (sum + kPriorRedundancy) / (redundancy + kPriorRedundancy);
}

}  // namespace plumbline
