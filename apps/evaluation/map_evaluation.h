#ifndef PLUMBLINE_APPS_EVALUATION_MAP_EVALUATION_H_
#define PLUMBLINE_APPS_EVALUATION_MAP_EVALUATION_H_

#include <plumbline/apps/evaluation/map_truth.h>
#include <plumbline/apps/evaluation/relations.h>
#include <plumbline/factors/pose2.h>

#include <cstdint>
#include <vector>

namespace plumbline {

struct MapTruthOptions {
  /// Shorter walls (by what was seen of them) are not asked for, and shorter
  /// map segments are not called false, m.
  double minimum_length = 1.0;
  /// How far a map segment may turn away from the wall, degrees.
  double maximum_angle_deg = 5.0;
  /// How far it may lie beside the wall, m.
  double maximum_offset = 0.5;
  /// How far it may stand out over the wall's ends, m.
  double end_slack = 0.25;
  /// Part of what was seen of a wall that map segments must cover for the wall
  /// to be found, and part of a map segment that walls must explain for it not
  /// to be false.
  double minimum_overlap = 0.5;
  /// Orientation features match a direction of the truth this close, degrees.
  double maximum_orientation_error_deg = 1.0;
};

/// One wall against the map.
struct WallResult {
  int id = 0;
  /// Length that the laser saw, and how much of that the map covers, m.
  double seen = 0.0;
  double covered = 0.0;
  bool found = false;
  /// Means over the matching parts of map segments, weighted by length, of the
  /// absolute differences: direction (degrees) and distance across the wall
  /// (m). Only for walls that were found.
  double direction_error_deg = 0.0;
  double offset_error = 0.0;
};

/// The walls of one direction of the building against the map.
struct DirectionResult {
  /// Direction of the truth, degrees, and the length of the map's walls that
  /// match walls of this direction, m (only of walls of at least the minimum
  /// length).
  double angle_deg = 0.0;
  double length = 0.0;
  /// How far these are turned counter-clockwise on average, weighted by length,
  /// degrees.
  double error_deg = 0.0;
};

/// A map against the truth.
struct MapTruthEvaluation {
  /// World pose of the map frame that was used.
  Pose2 alignment = Pose2::Zero();
  /// Walls of which the laser saw at least the minimum length, in the truth's
  /// order.
  std::vector<WallResult> walls;
  /// Over the walls that were found.
  ErrorStatistics direction_error_deg;
  ErrorStatistics offset_error;  ///< m
  /// Ids of walls that were not found.
  std::vector<int> missed_walls;
  /// Ids of map features that match no wall.
  std::vector<std::int64_t> false_walls;
  /// Length of walls of the map beyond the first on the same part of a wall, m:
  /// walls that the map has twice. Segments that live closures join are one.
  double doubled_length = 0.0;
  /// Parts of the length that were found (of what was seen) and that are right
  /// (of the map's segments of at least the minimum length), 0 to 1; 1 when
  /// there is nothing to find.
  double recall = 1.0;
  double precision = 1.0;
  /// The lengths that these are parts of, m: 0 when there is nothing to find.
  double asked_length = 0.0;
  double judged_length = 0.0;
  /// Angles (degrees, in the world frame) of orientation features that match
  /// no direction, and directions, with at least one wall asked for, that no
  /// orientation feature matches.
  std::vector<double> false_orientations_deg;
  std::vector<double> missed_orientations_deg;
  /// Orientation features beyond the first that match a direction.
  int duplicate_orientations = 0;
  /// Directions of the building that walls of the map match, in the truth's
  /// order.
  std::vector<DirectionResult> directions;
  /// How far the map bends the building, degrees: the largest difference
  /// between the errors of two directions that have at least a tenth of the
  /// length each. Not known where the map has less of a direction of which at
  /// least a tenth was asked for: it may have turned away.
  double bend_error_deg = 0.0;
  bool is_bend_known = false;
};

/// Compares a map, moved by `alignment`, with the truth. Segments that live
/// closures join count as one wall (UnitePieces). Every few centimetres of a
/// wall of the map count for the nearest true wall that is parallel to it, so
/// that the two faces of a thin wall are told apart.
MapTruthEvaluation EvaluateMap(
    const StraightMap& map, const MapTruth& truth, const Pose2& alignment,
    const MapTruthOptions& options = MapTruthOptions());

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_EVALUATION_MAP_EVALUATION_H_
