#ifndef PLUMBLINE_PLAN_SPACE_GRID_H_
#define PLUMBLINE_PLAN_SPACE_GRID_H_

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <vector>

namespace plumbline {

/// What a laser saw at a place.
enum class Space : std::uint8_t { kUnknown, kFree, kOccupied };

/// A raster of the space that was seen, row by row from the bottom.
struct SpaceGrid {
  /// Side of a cell, m (> 0).
  double resolution = 0.05;
  /// Lower left corner of the lower left cell, m, map frame.
  Eigen::Vector2d origin = Eigen::Vector2d::Zero();
  int width = 0;
  int height = 0;
  /// width * height cells.
  std::vector<Space> cells;

  /// Unknown outside of the raster.
  Space At(int column, int row) const {
    if (column < 0 || row < 0 || column >= width || row >= height) {
      return Space::kUnknown;
    }
    return cells[static_cast<std::size_t>(row) * width + column];
  }
  /// At a point, m, map frame.
  Space At(const Eigen::Vector2d& point) const {
    const Eigen::Vector2d cell = (point - origin) / resolution;
    return At(static_cast<int>(std::floor(cell[0])),
              static_cast<int>(std::floor(cell[1])));
  }
  /// Middle of a cell, m, map frame.
  Eigen::Vector2d Middle(int column, int row) const {
    return origin + resolution * Eigen::Vector2d(column + 0.5, row + 0.5);
  }
};

}  // namespace plumbline

#endif  // PLUMBLINE_PLAN_SPACE_GRID_H_
