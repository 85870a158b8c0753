#ifndef PLUMBLINE_APPS_EVALUATION_TRAJECTORY_ERRORS_H_
#define PLUMBLINE_APPS_EVALUATION_TRAJECTORY_ERRORS_H_

#include <plumbline/apps/evaluation/trajectory_file.h>

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {

/// Statistics of errors, by the names that evo gives them
/// (github.com/MichaelGrupp/evo).
struct ErrorSummary {
  std::size_t count = 0;
  double rmse = 0.0;
  double mean = 0.0;
  /// Of an even number the mean of the middle two.
  double median = 0.0;
  /// Standard deviation of the errors themselves: divided by their number.
  double std = 0.0;
  double min = 0.0;
  double max = 0.0;
  /// Sum of squared errors.
  double sse = 0.0;
};

/// All zero for no errors.
ErrorSummary SummarizeErrors(const std::vector<double>& errors);

/// Poses of two trajectories that belong together.
struct PosePairs {
  /// Of the reference, s.
  std::vector<double> times;
  std::vector<Pose3> reference;
  std::vector<Pose3> estimate;
};

/// Matches poses by time as evo does: each pose of the trajectory with fewer
/// poses with the one of the other that is nearest in time, if they are at most
/// `max_difference` s apart (to a nanosecond). `offset` is added to the times
/// of the estimate, s. Trajectories without times match by number and must be
/// of one length. Throws Error when nothing matches, or only one of the two has
/// times.
PosePairs AssociatePoses(const TrajectoryFile& reference,
                         const TrajectoryFile& estimate,
                         double max_difference = 0.01, double offset = 0.0);

/// How the estimate is moved onto the reference.
enum class PoseAlignment {
  kNone,
  /// The first poses coincide.
  kOrigin,
  /// Both are taken into the plane (z, roll and pitch are dropped); then the
  /// least sum of squared distances over turns about z and shifts.
  kSe2,
  /// The least sum of squared distances over all rigid motions (Umeyama 1991).
  kSe3,
  /// The same with a common scale.
  kSim3,
};

/// What moves a point p of the estimate: scale * rotation * p + translation.
struct AlignmentTransform {
  Pose3 motion;
  double scale = 1.0;
};

/// True when all positions lie at z = 0 and all rotations are about z: a map of
/// the plane.
bool IsPlanar(const std::vector<TimedPose3>& poses);

/// Finds the transform and moves the estimate by it; for kSe2 both sides are in
/// the plane afterwards. Throws Error when the pairs do not determine it: fewer
/// than two of them (kSe2), positions on one line (kSe3, kSim3).
AlignmentTransform AlignPoses(PoseAlignment alignment, PosePairs* pairs);

/// Absolute pose error: what lies between the two poses of a pair.
struct AbsoluteErrors {
  std::vector<double> translation;   ///< m
  std::vector<double> rotation_deg;  ///< degrees, 0 to 180
};

AbsoluteErrors ComputeAbsoluteErrors(const PosePairs& pairs);

/// Which steps relative errors are taken over.
struct RelativeErrorOptions {
  /// Length of a step: a number of poses, or m of the estimate's path.
  double delta = 1.0;
  bool delta_is_m = false;
  /// A step from every pose and not only one after another; of those in metres
  /// the one whose length is nearest to delta, if to within a tenth of it.
  bool all_pairs = false;
};

/// Relative pose error: with q and p the motions of reference and estimate over
/// the same step, inverse(q) (+) p.
struct RelativeErrors {
  /// Indices of the pairs between which the steps lie.
  std::vector<std::pair<std::size_t, std::size_t>> steps;
  std::vector<double> translation;   ///< m
  std::vector<double> rotation_deg;  ///< degrees, 0 to 180
};

/// Steps one after another begin as evo's do: by number at the first pose, by
/// metres at the first pose where the path is `delta` long. Empty when the
/// trajectory is too short for a step. Throws Error for a delta that is not
/// positive, or no whole number of poses.
RelativeErrors ComputeRelativeErrors(const PosePairs& pairs,
                                     const RelativeErrorOptions& options);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_EVALUATION_TRAJECTORY_ERRORS_H_
