#include <plumbline/detectors/wall_corners.h>
#include <plumbline/factors/angle.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <tuple>

namespace plumbline {
namespace {

// From a corner so many of the nearest in each direction are tried.
constexpr std::size_t kMaxTries = 16;

double Cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

}  // namespace

WallCorners::WallCorners(const std::vector<VisibleWall>& walls,
                         const VisibleWallGrid& grid, double reach,
                         const WallCornerOptions& options)
    : walls_(walls),
      options_(options),
      corners_of_(walls.size()),
      in_line_(walls.size()) {
  for (int i = 0; i < static_cast<int>(walls.size()); ++i) {
    in_line_[static_cast<std::size_t>(i)].push_back(i);
    for (const int j : grid.Near(wall(i), reach)) {
      if (j == i) continue;
      if (AreInLine(wall(i), wall(j))) {
        in_line_[static_cast<std::size_t>(i)].push_back(j);
      }
      if (j > i) AddCorner(i, j);
    }
  }
}

bool WallCorners::AreInLine(const VisibleWall& first,
                            const VisibleWall& second) const {
  if (std::abs(NormalizeAxial(first.angle - second.angle)) >
      options_.gate_angle) {
    return false;
  }
  const auto own = std::pair(-first.half_length, first.half_length);
  const auto other = IntervalAlong(second, first.middle, first.direction);
  if (-Overlap(own, other) > options_.max_opening || RunsBeside(own, other)) {
    return false;
  }
  // Across, seen from the nearer end of each.
  const auto is_near = [&](const VisibleWall& from, const VisibleWall& to) {
    const double along = from.direction.dot(to.middle - from.middle);
    const double sign =
        (from.direction.dot(to.direction) > 0.0) == (along > 0.0) ? -1.0 : 1.0;
    const Eigen::Vector2d end =
        to.middle + sign * to.half_length * to.direction;
    return std::abs(Cross(from.direction, end - from.middle)) <= options_.gate;
  };
  return is_near(first, second) && is_near(second, first);
}

// Where walls meet at a right angle.
void WallCorners::AddCorner(int i, int j) {
  const double turn = std::abs(NormalizeAxial(wall(i).angle - wall(j).angle));
  if (0.5 * kPi - turn > options_.gate_angle) return;
  const double sine = Cross(wall(i).direction, wall(j).direction);
  const double along_i =
      Cross(wall(j).middle - wall(i).middle, wall(j).direction) / sine;
  const double along_j =
      Cross(wall(j).middle - wall(i).middle, wall(i).direction) / sine;
  if (std::abs(along_i) > wall(i).half_length + options_.corner_gap ||
      std::abs(along_j) > wall(j).half_length + options_.corner_gap) {
    return;
  }
  const int corner = size();
  corners_.push_back({i, j, wall(i).middle + along_i * wall(i).direction});
  corners_of_[static_cast<std::size_t>(i)].push_back(corner);
  corners_of_[static_cast<std::size_t>(j)].push_back(corner);
  between_[{i, j}] = corner;
}

int WallCorners::Between(int wall, int other) const {
  const auto found = between_.find(std::minmax(wall, other));
  return found == between_.end() ? -1 : found->second;
}

std::vector<WallCorners::OnWall> WallCorners::Along(int from, int wall_index,
                                                    double min_distance,
                                                    double max_distance) const {
  std::array<std::vector<std::tuple<double, int, int>>, 2> found;
  for (const int on : in_line_[static_cast<std::size_t>(wall_index)]) {
    for (const int other : corners_of_[static_cast<std::size_t>(on)]) {
      const double along =
          wall(wall_index)
              .direction.dot(corner(other).position - corner(from).position);
      if (other == from || std::abs(along) < min_distance ||
          std::abs(along) > max_distance) {
        continue;
      }
      found[along < 0.0].emplace_back(std::abs(along), other, on);
    }
  }
  std::vector<OnWall> corners;
  for (auto& direction : found) {
    std::sort(direction.begin(), direction.end());
    if (direction.size() > kMaxTries) direction.resize(kMaxTries);
    for (const auto& entry : direction) {
      corners.push_back({std::get<1>(entry), std::get<2>(entry)});
    }
  }
  return corners;
}

}  // namespace plumbline
