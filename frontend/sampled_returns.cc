#include <plumbline/frontend/beam_directions.h>
#include <plumbline/frontend/sampled_returns.h>

#include <algorithm>
#include <cmath>

namespace plumbline {
namespace {

// Cells by which walls are looked up, and the farthest off a wall that it is
// looked for, m.
constexpr double kWallCell = 0.5;
constexpr double kWallReach = 0.15;

std::int64_t CellNumber(double place, double size) {
  return static_cast<std::int64_t>(std::floor(place / size));
}

std::int64_t KeyOf(const Eigen::Vector2d& place, double size) {
  return CellKey(CellNumber(place.x(), size), CellNumber(place.y(), size));
}

// Indices of the scans that are taken.
std::vector<std::size_t> ChooseScans(const std::vector<Pose2>& poses,
                                     const SampledReturnsOptions& options) {
  std::vector<std::size_t> moved;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    if (!moved.empty()) {
      const Pose2& last = poses[moved.back()];
      if ((poses[i].head<2>() - last.head<2>()).norm() < options.step &&
          std::abs(NormalizeAngle(poses[i][2] - last[2])) < options.turn) {
        continue;
      }
    }
    moved.push_back(i);
  }
  const std::size_t stride =
      (moved.size() + options.max_scans - 1) / options.max_scans;
  std::vector<std::size_t> chosen;
  for (std::size_t i = 0; i < moved.size(); i += stride) {
    chosen.push_back(moved[i]);
  }
  return chosen;
}

}  // namespace

SampledReturns::SampledReturns(const std::vector<Wall>& walls,
                               const std::vector<Scan>& scans,
                               const std::vector<Pose2>& poses,
                               const SampledReturnsOptions& options)
    : options_(options), walls_(walls) {
  IndexWalls();
  BeamDirections beams;
  for (const std::size_t i : ChooseScans(poses, options)) {
    const Scan& scan = scans[i];
    const Pose2 laser = Compose(poses[i], scan.laser_offset);
    const PoseTransform transform(laser);
    const std::vector<Eigen::Vector2d>& directions = beams.Of(scan);
    const std::size_t stride = std::max<std::size_t>(
        1, (directions.size() + options.max_beams - 1) / options.max_beams);
    View view;
    view.origin = laser.head<2>();
    view.begin = returns_.size();
    for (std::size_t beam = 0; beam < directions.size(); beam += stride) {
      const double range = scan.ranges[beam];
      if (range < options.minimum_range || range > options.usable_range) {
        continue;
      }
      const Eigen::Vector2d place = transform.Point(range * directions[beam]);
      returns_.push_back({place, AddToCell(place),
                          WallAt(place, view.origin, options.wall_offset)});
    }
    view.end = returns_.size();
    views_.push_back(view);
  }
  for (Cell& cell : cells_) cell.mean /= cell.count;
}

void SampledReturns::IndexWalls() {
  for (std::size_t i = 0; i < walls_.size(); ++i) {
    const Wall& wall = walls_[i];
    const int steps =
        1 + static_cast<int>(std::ceil((wall.length() + 2.0 * kWallReach) /
                                       (0.5 * kWallCell)));
    const double begin = wall.begin - kWallReach;
    for (int k = 0; k <= steps; ++k) {
      const Eigen::Vector2d place =
          wall.At(begin + (wall.length() + 2.0 * kWallReach) * k / steps);
      for (const double dx : {-kWallReach, kWallReach}) {
        for (const double dy : {-kWallReach, kWallReach}) {
          const int next = static_cast<int>(walls_near_.size());
          const int cell = walls_near_of_.FindOrAdd(
              KeyOf(place + Eigen::Vector2d(dx, dy), kWallCell), next);
          if (cell == next) walls_near_.emplace_back();
          std::vector<int>& near = walls_near_[static_cast<std::size_t>(cell)];
          const int number = static_cast<int>(i);
          if (near.empty() || near.back() != number) near.push_back(number);
        }
      }
    }
  }
}

int SampledReturns::AddToCell(const Eigen::Vector2d& place) {
  const int number = cell_of_.FindOrAdd(KeyOf(place, options_.cell_size),
                                        static_cast<int>(cells_.size()));
  const auto index = static_cast<std::size_t>(number);
  if (index == cells_.size()) cells_.emplace_back();
  cells_[index].mean += place;
  ++cells_[index].count;
  return number;
}

bool SampledReturns::IsNear(const Eigen::Vector2d& place, double reach) const {
  const std::int64_t column = CellNumber(place.x(), options_.cell_size);
  const std::int64_t row = CellNumber(place.y(), options_.cell_size);
  for (std::int64_t dy = -1; dy <= 1; ++dy) {
    for (std::int64_t dx = -1; dx <= 1; ++dx) {
      const int cell = cell_of_.Find(CellKey(column + dx, row + dy));
      if (cell >= 0 &&
          (cells_[static_cast<std::size_t>(cell)].mean - place).squaredNorm() <=
              reach * reach) {
        return true;
      }
    }
  }
  return false;
}

int SampledReturns::WallAt(const Eigen::Vector2d& place,
                           const Eigen::Vector2d& origin, double offset) const {
  const int cell = walls_near_of_.Find(KeyOf(place, kWallCell));
  if (cell < 0) return -1;
  int nearest = -1;
  double least = offset;
  for (const int number : walls_near_[static_cast<std::size_t>(cell)]) {
    const Wall& wall = walls_[static_cast<std::size_t>(number)];
    const double across = std::abs(wall.Across(place));
    if (across > least) continue;
    const double along = wall.Along(place);
    if (along < wall.begin - offset || along > wall.end + offset ||
        wall.Across(origin) <= 0.0) {
      continue;
    }
    least = across;
    nearest = number;
  }
  return nearest;
}

}  // namespace plumbline
