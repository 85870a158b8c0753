#ifndef PLUMBLINE_FRONTEND_KEY_VIEWS_H_
#define PLUMBLINE_FRONTEND_KEY_VIEWS_H_

#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/scan.h>
#include <plumbline/frontend/scan_matcher.h>
#include <plumbline/frontend/scan_points.h>

#include <Eigen/Core>
#include <cstddef>
#include <vector>

namespace plumbline {

/// What a key scan saw, and from where.
struct KeyView {
  /// Of the robot, in the frame of the map that the scan is in.
  Pose2 pose = Pose2::Zero();
  /// Position of the laser in the robot's frame, m.
  Eigen::Vector2d laser = Eigen::Vector2d::Zero();
  /// Returns in the robot's frame, thinned out.
  std::vector<ScanPoint> points;
};

/// Points of a view lie at least this far apart, m.
constexpr double kViewSpacing = 0.1;

/// The views of scans: `keys` are indices into `scans`, `poses` those of the
/// robot at these. Throws Error when their numbers differ.
std::vector<KeyView> MakeKeyViews(const std::vector<Scan>& scans,
                                  const std::vector<int>& keys,
                                  const std::vector<Pose2>& poses,
                                  const ScanPointsOptions& options);

/// Makes these views what the matcher compares with, in their map's frame.
void SetReference(const std::vector<KeyView>& map, ScanMatcher* matcher);

/// Indices of the views within `radius`, m, of a place, ascending; of more than
/// `most` as many that are spread evenly over them. Cost: linear in the views.
std::vector<std::size_t> ViewsNear(const std::vector<KeyView>& map,
                                   const Pose2& place, double radius,
                                   std::size_t most);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_KEY_VIEWS_H_
