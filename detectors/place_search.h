#ifndef PLUMBLINE_DETECTORS_PLACE_SEARCH_H_
#define PLUMBLINE_DETECTORS_PLACE_SEARCH_H_

#include <plumbline/core/detector.h>
#include <plumbline/core/marginals.h>
#include <plumbline/detectors/closure_candidates.h>
#include <plumbline/detectors/same_wall.h>
#include <plumbline/detectors/wall_graph.h>

#include <Eigen/Core>
#include <vector>

namespace plumbline {

/// Walls that were seen together.
struct WallPlace {
  /// The wall that they lie around, and the middle of its visible part, m.
  int anchor = -1;
  Eigen::Vector2d center = Eigen::Vector2d::Zero();
  /// Indices, ascending, the anchor included.
  std::vector<int> walls;
};

/// Covers the walls with places (SameWallOptions::place_links, place_radius,
/// place_spacing), in the order of their anchors.
std::vector<WallPlace> FindPlaces(const WallGraph& walls,
                                  const SameWallOptions& options);

/// Adds to the candidates what comparing places of different visits tells: each
/// pair of places that lie near each other, as far as the graph and the way
/// between them leave open, is compared as a whole (MatchPlaces), and matches
/// that another pair of nearly the same worth contradicts are left out. Pairs
/// whose search would be wider than what is proposed together
/// (ClosureCandidates::Widest of `width`, m) wait. Counts what it does, and
/// asks to stop, through `scope`.
void ComparePlaces(const WallGraph& walls, const SameWallOptions& options,
                   double width, const DetectionScope& scope,
                   Marginals* marginals, ClosureCandidates* candidates);

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_PLACE_SEARCH_H_
