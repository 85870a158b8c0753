#ifndef PLUMBLINE_FRONTEND_SCAN_ODOMETRY_H_
#define PLUMBLINE_FRONTEND_SCAN_ODOMETRY_H_

#include <plumbline/frontend/odometry_refinement.h>
#include <plumbline/frontend/scan.h>

#include <cstddef>
#include <functional>

namespace plumbline {

/// Options for making odometry from scans alone.
struct ScanOdometryOptions {
  /// How far a robot of the usual kind may have left its steady course between
  /// two scans: per second.
  ///
  /// Speed that is not that of the step before, m/s, and turn rate, rad/s.
  double speed_noise = 0.5;
  double turn_noise = DegToRad(60.0);
  /// The same of the turn rate where a gyroscope measures it.
  double gyroscope_noise = DegToRad(6.0);
  /// Share of the variance of the scans' turn rates that a gyroscope must
  /// explain to be believed.
  double min_explained = 0.7;
  /// By how much the scans must fit each other better where the motion during
  /// them is undone, as a share of the cost of matching.
  double min_sweep_gain = 0.05;
  /// Faster than this no robot is expected, m/s and rad/s.
  double max_speed = 3.0;
  double max_turn = DegToRad(360.0);
  ScanPointsOptions points;
  ScanMatcherOptions matcher;
  /// Polled regularly; true ends the work there. May be empty.
  std::function<bool()> stop;
  /// Called with scans done and all of them. May be empty.
  std::function<void(std::size_t, std::size_t)> progress;
};

/// Figures of AddScanOdometry.
struct ScanOdometryReport {
  /// Scans that no match could place: they go on as the robot went before.
  std::size_t unmatched = 0;
  /// Of the way by scans alone, m, and how much of it lies where the returns
  /// leave the place along the way open, as in corridors without anything in
  /// sight: lengths there are those of a steady motion.
  double way = 0.0;
  double open_way = 0.0;
  /// The model of the gyroscope, turn rate = scale * rate + bias, rad/s, fitted
  /// to the scans' own turns, and the share of their variance that it explains.
  bool used_yaw_rates = false;
  double yaw_scale = 1.0;
  double yaw_bias = 0.0;
  double explained = 0.0;
  /// The motion during scans was undone: the laser takes from one scan to the
  /// next for a sweep that begins at Scan::timestamp, in the order of beams (1)
  /// or against it (-1). 0: it was left.
  int sweep = 0;
};

/// Fills Scan::odometry of a log that has none: each scan is matched with what
/// was seen last, from where a steady motion would have brought the robot.
/// Where Log::yaw_rates says how fast it turned, this is done twice: the first
/// time serves to find scale and bias of the gyroscope (which may be in
/// degrees, or upside down), the second is guided by it. Scans that are many
/// and near each other in time (5 a second and more) are what this needs.
ScanOdometryReport AddScanOdometry(const ScanOdometryOptions& options,
                                   Log* log);

/// Tries, on a stretch of a log with odometry in which the robot turned,
/// whether scans fit each other better as sweeps of a turning laser whose
/// duration the log does not say, and undoes the motion during all of them if
/// so. Returns ScanOdometryReport::sweep. Scans of less than 200 degrees, and
/// those whose motion was undone before, are left as they are.
int UndoSweepsByOdometry(const ScanOdometryOptions& options, Log* log);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_SCAN_ODOMETRY_H_
