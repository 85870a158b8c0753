#ifndef PLUMBLINE_FRONTEND_CSV_READER_H_
#define PLUMBLINE_FRONTEND_CSV_READER_H_

#include <plumbline/frontend/input_stream.h>
#include <plumbline/frontend/log_reader.h>
#include <plumbline/frontend/scan.h>

#include <string_view>

namespace plumbline {

/// Reads scans from a table of comma-separated values: a line that names the
/// columns, then a line per scan. Columns, in any order:
///
///   time                         s
///   r0, r1, r2, ...              ranges, m; as many as the laser has beams
///   start_angle, angle_step      direction of r0 in the laser's frame and the
///                                step to the next beam, rad, positive
///                                counterclockwise; needed unless LaserOptions
///                                have them
///   x, y, theta                  odometry, m and rad: all of them, or none
///   laser_x, laser_y, laser_theta
///                                pose of the laser in the robot's frame, m and
///                                rad; 0 where they are missing
///   max_range                    readings from here on are no return, m; 80
///                                where it is missing
///
/// Other columns are not used, and Log::notes says so. A range that is an empty
/// cell, nan, inf, NA, none, null (in any case), zero or negative is no return.
/// Cells may be in quotes: separators in them separate nothing, quotes in them
/// are doubled, and they end with the line. Lines that begin with # are
/// comments. A line with another number of cells than the first, with a range
/// that is any other text, or with a time, angle or pose that is not a finite
/// number or absurd, is passed over and counted in Log::skipped. Throws Error
/// when a column is missing or named twice, or there is no scan.
Log ReadCsvLog(InputStream* input, const LaserOptions& options);

/// Whether a line that names such columns begins the text, after comments.
bool LooksLikeCsvLog(std::string_view prefix);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_CSV_READER_H_
