#ifndef PLUMBLINE_APPS_EVALUATION_MAP_TRUTH_H_
#define PLUMBLINE_APPS_EVALUATION_MAP_TRUTH_H_

#include <plumbline/apps/evaluation/relations.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/input_stream.h>

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {

/// A straight wall of a simulated building: one face of it, in the world frame.
struct TruthWall {
  int id = 0;
  /// Ends, m.
  Eigen::Vector2d begin = Eigen::Vector2d::Zero();
  Eigen::Vector2d end = Eigen::Vector2d::Zero();
  /// Index into MapTruth::orientations_deg, or -1 for a wall that belongs to no
  /// orientation of the building (clutter).
  int orientation = -1;
  /// Parts that the laser hit, m along the wall from `begin`.
  std::vector<std::pair<double, double>> seen;
};

/// What the simulator knows about the world.
struct MapTruth {
  /// The file, for messages.
  std::string name;
  /// Directions of the building, degrees, axial (period 180).
  std::vector<double> orientations_deg;
  std::vector<TruthWall> walls;
  /// True poses of the scans.
  std::vector<TimedPose> poses;
};

/// Reads a truth file ("format":"plumbline-truth", version 1). Throws Error
/// that names the file and the entry which is missing or wrong.
MapTruth ReadMapTruth(const std::string& path);
MapTruth ReadMapTruth(InputStream* input);

/// A straight piece of a map in the map's frame: x, y (m) and direction (rad),
/// with its visible part from `begin` to `end` along the direction (m).
struct MapSegment {
  std::int64_t id = 0;
  Pose2 pose = Pose2::Zero();
  double begin = 0.0;
  double end = 0.0;
};

/// An orientation feature of a map.
struct MapOrientation {
  std::int64_t id = 0;
  /// rad, axial
  double angle = 0.0;
};

/// Two segments of a map that a closure says are one wall.
struct MapClosure {
  std::int64_t first = 0;
  std::int64_t second = 0;
  /// False: it was broken.
  bool is_live = true;
};

/// What of a map can be compared with the truth.
struct StraightMap {
  /// Features of type segment and line, each as it stands in the graph.
  std::vector<MapSegment> segments;
  /// In the order of the file.
  std::vector<MapClosure> closures;
  /// Features of type orientation.
  std::vector<MapOrientation> orientations;
};

/// Reads the features of a map.json (core/graph_json.h); types other than
/// segment, line and orientation are passed over. Throws Error as
/// ReadMapTruth does.
StraightMap ReadStraightMap(const std::string& path);
StraightMap ReadStraightMap(InputStream* input);

/// The rigid transformation (world pose of the map frame) that moves `from`
/// onto `to` with the least sum of squared distances of the positions; where
/// the positions are all (almost) one place, the headings decide the rotation.
/// Throws Error when the sizes differ or are zero.
Pose2 FitRigidTransform(const std::vector<Pose2>& from,
                        const std::vector<Pose2>& to);

/// World pose of the map frame: the best fit of the trajectory on the true
/// poses with the same time stamps (to a millisecond). Throws Error when none
/// has.
Pose2 AlignTrajectory(const std::vector<TimedPose>& trajectory,
                      const MapTruth& truth);

/// Errors of a trajectory, moved by an alignment, at the true poses with the
/// same time stamps (to a millisecond).
struct PoseErrors {
  ErrorStatistics position;     ///< m
  ErrorStatistics heading_deg;  ///< degrees, absolute
};

PoseErrors EvaluatePoses(const std::vector<TimedPose>& trajectory,
                         const MapTruth& truth, const Pose2& alignment);

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
  /// length each.
  double bend_error_deg = 0.0;
};

/// Compares a map, moved by `alignment`, with the truth. Segments that live
/// closures join count as one wall (UnitePieces). Every few centimetres of a
/// wall of the map count for the nearest true wall that is parallel to it, so
/// that the two faces of a thin wall are told apart.
MapTruthEvaluation EvaluateMap(
    const StraightMap& map, const MapTruth& truth, const Pose2& alignment,
    const MapTruthOptions& options = MapTruthOptions());

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_EVALUATION_MAP_TRUTH_H_
