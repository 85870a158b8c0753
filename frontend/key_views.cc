#include <plumbline/core/error.h>
#include <plumbline/frontend/key_views.h>

#include <string>
#include <utility>

namespace plumbline {

std::vector<KeyView> MakeKeyViews(const std::vector<Scan>& scans,
                                  const std::vector<int>& keys,
                                  const std::vector<Pose2>& poses,
                                  const ScanPointsOptions& options) {
  if (keys.size() != poses.size()) {
    throw PLUMBLINE_ERROR(
        std::to_string(poses.size()) + " poses",
        "one for each of " + std::to_string(keys.size()) + " key scans");
  }
  std::vector<KeyView> views;
  views.reserve(keys.size());
  std::vector<ScanPoint> points;
  for (std::size_t k = 0; k < keys.size(); ++k) {
    const Scan& scan = scans[static_cast<std::size_t>(keys[k])];
    ExtractScanPoints(scan, options, &points);
    KeyView view;
    view.pose = poses[k];
    view.laser = scan.laser_offset.head<2>();
    Eigen::Vector2d last = Eigen::Vector2d::Constant(1e9);
    for (const ScanPoint& point : points) {
      if ((point.position - last).norm() < kViewSpacing) continue;
      last = point.position;
      view.points.push_back(point);
    }
    views.push_back(std::move(view));
  }
  return views;
}

void SetReference(const std::vector<KeyView>& map, ScanMatcher* matcher) {
  std::vector<ScanPoint> points;
  std::vector<Viewpoint> viewpoints;
  for (const KeyView& view : map) {
    const PoseTransform transform(view.pose);
    viewpoints.push_back({transform.Point(view.laser), points.size()});
    for (const ScanPoint& point : view.points) {
      points.push_back(Moved(point, transform));
    }
  }
  matcher->SetReference(std::move(points), std::move(viewpoints));
}

std::vector<std::size_t> ViewsNear(const std::vector<KeyView>& map,
                                   const Pose2& place, double radius,
                                   std::size_t most) {
  std::vector<std::size_t> near;
  for (std::size_t k = 0; k < map.size(); ++k) {
    if ((map[k].pose - place).head<2>().norm() <= radius) {
      near.push_back(k);
    }
  }
  if (near.size() <= most) return near;
  std::vector<std::size_t> spread;
  for (std::size_t i = 0; i < most; ++i) {
    spread.push_back(near[i * near.size() / most]);
  }
  return spread;
}

}  // namespace plumbline
