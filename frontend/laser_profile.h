#ifndef PLUMBLINE_FRONTEND_LASER_PROFILE_H_
#define PLUMBLINE_FRONTEND_LASER_PROFILE_H_

#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/scan.h>

#include <vector>

namespace plumbline {

/// Directions of the beams of a scan, rad: of the first, and from one to the
/// next.
struct BeamFan {
  double start_angle = 0.0;
  double angle_step = 0.0;
};

/// Beams that a message without angles has: -90 to 90 degrees for 180, 181, 360
/// and 361 of them, else `resolution` apart (rad, 0: unknown) around straight
/// ahead, or over 180 degrees.
BeamFan FanOfBeams(int beams, double resolution);

/// The value at which the readings below `limit`, m, saturate: the smallest of
/// a sharp pile at the top of the log's readings with (almost) nothing right
/// below it; 0 when there is none. A wall far away does not make such a pile: a
/// flat wall 8 m away fills less than a tenth of the beams to within 1.5 cm.
double SaturatedRange(const std::vector<Scan>& scans, double limit);

/// The largest reading of a log, m, where it stands for no return, whatever the
/// scans' maximum_range says: a hundredth of all readings and a tenth of the
/// beams have exactly this one, half of these beams not always, and next to
/// none lie just below it. The largest of what a laser measured is the rarest.
/// 0 otherwise.
double RepeatedRange(const std::vector<Scan>& scans);

/// Where a laser is on a robot.
struct LaserMount {
  /// In the robot's frame, m and rad, to the digits that logs have.
  Pose2 pose = Pose2::Zero();
  /// Whether nearly all scans agree on it.
  bool is_fixed = false;
  /// Whether it is less than 5 m from the robot's middle.
  bool is_on_robot = false;
  /// Scans that do not agree.
  std::vector<int> apart;
};

/// The median over the scans of the laser's pose, seen from Scan::odometry.
/// `lasers` has a pose for each scan; there is at least one.
LaserMount FindLaserMount(const std::vector<Scan>& scans,
                          const std::vector<Pose2>& lasers);

/// Keeps every k-th beam, from the first on, with the smallest k that leaves at
/// most `most`; returns k. The work of matching grows with the square of the
/// beams where they are far denser than walls ask for.
int ThinScan(int most, Scan* scan);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_LASER_PROFILE_H_
