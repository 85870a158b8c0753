#include <plumbline/plan/sides.h>

#include <algorithm>
#include <utility>

namespace plumbline {

std::vector<Sides> SidesOf(const Arrangement& arrangement,
                           const std::vector<int>& room_of_face,
                           const std::vector<DrawnLine>& drawn) {
  std::vector<Sides> sides(drawn.size());
  for (std::size_t i = 0; i < drawn.size(); ++i) {
    const auto size = static_cast<std::size_t>(drawn[i].profile.size());
    sides[i].left.assign(size, Sides::kNone);
    sides[i].right.assign(size, Sides::kNone);
  }
  for (const ArrangementEdge& edge : arrangement.edges) {
    if (edge.line < 0) continue;
    const auto room = [&](int face) {
      return face < 0 ? -1 : room_of_face[static_cast<std::size_t>(face)];
    };
    int left = room(edge.left);
    int right = room(edge.right);
    if (left == right) continue;
    const auto line = static_cast<std::size_t>(edge.line);
    const WallProfile& profile = drawn[line].profile;
    double from = drawn[line].line.Along(edge.begin);
    double to = drawn[line].line.Along(edge.end);
    if (from > to) {
      std::swap(from, to);
      std::swap(left, right);
    }
    for (int i = std::max(0, profile.IndexOf(from)); i < profile.size(); ++i) {
      const double middle = profile.MiddleOf(i);
      if (middle > to) break;
      if (middle < from) continue;
      sides[line].left[static_cast<std::size_t>(i)] = left;
      sides[line].right[static_cast<std::size_t>(i)] = right;
    }
  }
  return sides;
}

}  // namespace plumbline
