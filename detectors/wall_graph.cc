#include <plumbline/core/registry.h>
#include <plumbline/detectors/same_wall.h>
#include <plumbline/detectors/wall_graph.h>

#include <algorithm>

namespace plumbline {

using Eigen::Vector2d;

Wall Geometry(const PlaceWall& wall) {
  return MakeWall(wall.position, wall.direction, wall.begin, wall.end);
}

WallGraph::WallGraph(const Graph& graph)
    : classes_(0), parts_(static_cast<std::size_t>(graph.feature_id_end())) {
  ReadWalls(graph);
  classes_ = DisjointSets(walls_.size());
  ReadConstraints(graph);
  for (int i = 0; i < size(); ++i) {
    walls_[i].group = static_cast<int>(ClassOf(i));
  }
}

void WallGraph::ReadWalls(const Graph& graph) {
  for (const Feature* feature : graph.Features()) {
    if (feature->level != 0 || !feature->type->Is(FeatureRole::kWall) ||
        !feature->type->traits.is_one_sided) {
      continue;
    }
    index_[feature->id] = static_cast<int>(walls_.size());
    PlaceWall wall;
    wall.id = feature->id;
    const Eigen::Vector3d frame = feature->type->frame(*feature);
    wall.position = frame.head<2>();
    wall.direction = frame[2];
    wall.begin = feature->extent_begin;
    wall.end = feature->extent_end;
    walls_.push_back(wall);
  }
}

void WallGraph::ReadConstraints(const Graph& graph) {
  links_.resize(walls_.size());
  for (const Constraint* constraint : graph.Constraints()) {
    const bool is_live = constraint->state == ConstraintState::kLive;
    if (is_live) {
      for (const FeatureId id : constraint->features) {
        parts_.Join(static_cast<std::size_t>(constraint->features[0]),
                    static_cast<std::size_t>(id));
      }
    }
    if (constraint->features.size() != 2) continue;
    const auto first = index_.find(constraint->features[0]);
    const auto second = index_.find(constraint->features[1]);
    if (first == index_.end() || second == index_.end()) continue;
    const int i = first->second;
    const int j = second->second;
    if (constraint->kind == ConstraintClass::kMeasurement) {
      if (!is_live) continue;
      const double distance = (walls_[i].position - walls_[j].position).norm();
      links_[i].push_back({j, distance});
      links_[j].push_back({i, distance});
    } else if (constraint->type->Is(RelationRole::kSameWall)) {
      if (is_live) {
        classes_.Join(static_cast<std::size_t>(i), static_cast<std::size_t>(j));
        closures_.push_back({i, j});
      } else {
        broken_.insert({std::min(i, j), std::max(i, j)});
      }
    }
  }
  for (auto& links : links_) {
    std::sort(links.begin(), links.end());
    links.erase(std::unique(links.begin(), links.end(),
                            [](const auto& a, const auto& b) {
                              return a.first == b.first;
                            }),
                links.end());
  }
}

double WallGraph::Length(int i) const {
  return walls_[i].end - walls_[i].begin;
}

Vector2d WallGraph::Middle(int i) const { return Geometry(walls_[i]).Middle(); }

double WallGraph::DistanceTo(int i, const Vector2d& point) const {
  const Wall wall = Geometry(walls_[i]);
  const Vector2d relative = point - wall.position;
  const double t = std::clamp(wall.Along(point), wall.begin, wall.end);
  return (relative - t * wall.direction).norm();
}

std::map<int, int> WallGraph::Within(int wall, int depth) const {
  std::map<int, int> distance = {{wall, 0}};
  std::vector<int> frontier = {wall};
  for (int d = 1; d <= depth; ++d) {
    std::vector<int> next;
    for (const int i : frontier) {
      for (const auto& link : links_[i]) {
        if (distance.try_emplace(link.first, d).second)
          next.push_back(link.first);
      }
    }
    frontier = std::move(next);
  }
  return distance;
}

std::size_t WallGraph::ClassOf(int i) const {
  return classes_.Find(static_cast<std::size_t>(i));
}

bool WallGraph::AreConnected(int i, int j) const {
  return parts_.Find(static_cast<std::size_t>(walls_[i].id)) ==
         parts_.Find(static_cast<std::size_t>(walls_[j].id));
}

}  // namespace plumbline
