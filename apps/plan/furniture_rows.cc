#include <plumbline/plan/furniture_rows.h>
#include <plumbline/plan/room_shape.h>
#include <plumbline/plan/sides.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

namespace plumbline {
namespace {

using Eigen::Vector2d;

// A gap between pieces of furniture, m, and how far apart two of them are at
// most, m: of two doors of one room the wall between them is longer.
constexpr double kLeastGap = 0.3;
constexpr double kLongestBetween = 2.0;
// What stands between two gaps is longer than a post in an opening, m.
constexpr double kLeastBetween = 0.3;
// A way out is as wide as this, m, or the robot drove through it: beside a
// cupboard may be a crack.
constexpr double kLeastWayOut = 0.8;
// What is smaller is no room that a way could lead to, m^2.
constexpr double kLeastRoom = 2.0;

// Of two lines in one row by its cosine, and m across.
constexpr double kSameRowCosine = 0.996;
constexpr double kSameRow = 0.3;

// An opening between two regions.
struct Gap {
  Vector2d begin, end;
};

// What leads from one region to another.
struct Ways {
  double widest = 0.0;
  // Two gaps lie near to each other in one row.
  bool has_row = false;
  std::vector<Gap> gaps;
};

// Whether two gaps lie in one row, with a piece of furniture between them. What
// stands in a row may lie on two lines beside each other.
bool AreInRow(const Gap& a, const Gap& b) {
  const Vector2d along = (a.end - a.begin).normalized();
  const Vector2d other = (b.end - b.begin).normalized();
  const Vector2d across(-along[1], along[0]);
  if (std::abs(along.dot(other)) < kSameRowCosine ||
      std::abs(across.dot(0.5 * (b.begin + b.end - a.begin - a.end))) >
          kSameRow) {
    return false;
  }
  const auto ends = [&](const Gap& gap) {
    return std::minmax({along.dot(gap.begin), along.dot(gap.end)});
  };
  const auto [a_from, a_to] = ends(a);
  const auto [b_from, b_to] = ends(b);
  const double between = std::max(b_from - a_to, a_from - b_to);
  return between >= kLeastBetween && between <= kLongestBetween;
}

// By line, which of its samples the robot drove across.
std::vector<std::vector<bool>> DrivenAcross(const std::vector<DrawnLine>& drawn,
                                            const std::vector<Pose2>& path) {
  std::vector<std::vector<bool>> driven;
  for (const DrawnLine& line : drawn) {
    std::vector<bool> samples(static_cast<std::size_t>(line.profile.size()));
    for (std::size_t i = 1; i < path.size(); ++i) {
      const Vector2d from = path[i - 1].head<2>();
      const Vector2d to = path[i].head<2>();
      const double before = line.line.Across(from);
      const double after = line.line.Across(to);
      // Where the way breaks off one of them is not finite.
      if (!std::isfinite(before - after) || (before > 0.0) == (after > 0.0)) {
        continue;
      }
      const double share = before / (before - after);
      const double along = line.line.Along(from + share * (to - from));
      if (along < line.from || along > line.to) continue;
      const int at = line.profile.IndexOf(along);
      if (at >= 0 && at < line.profile.size()) {
        samples[static_cast<std::size_t>(at)] = true;
      }
    }
    driven.push_back(std::move(samples));
  }
  return driven;
}

// Ways between regions, by both numbers, either first.
std::map<int, std::map<int, Ways>> WaysBetween(
    const Arrangement& arrangement, const std::vector<DrawnLine>& drawn,
    const std::vector<std::vector<bool>>& driven,
    const std::vector<int>& region) {
  std::map<int, std::map<int, Ways>> ways;
  const std::vector<Sides> sides = SidesOf(arrangement, region, drawn);
  for (std::size_t line = 0; line < drawn.size(); ++line) {
    const WallProfile& profile = drawn[line].profile;
    const auto pair_at = [&](int i) -> std::pair<int, int> {
      return std::minmax(sides[line].left[static_cast<std::size_t>(i)],
                         sides[line].right[static_cast<std::size_t>(i)]);
    };
    const auto is_open = [&](int i) {
      return profile.At(i) == Mark::kOpen || profile.At(i) == Mark::kDoor;
    };
    for (int i = 0; i < profile.size();) {
      const std::pair<int, int> pair = pair_at(i);
      int j = i;
      int seen = 0;
      bool is_driven = false;
      for (; j < profile.size() && is_open(j) && pair_at(j) == pair; ++j) {
        seen += profile.is_seen_open[static_cast<std::size_t>(j)];
        is_driven = is_driven || driven[line][static_cast<std::size_t>(j)];
      }
      const double width = (j - i) * WallProfile::kStep;
      if (pair.first >= 0 && width >= kLeastGap) {
        const WallLine& on = drawn[line].line;
        const Gap gap{on.At(profile.begin + i * WallProfile::kStep),
                      on.At(profile.begin + j * WallProfile::kStep)};
        for (const auto& [from, to] :
             {pair, std::make_pair(pair.second, pair.first)}) {
          Ways& way = ways[from][to];
          way.widest = std::max(
              way.widest, is_driven ? kLeastWayOut : seen * WallProfile::kStep);
          way.has_row =
              way.has_row || std::any_of(way.gaps.begin(), way.gaps.end(),
                                         [&](const Gap& other) {
                                           return AreInRow(other, gap);
                                         });
          way.gaps.push_back(gap);
        }
      }
      i = std::max(j, i + 1);
    }
  }
  return ways;
}

}  // namespace

void JoinAcrossFurniture(const Arrangement& arrangement,
                         const std::vector<DrawnLine>& drawn,
                         const std::vector<Pose2>& path,
                         std::vector<int>* region) {
  const std::vector<std::vector<bool>> driven = DrivenAcross(drawn, path);
  for (bool is_changed = true; is_changed;) {
    is_changed = false;
    const std::map<int, RegionParts> parts =
        PartsOfRegions(arrangement, *region);
    const std::map<int, std::map<int, Ways>> ways =
        WaysBetween(arrangement, drawn, driven, *region);
    const auto is_way_out = [&](int other, const Ways& way) {
      return parts.at(other).area >= kLeastRoom &&
             (way.has_row || way.widest >= kLeastWayOut);
    };
    for (const auto& [part, others] : ways) {
      int into = -1;
      bool has_others = false;
      for (const auto& [other, way] : others) {
        if (is_way_out(other, way) && way.has_row) into = other;
      }
      if (into < 0 || parts.at(part).area > parts.at(into).area) continue;
      // Two rooms along a corridor have a door each to it.
      bool is_shared = false;
      for (const auto& [third, way] : others) {
        if (third == into || !is_way_out(third, way)) continue;
        has_others = true;
        const auto of_into = ways.at(into).find(third);
        is_shared = is_shared || (of_into != ways.at(into).end() &&
                                  is_way_out(third, of_into->second));
      }
      if (is_shared || IsLongAndNarrow(UnionOf(parts.at(into).faces).front()) ||
          (has_others &&
           IsLongAndNarrow(UnionOf(parts.at(part).faces).front()))) {
        continue;
      }
      std::replace(region->begin(), region->end(), part, into);
      is_changed = true;
      break;
    }
  }
}

}  // namespace plumbline
