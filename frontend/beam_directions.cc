#include <plumbline/frontend/beam_directions.h>

#include <cmath>

namespace plumbline {

const std::vector<Eigen::Vector2d>& BeamDirections::Of(const Scan& scan) {
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
