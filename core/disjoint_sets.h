#ifndef PLUMBLINE_CORE_DISJOINT_SETS_H_
#define PLUMBLINE_CORE_DISJOINT_SETS_H_

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <vector>

namespace plumbline {

/// Disjoint sets of the numbers 0 to size - 1, with path halving; the root of a
/// set is its smallest number, whatever the order of joins.
class DisjointSets {
 public:
  /// Elements 0 to size - 1, each a set of its own.
  explicit DisjointSets(std::size_t size) : parents_(size) {
    std::iota(parents_.begin(), parents_.end(), std::size_t{0});
  }

  /// Root of the set that `i` is in.
  std::size_t Find(std::size_t i) {
    while (parents_[i] != i) {
      parents_[i] = parents_[parents_[i]];
      i = parents_[i];
    }
    return i;
  }

  /// Makes one set of two; false when they were one already.
  bool Join(std::size_t i, std::size_t j) {
    i = Find(i);
    j = Find(j);
    if (i == j) return false;
    parents_[std::max(i, j)] = std::min(i, j);
    return true;
  }

 private:
  std::vector<std::size_t> parents_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_DISJOINT_SETS_H_
