#include <plumbline/core/error.h>
#include <plumbline/core/parallel_for.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/wall.h>
#include <plumbline/frontend/cell_index.h>
#include <plumbline/frontend/wall_votes.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <string>

namespace plumbline {
namespace {

constexpr double kCell = 0.5;

// Its ends are where returns may still be on it.
struct GridWall : Wall {
  FeatureId id = kNoId;
};

// Walls by the cells that a return on them may fall into.
class WallGrid {
 public:
  WallGrid(const Graph& graph, const WallVoteOptions& options) {
    for (const Feature* feature : graph.Features()) {
      if (!feature->type->Is(FeatureRole::kWall) ||
          !feature->type->traits.is_one_sided || feature->level != 0) {
        continue;
      }
      GridWall wall;
      static_cast<Wall&>(wall) = *WallOf(*feature);
      wall.id = feature->id;
      wall.begin -= options.max_gap;
      wall.end += options.max_gap;
      const int index = static_cast<int>(walls_.size());
      walls_.push_back(wall);
      // Steps of half a cell along and across reach every cell of the strip.
      const double step = 0.5 * kCell;
      const int along =
          static_cast<int>(std::ceil((wall.end - wall.begin) / step));
      const int across =
          static_cast<int>(std::ceil(2.0 * options.max_offset / step)) + 1;
      for (int i = 0; i <= along; ++i) {
        for (int j = 0; j <= across; ++j) {
          const Eigen::Vector2d point =
              wall.position +
              (wall.begin + (wall.end - wall.begin) * i / std::max(1, along)) *
                  wall.direction +
              (2.0 * j / across - 1.0) * options.max_offset * wall.normal();
          const int next = static_cast<int>(cells_.size());
          const int number = cell_of_.FindOrAdd(Key(point), next);
          if (number == next) cells_.emplace_back();
          std::vector<int>& cell = cells_[number];
          if (cell.empty() || cell.back() != index) cell.push_back(index);
        }
      }
    }
  }

  // Of the cell that a point lies in.
  static std::int64_t Key(const Eigen::Vector2d& point) {
    return CellKey(Floor(point.x() / kCell), Floor(point.y() / kCell));
  }
  // Null where no wall is.
  const std::vector<int>* In(std::int64_t cell) const {
    const int found = cell_of_.Find(cell);
    return found < 0 ? nullptr : &cells_[found];
  }
  const GridWall& wall(int index) const { return walls_[index]; }
  bool is_empty() const { return walls_.empty(); }

 private:
  // One is asked for with every return, and the library's is called.
  static std::int64_t Floor(double value) {
    const auto truncated = static_cast<std::int64_t>(value);
    return truncated - (static_cast<double>(truncated) > value ? 1 : 0);
  }

  std::vector<GridWall> walls_;
  CellIndex cell_of_;
  std::vector<std::vector<int>> cells_;
};

}  // namespace

std::vector<std::vector<WallVote>> CollectWallVotes(
    const Graph& graph, const std::vector<Place>& places,
    const std::vector<Pose2>& poses, const WallVoteOptions& options) {
  if (places.size() != poses.size()) {
    throw PLUMBLINE_ERROR(std::to_string(places.size()) + " places and " +
                              std::to_string(poses.size()) + " poses",
                          "one pose for each place");
  }
  const WallGrid grid(graph, options);
  const double min_cosine = std::cos(options.max_turn);
  const double scale = 1.0 / (options.point_sigma * options.point_sigma *
                              options.loss_scale * options.loss_scale);
  std::vector<std::vector<WallVote>> votes(places.size());
  if (grid.is_empty()) return votes;
  ParallelFor(places.size(), options.num_threads, [&](std::size_t k) {
    const PoseTransform transform(poses[k]);
    const double share =
        options.independence / (options.point_sigma * options.point_sigma *
                                std::max(1, places[k].num_scans));
    std::map<FeatureId, WallVote> of_wall;
    WallVote* last = nullptr;
    // Neighbouring returns mostly fall into one cell.
    std::int64_t cell = WallGrid::Key(poses[k].head<2>());
    const std::vector<int>* near = grid.In(cell);
    for (const SurfaceReturn& point : places[k].returns) {
      if (point.normal.squaredNorm() == 0.0f) continue;
      const Eigen::Vector2d own_position = point.position.cast<double>();
      const Eigen::Vector2d position = transform.Point(own_position);
      const std::int64_t own = WallGrid::Key(position);
      if (own != cell) {
        cell = own;
        near = grid.In(cell);
      }
      if (near == nullptr) continue;
      const Eigen::Vector2d normal =
          transform.Direction(point.normal.cast<double>());
      double best = options.max_offset;
      FeatureId hit = kNoId;
      for (const int index : *near) {
        const GridWall& wall = grid.wall(index);
        const Eigen::Vector2d difference = position - wall.position;
        const double offset = std::abs(difference.dot(wall.normal()));
        if (!(offset < best)) continue;
        const double along = difference.dot(wall.direction);
        if (along >= wall.begin && along <= wall.end &&
            normal.dot(wall.normal()) >= min_cosine) {
          best = offset;
          hit = wall.id;
        }
      }
      if (hit == kNoId) continue;
      // Neighbouring returns mostly lie on one wall.
      if (last == nullptr || last->wall != hit) {
        last = &of_wall[hit];
        last->wall = hit;
      }
      WallVote& vote = *last;
      ++vote.points;
      const Eigen::Vector3d homogeneous(own_position.x(), own_position.y(),
                                        1.0);
      vote.information.noalias() += share / (1.0 + scale * best * best) *
                                    homogeneous * homogeneous.transpose();
    }
    for (const auto& entry : of_wall) {
      if (entry.second.points >= options.min_points) {
        votes[k].push_back(entry.second);
      }
    }
  });
  return votes;
}

}  // namespace plumbline
