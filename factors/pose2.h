#ifndef PLUMBLINE_FACTORS_POSE2_H_
#define PLUMBLINE_FACTORS_POSE2_H_

#include <plumbline/factors/angle.h>

#include <Eigen/Core>
#include <cmath>

namespace plumbline {

/// A rigid transformation of the plane, or a pose: position (x, y) in metres
/// and heading theta in radians, stored in this order. The heading is not
/// wrapped by construction; Compose and Inverse wrap their results.
using Pose2 = Eigen::Vector3d;

/// Compounding p1 (+) p2 (Smith and Cheeseman 1986): the pose p2, given in the
/// frame p1, expressed in the frame in which p1 is given. Heading in
/// (-pi, pi].
inline Pose2 Compose(const Pose2& p1, const Pose2& p2) {
  const double c = std::cos(p1[2]);
  const double s = std::sin(p1[2]);
  return Pose2(p1[0] + c * p2[0] - s * p2[1], p1[1] + s * p2[0] + c * p2[1],
               NormalizeAngle(p1[2] + p2[2]));
}

/// Inverse (-)p, so that Compose(Inverse(p), p) is the identity.
inline Pose2 Inverse(const Pose2& p) {
  const double c = std::cos(p[2]);
  const double s = std::sin(p[2]);
  return Pose2(-c * p[0] - s * p[1], s * p[0] - c * p[1],
               NormalizeAngle(-p[2]));
}

/// Relative pose inverse(p1) (+) p2 (Eq. 19): p2 seen from p1. The difference
/// of positions is taken first, so the result keeps its accuracy far from the
/// origin.
inline Pose2 Between(const Pose2& p1, const Pose2& p2) {
  const double c = std::cos(p1[2]);
  const double s = std::sin(p1[2]);
  const double dx = p2[0] - p1[0];
  const double dy = p2[1] - p1[1];
  return Pose2(c * dx + s * dy, -s * dx + c * dy,
               NormalizeAngle(p2[2] - p1[2]));
}

/// Takes points and directions from the frame `pose` to the frame in which
/// `pose` is given; for many of them, as its sine and cosine are taken once.
class PoseTransform {
 public:
  /// Of the frame with this origin (m) and heading (rad).
  explicit PoseTransform(const Pose2& pose)
      : position_(pose[0], pose[1]),
        cosine_(std::cos(pose[2])),
        sine_(std::sin(pose[2])) {}

  /// A point, m.
  Eigen::Vector2d Point(const Eigen::Vector2d& point) const {
    return {position_[0] + cosine_ * point[0] - sine_ * point[1],
            position_[1] + sine_ * point[0] + cosine_ * point[1]};
  }

  /// A direction: a vector of any length, only turned.
  Eigen::Vector2d Direction(const Eigen::Vector2d& direction) const {
    return {cosine_ * direction[0] - sine_ * direction[1],
            sine_ * direction[0] + cosine_ * direction[1]};
  }

 private:
  Eigen::Vector2d position_;
  double cosine_;
  double sine_;
};

/// The point `point` (m), given in the frame `pose`, in the frame in which
/// `pose` is given.
inline Eigen::Vector2d TransformPoint(const Pose2& pose,
                                      const Eigen::Vector2d& point) {
  return PoseTransform(pose).Point(point);
}

/// Jacobian (3x3) of Compose(p1, p2) with respect to p1.
inline Eigen::Matrix3d ComposeJacobianFirst(const Pose2& p1, const Pose2& p2) {
  const double c = std::cos(p1[2]);
  const double s = std::sin(p1[2]);
  Eigen::Matrix3d jacobian = Eigen::Matrix3d::Identity();
  jacobian(0, 2) = -s * p2[0] - c * p2[1];
  jacobian(1, 2) = c * p2[0] - s * p2[1];
  return jacobian;
}

/// Jacobian (3x3) of Compose(p1, p2) with respect to p2.
inline Eigen::Matrix3d ComposeJacobianSecond(const Pose2& p1) {
  const double c = std::cos(p1[2]);
  const double s = std::sin(p1[2]);
  Eigen::Matrix3d jacobian = Eigen::Matrix3d::Identity();
  jacobian(0, 0) = c;
  jacobian(0, 1) = -s;
  jacobian(1, 0) = s;
  jacobian(1, 1) = c;
  return jacobian;
}

/// Jacobian (3x3) of Inverse(p) with respect to p.
inline Eigen::Matrix3d InverseJacobian(const Pose2& p) {
  const double c = std::cos(p[2]);
  const double s = std::sin(p[2]);
  Eigen::Matrix3d jacobian;
  jacobian << -c, -s, s * p[0] - c * p[1],  //
      s, -c, c * p[0] + s * p[1],           //
      0, 0, -1;
  return jacobian;
}

/// Jacobian (3x3) of Between(p1, p2) with respect to p1.
inline Eigen::Matrix3d BetweenJacobianFirst(const Pose2& p1, const Pose2& p2) {
  const double c = std::cos(p1[2]);
  const double s = std::sin(p1[2]);
  const double dx = p2[0] - p1[0];
  const double dy = p2[1] - p1[1];
  Eigen::Matrix3d jacobian;
  jacobian << -c, -s, c * dy - s * dx,  //
      s, -c, -c * dx - s * dy,          //
      0, 0, -1;
  return jacobian;
}

/// Jacobian (3x3) of Between(p1, p2) with respect to p2.
inline Eigen::Matrix3d BetweenJacobianSecond(const Pose2& p1) {
  const double c = std::cos(p1[2]);
  const double s = std::sin(p1[2]);
  Eigen::Matrix3d jacobian;
  jacobian << c, s, 0,  //
      -s, c, 0,         //
      0, 0, 1;
  return jacobian;
}

/// A pose with its covariance (3x3, units m^2, m rad, rad^2), expressed in the
/// reference frame of the pose.
struct UncertainPose2 {
  Pose2 mean = Pose2::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
};

/// Compounds two independent uncertain transformations to first order (Smith
/// and Cheeseman 1986).
inline UncertainPose2 Compose(const UncertainPose2& p1,
                              const UncertainPose2& p2) {
  const Eigen::Matrix3d j1 = ComposeJacobianFirst(p1.mean, p2.mean);
  const Eigen::Matrix3d j2 = ComposeJacobianSecond(p1.mean);
  return {Compose(p1.mean, p2.mean), j1 * p1.covariance * j1.transpose() +
                                         j2 * p2.covariance * j2.transpose()};
}

/// Inverse of an uncertain transformation to first order.
inline UncertainPose2 Inverse(const UncertainPose2& p) {
  const Eigen::Matrix3d j = InverseJacobian(p.mean);
  return {Inverse(p.mean), j * p.covariance * j.transpose()};
}

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_POSE2_H_
