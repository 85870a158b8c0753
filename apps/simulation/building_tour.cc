#include <plumbline/apps/simulation/building_tour.h>
#include <plumbline/apps/simulation/world_geometry.h>

#include <algorithm>
#include <cstddef>
#include <utility>

namespace plumbline {

using Eigen::Vector2d;
using world_geometry::DistanceToSegment;

void WalkCorridor(const Vector2d& from, const Vector2d& to,
                  std::vector<BuildingVisit>* visits,
                  std::vector<Vector2d>* path) {
  std::vector<std::pair<double, BuildingVisit*>> met;
  for (BuildingVisit& visit : *visits) {
    if (!visit.done && DistanceToSegment(visit.junction, from, to) < 1e-6) {
      met.emplace_back((visit.junction - from).norm(), &visit);
    }
  }
  std::stable_sort(met.begin(), met.end(), [](const auto& a, const auto& b) {
    return a.first < b.first;
  });
  for (const auto& [distance, visit] : met) {
    visit->done = true;
    path->push_back(visit->junction);
    path->insert(path->end(), visit->excursion.begin(), visit->excursion.end());
    path->push_back(visit->junction);
  }
  path->push_back(to);
}

std::vector<Vector2d> TourCorridors(const std::vector<double>& xs,
                                    const std::vector<double>& ys,
                                    std::vector<BuildingVisit> visits) {
  std::vector<Vector2d> nodes;
  for (std::size_t i = 0; i < ys.size(); ++i) {
    const bool to_right = i % 2 == 0;
    nodes.emplace_back(to_right ? xs.front() : xs.back(), ys[i]);
    nodes.emplace_back(to_right ? xs.back() : xs.front(), ys[i]);
  }
  const bool ends_left = ys.size() % 2 == 0;
  // With a single row the right-most corridor is driven along already.
  const std::size_t num_vertical = xs.size() - (ys.size() == 2 ? 1 : 0);
  for (std::size_t i = 0; i < num_vertical; ++i) {
    const double x = ends_left ? xs[i] : xs[xs.size() - 1 - i];
    const bool down = i % 2 == 0;
    nodes.emplace_back(x, down ? ys.back() : ys.front());
    nodes.emplace_back(x, down ? ys.front() : ys.back());
  }
  std::vector<Vector2d> way = {nodes[0]};
  for (std::size_t i = 1; i < nodes.size(); ++i) {
    WalkCorridor(nodes[i - 1], nodes[i], &visits, &way);
  }
  std::vector<Vector2d> path;
  for (const Vector2d& point : way) {
    if (path.empty() || (point - path.back()).norm() > 1e-6) {
      path.push_back(point);
    }
  }
  return path;
}

}  // namespace plumbline
