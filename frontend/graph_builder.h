#ifndef PLUMBLINE_FRONTEND_GRAPH_BUILDER_H_
#define PLUMBLINE_FRONTEND_GRAPH_BUILDER_H_

#include <plumbline/core/feature.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/localization.h>
#include <plumbline/frontend/point_association.h>
#include <plumbline/frontend/robot_links.h>
#include <plumbline/frontend/scan_points.h>
#include <plumbline/frontend/segment_extraction.h>

#include <Eigen/Core>
#include <Eigen/LU>
#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {

/// A scan that enters the map, as odometry refinement hands it over.
struct KeyScan {
  /// Index of the scan in the log.
  int index = 0;
  /// Motion since the key scan before, or since `since`, in that scan's frame;
  /// ignored for the first.
  UncertainPose2 motion;
  /// Index in the log of the key scan that `motion` counts from when it is not
  /// the one before: the robot was lost and found elsewhere. -1 otherwise.
  int since = -1;
  /// `motion` is a guess: nothing that was seen before can be recognized from
  /// here.
  bool is_loose = false;
  /// Where the first one stands, map frame; ignored for the others.
  Pose2 start = Pose2::Zero();
  /// Its returns in the order of beams, robot's frame.
  std::vector<ScanPoint> returns;
  /// Position of the laser, robot's frame, m.
  Eigen::Vector2d laser = Eigen::Vector2d::Zero();
  /// Angle between beams, rad.
  double angle_step = 0.0;
  /// Factor by which the laser is noisier than usual (RangeNoiseScale).
  double noise_scale = 1.0;
};

/// One observation that was recognized as a segment of the map.
struct FeatureMatch {
  FeatureId feature = kNoId;
  SegmentObservation observation;
};

/// Record of a key scan: enough to find its pose again when the map
/// has moved.
struct KeyScanRecord {
  /// Index of the scan in the log.
  int scan = 0;
  /// Motion since the key scan before, or since the record `from`, in that
  /// scan's frame.
  UncertainPose2 motion;
  /// Index of the record that `motion` counts from when it is not the one
  /// before; -1 otherwise.
  int from = -1;
  /// `motion` is a guess.
  bool is_loose = false;
  /// Pose (map frame) as it was when the scan came in.
  Pose2 pose = Pose2::Zero();
  /// Recognized segments, and those that this scan made.
  std::vector<FeatureMatch> matches;
  /// Recognized points, and those that this scan made.
  std::vector<PointMatch> points;
};

/// Whether `motion` is measured from the record before: not where the robot was
/// lost, or another log begins.
inline bool FollowsTheOneBefore(const KeyScanRecord& record) {
  return record.from < 0 && !record.is_loose;
}

/// Grows a graph from key scans: the part of the front-end that depends on the
/// kind of raw features. Only the last robot pose is kept; what the poses
/// before it knew is in the measurements between features (core/method.md,
/// section 7).
class GraphBuilder {
 public:
  virtual ~GraphBuilder() = default;
  GraphBuilder(const GraphBuilder&) = delete;
  GraphBuilder& operator=(const GraphBuilder&) = delete;

  /// Registered name of the raw features' type: level 0 of the hierarchy.
  virtual std::string feature_type() const = 0;

  /// Takes the next key scan of the log.
  virtual void AddScan(const KeyScan& scan) = 0;

  /// Writes the robot and its links into the graph as it stands now, so that a
  /// solve carries the robot along with what it is linked to.
  virtual void WriteRobot() = 0;
  /// Takes the robot's pose back from the graph after a solve.
  void ReadRobot() { robot_.Read(); }

  /// Writes what it knows between two key scans, to be read by another one of
  /// the same kind and options on an equal graph.
  virtual void WriteState(StateWriter* state) const;
  virtual void ReadState(StateReader* state);

  /// The robot's pose, map frame.
  const Pose2& robot() const { return robot_.pose(); }
  /// The robot's feature in the graph; kNoId before the first WriteRobot.
  FeatureId robot_id() const { return robot_.id(); }

  /// Features that the robot is linked to and those they are bound to, up to
  /// `depth` constraints from the robot, and the robot, ascending.
  std::vector<FeatureId> Neighborhood(int depth) const {
    return robot_.Neighborhood(depth);
  }

  /// Records of the key scans, in the order of the log.
  const std::vector<KeyScanRecord>& records() const { return records_; }
  /// Observations that matched a feature, and features made, so far.
  std::int64_t num_matches() const { return num_matches_; }
  std::int64_t num_created() const { return num_created_; }

 protected:
  /// The graph and registry must outlive the builder.
  GraphBuilder(Graph* graph, const Registry& registry)
      : graph_(graph), registry_(registry), robot_(graph) {}

  /// To be called before BeginScan with the argument of AddScan: takes the
  /// robot and its links back to the key scan `scan.since` if one is given.
  void Place(const KeyScan& scan);

  /// Begins a key scan: the first starts at `start`, for others the robot goes
  /// by `motion` and its links to features that are farther away than
  /// `link_radius` by `distance` (RobotLinks::Cut) are cut.
  KeyScanRecord BeginScan(
      int scan, const UncertainPose2& motion, const Pose2& start,
      double link_radius,
      const std::function<double(const Feature&)>& distance);

  /// Ends a key scan. After a loose one the robot is linked to what that one
  /// saw alone, if it saw anything.
  void EndScan(KeyScanRecord record);

  /// Corrects the robot by what was recognized, if anything was.
  /// `associate(pose)` gives the associations at a pose, which must have the
  /// index `candidate` into `candidates`; `localize(prior, associations)` the
  /// pose that they speak for, with the prior's information.
  template <typename Candidate, typename Association, typename Associate,
            typename Localize>
  void CorrectRobot(const std::vector<Candidate>& candidates,
                    const Associate& associate, const Localize& localize,
                    std::vector<Association>* associations) {
    if (associations->empty()) return;
    const Eigen::Matrix3d prior = robot_.Tightest().inverse();
    Localization localized = localize(prior, *associations);
    // Again from the corrected pose: what was at the edge of the gates may be
    // in now, or out.
    std::vector<Association> again = associate(localized.pose);
    if (!again.empty()) {
      *associations = std::move(again);
      localized = localize(prior, *associations);
    }
    std::vector<FeatureId> seen;
    for (const Association& association : *associations) {
      seen.push_back(candidates[association.candidate].feature);
    }
    robot_.Correct(localized.pose, localized.observation_information, seen);
  }

  /// The state of the builder, for the kinds of features to work on: the graph,
  /// the robot in it, and what the functions above return.
  Graph* graph_;
  const Registry& registry_;
  RobotLinks robot_;
  std::vector<KeyScanRecord> records_;
  std::int64_t num_matches_ = 0;
  std::int64_t num_created_ = 0;

 private:
  // Of the key scan that begins.
  int from_ = -1;
  bool is_loose_ = false;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_GRAPH_BUILDER_H_
