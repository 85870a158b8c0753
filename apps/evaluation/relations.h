#ifndef PLUMBLINE_APPS_EVALUATION_RELATIONS_H_
#define PLUMBLINE_APPS_EVALUATION_RELATIONS_H_

#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/input_stream.h>
#include <plumbline/frontend/timed_pose.h>

#include <cstddef>
#include <ostream>
#include <string>
#include <vector>

namespace plumbline {

/// True displacement between two moments (Kuemmerle et al. 2009).
struct Relation {
  /// s
  double time1 = 0.0;
  double time2 = 0.0;
  /// Pose at time2 seen from the pose at time1, m and rad.
  Pose2 displacement = Pose2::Zero();
  /// Line of the file, from 1.
  int line = 0;
};

/// Reads a relations file, `t1 t2 x y z roll pitch yaw` a line (comments and
/// empty lines are passed over; z, roll and pitch are dropped). Throws Error as
/// ReadTum does.
std::vector<Relation> ReadRelations(const std::string& path);
std::vector<Relation> ReadRelations(InputStream* input);

/// Finds poses by time.
class TrajectoryIndex {
 public:
  /// Keeps a reference to `trajectory`, whose time stamps need not ascend.
  explicit TrajectoryIndex(const std::vector<TimedPose>& trajectory);

  /// Index of the pose nearest in time to `timestamp`, of several equally near
  /// ones the first; -1 when none is within `tolerance` s (and a microsecond
  /// for the rounding of decimal stamps).
  int Find(double timestamp, double tolerance) const;

 private:
  const std::vector<TimedPose>& trajectory_;
  // Indices by time, then by index.
  std::vector<int> order_;
};

/// Of a set of numbers.
struct ErrorStatistics {
  std::size_t count = 0;
  double mean = 0.0;
  /// Sample standard deviation (divided by count - 1); 0 for one number.
  double standard_deviation = 0.0;
  double maximum = 0.0;
};

/// All zero for no numbers.
ErrorStatistics ComputeStatistics(const std::vector<double>& values);

/// Error of a trajectory against one relation.
struct RelationError {
  Relation relation;
  /// inverse(u) (+) d: u the relation's displacement, d the trajectory's.
  Pose2 error = Pose2::Zero();
  /// Length of the error's (x, y), m.
  double translation = 0.0;
  /// Absolute value of the error's angle, degrees, 0 to 180.
  double rotation_deg = 0.0;
};

/// How well a trajectory fits its relations.
struct RelationEvaluation {
  ErrorStatistics translation;           ///< m
  ErrorStatistics squared_translation;   ///< m^2
  ErrorStatistics rotation_deg;          ///< degrees
  ErrorStatistics squared_rotation_deg;  ///< degrees^2
  /// Of the relations whose times both match a pose, in the file's order.
  std::vector<RelationError> errors;
  /// The others.
  std::vector<Relation> unmatched;
};

/// Kuemmerle et al. 2009: with d = inverse(p(t1)) (+) p(t2) the error of a
/// relation is inverse(u) (+) d. Poses are matched by time stamp to within
/// `time_tolerance` s, never interpolated.
RelationEvaluation EvaluateRelations(const std::vector<TimedPose>& trajectory,
                                     const std::vector<Relation>& relations,
                                     double time_tolerance = 1e-3);

/// Writes a line per matched relation: line,t1,t2,error_x_m,error_y_m,
/// error_theta_deg,translation_m,rotation_deg.
void WriteRelationErrors(const RelationEvaluation& evaluation,
                         std::ostream& output);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_EVALUATION_RELATIONS_H_
