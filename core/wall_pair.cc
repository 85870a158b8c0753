#include <plumbline/core/wall_pair.h>

#include <algorithm>

namespace plumbline {

Pose2 MiddleOfCommonPart(const Wall& first, const Wall& second) {
  const Interval other = first.IntervalOf(second);
  const Eigen::Vector2d point =
      first.At(0.5 * (std::max(first.begin, other.first) +
                      std::min(first.end, other.second)));
  return Pose2(point.x(), point.y(), first.angle);
}

}  // namespace plumbline
