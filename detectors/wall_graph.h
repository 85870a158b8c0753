#ifndef PLUMBLINE_DETECTORS_WALL_GRAPH_H_
#define PLUMBLINE_DETECTORS_WALL_GRAPH_H_

#include <plumbline/core/disjoint_sets.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/wall.h>
#include <plumbline/detectors/place_match.h>

#include <map>
#include <set>
#include <utility>
#include <vector>

namespace plumbline {

/// Indices of two walls, the smaller first.
using WallPair = std::pair<int, int>;

/// The geometry of a wall of a place.
Wall Geometry(const PlaceWall& wall);

/// The walls of a graph (segments of level 0, in the order of ids), and what
/// ties them to each other: measurements, live closures and broken ones.
class WallGraph {
 public:
  /// Takes the state of the graph as it is. Closures are the constraints of
  /// the relation kSameWallRelation.
  explicit WallGraph(const Graph& graph);

  /// The walls; those that live closures make one have one group.
  const std::vector<PlaceWall>& walls() const { return walls_; }
  const PlaceWall& wall(int i) const { return walls_[i]; }
  int size() const { return static_cast<int>(walls_.size()); }

  /// Length of the visible part, m.
  double Length(int i) const;
  /// Middle of the visible part, map frame, m.
  Eigen::Vector2d Middle(int i) const;
  /// Distance of a point of the map to the visible part, m.
  double DistanceTo(int i, const Eigen::Vector2d& point) const;

  /// Walls that live measurements tie to a wall, ascending, with the distance
  /// of the two reference points, m.
  const std::vector<std::pair<int, double>>& LinksOf(int i) const {
    return links_[i];
  }
  /// Walls up to `depth` links away with the number of links, itself included.
  std::map<int, int> Within(int wall, int depth) const;

  /// Pairs with a live closure, as the graph has them, in the order of ids.
  const std::vector<WallPair>& closures() const { return closures_; }
  /// True when a closure of the two was broken.
  bool WasBroken(const WallPair& pair) const { return broken_.count(pair) > 0; }
  /// True when live closures make them one, also by way of others.
  bool AreOne(int i, int j) const { return ClassOf(i) == ClassOf(j); }
  /// Number of the class of walls that live closures make one.
  std::size_t ClassOf(int i) const;
  /// True when live constraints of any kind connect them.
  bool AreConnected(int i, int j) const;

 private:
  void ReadWalls(const Graph& graph);
  void ReadConstraints(const Graph& graph);

  std::vector<PlaceWall> walls_;
  std::map<FeatureId, int> index_;
  std::vector<std::vector<std::pair<int, double>>> links_;
  std::vector<WallPair> closures_;
  std::set<WallPair> broken_;
  // Of walls, by index, and of all features, by id. Finding shortens the ways.
  mutable DisjointSets classes_;
  mutable DisjointSets parts_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_WALL_GRAPH_H_
