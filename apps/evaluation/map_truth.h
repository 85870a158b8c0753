#ifndef PLUMBLINE_APPS_EVALUATION_MAP_TRUTH_H_
#define PLUMBLINE_APPS_EVALUATION_MAP_TRUTH_H_

#include <plumbline/apps/simulation/world_rooms.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/input_stream.h>
#include <plumbline/frontend/timed_pose.h>

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
  /// Closed spaces between the faces of walls, world frame, and the doors
  /// between them.
  std::vector<Polygon> rooms;
  std::vector<TrueDoor> doors;
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

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_EVALUATION_MAP_TRUTH_H_
