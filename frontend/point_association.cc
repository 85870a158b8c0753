#include <plumbline/frontend/point_association.h>

#include <cmath>

namespace plumbline {

PointObservation PointOnSurface(const SegmentObservation& surface, double along,
                                double along_sigma) {
  const double c = std::cos(surface.pose[2]);
  const double s = std::sin(surface.pose[2]);
  // Offset and direction are independent at the middle.
  const double across =
      surface.covariance(0, 0) + along * along * surface.covariance(1, 1);
  Eigen::Matrix2d axes;
  axes << c, -s, s, c;
  PointObservation point;
  point.position = surface.pose.head<2>() + along * axes.col(0);
  point.covariance = axes *
                     Eigen::Vector2d(along_sigma * along_sigma, across)
                         .asDiagonal()
                         .toDenseMatrix() *
                     axes.transpose();
  point.covariance(1, 0) = point.covariance(0, 1);
  return point;
}

std::vector<PointAssociation> AssociatePoints(
    const Pose2& robot, const std::vector<SegmentObservation>& surfaces,
    const std::vector<PointCandidate>& candidates,
    const PointAssociationOptions& options) {
  std::vector<PointAssociation> associations;
  const Pose2 to_robot = Inverse(robot);
  for (std::size_t k = 0; k < candidates.size(); ++k) {
    const PointCandidate& candidate = candidates[k];
    // As seen from the robot.
    const Eigen::Vector2d point = TransformPoint(to_robot, candidate.position);
    const double direction = candidate.direction - robot[2];
    // The robot's errors in its own axes move the point by j times them.
    const double c = std::cos(robot[2]);
    const double s = std::sin(robot[2]);
    Eigen::Matrix<double, 2, 3> j;
    j << -c, -s, point.y(),  //
        s, -c, -point.x();
    PointAssociation best;
    best.squared_distance = options.gate;
    for (std::size_t w = 0; w < surfaces.size(); ++w) {
      const SegmentObservation& surface = surfaces[w];
      const Eigen::Vector2d along_axis(std::cos(surface.pose[2]),
                                       std::sin(surface.pose[2]));
      const Eigen::Vector2d normal(-along_axis.y(), along_axis.x());
      const Eigen::Vector2d arm = point - surface.pose.head<2>();
      const double along = along_axis.dot(arm);
      const double offset = normal.dot(arm);
      if (std::abs(along) > 0.5 * surface.length ||
          std::abs(offset) > options.max_offset ||
          std::abs(NormalizeAngle(direction - surface.pose[2])) >
              options.max_angle) {
        continue;
      }
      const Eigen::Matrix<double, 1, 3> row = normal.transpose() * j;
      const double variance =
          surface.covariance(0, 0) + along * along * surface.covariance(1, 1) +
          options.feature_sigma * options.feature_sigma +
          row * candidate.robot_covariance * row.transpose();
      const double squared = offset * offset / variance;
      if (squared < best.squared_distance) {
        best.candidate = static_cast<int>(k);
        best.surface = static_cast<int>(w);
        best.along = along;
        best.squared_distance = squared;
      }
    }
    if (best.candidate < 0) continue;
    best.observation =
        PointOnSurface(surfaces[best.surface], best.along, options.along_sigma);
    associations.push_back(best);
  }
  std::vector<int> on_surface(surfaces.size(), 0);
  for (const PointAssociation& association : associations) {
    ++on_surface[association.surface];
  }
  for (PointAssociation& association : associations) {
    association.observation.share = 1.0 / on_surface[association.surface];
  }
  return associations;
}

}  // namespace plumbline
