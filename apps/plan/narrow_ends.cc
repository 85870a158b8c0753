#include <plumbline/plan/narrow_ends.h>
#include <plumbline/plan/room_shape.h>

#include <algorithm>
#include <map>
#include <utility>

namespace plumbline {
namespace {

// A narrow region is no wider than this, m, and not larger than that, m^2.
constexpr double kNarrow = 1.3;
constexpr double kLargest = 8.0;
// Share of its width that is open, at its end and not along its side; and what
// may be open to other regions, m.
constexpr double kWholeWidth = 0.85;
constexpr double kAlongTheSide = 1.3;
constexpr double kElsewhere = 0.3;
// Share of the rest of its border that is wall: what was seen of a room through
// its door is as narrow, but has no walls beside it.
constexpr double kWalled = 0.5;

bool HoldsOne(const Polygon& outline, const std::vector<Pose2>& path) {
  return std::any_of(path.begin(), path.end(), [&](const Pose2& pose) {
    return outline.Contains(pose.head<2>());
  });
}

}  // namespace

void JoinNarrowEnds(const Arrangement& arrangement,
                    const std::vector<Pose2>& path, std::vector<int>* region) {
  const auto region_of = [&](int face) {
    return face < 0 ? -1 : (*region)[static_cast<std::size_t>(face)];
  };
  const std::map<int, RegionParts> regions =
      PartsOfRegions(arrangement, *region);
  // Openings by the regions on both sides, either first, m.
  std::map<int, std::map<int, double>> openings;
  std::map<int, BorderLengths> borders;
  for (const ArrangementEdge& edge : arrangement.edges) {
    const int left = region_of(edge.left);
    const int right = region_of(edge.right);
    if (left == right) continue;
    const double open =
        edge.lengths.Of(Mark::kOpen) + edge.lengths.Of(Mark::kDoor);
    openings[left][right] += open;
    openings[right][left] += open;
    borders[left].Add(edge.lengths);
    borders[right].Add(edge.lengths);
  }
  std::map<int, int> joined;
  for (const auto& [id, parts] : regions) {
    if (parts.area > kLargest) continue;
    const std::vector<Polygon> outlines = UnionOf(parts.faces);
    if (outlines.size() != 1) continue;
    const Polygon& outline = outlines.front();
    if (!Offset(outline, -0.5 * kNarrow).empty()) continue;
    int widest = -1;
    double open = 0.0;
    double all = 0.0;
    for (const auto& [other, width] : openings[id]) {
      if (other < 0) continue;
      all += width;
      if (width > open) {
        open = width;
        widest = other;
      }
    }
    const double width = SidesOfRectangle(outline).first;
    const BorderLengths& border = borders[id];
    // To larger ones alone, so that no two go to each other.
    if (widest < 0 || regions.at(widest).area <= parts.area ||
        open < kWholeWidth * width || open > kAlongTheSide * width ||
        all - open > kElsewhere ||
        border.Of(Mark::kWall) < kWalled * (border.length() - open) ||
        HoldsOne(outline, path)) {
      continue;
    }
    joined[id] = widest;
  }
  for (int& id : *region) {
    // One that goes to another narrow one goes with it.
    for (auto next = joined.find(id); next != joined.end();
         next = joined.find(id)) {
      id = next->second;
    }
  }
}

}  // namespace plumbline
