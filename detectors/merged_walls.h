#ifndef PLUMBLINE_DETECTORS_MERGED_WALLS_H_
#define PLUMBLINE_DETECTORS_MERGED_WALLS_H_

#include <plumbline/core/graph.h>
#include <plumbline/factors/pose2.h>

#include <vector>

namespace plumbline {

/// A straight piece of wall: a pose on it (m, rad; x along it) and its visible
/// part, m along the direction from there.
struct WallPiece {
  Pose2 pose = Pose2::Zero();
  double begin = 0.0;
  double end = 0.0;
};

/// The single wall that several pieces make up: in line with their mean
/// (offsets weighted by length, directions by its cube, as a long piece knows
/// its direction best), from the first end to the last. A single piece comes
/// back as it is. Throws Error for an empty list.
WallPiece UnitePieces(const std::vector<WallPiece>& pieces);

/// A wall as outputs show it.
struct MergedWall {
  /// The wall feature; where several were merged, the one with the lowest id
  /// with the parameters and extent of all, and their observations together.
  Feature wall;
  /// Ids of what was merged, ascending; at least one.
  std::vector<FeatureId> members;
};

/// The walls (segments and lines) of a graph, those that live closures
/// (kSameWallRelation) make one merged; in the order of their lowest ids. The
/// graph keeps all of them.
std::vector<MergedWall> MergeWalls(const Graph& graph);

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_MERGED_WALLS_H_
