#include <plumbline/core/registry.h>
#include <plumbline/core/wall.h>
#include <plumbline/frontend/wall_junctions.h>

#include <cmath>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

struct Candidate : Wall {
  Feature* feature = nullptr;
};

// Ends of walls by cells.
using Cell = std::pair<std::int64_t, std::int64_t>;

Cell CellOf(const Eigen::Vector2d& point, double size) {
  return {static_cast<std::int64_t>(std::floor(point.x() / size)),
          static_cast<std::int64_t>(std::floor(point.y() / size))};
}

// Whether the edge between the end of `a` and the beginning of `b` was moved.
bool MoveEdge(const WallJunctionOptions& options, Candidate* a, Candidate* b) {
  if (a->direction.dot(b->direction) < std::cos(options.max_angle)) {
    return false;
  }
  const double sine = a->normal().dot(b->direction);
  if (std::abs(sine) < std::sin(options.min_angle)) return false;
  const Eigen::Vector2d begin = b->At(b->begin);
  const double gap = a->Along(begin) - a->end;
  if (gap > options.max_gap || gap < -options.max_overlap ||
      std::abs(a->Across(begin)) > options.max_step) {
    return false;
  }
  const double on_b = -a->Across(b->position) / sine;
  const double on_a = a->Along(b->At(on_b));
  const bool a_grows = on_a > a->end;
  const bool b_grows = on_b < b->begin;
  // Into an opening: there is nothing to be confused.
  if (a_grows && b_grows) return false;
  const double offset = a_grows   ? std::abs(a->Across(begin))
                        : b_grows ? std::abs(b->Across(a->At(a->end)))
                                  : 0.0;
  if (offset > options.max_offset || on_a - a->begin < options.min_length ||
      b->end - on_b < options.min_length) {
    return false;
  }
  if (on_a == a->end && on_b == b->begin) return false;
  a->end = on_a;
  b->begin = on_b;
  a->feature->extent_end = on_a;
  b->feature->extent_begin = on_b;
  return true;
}

}  // namespace

int MoveWallJunctions(const WallJunctionOptions& options, Graph* graph) {
  std::vector<Candidate> walls;
  for (const Feature* feature : std::as_const(*graph).Features()) {
    if (!feature->type->Is(FeatureRole::kWall) ||
        !feature->type->traits.is_one_sided || feature->level != 0) {
      continue;
    }
    Candidate wall;
    static_cast<Wall&>(wall) = *WallOf(*feature);
    if (!std::isfinite(wall.begin) || !std::isfinite(wall.end)) continue;
    wall.feature = &graph->GetFeature(feature->id);
    walls.push_back(wall);
  }
  const double size = options.max_gap + options.max_overlap + options.max_step;
  std::map<Cell, std::vector<std::size_t>> begins;
  for (std::size_t i = 0; i < walls.size(); ++i) {
    begins[CellOf(walls[i].At(walls[i].begin), size)].push_back(i);
  }
  int moved = 0;
  for (std::size_t i = 0; i < walls.size(); ++i) {
    const Cell here = CellOf(walls[i].At(walls[i].end), size);
    for (std::int64_t x = here.first - 1; x <= here.first + 1; ++x) {
      for (std::int64_t y = here.second - 1; y <= here.second + 1; ++y) {
        const auto found = begins.find({x, y});
        if (found == begins.end()) continue;
        for (const std::size_t k : found->second) {
          if (k != i) moved += MoveEdge(options, &walls[i], &walls[k]);
        }
      }
    }
  }
  return moved;
}

}  // namespace plumbline
