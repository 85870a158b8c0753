#ifndef PLUMBLINE_TEST_DETECTORS_FACE_WORLD_H_
#define PLUMBLINE_TEST_DETECTORS_FACE_WORLD_H_

#include <plumbline/core/em.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/hierarchy.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/session.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/factors/angle.h>
#include <plumbline/factors/pose2.h>

#include <Eigen/Core>
#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {

// A map as the adjustment of poses and walls leaves it: poses bound by odometry
// and by what each of them has seen of the walls. Everything can be moved and
// turned as a whole, and measured with noise.
class FaceWorld {
 public:
  explicit FaceWorld(const Pose2& motion = Pose2::Zero(),
                     std::uint64_t seed = 1)
      : motion_(motion), engine_(seed) {
    RegisterBuiltins(&registry_);
  }

  // Uniform in [low, high).
  double Uniform(double low, double high) {
    return low + (high - low) * static_cast<double>(engine_() >> 11) /
                     9007199254740992.0;
  }
  // Standard normal, about.
  double Normal() {
    double sum = -6.0;
    for (int i = 0; i < 12; ++i) sum += Uniform(0.0, 1.0);
    return sum;
  }

  // A pose of the robot, after the last one. The first of a part is fixed.
  FeatureId AddPose(double x, double y, double theta) {
    const Pose2 truth = Compose(motion_, Pose2(x, y, theta));
    Transaction transaction;
    Feature pose;
    pose.type = &registry_.GetFeature("pose");
    pose.fixed = poses_.empty() || begins_part_;
    Pose2 start = truth;
    Pose2 odometry = Pose2::Zero();
    if (!pose.fixed) {
      odometry = Between(truth_.at(poses_.back()), truth);
      odometry +=
          noise_ * Pose2(odometry_sigma_ * Normal(), odometry_sigma_ * Normal(),
                         odometry_sigma_angle_ * Normal());
      const Feature& last = graph_.GetFeature(poses_.back());
      start = Compose(
          Pose2(last.parameters[0], last.parameters[1], last.parameters[2]),
          odometry);
    }
    pose.parameters = {start[0], start[1], start[2]};
    const FeatureId id = transaction.AddFeature(pose);
    if (!pose.fixed) {
      Eigen::Vector3d sigmas(odometry_sigma_, odometry_sigma_,
                             odometry_sigma_angle_);
      transaction.AddConstraint(MakeMeasurement(
          registry_.GetRelation("pose_pose"), {poses_.back(), id}, odometry,
          InformationFromSigmas(sigmas), "test"));
    }
    poses_.push_back(graph_.Apply(std::move(transaction)).features[0]);
    truth_[poses_.back()] = truth;
    begins_part_ = false;
    return poses_.back();
  }

  // The next pose is tied to nothing before it.
  void BeginPart() { begins_part_ = true; }

  // A face from one end to the other, seen from its left. Its position is a
  // third of the way along.
  FeatureId AddFace(double x1, double y1, double x2, double y2) {
    const double length = std::hypot(x2 - x1, y2 - y1);
    const Pose2 truth =
        Compose(motion_, Pose2(x1 + (x2 - x1) / 3.0, y1 + (y2 - y1) / 3.0,
                               std::atan2(y2 - y1, x2 - x1)));
    Feature face;
    face.type = &registry_.GetFeature("segment");
    face.parameters = {truth[0], truth[1], truth[2]};
    face.extent_begin = -length / 3.0;
    face.extent_end = 2.0 * length / 3.0;
    Transaction transaction;
    transaction.AddFeature(face);
    faces_.push_back(graph_.Apply(std::move(transaction)).features[0]);
    truth_[faces_.back()] = truth;
    return faces_.back();
  }

  // What a pose sees of a face: standard deviations of its distance, at the
  // middle of the face, and its direction, m and rad.
  void See(FeatureId pose, FeatureId face, double sigma, double sigma_angle) {
    const Pose2& robot = truth_.at(pose);
    const Pose2& wall = truth_.at(face);
    const Feature& feature = graph_.GetFeature(face);
    // From the middle of the visible part.
    const double lever = 0.5 * (feature.extent_begin + feature.extent_end);
    const double along = std::cos(wall[2]) * (robot[0] - wall[0]) +
                         std::sin(wall[2]) * (robot[1] - wall[1]) - lever;
    Eigen::Vector2d seen(std::cos(wall[2]) * (robot[1] - wall[1]) -
                             std::sin(wall[2]) * (robot[0] - wall[0]),
                         NormalizeAngle(robot[2] - wall[2]));
    const double offset = noise_ * sigma * Normal();
    const double turn = noise_ * sigma_angle * Normal();
    // A wall turned by so much about its middle is so much nearer to the pose.
    seen += Eigen::Vector2d(offset + along * turn, turn);
    Eigen::Matrix2d covariance;
    const double variance = sigma_angle * sigma_angle;
    covariance << sigma * sigma + along * along * variance, along * variance,
        along * variance, variance;
    Transaction transaction;
    transaction.AddConstraint(
        MakeMeasurement(registry_.GetRelation("pose_segment_collinearity"),
                        {pose, face}, seen, covariance.inverse(), "test"));
    // Where along its line a face has its position is a choice: the first pose
    // that sees it holds it there.
    if (graph_.ConstraintsOf(face).empty()) {
      const Pose2 relative = Between(robot, wall);
      const Eigen::Vector3d line(std::cos(relative[2]), std::sin(relative[2]),
                                 0.0);
      transaction.AddConstraint(MakeMeasurement(
          registry_.GetRelation("pose_pose"), {pose, face}, relative,
          line * line.transpose() / (0.01 * 0.01), "test"));
    }
    graph_.Apply(std::move(transaction));
  }

