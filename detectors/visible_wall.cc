#include <plumbline/detectors/visible_wall.h>

#include <algorithm>
#include <cmath>
#include <set>

namespace plumbline {

std::optional<VisibleWall> VisiblePartOf(const Feature& feature) {
  const std::optional<Wall> wall = WallOf(feature);
  if (!wall) return std::nullopt;
  VisibleWall visible;
  visible.feature = &feature;
  visible.middle = wall->Middle();
  visible.angle = wall->angle;
  visible.direction = wall->direction;
  visible.half_length = 0.5 * wall->length();
  if (!(visible.half_length > 0.0) || !std::isfinite(visible.half_length) ||
      !std::isfinite(visible.angle) || !visible.middle.allFinite()) {
    return std::nullopt;
  }
  return visible;
}

Interval IntervalAlong(const VisibleWall& wall, const Eigen::Vector2d& origin,
                       const Eigen::Vector2d& along) {
  const double middle = along.dot(wall.middle - origin);
  const double reach = wall.half_length * std::abs(along.dot(wall.direction));
  return {middle - reach, middle + reach};
}

bool RunsBeside(const Interval& a, const Interval& b) {
  return Overlap(a, b) > 0.5 * std::min(a.second - a.first, b.second - b.first);
}

template <typename Visitor>
void VisibleWallGrid::Visit(const VisibleWall& wall, double reach,
                            const Visitor& visit) const {
  const double end = wall.half_length + reach;
  const int steps = 1 + static_cast<int>(std::ceil(2.0 * end / cell_));
  for (int i = 0; i <= steps; ++i) {
    const Eigen::Vector2d point =
        wall.middle +
        end * (2.0 * static_cast<double>(i) / steps - 1.0) * wall.direction;
    visit({static_cast<std::int64_t>(std::floor(point.x() / cell_)),
           static_cast<std::int64_t>(std::floor(point.y() / cell_))});
  }
}

void VisibleWallGrid::Add(int index, const VisibleWall& wall, double reach) {
  Visit(wall, reach, [&](const Cell& cell) {
    std::vector<int>& walls = cells_[cell];
    if (walls.empty() || walls.back() != index) walls.push_back(index);
  });
}

std::vector<int> VisibleWallGrid::Near(const VisibleWall& wall,
                                       double reach) const {
  std::set<int> found;
  std::set<Cell> seen;
  Visit(wall, reach, [&](const Cell& center) {
    for (std::int64_t x = center.first - 1; x <= center.first + 1; ++x) {
      for (std::int64_t y = center.second - 1; y <= center.second + 1; ++y) {
        if (!seen.insert({x, y}).second) continue;
        const auto cell = cells_.find({x, y});
        if (cell == cells_.end()) continue;
        found.insert(cell->second.begin(), cell->second.end());
      }
    }
  });
  return {found.begin(), found.end()};
}

}  // namespace plumbline
