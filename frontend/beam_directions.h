#ifndef PLUMBLINE_FRONTEND_BEAM_DIRECTIONS_H_
#define PLUMBLINE_FRONTEND_BEAM_DIRECTIONS_H_

#include <plumbline/frontend/scan.h>

#include <Eigen/Core>
#include <cstddef>
#include <vector>

namespace plumbline {

/// Directions of the beams of scans. They are computed once for all scans of
/// one laser that come in a row.
class BeamDirections {
 public:
  /// Unit vectors in the laser's frame, one for each range; valid until the
  /// next call.
  const std::vector<Eigen::Vector2d>& Of(const Scan& scan);

 private:
  std::vector<Eigen::Vector2d> directions_;
  double start_angle_ = 0.0;
  double angle_step_ = 0.0;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_BEAM_DIRECTIONS_H_