  // Each pose sees the faces that it is in front of, up to `range` (m) from
  // their middle. The direction of a face of 1 m is seen to `sigma_angle`.
  void SeeAll(double range, double sigma, double sigma_angle) {
    for (const FeatureId pose : poses_) {
      for (const FeatureId face : faces_) {
        const Feature& feature = graph_.GetFeature(face);
        const Pose2& robot = truth_.at(pose);
        const Pose2& wall = truth_.at(face);
        const double lever = 0.5 * (feature.extent_begin + feature.extent_end);
        const double dx = robot[0] - wall[0] - lever * std::cos(wall[2]);
        const double dy = robot[1] - wall[1] - lever * std::sin(wall[2]);
        const double across = std::cos(wall[2]) * dy - std::sin(wall[2]) * dx;
        const double length = feature.extent_end - feature.extent_begin;
        if (across <= 0.1 || std::hypot(dx, dy) > range + 0.5 * length) {
          continue;
        }
        See(pose, face, sigma, sigma_angle / std::pow(length, 1.5));
      }
    }
  }

  // Solves for the measurements.
  void Solve() {
    SolverSession session(&graph_, registry_, {});
    session.SolveGlobal();
  }

  // Runs EM; true when it converged.
  bool RunEm(const std::string& hierarchy,
             const std::map<std::string, DetectorParameters>& parameters = {}) {
    SolverSession session(&graph_, registry_, {});
    EmOrchestrator em(&graph_, &session, registry_,
                      MakeHierarchy(ParseHierarchy(hierarchy), registry_,
                                    {"segment"}, parameters),
                      EmOptions());
    return em.Run().converged();
  }

  Transaction Detect(const std::string& detector,
                     const DetectorParameters& parameters = {},
                     const std::vector<FeatureId>* scoped = nullptr,
                     DetectionCounts* counts = nullptr) {
    DetectionScope scope;
    scope.features = scoped;
    scope.counts = counts;
    return registry_.GetDetector(detector)
        .make(parameters)
        ->Detect(graph_, registry_, scope);
  }

  // Features tied by live structure of a relation, first of each constraint.
  std::vector<FeatureId> Tied(const std::string& relation) const {
    std::vector<FeatureId> tied;
    for (const Constraint* constraint : std::as_const(graph_).Constraints()) {
      if (constraint->state == ConstraintState::kLive &&
          constraint->type->name == relation) {
        tied.push_back(constraint->features[0]);
      }
    }
    std::sort(tied.begin(), tied.end());
    return tied;
  }

  // Error of a face at its middle, across, and of its direction, m and rad.
  Eigen::Vector2d ErrorOf(FeatureId face) const {
    const Feature& feature = graph_.GetFeature(face);
    const Pose2& truth = truth_.at(face);
    const double lever = 0.5 * (feature.extent_begin + feature.extent_end);
    const auto& p = feature.parameters;
    const double dx = p[0] + lever * std::cos(p[2]) - truth[0];
    const double dy = p[1] + lever * std::sin(p[2]) - truth[1];
    return {std::cos(truth[2]) * dy - std::sin(truth[2]) * dx,
            NormalizeAngle(p[2] - truth[2])};
  }

  // Mean square of the errors across, m^2, once the faces are laid on the truth
  // as a whole.
  double MeanSquareError(const std::set<FeatureId>& faces) const {
    Eigen::MatrixXd motion(faces.size(), 3);
    Eigen::VectorXd errors(faces.size());
    Eigen::Index row = 0;
    const Pose2& origin = truth_.at(*faces.begin());
    for (const FeatureId id : faces) {
      const Feature& feature = graph_.GetFeature(id);
      const Pose2& truth = truth_.at(id);
      const double lever = 0.5 * (feature.extent_begin + feature.extent_end);
      const Eigen::Vector2d normal(-std::sin(truth[2]), std::cos(truth[2]));
      const Eigen::Vector2d middle =
          truth.head<2>() - origin.head<2>() +
          lever * Eigen::Vector2d(std::cos(truth[2]), std::sin(truth[2]));
      motion.row(row) << normal.x(), normal.y(),
          normal.dot(Eigen::Vector2d(-middle.y(), middle.x()));
      errors[row++] = ErrorOf(id)[0];
    }
    const Eigen::VectorXd left =
        errors -
        motion * motion.completeOrthogonalDecomposition().solve(errors);
    return left.squaredNorm() / static_cast<double>(faces.size());
  }

  Graph& graph() { return graph_; }
  const Registry& registry() const { return registry_; }
  const std::vector<FeatureId>& poses() const { return poses_; }
  const std::vector<FeatureId>& faces() const { return faces_; }
  void set_noise(double noise) { noise_ = noise; }

 private:
  Registry registry_;
  Graph graph_;
  Pose2 motion_;
  std::mt19937_64 engine_;
  // Factor of all noise that is drawn; what the graph is told of it stays.
  double noise_ = 0.0;
  double odometry_sigma_ = 0.01;
  double odometry_sigma_angle_ = DegToRad(0.3);
  bool begins_part_ = false;
  std::vector<FeatureId> poses_;
  std::vector<FeatureId> faces_;
  std::map<FeatureId, Pose2> truth_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_TEST_DETECTORS_FACE_WORLD_H_
