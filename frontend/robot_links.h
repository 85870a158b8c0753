#ifndef PLUMBLINE_FRONTEND_ROBOT_LINKS_H_
#define PLUMBLINE_FRONTEND_ROBOT_LINKS_H_

#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/state_archive.h>
#include <plumbline/factors/pose2.h>

#include <Eigen/Core>
#include <functional>
#include <map>
#include <string>
#include <vector>

namespace plumbline {

/// The robot as it moves through a graph: its last pose, the only one that is
/// kept, and how well that is known relative to the features that it is linked
/// to (core/method.md, section 7, step 1). The poses before it are marginalized
/// out into these covariances.
class RobotLinks {
 public:
  /// Covariances (3x3; m, rad) of the robot's pose relative to each feature, in
  /// the axes of the map frame.
  using Links = std::map<FeatureId, Eigen::Matrix3d>;

  /// The graph must outlive this.
  explicit RobotLinks(Graph* graph) : graph_(graph) {}

  /// Where the robot is, map frame.
  const Pose2& pose() const { return pose_; }
  void set_pose(const Pose2& pose) { pose_ = pose; }
  /// The robot's feature in the graph; kNoId before the first Write.
  FeatureId id() const { return id_; }
  const Links& links() const { return links_; }

  /// Links the robot to a feature; no effect when it is linked already.
  void Add(FeatureId id, const Eigen::Matrix3d& covariance) {
    links_.emplace(id, covariance);
  }

  /// Cuts all links.
  void ClearLinks() { links_.clear(); }

  /// Composes a motion, given in the robot's frame, onto the pose and its
  /// covariances.
  void Predict(const UncertainPose2& motion);

  /// Cuts the links to features that are gone or farther away than `radius`, m,
  /// by `distance` (of the visible part from the robot). When all are, the best
  /// known one stays: without any the map would fall apart.
  void Cut(double radius,
           const std::function<double(const Feature&)>& distance);

  /// The robot was found at `pose` by observations with this information (axes
  /// of the map frame) of the features `seen`: every link gets better, and
  /// those seen that are not linked yet become so.
  void Correct(const Pose2& pose, const Eigen::Matrix3d& information,
               const std::vector<FeatureId>& seen);

  /// The covariances with the largest and the smallest trace; zero and 1e6
  /// times the identity without links.
  Eigen::Matrix3d Widest() const;
  Eigen::Matrix3d Tightest() const;

  /// Features that the robot is linked to and those that measurements bind
  /// them to, up to `depth` constraints from the robot, and the robot itself
  /// when it is in the graph; ascending.
  std::vector<FeatureId> Neighborhood(int depth) const;

  /// Puts the robot, or its new pose, and constraints to it into the graph in
  /// place of those that were there. `constraints` gets the id that they name
  /// the robot by. `source` is put on the robot's feature.
  void Write(
      const Registry& registry, const std::string& source,
      const std::function<std::vector<Constraint>(FeatureId)>& constraints);

  /// Takes the pose back from the graph after a solve; no effect before the
  /// first Write.
  void Read();

  /// Writes pose, id and links, to be read by another one on an equal graph.
  void WriteState(StateWriter* state) const;
  void ReadState(StateReader* state);

 private:
  Graph* graph_;
  Pose2 pose_ = Pose2::Zero();
  FeatureId id_ = kNoId;
  Links links_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_ROBOT_LINKS_H_
