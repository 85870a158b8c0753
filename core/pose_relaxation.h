#ifndef PLUMBLINE_CORE_POSE_RELAXATION_H_
#define PLUMBLINE_CORE_POSE_RELAXATION_H_

#include <plumbline/core/constraint.h>
#include <plumbline/factors/pose2.h>

#include <Eigen/Core>
#include <vector>

namespace plumbline {

/// A relation that tells where a pose of the plane is, seen from another one.
struct PoseSighting {
  /// The place of a pose that is not there: `first` of a prior.
  static constexpr int kNone = -1;

  /// Of the relation.
  ConstraintId id = 0;
  /// Places among the poses.
  int first = kNone;
  int second = kNone;
  /// m, m, rad; of a prior in the map frame.
  Pose2 value = Pose2::Zero();
  Eigen::Matrix3d information = Eigen::Matrix3d::Identity();
};

/// A relation that tells where a landmark is, seen from a pose; m.
struct PositionSighting {
  /// Places among the poses and among the landmarks.
  int pose = 0;
  int landmark = 0;
  Eigen::Vector2d value = Eigen::Vector2d::Zero();
  Eigen::Matrix2d information = Eigen::Matrix2d::Identity();
};

/// Poses and landmarks of the plane that relations tie together: what is
/// relaxed, and what holds it.
struct PoseNetwork {
  std::vector<Pose2> poses;
  std::vector<Eigen::Vector2d> landmarks;
  /// Of each: it stays where it is.
  std::vector<bool> is_known_pose;
  std::vector<bool> is_known_landmark;
  std::vector<PoseSighting> pose_sightings;
  std::vector<PositionSighting> position_sightings;
};

/// Moves poses and landmarks to where two sparse linear least-squares problems
/// put them: headings as points of the plane in place of the unit circle, from
/// relative headings alone, then positions at these headings (Carlone et al.
/// 2015). Where landmarks close loops, headings and positions are also solved
/// for together, and the result with the lower objective stays. Throws Error
/// when a problem has no solution, for numbers that overflow.
void RelaxPoses(PoseNetwork* network);

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_POSE_RELAXATION_H_
