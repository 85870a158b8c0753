#include <plumbline/plan/min_cut.h>

#include <algorithm>
#include <limits>

namespace plumbline {
namespace {

// Flow below it is rounding.
constexpr double kLeast = 1e-9;

}  // namespace

// The node after the others is the source (true), the one after it the sink.
MinCut::MinCut(std::size_t num_nodes)
    : num_nodes_(num_nodes),
      if_false_(num_nodes, 0.0),
      if_true_(num_nodes, 0.0),
      arcs_of_(num_nodes + 2) {}

void MinCut::AddNodeCost(std::size_t node, double if_false, double if_true) {
  if_false_[node] += if_false;
  if_true_[node] += if_true;
}

void MinCut::AddEdgeCost(std::size_t a, std::size_t b, double if_different) {
  AddArcs(a, b, if_different, if_different);
}

void MinCut::AddArcs(std::size_t from, std::size_t to, double there,
                     double back) {
  arcs_of_[from].push_back(arcs_.size());
  arcs_.push_back({to, there});
  arcs_of_[to].push_back(arcs_.size());
  arcs_.push_back({from, back});
}

bool MinCut::FindLevels() {
  level_.assign(num_nodes_ + 2, -1);
  std::vector<std::size_t> queue = {num_nodes_};
  level_[num_nodes_] = 0;
  for (std::size_t i = 0; i < queue.size(); ++i) {
    for (const std::size_t arc : arcs_of_[queue[i]]) {
      const std::size_t to = arcs_[arc].to;
      if (arcs_[arc].left <= kLeast || level_[to] >= 0) continue;
      level_[to] = level_[queue[i]] + 1;
      queue.push_back(to);
    }
  }
  return level_[num_nodes_ + 1] >= 0;
}

double MinCut::Push(std::size_t node, double most) {
  if (node == num_nodes_ + 1) return most;
  double pushed = 0.0;
  for (std::size_t& i = next_[node]; i < arcs_of_[node].size(); ++i) {
    const std::size_t arc = arcs_of_[node][i];
    const std::size_t to = arcs_[arc].to;
    if (arcs_[arc].left <= kLeast || level_[to] != level_[node] + 1) continue;
    const double flow = Push(to, std::min(most - pushed, arcs_[arc].left));
    arcs_[arc].left -= flow;
    arcs_[arc ^ 1].left += flow;
    pushed += flow;
    if (most - pushed <= kLeast) return pushed;
  }
  return pushed;
}

std::vector<bool> MinCut::Solve() {
  for (std::size_t i = 0; i < num_nodes_; ++i) {
    // Cutting the source off makes a node false.
    const double common = std::min(if_false_[i], if_true_[i]);
    AddArcs(num_nodes_, i, if_false_[i] - common, 0.0);
    AddArcs(i, num_nodes_ + 1, if_true_[i] - common, 0.0);
  }
  while (FindLevels()) {
    next_.assign(num_nodes_ + 2, 0);
    while (Push(num_nodes_, std::numeric_limits<double>::infinity()) > kLeast) {
    }
  }
  // The last levels are what the source still reaches.
  std::vector<bool> labels(num_nodes_);
  for (std::size_t i = 0; i < num_nodes_; ++i) labels[i] = level_[i] >= 0;
  return labels;
}

}  // namespace plumbline
