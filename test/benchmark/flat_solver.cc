#include "benchmark/flat_solver.h"

#include <plumbline/factors/angle.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

namespace plumbline {
namespace {

// Steps in a row that may lead uphill.
constexpr int kUphillSteps = 3;
constexpr double kSmallestDamping = 1e-10;

cholmod_sparse Upper(int size, std::vector<int>* begin, std::vector<int>* rows,
                     double* values) {
  cholmod_sparse matrix = {};
  matrix.nrow = matrix.ncol = static_cast<std::size_t>(size);
  matrix.nzmax = rows->size();
  matrix.p = begin->data();
  matrix.i = rows->data();
  matrix.x = values;
  matrix.stype = 1;
  matrix.itype = CHOLMOD_INT;
  matrix.xtype = values == nullptr ? CHOLMOD_PATTERN : CHOLMOD_REAL;
  matrix.dtype = CHOLMOD_DOUBLE;
  matrix.sorted = 1;
  matrix.packed = 1;
  return matrix;
}

}  // namespace

FlatSolver::FlatSolver(const PlainGraph& graph)
    : graph_(graph), is_active_(graph.edges.size(), 1) {
  cholmod_start(&common_);
  const int n = static_cast<int>(graph_.blocks.size());
  column_of_.assign(n, -1);
  stride_.assign(n, 0);
  int size = 0;
  std::vector<int> variables;
  std::vector<int> variable_of(n, -1);
  for (int v = 0; v < n; ++v) {
    if (graph_.is_fixed[v]) continue;
    variable_of[v] = static_cast<int>(variables.size());
    variables.push_back(v);
    column_of_[v] = size;
    size += graph_.sizes[v];
  }
  // Blocks above the diagonal by column.
  std::vector<std::vector<int>> above(n);
  for (const PlainGraph::Edge& edge : graph_.edges) {
    if (column_of_[edge.first] < 0 || column_of_[edge.second] < 0) continue;
    above[std::max(edge.first, edge.second)].push_back(
        std::min(edge.first, edge.second));
  }
  std::vector<int> block_begin = {0};
  std::vector<int> block_rows;
  column_begin_ = {0};
  std::vector<std::vector<int>> begins(n);
  for (const int v : variables) {
    std::vector<int>& blocks = above[v];
    std::sort(blocks.begin(), blocks.end());
    blocks.erase(std::unique(blocks.begin(), blocks.end()), blocks.end());
    blocks.push_back(v);
    for (const int row : blocks) {
      block_rows.push_back(variable_of[row]);
      begins[v].push_back(column_begin_.back() + stride_[v]);
      stride_[v] += graph_.sizes[row];
    }
    block_begin.push_back(static_cast<int>(block_rows.size()));
    for (int c = 0; c < graph_.sizes[v]; ++c) {
      diagonal_.push_back(begins[v].back() + c * stride_[v] + c);
      for (const int row : blocks) {
        for (int r = 0; r < graph_.sizes[row]; ++r) {
          rows_.push_back(column_of_[row] + r);
        }
      }
      column_begin_.push_back(static_cast<int>(rows_.size()));
    }
  }
  values_.resize(rows_.size());
  damped_.resize(rows_.size());
  for (const PlainGraph::Edge& edge : graph_.edges) {
    Place place;
    if (column_of_[edge.first] >= 0) place.aa = begins[edge.first].back();
    if (column_of_[edge.second] >= 0) place.bb = begins[edge.second].back();
    if (place.aa >= 0 && place.bb >= 0) {
      const auto [row, column] = std::minmax(edge.first, edge.second);
      const std::vector<int>& blocks = above[column];
      place.ab = begins[column][static_cast<std::size_t>(
          std::lower_bound(blocks.begin(), blocks.end(), row) -
          blocks.begin())];
      place.is_turned = edge.first > edge.second;
    }
    places_.push_back(place);
  }
  gradient_.resize(size);
  step_.resize(size);

  cholmod_sparse blocks = Upper(static_cast<int>(variables.size()),
                                &block_begin, &block_rows, nullptr);
  std::vector<int> block_order(variables.size());
  cholmod_amd(&blocks, nullptr, 0, block_order.data(), &common_);
  std::vector<int> order;
  for (const int b : block_order) {
    for (int c = 0; c < graph_.sizes[variables[b]]; ++c) {
      order.push_back(column_of_[variables[b]] + c);
    }
  }
  common_.nmethods = 1;
  common_.method[0].ordering = CHOLMOD_GIVEN;
  cholmod_sparse matrix = Upper(size, &column_begin_, &rows_, damped_.data());
  factor_ = cholmod_analyze_p(&matrix, order.data(), nullptr, 0, &common_);
}

FlatSolver::~FlatSolver() {
  cholmod_free_factor(&factor_, &common_);
  cholmod_finish(&common_);
}

template <int kRows, int kA, int kB>
void FlatSolver::Add(int edge, const Eigen::Matrix<double, kRows, 1>& error,
                     const Eigen::Matrix<double, kRows, kA>& a,
                     const Eigen::Matrix<double, kRows, kB>& b) {
  using Eigen::Matrix;
  using Stride = Eigen::OuterStride<>;
  const PlainGraph::Edge& measured = graph_.edges[edge];
  const Matrix<double, kRows, kRows> information =
      measured.information.topLeftCorner<kRows, kRows>();
  const Matrix<double, kRows, 1> weighted = information * error;
  objective_ += error.dot(weighted);
  const Place& place = places_[edge];
  const Matrix<double, kA, kRows> a_weighted = a.transpose() * information;
  if (place.aa >= 0) {
    Eigen::Map<Matrix<double, kA, kA>, 0, Stride>(
        &values_[place.aa], Stride(stride_[measured.first])) += a_weighted * a;
    gradient_.template segment<kA>(column_of_[measured.first]) +=
        a.transpose() * weighted;
  }
  if (place.bb >= 0) {
    Eigen::Map<Matrix<double, kB, kB>, 0, Stride>(
        &values_[place.bb], Stride(stride_[measured.second])) +=
        b.transpose() * information * b;
    gradient_.template segment<kB>(column_of_[measured.second]) +=
        b.transpose() * weighted;
  }
  if (place.ab < 0) return;
  const Matrix<double, kA, kB> product = a_weighted * b;
  if (place.is_turned) {
    Eigen::Map<Matrix<double, kB, kA>, 0, Stride>(
        &values_[place.ab], Stride(stride_[measured.first])) +=
        product.transpose();
  } else {
    Eigen::Map<Matrix<double, kA, kB>, 0, Stride>(
        &values_[place.ab], Stride(stride_[measured.second])) += product;
  }
}

void FlatSolver::Linearize(int edge) {
  using Kind = PlainGraph::Edge::Kind;
  const PlainGraph::Edge& measured = graph_.edges[edge];
  const std::array<double, 3>& p = graph_.blocks[measured.first];
  const std::array<double, 3>& q = graph_.blocks[measured.second];
  const Eigen::Vector3d& u = measured.expected;
  const double angle =
      measured.kind == Kind::kPose || measured.kind == Kind::kPoint ? p[2]
                                                                    : q[1];
  const double c = std::cos(angle);
  const double s = std::sin(angle);
  switch (measured.kind) {
    case Kind::kPose: {
      const double dx = q[0] - p[0];
      const double dy = q[1] - p[1];
      Eigen::Matrix3d a;
      a << -c, -s, c * dy - s * dx, s, -c, -c * dx - s * dy, 0, 0, -1;
      Eigen::Matrix3d b;
      b << c, s, 0, -s, c, 0, 0, 0, 1;
      const Eigen::Vector3d error(c * dx + s * dy - u[0],
                                  c * dy - s * dx - u[1],
                                  NormalizeAngle(q[2] - p[2] - u[2]));
      return Add<3, 3, 3>(edge, error, a, b);
    }
    case Kind::kPoint: {
      const double dx = q[0] - p[0];
      const double dy = q[1] - p[1];
      Eigen::Matrix<double, 2, 3> a;
      a << -c, -s, c * dy - s * dx, s, -c, -c * dx - s * dy;
      Eigen::Matrix2d b;
      b << c, s, -s, c;
      const Eigen::Vector2d error(c * dx + s * dy - u[0],
                                  c * dy - s * dx - u[1]);
      return Add<2, 3, 2>(edge, error, a, b);
    }
    case Kind::kLine: {
      Eigen::Matrix<double, 2, 3> a;
      a << s, -c, 0, 0, 0, -1;
      Eigen::Matrix2d b;
      b << 1, p[0] * c + p[1] * s, 0, 1;
      const Eigen::Vector2d error(q[0] + p[0] * s - p[1] * c - u[0],
                                  NormalizeAngle(q[1] - p[2] - u[1]));
      return Add<2, 3, 2>(edge, error, a, b);
    }
    case Kind::kPointOnLine: {
      const Eigen::Matrix<double, 1, 2> a(-s, c);
      const Eigen::Matrix<double, 1, 2> b(-1, -p[1] * s - p[0] * c);
      Eigen::Matrix<double, 1, 1> error;
      error << p[1] * c - p[0] * s - q[0] - u[0];
      return Add<1, 2, 2>(edge, error, a, b);
    }
  }
}

void FlatSolver::Linearize() {
  std::fill(values_.begin(), values_.end(), 0.0);
  gradient_.setZero();
  objective_ = 0.0;
  for (std::size_t k = 0; k < graph_.edges.size(); ++k) {
    if (is_active_[k] != 0) Linearize(static_cast<int>(k));
  }
}

// False when the matrix is not positive definite.
bool FlatSolver::Step(double damping) {
  damped_ = values_;
  for (const int k : diagonal_) damped_[k] *= 1.0 + damping;
  const int size = static_cast<int>(diagonal_.size());
  cholmod_sparse matrix = Upper(size, &column_begin_, &rows_, damped_.data());
  common_.status = CHOLMOD_OK;
  if (cholmod_factorize(&matrix, factor_, &common_) == 0 ||
      common_.status != CHOLMOD_OK) {
    return false;
  }
  cholmod_dense right = {};
  right.nrow = right.nzmax = right.d = static_cast<std::size_t>(size);
  right.ncol = 1;
  right.x = gradient_.data();
  right.xtype = CHOLMOD_REAL;
  cholmod_dense* solution = cholmod_solve(CHOLMOD_A, factor_, &right, &common_);
  step_ = Eigen::Map<const Eigen::VectorXd>(
      static_cast<const double*>(solution->x), size);
  cholmod_free_dense(&solution, &common_);
  return true;
}

FlatSolver::Result FlatSolver::Solve(double tolerance, int max_steps) {
  Result result;
  Linearize();
  double damping = kSmallestDamping;
  double best = objective_;
  auto best_blocks = graph_.blocks;
  int uphill = 0;
  while (result.steps < max_steps) {
    const double before = objective_;
    const bool has_stepped = Step(damping);
    ++result.steps;
    if (has_stepped) {
      for (std::size_t v = 0; v < graph_.blocks.size(); ++v) {
        if (column_of_[v] < 0) continue;
        for (int i = 0; i < graph_.sizes[v]; ++i) {
          graph_.blocks[v][i] -= step_[column_of_[v] + i];
        }
      }
      Linearize();
      if (objective_ < best) {
        best = objective_;
        best_blocks = graph_.blocks;
        uphill = 0;
        damping = std::max(kSmallestDamping, damping / 10.0);
      } else {
        ++uphill;
      }
      if (std::abs(before - objective_) <= tolerance * before) break;
    }
    if (!has_stepped || uphill > kUphillSteps) {
      graph_.blocks = best_blocks;
      Linearize();
      damping = std::max(10.0 * damping, 1e-6);
      uphill = 0;
    }
  }
  graph_.blocks = best_blocks;
  result.objective = best;
  return result;
}

}  // namespace plumbline
