#include <plumbline/apps/evaluation/trajectory_alignment.h>
#include <plumbline/core/error.h>

#include <cmath>

namespace plumbline {

Pose2 FitRigidTransform(const std::vector<Pose2>& from,
                        const std::vector<Pose2>& to) {
  if (from.size() != to.size() || from.empty()) {
    throw PLUMBLINE_ERROR("poses to align do not pair up",
                          "as many poses on both sides, at least one");
  }
  Eigen::Vector2d from_center = Eigen::Vector2d::Zero();
  Eigen::Vector2d to_center = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < from.size(); ++i) {
    from_center += from[i].head<2>();
    to_center += to[i].head<2>();
  }
  from_center /= static_cast<double>(from.size());
  to_center /= static_cast<double>(to.size());
  double cosine = 0.0;
  double sine = 0.0;
  double heading_cosine = 0.0;
  double heading_sine = 0.0;
  double spread = 0.0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    const Eigen::Vector2d a = from[i].head<2>() - from_center;
    const Eigen::Vector2d b = to[i].head<2>() - to_center;
    cosine += a.dot(b);
    sine += a.x() * b.y() - a.y() * b.x();
    spread += b.squaredNorm();
    heading_cosine += std::cos(to[i][2] - from[i][2]);
    heading_sine += std::sin(to[i][2] - from[i][2]);
  }
  // Positions within 10 cm say less about the rotation than headings do.
  const bool in_place = spread <= 0.01 * static_cast<double>(from.size()) ||
                        std::hypot(cosine, sine) == 0.0;
  const double angle = in_place ? std::atan2(heading_sine, heading_cosine)
                                : std::atan2(sine, cosine);
  const Eigen::Vector2d moved =
      TransformPoint(Pose2(0.0, 0.0, angle), from_center);
  return Pose2(to_center.x() - moved.x(), to_center.y() - moved.y(), angle);
}

Pose2 AlignTrajectory(const std::vector<TimedPose>& trajectory,
                      const MapTruth& truth) {
  const TrajectoryIndex index(trajectory);
  std::vector<Pose2> from;
  std::vector<Pose2> to;
  for (const TimedPose& timed : truth.poses) {
    const int match = index.Find(timed.timestamp, 1e-3);
    if (match < 0) continue;
    from.push_back(trajectory[match].pose);
    to.push_back(timed.pose);
  }
  if (from.empty()) {
    throw Error(truth.name, 0,
                "no true pose has the time stamp of a pose of the trajectory",
                "the truth and the trajectory of the same log");
  }
  return FitRigidTransform(from, to);
}

PoseErrors EvaluatePoses(const std::vector<TimedPose>& trajectory,
                         const MapTruth& truth, const Pose2& alignment) {
  const TrajectoryIndex index(trajectory);
  std::vector<double> positions;
  std::vector<double> headings;
  for (const TimedPose& timed : truth.poses) {
    const int match = index.Find(timed.timestamp, 1e-3);
    if (match < 0) continue;
    const Pose2 pose = Compose(alignment, trajectory[match].pose);
    positions.push_back((pose - timed.pose).head<2>().norm());
    headings.push_back(
        std::abs(RadToDeg(NormalizeAngle(pose[2] - timed.pose[2]))));
  }
  return {ComputeStatistics(positions), ComputeStatistics(headings)};
}

}  // namespace plumbline
