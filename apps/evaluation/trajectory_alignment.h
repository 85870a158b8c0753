#ifndef PLUMBLINE_APPS_EVALUATION_TRAJECTORY_ALIGNMENT_H_
#define PLUMBLINE_APPS_EVALUATION_TRAJECTORY_ALIGNMENT_H_

#include <plumbline/apps/evaluation/map_truth.h>
#include <plumbline/apps/evaluation/relations.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/timed_pose.h>

#include <vector>

namespace plumbline {

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

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_EVALUATION_TRAJECTORY_ALIGNMENT_H_
