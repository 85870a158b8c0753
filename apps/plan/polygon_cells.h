#ifndef PLUMBLINE_PLAN_POLYGON_CELLS_H_
#define PLUMBLINE_PLAN_POLYGON_CELLS_H_

#include <plumbline/plan/polygon.h>
#include <plumbline/plan/space_grid.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace plumbline {

/// Calls visit(column, row) for the cells of `space` whose middles lie in a
/// polygon (m, map frame), row by row from the bottom.
template <typename Visit>
void ForEachCell(const Polygon& polygon, const SpaceGrid& space,
                 const Visit& visit) {
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (const Eigen::Vector2d& p : polygon.shell) {
    low = std::min(low, p[1]);
    high = std::max(high, p[1]);
  }
  const double size = space.resolution;
  const int first =
      std::max(0, static_cast<int>(std::floor((low - space.origin[1]) / size)));
  const int last =
      std::min(space.height - 1,
               static_cast<int>(std::floor((high - space.origin[1]) / size)));
  std::vector<double> crossings;
  for (int row = first; row <= last; ++row) {
    const double y = space.origin[1] + (row + 0.5) * size;
    crossings.clear();
    const auto cross = [&](const Ring& ring) {
      for (std::size_t i = 0; i < ring.size(); ++i) {
        const Eigen::Vector2d& a = ring[i];
        const Eigen::Vector2d& b = ring[(i + 1) % ring.size()];
        if ((a[1] > y) == (b[1] > y)) continue;
        crossings.push_back(a[0] + (b[0] - a[0]) * (y - a[1]) / (b[1] - a[1]));
      }
    };
    cross(polygon.shell);
    for (const Ring& hole : polygon.holes) cross(hole);
    std::sort(crossings.begin(), crossings.end());
    for (std::size_t i = 0; i + 1 < crossings.size(); i += 2) {
      const int from = std::max(
          0, static_cast<int>(
                 std::ceil((crossings[i] - space.origin[0]) / size - 0.5)));
      const int to = std::min(
          space.width - 1,
          static_cast<int>(
              std::ceil((crossings[i + 1] - space.origin[0]) / size - 0.5)) -
              1);
      for (int column = from; column <= to; ++column) visit(column, row);
    }
  }
}

}  // namespace plumbline

#endif  // PLUMBLINE_PLAN_POLYGON_CELLS_H_
