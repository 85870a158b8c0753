#ifndef PLUMBLINE_DETECTORS_WALL_WAYS_H_
#define PLUMBLINE_DETECTORS_WALL_WAYS_H_

#include <plumbline/detectors/wall_graph.h>

#include <cstddef>
#include <vector>

namespace plumbline {

/// Ways from wall to wall along measurement links: how far the robot went, at
/// least, between looking at one and at the other.
///
/// Closures that hold two directions are links too: the way round a closed loop
/// adds no uncertainty between its ends. A closure holds two directions when
/// the surroundings of its walls, up to `closure_links` measurement links away,
/// have another wall in common across them: then nothing is free to move
/// between the two visits.
class WallWays {
 public:
  class Search;

  WallWays(const WallGraph& walls, int closure_links);

  /// Length of the shortest way from a wall to every other, m; infinite where
  /// there is none. `search` may be of any call before, of this thread.
  std::vector<double> From(int wall, Search* search) const;

  /// The same for some walls that there are ways to: the search ends once they
  /// are known. What is returned of others is not less than their ways.
  std::vector<double> From(int wall, const std::vector<int>& targets,
                           Search* search) const;

  /// For each wall the number of its connected part, that is the smallest index
  /// in the part.
  std::vector<std::size_t> Parts() const;

 private:
  struct Way {
    int to = -1;
    double length = 0.0;  // m
  };

  // To all walls when `targets` is null.
  std::vector<double> Find(int wall, const std::vector<int>* targets,
                           Search* search) const;
  std::size_t StepOf(double length) const {
    return static_cast<std::size_t>(length / step_);
  }

  // Those of one wall after those of the one before.
  std::vector<Way> ways_;
  std::vector<int> begin_;
  // Of a search, m.
  double step_ = 1.0;
};

/// What a search needs, kept for its memory.
class WallWays::Search {
 private:
  friend class WallWays;

  // Ways by the steps of their length.
  std::vector<std::vector<Way>> buckets_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_WALL_WAYS_H_
