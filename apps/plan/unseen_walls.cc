#include <plumbline/core/parallel_for.h>
#include <plumbline/plan/polygon_cells.h>
#include <plumbline/plan/unseen_walls.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

namespace plumbline {
namespace {

using Eigen::Vector2d;

// Directions with a larger cosine are one.
constexpr double kSameCosine = 0.99;

struct Cell {
  Vector2d middle;
  Space space;
};

// What lies across a region at one place.
struct Strip {
  int all = 0;
  int free = 0;
  int occupied = 0;
  double begin = 0.0;
  double end = 0.0;
};

// The directions of the walls around each region, the one with most wall
// first.
std::map<int, std::vector<Vector2d>> DirectionsOf(
    const Arrangement& arrangement, const std::vector<int>& region,
    const std::vector<DrawnLine>& drawn, double min_wall) {
  struct Direction {
    Vector2d along;
    double wall;
  };
  std::map<int, std::vector<Direction>> all;
  for (const ArrangementEdge& edge : arrangement.edges) {
    if (edge.line < 0) continue;
    const WallLine& line = drawn[static_cast<std::size_t>(edge.line)].line;
    if (!line.is_aligned) continue;
    const auto region_of = [&](int face) {
      return face < 0 ? -1 : region[static_cast<std::size_t>(face)];
    };
    const int left = region_of(edge.left);
    const int right = region_of(edge.right);
    if (left == right) continue;
    for (const int side : {left, right}) {
      if (side < 0) continue;
      std::vector<Direction>& directions = all[side];
      auto found = std::find_if(
          directions.begin(), directions.end(), [&](const Direction& other) {
            return std::abs(other.along.dot(line.along)) > kSameCosine;
          });
      if (found == directions.end()) {
        found = directions.insert(found, {line.along, 0.0});
      }
      found->wall += edge.lengths.Of(Mark::kWall);
    }
  }
  std::map<int, std::vector<Vector2d>> result;
  for (auto& [id, directions] : all) {
    std::stable_sort(
        directions.begin(), directions.end(),
        [](const Direction& a, const Direction& b) { return a.wall > b.wall; });
    for (const Direction& direction : directions) {
      if (direction.wall >= min_wall) result[id].push_back(direction.along);
    }
  }
  return result;
}

// The strips of a region along a direction, by their place across it.
std::map<int, Strip> StripsOf(const std::vector<Cell>& cells,
                              const Vector2d& along, double width) {
  const Vector2d normal(-along[1], along[0]);
  std::map<int, Strip> strips;
  // Neighbouring cells mostly lie in one strip or in two.
  auto last = strips.end();
  for (const Cell& cell : cells) {
    const double t = along.dot(cell.middle);
    const int place =
        static_cast<int>(std::floor(normal.dot(cell.middle) / width));
    if (last == strips.end() || last->first != place) {
      last = strips.try_emplace(place).first;
    }
    Strip& strip = last->second;
    if (strip.all == 0) strip.begin = strip.end = t;
    strip.begin = std::min(strip.begin, t);
    strip.end = std::max(strip.end, t);
    ++strip.all;
    strip.free += cell.space == Space::kFree;
    strip.occupied += cell.space == Space::kOccupied;
  }
  return strips;
}

// Walls along a direction between places that were seen.
void FindAlong(const std::vector<Cell>& cells, const Vector2d& along,
               double width, const UnseenWallOptions& options,
               std::vector<WallLine>* lines) {
  const Vector2d normal(-along[1], along[0]);
  const std::map<int, Strip> strips = StripsOf(cells, along, width);
  const auto is_unseen = [&](const Strip& strip) {
    return strip.free <= options.most_free * strip.all;
  };
  int after = 0;
  for (const auto& [place, strip] : strips) after += strip.free;
  const double least = options.min_area / (width * width);
  int before = 0;
  for (auto first = strips.begin(); first != strips.end();) {
    if (!is_unseen(first->second)) {
      before += first->second.free;
      after -= first->second.free;
      ++first;
      continue;
    }
    auto last = first;
    int next = first->first;
    int most_occupied = 0;
    while (last != strips.end() && last->first == next &&
           is_unseen(last->second)) {
      most_occupied = std::max(most_occupied, last->second.occupied);
      after -= last->second.free;
      ++next;
      ++last;
    }
    if (before >= least && after >= least) {
      // Where most was hit, or in the middle.
      double sum = 0.0;
      int count = 0;
      WallLine line;
      for (auto it = first; it != last; ++it) {
        if (it->second.occupied < most_occupied) continue;
        sum += (it->first + 0.5) * width;
        if (count++ > 0) continue;
        line.begin = it->second.begin;
        line.end = it->second.end;
      }
      const double across = sum / count;
      line.along = along;
      line.origin = across * normal;
      line.is_aligned = true;
      const double low = first->first * width - across;
      const double high = next * width - across;
      if (high - low <= options.max_thickness) {
        line.low = low;
        line.high = high;
      }
      lines->push_back(line);
      before = 0;
    }
    first = last;
  }
}

}  // namespace

std::vector<WallLine> FindUnseenWalls(const Arrangement& arrangement,
                                      const std::vector<int>& region,
                                      const std::vector<DrawnLine>& drawn,
                                      const SpaceGrid& space,
                                      const UnseenWallOptions& options) {
  std::map<int, std::vector<std::size_t>> faces;
  for (std::size_t i = 0; i < region.size(); ++i) {
    if (region[i] >= 0) faces[region[i]].push_back(i);
  }
  const std::map<int, std::vector<Vector2d>> found =
      DirectionsOf(arrangement, region, drawn, options.min_wall);
  const std::vector<std::pair<int, std::vector<Vector2d>>> regions(
      found.begin(), found.end());
  std::vector<std::vector<WallLine>> lines_of(regions.size());
  ParallelFor(regions.size(), ThreadsHere(), [&](std::size_t i) {
    const auto& [id, directions] = regions[i];
    std::vector<Cell> cells;
    for (const std::size_t face : faces.at(id)) {
      ForEachCell(arrangement.faces[face], space, [&](int column, int row) {
        cells.push_back({space.Middle(column, row), space.At(column, row)});
      });
    }
    for (const Vector2d& along : directions) {
      FindAlong(cells, along, space.resolution, options, &lines_of[i]);
      // Other directions of what is left are for the parts.
      if (!lines_of[i].empty()) break;
    }
  });
  std::vector<WallLine> lines;
  for (const std::vector<WallLine>& some : lines_of) {
    lines.insert(lines.end(), some.begin(), some.end());
  }
  return lines;
}

}  // namespace plumbline
