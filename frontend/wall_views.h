#ifndef PLUMBLINE_FRONTEND_WALL_VIEWS_H_
#define PLUMBLINE_FRONTEND_WALL_VIEWS_H_

#include <plumbline/core/feature.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/scan.h>
#include <plumbline/frontend/scan_points.h>

#include <cstddef>
#include <vector>

namespace plumbline {

/// For each wall (map frame, with its extent) the group of scans with the most
/// returns on it: within `max_offset`, m, across, and between its ends. -1 for
/// one that no return lies on. The smallest group of several equal ones.
/// `poses`: of the scans, map frame; `groups`: of each scan, 0 or more. Cost:
/// linear in the returns. Throws Error when the numbers of scans, poses and
/// groups differ.
std::vector<int> GroupsThatSaw(const std::vector<Feature>& walls,
                               const std::vector<Scan>& scans,
                               const std::vector<Pose2>& poses,
                               const std::vector<int>& groups,
                               const ScanPointsOptions& points,
                               double max_offset);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_WALL_VIEWS_H_
