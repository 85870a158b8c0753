#ifndef PLUMBLINE_DETECTORS_VISIBLE_WALL_H_
#define PLUMBLINE_DETECTORS_VISIBLE_WALL_H_

#include <plumbline/core/feature.h>
#include <plumbline/core/wall.h>

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <optional>
#include <utility>
#include <vector>

namespace plumbline {

/// The visible part of a wall, by its middle: a side of a room, or a part of
/// one. m, rad, map frame.
struct VisibleWall {
  const Feature* feature = nullptr;
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  double angle = 0.0;
  /// (cos(angle), sin(angle)).
  Eigen::Vector2d direction = Eigen::Vector2d::UnitX();
  double half_length = 0.0;
};

/// The visible part of a feature; nothing when it is not a wall or its visible
/// part is not finite.
std::optional<VisibleWall> VisiblePartOf(const Feature& feature);

/// Where a wall lies along a line through `origin` in the direction `along`, a
/// unit vector.
Interval IntervalAlong(const VisibleWall& wall, const Eigen::Vector2d& origin,
                       const Eigen::Vector2d& along);

/// Whether two walls on one line are two faces of a wall rather than two parts
/// of it: half of the shorter one lies beside the other.
bool RunsBeside(const Interval& a, const Interval& b);

/// Walls by place: all that may pass near another.
class VisibleWallGrid {
 public:
  /// Of cells of this size, m.
  explicit VisibleWallGrid(double cell) : cell_(cell) {}

  /// Enters a wall under a number. `reach`: how far it counts past its ends, m.
  void Add(int index, const VisibleWall& wall, double reach);

  /// Numbers of the walls that pass within a cell of the wall and `reach` past
  /// its ends, ascending; itself among them when it was entered.
  std::vector<int> Near(const VisibleWall& wall, double reach) const;

 private:
  using Cell = std::pair<std::int64_t, std::int64_t>;

  template <typename Visitor>
  void Visit(const VisibleWall& wall, double reach, const Visitor& visit) const;

  double cell_;
  std::map<Cell, std::vector<int>> cells_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_VISIBLE_WALL_H_
