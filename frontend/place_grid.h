#ifndef PLUMBLINE_FRONTEND_PLACE_GRID_H_
#define PLUMBLINE_FRONTEND_PLACE_GRID_H_

#include <plumbline/factors/pose2.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

namespace plumbline {

/// Poses by the cell of a grid that they lie in.
class PlaceGrid {
 public:
  /// `poses`: any one frame; `cell`: length of a cell's sides, m, above 0.
  PlaceGrid(const std::vector<Pose2>& poses, double cell) : cell_(cell) {
    for (std::size_t k = 0; k < poses.size(); ++k) {
      entries_.emplace_back(CellOf(poses[k].head<2>()), k);
    }
    std::sort(entries_.begin(), entries_.end());
  }

  /// Calls `visit` with the index of each pose in the cell of a position (m,
  /// the poses' frame) and the eight around it: all within the length of a
  /// cell, and some that are farther away.
  template <typename Visit>
  void Around(const Eigen::Vector2d& position, const Visit& visit) const {
    const Cell middle = CellOf(position);
    for (long x = middle.first - 1; x <= middle.first + 1; ++x) {
      for (long y = middle.second - 1; y <= middle.second + 1; ++y) {
        const Cell cell(x, y);
        auto entry = std::lower_bound(entries_.begin(), entries_.end(),
                                      std::make_pair(cell, std::size_t{0}));
        for (; entry != entries_.end() && entry->first == cell; ++entry) {
          visit(entry->second);
        }
      }
    }
  }

 private:
  using Cell = std::pair<long, long>;
  Cell CellOf(const Eigen::Vector2d& position) const {
    return {std::lround(position.x() / cell_),
            std::lround(position.y() / cell_)};
  }

  double cell_;
  std::vector<std::pair<Cell, std::size_t>> entries_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_PLACE_GRID_H_
