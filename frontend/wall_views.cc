#include <plumbline/core/error.h>
#include <plumbline/core/registry.h>
#include <plumbline/frontend/wall_views.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string>

namespace plumbline {
namespace {

// Walls are looked up by cells of this size, m.
constexpr double kCell = 0.5;

using Cell = std::array<long, 2>;

Cell CellOf(const Eigen::Vector2d& position) {
  return {std::lround(position.x() / kCell), std::lround(position.y() / kCell)};
}

}  // namespace

std::vector<int> GroupsThatSaw(const std::vector<Feature>& walls,
                               const std::vector<Scan>& scans,
                               const std::vector<Pose2>& poses,
                               const std::vector<int>& groups,
                               const ScanPointsOptions& points,
                               double max_offset) {
  if (poses.size() != scans.size() || groups.size() != scans.size()) {
    throw PLUMBLINE_ERROR(
        std::to_string(poses.size()) + " poses and " +
            std::to_string(groups.size()) + " groups",
        "one for each of " + std::to_string(scans.size()) + " scans");
  }
  std::map<Cell, std::vector<std::size_t>> cells;
  std::vector<Pose2> frames;
  for (std::size_t w = 0; w < walls.size(); ++w) {
    frames.push_back(Inverse(walls[w].type->frame(walls[w])));
    const Pose2 pose = walls[w].type->frame(walls[w]);
    const double begin = walls[w].extent_begin;
    const double end = walls[w].extent_end;
    const int steps =
        static_cast<int>(std::ceil((end - begin) / (0.5 * kCell)));
    for (int step = 0; step <= steps; ++step) {
      const double along = begin + (end - begin) * step / std::max(1, steps);
      const Cell middle =
          CellOf(TransformPoint(pose, Eigen::Vector2d(along, 0.0)));
      for (long x = -1; x <= 1; ++x) {
        for (long y = -1; y <= 1; ++y) {
          std::vector<std::size_t>& there =
              cells[{middle[0] + x, middle[1] + y}];
          if (there.empty() || there.back() != w) there.push_back(w);
        }
      }
    }
  }
  std::vector<std::map<int, int>> counts(walls.size());
  std::vector<ScanPoint> returns;
  for (std::size_t i = 0; i < scans.size(); ++i) {
    ExtractScanPoints(scans[i], points, &returns);
    const PoseTransform transform(poses[i]);
    for (const ScanPoint& point : returns) {
      const Eigen::Vector2d position = transform.Point(point.position);
      const auto there = cells.find(CellOf(position));
      if (there == cells.end()) continue;
      for (const std::size_t w : there->second) {
        const Eigen::Vector2d local = TransformPoint(frames[w], position);
        if (std::abs(local.y()) <= max_offset &&
            local.x() >= walls[w].extent_begin &&
            local.x() <= walls[w].extent_end) {
          ++counts[w][groups[i]];
        }
      }
    }
  }
  std::vector<int> result;
  for (const std::map<int, int>& count : counts) {
    int best = -1;
    int most = 0;
    for (const auto& [group, number] : count) {
      if (number <= most) continue;
      most = number;
      best = group;
    }
    result.push_back(best);
  }
  return result;
}

}  // namespace plumbline
