#ifndef PLUMBLINE_PIPELINE_USABLE_INPUT_H_
#define PLUMBLINE_PIPELINE_USABLE_INPUT_H_

#include <plumbline/frontend/scan.h>
#include <plumbline/pipeline/log_solver.h>

#include <cstddef>
#include <vector>

namespace plumbline {

/// Throws Error when a scan is none that can be solved: odometry, laser_offset,
/// timestamp and angles have to be finite, poses within 1e7 m and rad, the
/// angle_step not 0 where there are two beams or more, each range finite (0
/// where nothing came back), and bearings finite and one per beam, or none.
/// `index`: of the scan in its log, from 0, for the message. The readers of
/// this library make such scans only.
void RequireUsable(const Scan& scan, std::size_t index);

/// The same for each of these scans.
void RequireUsable(const std::vector<Scan>& scans);

/// Throws Error when options are no numbers, or counts below 0.
void RequireUsable(const LogSolverOptions& options);

}  // namespace plumbline

#endif  // PLUMBLINE_PIPELINE_USABLE_INPUT_H_
