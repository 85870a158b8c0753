#ifndef PLUMBLINE_DETECTORS_POINT_GRAPH_H_
#define PLUMBLINE_DETECTORS_POINT_GRAPH_H_

#include <plumbline/core/detector.h>
#include <plumbline/core/graph.h>

#include <Eigen/Core>
#include <cstddef>
#include <vector>

namespace plumbline {

/// The "point" features that a detector looks at and what connects them, by
/// index. Indices are in the order of ids.
class PointGraph {
 public:
  /// A range of indices, good as long as the graph.
  class Neighbors {
   public:
    /// Of the indices from `begin` to before `end`.
    Neighbors(const int* begin, const int* end) : begin_(begin), end_(end) {}
    /// For loops over it.
    const int* begin() const { return begin_; }
    const int* end() const { return end_; }

   private:
    const int* begin_;
    const int* end_;
  };

  /// Points of scope.level with finite coordinates. With a list in the scope:
  /// the points listed and those that are connected to them by at most `reach`
  /// constraints, at a cost that depends on these only.
  ///
  /// Points are connected by live measurements between them. Virtual points
  /// (level 1 and up) have none: then each is connected with its 8 nearest,
  /// however far they are: the spacing of columns is not known beforehand.
  PointGraph(const Graph& graph, const DetectionScope& scope, int reach);

  /// Whether they are virtual points.
  bool are_virtual() const { return are_virtual_; }
  /// Number of points; ids and positions (m, map frame) by index.
  int size() const { return static_cast<int>(ids_.size()); }
  FeatureId id(int i) const { return ids_[static_cast<std::size_t>(i)]; }
  const Eigen::Vector2d& position(int i) const {
    return positions_[static_cast<std::size_t>(i)];
  }
  /// Indices of the points connected with the i-th, ascending.
  Neighbors neighbors(int i) const {
    const auto k = static_cast<std::size_t>(i);
    return {neighbors_.data() + neighbors_begin_[k],
            neighbors_.data() + neighbors_begin_[k + 1]};
  }
  /// Whether the scope lists the i-th point (all do without a list).
  bool is_listed(int i) const {
    return is_listed_[static_cast<std::size_t>(i)];
  }
  /// Index of a feature; -1 when it is not among the points.
  int Find(FeatureId id) const;

 private:
  void Connect(const Graph& graph);
  void ConnectNearest();

  bool are_virtual_ = false;
  std::vector<FeatureId> ids_;
  std::vector<Eigen::Vector2d> positions_;
  // Those of the i-th point are from neighbors_begin_[i] to before
  // neighbors_begin_[i + 1]: side by side, since searches go along the edges
  // all the time.
  std::vector<int> neighbors_;
  std::vector<std::size_t> neighbors_begin_;
  std::vector<bool> is_listed_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_POINT_GRAPH_H_
