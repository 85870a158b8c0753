#include <plumbline/detectors/wall_overlaps.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <set>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

// Pairs of walls that pass through one cell of a grid or through two beside
// each other: walls on each other may lie on both sides of where two cells
// meet.
class NeighbourGrid {
 public:
  NeighbourGrid(const WallGraph& walls, double min_length)
      : cells_(static_cast<std::size_t>(walls.size())) {
    for (int i = 0; i < walls.size(); ++i) {
      if (walls.Length(i) < min_length) continue;
      const Wall wall = Geometry(walls.wall(i));
      for (double t = wall.begin;; t += 0.5 * kCell) {
        cells_[i].insert(CellOf(wall.At(std::min(t, wall.end))));
        if (t >= wall.end) break;
      }
      for (const Cell& cell : cells_[i]) grid_[cell].push_back(i);
    }
  }

  // Walls with larger indices near a wall, ascending.
  std::set<int> LaterNear(int i) const {
    std::set<Cell> around;
    for (const auto& [x, y] : cells_[i]) {
      for (const long dx : {-1, 0, 1}) {
        for (const long dy : {-1, 0, 1}) around.insert({x + dx, y + dy});
      }
    }
    std::set<int> near;
    for (const Cell& cell : around) {
      const auto found = grid_.find(cell);
      if (found == grid_.end()) continue;
      const auto& walls = found->second;
      near.insert(std::upper_bound(walls.begin(), walls.end(), i), walls.end());
    }
    return near;
  }

 private:
  using Cell = std::pair<long, long>;
  static constexpr double kCell = 4.0;  // m

  static Cell CellOf(const Vector2d& point) {
    return {std::lround(point.x() / kCell), std::lround(point.y() / kCell)};
  }

  std::map<Cell, std::vector<int>> grid_;
  std::vector<std::set<Cell>> cells_;
};

// Standard deviation of the second wall's offset from the first at the middle
// of the part where they lie side by side, m.
double OffsetSigma(const PlaceWall& first, const PlaceWall& second,
                   const WallMatch& match, const Matrix3d& covariance) {
  const double turn = second.direction - first.direction;
  const Vector3d across(0.0, 1.0, match.along * std::cos(turn));
  return std::sqrt(std::max(0.0, across.dot(covariance * across)));
}

}  // namespace

std::optional<WallMatch> LieOnEachOther(const PlaceWall& first,
                                        const PlaceWall& second,
                                        const SameWallOptions& options) {
  const double angle = NormalizeAngle(second.direction - first.direction);
  const auto noise = [&](const PlaceWall& wall) {
    const double length = std::max(wall.end - wall.begin, 0.1);
    const double sigma =
        options.match.direction_noise / (length * std::sqrt(length));
    return sigma * sigma;
  };
  const double tolerance = options.match.angle_tolerance;
  if (std::abs(angle) >
      options.match.gate *
          std::sqrt(tolerance * tolerance + noise(first) + noise(second))) {
    return std::nullopt;
  }
  const Wall one = Geometry(first);
  const Wall other = Geometry(second);
  const Interval interval = one.IntervalOf(other);
  const double low = std::max(one.begin, interval.first);
  const double high = std::min(one.end, interval.second);
  if (high - low < options.match.min_overlap) return std::nullopt;
  WallMatch match;
  match.overlap = high - low;
  match.along = (0.5 * (low + high) - one.Along(other.position)) /
                one.direction.dot(other.direction);
  match.offset = one.normal().dot(other.position - one.position +
                                  match.along * other.direction);
  if (!(std::abs(match.offset) <= options.known_offset)) return std::nullopt;
  return match;
}

void FindOverlaps(const WallGraph& walls, const SameWallOptions& options,
                  const DetectionScope& scope, Marginals* marginals,
                  ClosureCandidates* candidates) {
  const NeighbourGrid grid(walls, options.min_length);
  std::int64_t searched = 0;
  std::int64_t apart = 0;
  std::int64_t one_already = 0;
  std::int64_t unknown = 0;
  for (int i = 0; i < walls.size() && !scope.ShouldStop(); ++i) {
    std::vector<FeatureId> others;
    std::vector<WallMatch> matches;
    std::vector<int> indices;
    for (const int j : grid.LaterNear(i)) {
      ++searched;
      const auto match = LieOnEachOther(walls.wall(i), walls.wall(j), options);
      if (!match) {
        ++apart;
        continue;
      }
      if (walls.AreOne(i, j) || !walls.AreConnected(i, j)) {
        ++one_already;
        continue;
      }
      others.push_back(walls.wall(j).id);
      indices.push_back(j);
      matches.push_back(*match);
    }
    if (others.empty()) continue;
    const std::vector<Matrix3d> covariances =
        marginals->RelativeCovariances(walls.wall(i).id, others);
    for (std::size_t k = 0; k < others.size(); ++k) {
      const double sigma = OffsetSigma(walls.wall(i), walls.wall(indices[k]),
                                       matches[k], covariances[k]);
      if (options.covariance_scale * sigma > options.known_sigma) {
        ++unknown;
        continue;
      }
      candidates->Add(i, indices[k], matches[k], 0.0, matches[k].overlap);
    }
  }
  scope.Count("wall pairs", searched);
  scope.Count("wall pairs refused: not on each other", apart);
  scope.Count("wall pairs refused: one already or not connected", one_already);
  scope.Count("wall pairs refused: relative place not known", unknown);
}

}  // namespace plumbline
