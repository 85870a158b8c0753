#ifndef PLUMBLINE_FACTORS_PLANAR_NORM_H_
#define PLUMBLINE_FACTORS_PLANAR_NORM_H_

#include <ceres/jet.h>

#include <cmath>
#include <limits>

namespace plumbline {

/// Euclidean length of (dx, dy) for use inside automatically differentiated
/// residuals. At zero length, where the gradient does not exist, it is taken as
/// (1, 0): one of the subgradients' unit vectors, so that it is finite and a
/// solver can leave the state, which a zero gradient would not let it do.
template <typename T>
T PlanarNorm(const T& dx, const T& dy) {
  using std::sqrt;
  const T squared = dx * dx + dy * dy;
  // Below this the square has underflowed; the length is zero for any purpose.
  if (squared < T(std::numeric_limits<double>::min())) return dx;
  return sqrt(squared);
}

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_PLANAR_NORM_H_
