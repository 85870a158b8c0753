#include <plumbline/core/disjoint_sets.h>
#include <plumbline/detectors/wall_ways.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

namespace plumbline {
namespace {

// Walls whose directions differ by more hold a place together in both
// directions, rad.
constexpr double kCrossing = DegToRad(20.0);
// Steps of the longest way between two neighbours.
constexpr double kStepsOfLongest = 16.0;

bool HoldsTwoDirections(const WallGraph& walls, const WallPair& closure,
                        int links) {
  std::multimap<std::size_t, int> crossing;
  for (const auto& entry : walls.Within(closure.first, links)) {
    const double turn =
        walls.wall(entry.first).direction - walls.wall(closure.first).direction;
    if (std::abs(std::sin(turn)) > std::sin(kCrossing)) {
      crossing.emplace(walls.ClassOf(entry.first), entry.first);
    }
  }
  for (const auto& entry : walls.Within(closure.second, links)) {
    const auto same = crossing.equal_range(walls.ClassOf(entry.first));
    if (std::any_of(same.first, same.second, [&](const auto& wall) {
          return wall.second != entry.first;
        })) {
      return true;
    }
  }
  return false;
}

}  // namespace

WallWays::WallWays(const WallGraph& walls, int closure_links) {
  std::vector<std::pair<int, int>> shortcuts;
  for (const WallPair& closure : walls.closures()) {
    if (!HoldsTwoDirections(walls, closure, closure_links)) continue;
    shortcuts.push_back(closure);
    shortcuts.push_back({closure.second, closure.first});
  }
  std::sort(shortcuts.begin(), shortcuts.end());
  auto shortcut = shortcuts.begin();
  begin_ = {0};
  for (int i = 0; i < walls.size(); ++i) {
    for (const auto& link : walls.LinksOf(i)) {
      ways_.push_back({link.first, link.second});
    }
    for (; shortcut != shortcuts.end() && shortcut->first == i; ++shortcut) {
      const int j = shortcut->second;
      ways_.push_back(
          {j, (walls.wall(i).position - walls.wall(j).position).norm()});
    }
    begin_.push_back(static_cast<int>(ways_.size()));
  }
  // In terms of the longest, so that steps are not many more than links.
  double longest = 0.0;
  for (const Way& way : ways_) longest = std::max(longest, way.length);
  if (longest > 0.0) step_ = longest / kStepsOfLongest;
}

std::vector<double> WallWays::From(int wall, Search* search) const {
  return Find(wall, nullptr, search);
}

std::vector<double> WallWays::From(int wall, const std::vector<int>& targets,
                                   Search* search) const {
  return Find(wall, &targets, search);
}

std::vector<double> WallWays::Find(int wall, const std::vector<int>* targets,
                                   Search* search) const {
  std::vector<double> ways(begin_.size() - 1,
                           std::numeric_limits<double>::infinity());
  ways[wall] = 0.0;
  // Nearest first to a step: a heap's order costs more than the few ways that
  // are shortened once more.
  std::vector<std::vector<Way>>& buckets = search->buckets_;
  if (buckets.empty()) buckets.resize(1);
  buckets[0].push_back({wall, 0.0});
  std::size_t known = 0;
  for (std::size_t b = 0; b < buckets.size(); ++b) {
    // Grows while it is gone through.
    for (std::size_t k = 0; k < buckets[b].size(); ++k) {
      const Way nearest = buckets[b][k];
      if (nearest.length > ways[nearest.to]) continue;
      for (int w = begin_[nearest.to]; w < begin_[nearest.to + 1]; ++w) {
        const Way way = {ways_[w].to, nearest.length + ways_[w].length};
        if (!(way.length < ways[way.to])) continue;
        ways[way.to] = way.length;
        const std::size_t step = StepOf(way.length);
        if (step >= buckets.size()) buckets.resize(step + 1);
        buckets[step].push_back(way);
      }
    }
    buckets[b].clear();
    if (targets == nullptr) continue;
    // Nothing makes a way of this step shorter any more.
    while (known < targets->size()) {
      const double way = ways[static_cast<std::size_t>((*targets)[known])];
      if (!std::isfinite(way) || StepOf(way) > b) break;
      ++known;
    }
    if (known == targets->size()) {
      for (std::vector<Way>& bucket : buckets) bucket.clear();
      break;
    }
  }
  return ways;
}

std::vector<std::size_t> WallWays::Parts() const {
  DisjointSets reached(begin_.size() - 1);
  for (std::size_t i = 0; i + 1 < begin_.size(); ++i) {
    for (int k = begin_[i]; k < begin_[i + 1]; ++k) {
      reached.Join(i, static_cast<std::size_t>(ways_[k].to));
    }
  }
  std::vector<std::size_t> parts;
  for (std::size_t i = 0; i + 1 < begin_.size(); ++i) {
    parts.push_back(reached.Find(i));
  }
  return parts;
}

}  // namespace plumbline
