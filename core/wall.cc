#include <plumbline/core/registry.h>
#include <plumbline/core/wall.h>

#include <cmath>

namespace plumbline {

Eigen::Vector2d FootPoint(const Eigen::Vector2d& anchor, double d,
                          double alpha) {
  return {anchor.x() - d * std::sin(alpha), anchor.y() + d * std::cos(alpha)};
}

Wall MakeWall(const Eigen::Vector2d& position, double angle, double begin,
              double end) {
  return {position, angle, {std::cos(angle), std::sin(angle)}, begin, end};
}

Wall MakeWall(const Pose2& pose, double begin, double end) {
  return MakeWall(Eigen::Vector2d(pose.head<2>()), pose[2], begin, end);
}

std::optional<Wall> WallOf(const Feature& feature) {
  if (!feature.type->Is(FeatureRole::kWall)) return std::nullopt;
  return MakeWall(feature.type->frame(feature), feature.extent_begin,
                  feature.extent_end);
}

}  // namespace plumbline
