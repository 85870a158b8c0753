#include <plumbline/core/disjoint_sets.h>
#include <plumbline/core/error.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/wall.h>
#include <plumbline/detectors/merged_walls.h>
#include <plumbline/detectors/same_wall.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

namespace plumbline {
namespace {

using Eigen::Vector2d;

// Lengths below count as this, m.
constexpr double kLeastLength = 1e-3;

double LengthOf(const WallPiece& piece) {
  return std::max(piece.end - piece.begin, kLeastLength);
}

}  // namespace

WallPiece UnitePieces(const std::vector<WallPiece>& pieces) {
  if (pieces.empty()) {
    throw PLUMBLINE_ERROR("no pieces of a wall", "at least one");
  }
  if (pieces.size() == 1) return pieces.front();
  const WallPiece& longest = *std::max_element(
      pieces.begin(), pieces.end(), [](const WallPiece& a, const WallPiece& b) {
        return LengthOf(a) < LengthOf(b);
      });
  // Differences to the longest, so that nothing is lost far from the origin.
  double turn = 0.0;
  double turn_weight = 0.0;
  for (const WallPiece& piece : pieces) {
    const double weight = std::pow(LengthOf(piece), 3);
    turn += weight * NormalizeAngle(piece.pose[2] - longest.pose[2]);
    turn_weight += weight;
  }
  WallPiece united = longest;
  united.pose[2] = NormalizeAngle(longest.pose[2] + turn / turn_weight);
  const Wall line = MakeWall(united.pose, 0.0, 0.0);
  const Vector2d across = line.normal();
  double offset = 0.0;
  double offset_weight = 0.0;
  bool is_first = true;
  for (const WallPiece& piece : pieces) {
    const Wall wall = MakeWall(piece.pose, piece.begin, piece.end);
    const Vector2d relative = wall.position - line.position;
    const Vector2d middle =
        relative + 0.5 * (wall.begin + wall.end) * wall.direction;
    offset += LengthOf(piece) * across.dot(middle);
    offset_weight += LengthOf(piece);
    const Interval interval = line.IntervalOf(wall);
    united.begin =
        is_first ? interval.first : std::min(united.begin, interval.first);
    united.end =
        is_first ? interval.second : std::max(united.end, interval.second);
    is_first = false;
  }
  united.pose.head<2>() += offset / offset_weight * across;
  return united;
}

std::vector<MergedWall> MergeWalls(const Graph& graph) {
  std::vector<const Feature*> walls;
  std::map<FeatureId, std::size_t> index;
  for (const Feature* feature : graph.Features()) {
    if (!feature->type->Is(FeatureRole::kWall)) continue;
    index[feature->id] = walls.size();
    walls.push_back(feature);
  }
  DisjointSets sets(walls.size());
  for (const Constraint* constraint : graph.Constraints()) {
    if (constraint->state != ConstraintState::kLive ||
        !constraint->type->Is(RelationRole::kSameWall)) {
      continue;
    }
    sets.Join(index.at(constraint->features[0]),
              index.at(constraint->features[1]));
  }
  std::map<std::size_t, std::vector<const Feature*>> classes;
  for (std::size_t i = 0; i < walls.size(); ++i) {
    classes[sets.Find(i)].push_back(walls[i]);
  }
  std::vector<MergedWall> merged;
  merged.reserve(classes.size());
  for (const auto& [root, members] : classes) {
    MergedWall wall;
    wall.wall = *members.front();
    std::vector<WallPiece> pieces;
    for (const Feature* member : members) {
      wall.members.push_back(member->id);
      pieces.push_back({member->type->frame(*member), member->extent_begin,
                        member->extent_end});
      if (member != members.front()) {
        wall.wall.observations += member->observations;
      }
    }
    if (members.size() > 1) {
      const WallPiece united = UnitePieces(pieces);
      std::copy(united.pose.data(), united.pose.data() + 3,
                wall.wall.parameters.begin());
      wall.wall.extent_begin = united.begin;
      wall.wall.extent_end = united.end;
    }
    merged.push_back(std::move(wall));
  }
  return merged;
}

}  // namespace plumbline
