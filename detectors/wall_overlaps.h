#ifndef PLUMBLINE_DETECTORS_WALL_OVERLAPS_H_
#define PLUMBLINE_DETECTORS_WALL_OVERLAPS_H_

#include <plumbline/core/detector.h>
#include <plumbline/core/marginals.h>
#include <plumbline/detectors/closure_candidates.h>
#include <plumbline/detectors/same_wall.h>
#include <plumbline/detectors/wall_graph.h>

#include <optional>

namespace plumbline {

/// Overlap of two walls where they stand in the map; nothing when their
/// directions differ by more than their lengths and the tolerance allow, when
/// they do not lie side by side, or when they are farther apart than
/// SameWallOptions::known_offset.
std::optional<WallMatch> LieOnEachOther(const PlaceWall& first,
                                        const PlaceWall& second,
                                        const SameWallOptions& options);

/// Adds to the candidates the walls that lie on each other and whose relative
/// place the graph knows to SameWallOptions::known_sigma: there is no room for
/// two. Counts what it does, and asks to stop, through `scope`.
void FindOverlaps(const WallGraph& walls, const SameWallOptions& options,
                  const DetectionScope& scope, Marginals* marginals,
                  ClosureCandidates* candidates);

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_WALL_OVERLAPS_H_
