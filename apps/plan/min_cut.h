#ifndef PLUMBLINE_PLAN_MIN_CUT_H_
#define PLUMBLINE_PLAN_MIN_CUT_H_

#include <cstddef>
#include <vector>

namespace plumbline {

/// Binary labels of least cost:
///
///     sum_i (cost of node i's label)
///       + sum_(i, j) cost(i, j) [label_i != label_j]
///
/// found exactly as a minimum cut by Dinic's maximum flow. Costs are >= 0.
class MinCut {
 public:
  explicit MinCut(std::size_t num_nodes);

  /// Adds to the costs of the labels of `node`.
  void AddNodeCost(std::size_t node, double if_false, double if_true);
  /// Adds to the cost of different labels at two nodes.
  void AddEdgeCost(std::size_t a, std::size_t b, double if_different);

  /// The optimal labels; among equal costs those with the fewest true. To be
  /// called once.
  std::vector<bool> Solve();

 private:
  struct Arc {
    std::size_t to;
    double left;
  };

  void AddArcs(std::size_t from, std::size_t to, double there, double back);
  bool FindLevels();
  double Push(std::size_t node, double most);

  std::size_t num_nodes_;
  std::vector<double> if_false_;
  std::vector<double> if_true_;
  /// Arcs lie in pairs, there and back.
  std::vector<Arc> arcs_;
  std::vector<std::vector<std::size_t>> arcs_of_;
  std::vector<int> level_;
  std::vector<std::size_t> next_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_PLAN_MIN_CUT_H_
