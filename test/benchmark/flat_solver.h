#ifndef PLUMBLINE_TEST_BENCHMARK_FLAT_SOLVER_H_
#define PLUMBLINE_TEST_BENCHMARK_FLAT_SOLVER_H_

#include <suitesparse/cholmod.h>

#include <Eigen/Core>
#include <array>
#include <vector>

namespace plumbline {

// Poses (x, y, theta), points (x, y) and directed lines (d, alpha), and what
// was measured between them, without this project's graph.
struct PlainGraph {
  struct Edge {
    enum class Kind { kPose, kPoint, kLine, kPointOnLine };
    Kind kind;
    int first;
    int second;
    Eigen::Vector3d expected;
    Eigen::Matrix3d information;
  };
  std::vector<std::array<double, 3>> blocks;
  std::vector<int> sizes;
  std::vector<bool> is_fixed;
  std::vector<int> lines;
  std::vector<Edge> edges;
};

// The floor that solves are compared with: damped Gauss-Newton on flat arrays,
// with derivatives by hand and the analysis kept between solves. An edge that
// has been taken out keeps its place in the matrix and is passed over.
class FlatSolver {
 public:
  struct Result {
    double objective = 0.0;
    int steps = 0;
  };

  explicit FlatSolver(const PlainGraph& graph);
  FlatSolver(const FlatSolver&) = delete;
  FlatSolver& operator=(const FlatSolver&) = delete;
  ~FlatSolver();

  void SetActive(int edge, bool is_active) { is_active_[edge] = is_active; }
  void SetExpected(int edge, const Eigen::Vector3d& expected) {
    graph_.edges[edge].expected = expected;
  }

  // Until a step changes the objective by less than this part of it, or for
  // `max_steps`.
  Result Solve(double tolerance, int max_steps);

 private:
  template <int kRows, int kA, int kB>
  void Add(int edge, const Eigen::Matrix<double, kRows, 1>& error,
           const Eigen::Matrix<double, kRows, kA>& a,
           const Eigen::Matrix<double, kRows, kB>& b);
  void Linearize(int edge);
  void Linearize();
  bool Step(double damping);

  // Where the blocks of an edge begin in the matrix, -1 where one is fixed.
  struct Place {
    int aa = -1;
    int bb = -1;
    int ab = -1;
    bool is_turned = false;
  };

  PlainGraph graph_;
  std::vector<char> is_active_;
  std::vector<int> column_of_;
  std::vector<int> stride_;
  std::vector<Place> places_;
  std::vector<int> column_begin_;
  std::vector<int> rows_;
  std::vector<double> values_;
  std::vector<double> damped_;
  std::vector<int> diagonal_;
  Eigen::VectorXd gradient_;
  Eigen::VectorXd step_;
  double objective_ = 0.0;
  cholmod_common common_ = {};
  cholmod_factor* factor_ = nullptr;
};

}  // namespace plumbline

#endif  // PLUMBLINE_TEST_BENCHMARK_FLAT_SOLVER_H_
