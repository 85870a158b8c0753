#ifndef PLUMBLINE_FRONTEND_CARMEN_READER_H_
#define PLUMBLINE_FRONTEND_CARMEN_READER_H_

#include <plumbline/frontend/input_stream.h>
#include <plumbline/frontend/log_reader.h>
#include <plumbline/frontend/scan.h>

#include <string>
#include <string_view>

namespace plumbline {

/// Reads a CARMEN log (plain, gzip, bzip2, "-" for standard input) into scans.
///
/// Messages, one per line, `NAME fields... ipc_timestamp ipc_host
/// logger_timestamp` (the ipc_timestamp is the scan's time):
///
///   FLASER n r1..rn x y theta odom_x odom_y odom_theta
///       scan of the front laser: the first pose is the laser's, the second
///       the robot's, both by odometry
///   ROBOTLASER1 type start_angle field_of_view resolution maximum_range
///       accuracy remission_mode n r1..rn m s1..sm laser_pose robot_pose
///       tv rv forward side turn_axis
///       the same with angles (the remissions "m s1..sm" may be missing)
///   RAWLASER1 as ROBOTLASER1 up to the remissions
///       a scan without poses: placed by ODOM
///   RLASER as FLASER
///       scan of the rear laser
///   ODOM x y theta tv rv acceleration
///   PARAM name value
///       laser settings
///   SYNC, TRUEPOS, COMMENT
///       counted only
///
/// A log often holds the same laser in several messages, so one kind gives the
/// scans: the first of FLASER, ROBOTLASER1, RAWLASER1, RLASER that occurs;
/// scans of the others are counted in Log::skipped. Scans keep the order of
/// the lines whatever their time stamps.
///
/// FLASER and RLASER carry no angles. Beams start at -90 degrees, 1 degree
/// apart for 180 and 181 beams and half a degree for 360 and 361. Any other
/// number is spaced by PARAM laser_front_laser_resolution, symmetric to the
/// front, or spread over 180 degrees (an odd number includes both ends).
/// Options that are set win over all of this.
///
/// Readings at or above the laser's maximum range are no return. It is the
/// message's (ROBOTLASER1, RAWLASER1), else PARAM robot_front_laser_max (or
/// robot_rear_laser_max), else 80 m; and lowered to the value at which the
/// log's own readings saturate when they pile up below that (81.8 m and 51 m in
/// well-known logs).
///
/// The laser's place on the robot is the median over the log of the first pose
/// seen from the second. Where that is not fixed (a "corrected" log has other
/// poses in the first place), or 5 m or more from the robot, the first poses
/// are passed over, the place is PARAM robot_frontlaser_offset or zero, and
/// Log::skipped says so: corrected poses are never taken for odometry.
///
/// RAWLASER1 scans get the odometry interpolated by time between the ODOM
/// lines before and after, or the last one when the times do not embrace the
/// scan's. Where those of the other messages come more seldom than scans they
/// are interpolated as well (SpreadSlowOdometry).
///
/// A ROBOTLASER1 or RAWLASER1 whose angular resolution is 0 takes it from its
/// field of view; where that is 0, too, it is a line that cannot be used unless
/// LaserOptions have the step.
///
/// Lines that cannot be used and readings that are no distances (not a number,
/// negative, above 1000 m) are passed over and counted in Log::skipped, as is
/// damage to compressed data. Throws Error when the input cannot be read or
/// holds no scan at all; the message says what was found.
Log ReadCarmenLog(const std::string& path, const LaserOptions& options);

/// Reads a log from an input that is open already (a peek does no harm).
Log ReadCarmenLog(InputStream* input, const LaserOptions& options);

/// Whether text that starts with `prefix` (a few kilobytes are plenty) is a
/// CARMEN log: the first line with a known tag decides.
bool LooksLikeCarmenLog(std::string_view prefix);

/// Whether text that starts with `prefix` is a g2o graph (also one that starts
/// with this project's own tags), likewise.
bool LooksLikeG2o(std::string_view prefix);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_CARMEN_READER_H_
