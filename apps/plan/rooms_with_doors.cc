#include <plumbline/plan/rooms_with_doors.h>

#include <algorithm>
#include <map>
#include <set>
#include <utility>

namespace plumbline {
namespace {

// Of a door, m, and of what lies between two rooms.
constexpr double kLeastDoor = 0.5;
constexpr double kLeastBetween = 1.5;

using Pair = std::pair<int, int>;  // the lower number first

}  // namespace

std::vector<int> LinesBetweenRoomsWithDoors(const Arrangement& arrangement,
                                            const std::vector<int>& region,
                                            int first, int last) {
  const auto region_of = [&](int face) {
    return face < 0 ? -1 : region[static_cast<std::size_t>(face)];
  };
  std::map<Pair, double> doors;
  std::map<int, std::map<Pair, double>> borders;
  for (const ArrangementEdge& edge : arrangement.edges) {
    const Pair sides =
        std::minmax({region_of(edge.left), region_of(edge.right)});
    if (sides.first < 0 || sides.first == sides.second) continue;
    doors[sides] += edge.lengths.Of(Mark::kDoor);
    if (edge.line >= first && edge.line < last) {
      borders[edge.line][sides] += edge.length();
    }
  }
  std::map<int, std::set<int>> behind_doors;
  for (const auto& [sides, width] : doors) {
    if (width < kLeastDoor) continue;
    behind_doors[sides.first].insert(sides.second);
    behind_doors[sides.second].insert(sides.first);
  }
  std::vector<int> lines;
  for (const auto& [line, pairs] : borders) {
    const bool is_between =
        std::any_of(pairs.begin(), pairs.end(), [&](const auto& entry) {
          const std::set<int>& a = behind_doors[entry.first.first];
          const std::set<int>& b = behind_doors[entry.first.second];
          return entry.second >= kLeastBetween &&
                 std::any_of(a.begin(), a.end(), [&](int third) {
                   return b.count(third) > 0 &&
                          behind_doors[third].size() >=
                              std::max(a.size(), b.size());
                 });
        });
    if (is_between) lines.push_back(line);
  }
  return lines;
}

}  // namespace plumbline
