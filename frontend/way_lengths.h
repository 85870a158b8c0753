#ifndef PLUMBLINE_FRONTEND_WAY_LENGTHS_H_
#define PLUMBLINE_FRONTEND_WAY_LENGTHS_H_

#include <plumbline/factors/pose2.h>

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <vector>

namespace plumbline {

/// Length of the way from the first pose to each, m. A step counts as no more
/// than `longest_step`, m: where the robot was lost the trajectory may jump.
inline std::vector<double> WayLengths(const std::vector<Pose2>& poses,
                                      double longest_step) {
  std::vector<double> lengths(poses.size(), 0.0);
  for (std::size_t k = 1; k < poses.size(); ++k) {
    lengths[k] =
        lengths[k - 1] +
        std::min(longest_step, (poses[k] - poses[k - 1]).head<2>().norm());
  }
  return lengths;
}

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_WAY_LENGTHS_H_
