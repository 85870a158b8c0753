#include <plumbline/core/disjoint_sets.h>
#include <plumbline/plan/free_standing.h>
#include <plumbline/plan/sides.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <utility>

namespace plumbline {
namespace {

using Eigen::Vector2d;

// What stands free is no longer than this in any direction of the raster, m.
constexpr double kLongest = 5.0;
// So much of it, m, and of all that is wall between two regions this share
// makes them one, if a gap between them is wider than a door, m, as the wall
// between two doors stands free as well, and no more than this share of the
// border was not seen; and no more than this share of it is drawn as wall: the
// front of a room between its door and a glazed stretch is more.
constexpr double kLeastStanding = 1.5;
constexpr double kStandingShare = 0.93;
constexpr double kMostWall = 0.6;
constexpr double kLeastGap = 1.4;
constexpr double kMostUnseen = 0.1;
constexpr double kStep = WallProfile::kStep;

// Which cells belong to something that has free floor all around it.
class FreeStanding {
 public:
  explicit FreeStanding(const SpaceGrid& space)
      : space_(space), states_(space.cells.size(), State::kNew) {}

  bool Is(int column, int row) {
    State& state = StateOf(column, row);
    if (state != State::kNew) return state == State::kFreeStanding;
    const bool is_standing = Spread(column, row);
    for (const auto& [x, y] : cells_) {
      StateOf(x, y) = is_standing ? State::kFreeStanding : State::kBuilding;
    }
    return is_standing;
  }

 private:
  enum class State : std::uint8_t { kNew, kHere, kFreeStanding, kBuilding };

  State& StateOf(int column, int row) {
    return states_[static_cast<std::size_t>(row) * space_.width + column];
  }

  // Collects the cells around one that are not free; false when they reach
  // farther than furniture. What was not seen may be anything.
  bool Spread(int column, int row) {
    const int longest = static_cast<int>(kLongest / space_.resolution);
    cells_ = {{column, row}};
    StateOf(column, row) = State::kHere;
    int left = column;
    int right = column;
    int low = row;
    int high = row;
    for (std::size_t i = 0; i < cells_.size(); ++i) {
      const auto [x, y] = cells_[i];
      left = std::min(left, x);
      right = std::max(right, x);
      low = std::min(low, y);
      high = std::max(high, y);
      if (right - left > longest || high - low > longest) return false;
      for (int k = 0; k < 9; ++k) {
        const int next_x = x + k % 3 - 1;
        const int next_y = y + k / 3 - 1;
        if (next_x < 0 || next_y < 0 || next_x >= space_.width ||
            next_y >= space_.height) {
          return false;
        }
        State& state = StateOf(next_x, next_y);
        if (state == State::kBuilding) return false;
        if (state != State::kNew || space_.At(next_x, next_y) == Space::kFree) {
          continue;
        }
        state = State::kHere;
        cells_.emplace_back(next_x, next_y);
      }
    }
    return true;
  }

  const SpaceGrid& space_;
  std::vector<State> states_;
  std::vector<std::pair<int, int>> cells_;
};

// What lies between two regions, m.
struct Divider {
  double all = 0.0;
  double wall = 0.0;
  double standing = 0.0;
  double widest_gap = 0.0;
  double unseen = 0.0;
};

// Whether all that was hit at a place on a line stands free.
bool StandsFree(const WallLine& line, double t, const SpaceGrid& space,
                FreeStanding* standing) {
  bool has_any = false;
  for (double v = line.low - kBesideWall; v <= line.high + kBesideWall;
       v += space.resolution) {
    const Vector2d cell =
        (line.At(t) + v * line.normal() - space.origin) / space.resolution;
    const int column = static_cast<int>(std::floor(cell[0]));
    const int row = static_cast<int>(std::floor(cell[1]));
    if (space.At(column, row) != Space::kOccupied) continue;
    if (!standing->Is(column, row)) return false;
    has_any = true;
  }
  return has_any;
}

}  // namespace

void JoinAcrossFreeStanding(const SpaceGrid& space,
                            const Arrangement& arrangement,
                            const std::vector<DrawnLine>& drawn,
                            std::vector<int>* region) {
  FreeStanding standing(space);
  std::map<std::pair<int, int>, Divider> borders;
  const std::vector<Sides> sides = SidesOf(arrangement, *region, drawn);
  for (std::size_t line = 0; line < drawn.size(); ++line) {
    const WallProfile& profile = drawn[line].profile;
    std::pair<int, int> before(-1, -1);
    double gap = 0.0;
    for (int i = 0; i < profile.size(); ++i) {
      const std::pair<int, int> pair =
          std::minmax(sides[line].left[static_cast<std::size_t>(i)],
                      sides[line].right[static_cast<std::size_t>(i)]);
      const Mark mark = profile.At(i);
      const bool is_open = mark == Mark::kOpen || mark == Mark::kDoor;
      gap = is_open ? (pair == before ? gap : 0.0) + kStep : 0.0;
      before = pair;
      if (pair.first < 0) continue;
      Divider& divider = borders[pair];
      divider.all += kStep;
      divider.widest_gap = std::max(divider.widest_gap, gap);
      if (mark == Mark::kUnknown) divider.unseen += kStep;
      if (mark != Mark::kWall) continue;
      divider.wall += kStep;
      if (StandsFree(drawn[line].line, profile.MiddleOf(i), space, &standing)) {
        divider.standing += kStep;
      }
    }
  }
  DisjointSets joined(region->size());
  for (const auto& [pair, divider] : borders) {
    if (divider.standing < kLeastStanding ||
        divider.standing < kStandingShare * divider.wall ||
        divider.wall > kMostWall * divider.all ||
        divider.widest_gap < kLeastGap ||
        divider.unseen > kMostUnseen * divider.all) {
      continue;
    }
    joined.Join(static_cast<std::size_t>(pair.first),
                static_cast<std::size_t>(pair.second));
  }
  for (int& id : *region) {
    if (id >= 0)
      id = static_cast<int>(joined.Find(static_cast<std::size_t>(id)));
  }
}

}  // namespace plumbline
