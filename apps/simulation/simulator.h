#ifndef PLUMBLINE_APPS_SIMULATION_SIMULATOR_H_
#define PLUMBLINE_APPS_SIMULATION_SIMULATOR_H_

#include <plumbline/apps/simulation/world.h>
#include <plumbline/apps/simulation/world_rooms.h>
#include <plumbline/factors/pose2.h>

#include <cstdint>
#include <functional>
#include <ostream>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {

/// How the robot follows the world's path.
struct DriveOptions {
  /// m/s on straight ways; turns are slower or on the spot.
  double speed = 0.7;
  /// rad/s, at most.
  double turn_rate = 0.8;
  /// Standard deviation of the disturbance of the turn rate that lets the robot
  /// sway about its path like a real one, rad/s.
  double sway = 0.04;
  /// Scans a second. Odometry is read twice between two scans.
  double scan_rate = 5.0;
  /// The robot's centre may come no closer to any surface, m.
  double clearance = 0.2;
  /// Time stamp of the first scan, s.
  double start_time = 1000.0;
};

/// A laser scanner.
struct LaserModel {
  /// 180, 181, 360 or 361: old CARMEN messages carry no angles, and readers
  /// take 1 degree a beam for the first two, half a degree for the others.
  int beams = 180;
  /// m; what is farther is no return.
  double maximum_range = 50.0;
  /// What the log has for no return, m.
  double no_return = 81.83;
  /// Standard deviation of a range: noise + noise_per_metre * range, m.
  double noise = 0.01;
  double noise_per_metre = 0.0;
  /// Probability that a beam gets no return.
  double missing = 0.005;
  /// Position of the laser in front of the robot's centre, m.
  double offset = 0.0;
};

/// Drift of wheel odometry. A step of `ds` metres and `dth` radians is measured
/// as
///
///     ds'  = (1 + scale) ds + N(0, noise^2 |ds|)
///     dth' = (1 + turn_scale) dth + heading_bias ds
///            + N(0, heading_noise^2 |ds|) + N(0, turn_noise^2 |dth|)
struct OdometryOptions {
  /// Relative.
  double scale = 0.01;
  double turn_scale = 0.02;
  /// degrees/m.
  double heading_bias_deg = 0.1;
  /// m/sqrt(m).
  double noise = 0.02;
  /// degrees/sqrt(m).
  double heading_noise_deg = 0.8;
  /// degrees/sqrt(degree).
  double turn_noise_deg = 0.2;
};

/// All of it.
struct SimulatorOptions {
  DriveOptions drive;
  LaserModel laser;
  OdometryOptions odometry;
  /// Called after every scan with the share of the way that is done; false
  /// ends the simulation there. May be empty.
  std::function<bool(double)> progress;
};

/// A moment of the drive.
struct SimulatedState {
  /// s.
  double time = 0.0;
  /// Of the robot, in the world and by odometry (m, rad). The first are equal.
  Pose2 pose = Pose2::Zero();
  Pose2 odometry = Pose2::Zero();
  /// Forward and turning velocity, m/s, rad/s.
  double speed = 0.0;
  double turn_rate = 0.0;
  /// m a beam, from -90 degrees on; empty where no scan was taken.
  std::vector<double> ranges;
};

/// What a drive through a world gives.
struct Simulation {
  WorldSurfaces surfaces;
  /// For every face the parts of it that beams hit, as distances (m) from its
  /// begin; hits less than 0.25 m apart are joined, lone hits are left out.
  std::vector<std::vector<std::pair<double, double>>> seen;
  /// Closed spaces and the doors between them.
  std::vector<Polygon> rooms;
  std::vector<TrueDoor> doors;
  /// In the order of time; scans and readings of odometry.
  std::vector<SimulatedState> states;
};

/// Follows the path: a point ahead on it is pursued, with turns on the spot
/// where it is far off the heading. States are 1 / (4 scan_rate) apart, without
/// odometry and ranges. Throws Error when there are fewer than two way points
/// or when the robot would come closer to a surface than the clearance.
std::vector<SimulatedState> Drive(const World& world,
                                  const DriveOptions& options,
                                  std::uint64_t seed);

/// Exact distances from a laser at `laser` (m, rad) to the nearest surface in
/// `count` directions, the first at `start_angle` and then `angle_step` apart
/// (rad, in the laser's frame). Infinite where there is nothing within
/// `maximum_range`. `hits`, when not null, gets the index of the face that each
/// beam hit (-1: none or a circle) and where on it (m from its begin).
std::vector<double> CastBeams(const WorldSurfaces& surfaces, const Pose2& laser,
                              double start_angle, double angle_step, int count,
                              double maximum_range,
                              std::vector<std::pair<int, double>>* hits);

/// Drives, measures and remembers what was seen. The drive, the laser's noise
/// and the odometry's draw from streams of their own, all from `seed`. Throws
/// Error on options out of range and as Drive.
Simulation Simulate(const World& world, const SimulatorOptions& options,
                    std::uint64_t seed);

/// Writes a CARMEN text log: `comments` as # lines, PARAM lines (maximum range
/// and offset of the laser), ODOM and FLASER lines. Ranges have 2 digits after
/// the point, poses and time stamps 6.
void WriteCarmenLog(const Simulation& simulation, const LaserModel& laser,
                    const std::vector<std::string>& comments,
                    std::ostream& output);

/// Whether a range, as WriteCarmenLog rounds it, is a return for who reads
/// CARMEN logs: there readings a little below the maximum range are none, and
/// what other formats say is no different.
bool IsReturn(double range, const LaserModel& laser);

/// Writes the scans as CSV (frontend/csv_reader.h) with the same digits; what
/// is no return is an empty cell.
void WriteCsvLog(const Simulation& simulation, const LaserModel& laser,
                 const std::vector<std::string>& comments,
                 std::ostream& output);

/// Writes the truth as JSON (m, rad, s; format "plumbline-truth", version 1):
///
///     orientations_deg: directions of walls, (-90, 90]
///     walls: id, x1, y1, x2, y2, orientation (index, or -1 for clutter),
///            seen (intervals [begin, end] in m from (x1, y1))
///     circles: id, x, y, r, begin_deg, sweep_deg (360 but for curved walls)
///     rooms: id, outline (rings of [x, y]: the shell against the clock, then
///            holes), between the faces of the walls
///     doors: x1, y1, x2, y2 (jambs), thickness, shut
///     poses: [t, x, y, theta] of the robot at every scan
void WriteTruth(const Simulation& simulation, std::ostream& output);

/// Writes exact displacements `t1 t2 x y z roll pitch yaw` between key scans,
/// which are at least 1 m or 45 degrees apart: from each to the next, and as
/// many between key scans drawn at random (from `seed`).
void WriteRelations(const Simulation& simulation, std::uint64_t seed,
                    std::ostream& output);

/// `text` as a gzip file without name and time. Throws Error when zlib fails.
std::string GzipCompress(const std::string& text);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_SIMULATION_SIMULATOR_H_
