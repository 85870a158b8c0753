#ifndef PLUMBLINE_FRONTEND_GRAPH_BUILDER_H_
#define PLUMBLINE_FRONTEND_GRAPH_BUILDER_H_

#include <plumbline/core/feature.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/point_association.h>
#include <plumbline/frontend/scan_points.h>
#include <plumbline/frontend/segment_extraction.h>

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

namespace plumbline {

/// A scan that enters the map, as odometry refinement hands it over.
struct KeyScan {
  /// Index of the scan in the log.
  int index = 0;
  /// Motion since the key scan before, in that scan's frame; ignored for the
  /// first.
  UncertainPose2 motion;
  /// Where the first one stands, map frame; ignored for the others.
  Pose2 start = Pose2::Zero();
  /// Its returns in the order of beams, robot's frame.
  std::vector<ScanPoint> returns;
  /// Position of the laser, robot's frame, m.
  Eigen::Vector2d laser = Eigen::Vector2d::Zero();
  /// Angle between beams, rad.
  double angle_step = 0.0;
};

/// One observation that was recognized as a segment of the map.
struct FeatureMatch {
  FeatureId feature = kNoId;
  SegmentObservation observation;
};

/// What is remembered of a key scan: enough to find its pose again when the
/// map has moved.
struct KeyScanRecord {
  /// Index of the scan in the log.
  int scan = 0;
  /// Motion since the key scan before, in that scan's frame.
  UncertainPose2 motion;
  /// Pose (map frame) as it was when the scan came in.
  Pose2 pose = Pose2::Zero();
  /// Recognized segments, and those that this scan made.
  std::vector<FeatureMatch> matches;
  /// The same of points.
  std::vector<PointMatch> points;
};

/// What grows a graph from key scans: the part of the front-end that depends on
/// the kind of raw features. Only the last robot pose is kept; what the poses
/// before it knew is in the measurements between features (method.md, section
/// 7).
class GraphBuilder {
 public:
  virtual ~GraphBuilder() = default;

  /// Registered name of the raw features' type: level 0 of the hierarchy.
  virtual std::string feature_type() const = 0;

  /// Takes the next key scan of the log.
  virtual void AddScan(const KeyScan& scan) = 0;

  /// Writes the robot and its links into the graph as it stands now, so that a
  /// solve carries the robot along with what it is linked to.
  virtual void WriteRobot() = 0;
  /// Takes the robot's pose back from the graph after a solve.
  virtual void ReadRobot() = 0;
  /// The robot's feature in the graph; kNoId before the first WriteRobot.
  virtual FeatureId robot_id() const = 0;

  /// Features that the robot is linked to and those they are bound to, up to
  /// `depth` constraints from the robot, and the robot, ascending.
  virtual std::vector<FeatureId> Neighborhood(int depth) const = 0;

  /// What was kept of key scans, in the order of the log.
  virtual const std::vector<KeyScanRecord>& records() const = 0;
  /// Observations that matched a feature, and features made, so far.
  virtual std::int64_t num_matches() const = 0;
  virtual std::int64_t num_created() const = 0;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_GRAPH_BUILDER_H_
