#include <plumbline/frontend/beam_directions.h>

#include <cmath>
#include <limits>

namespace plumbline {

const std::vector<Eigen::Vector2d>& BeamDirections::Of(const Scan& scan) {
  if (!scan.bearings.empty()) {
    directions_.resize(scan.ranges.size());
    for (std::size_t i = 0; i < directions_.size(); ++i) {
      const double bearing = scan.Bearing(i);
      directions_[i] = {std::cos(bearing), std::sin(bearing)};
    }
    // No other scan has these.
    angle_step_ = 0.0;
    start_angle_ = std::numeric_limits<double>::quiet_NaN();
    return directions_;
  }
  if (scan.ranges.size() == directions_.size() &&
      scan.start_angle == start_angle_ && scan.angle_step == angle_step_) {
    return directions_;
  }
  start_angle_ = scan.start_angle;
  angle_step_ = scan.angle_step;
  directions_.resize(scan.ranges.size());
  for (std::size_t i = 0; i < directions_.size(); ++i) {
    const double angle = start_angle_ + static_cast<double>(i) * angle_step_;
    directions_[i] = {std::cos(angle), std::sin(angle)};
  }
  return directions_;
}

}  // namespace plumbline
