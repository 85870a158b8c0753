#ifndef PLUMBLINE_FACTORS_SOLVE_SYMMETRIC_H_
#define PLUMBLINE_FACTORS_SOLVE_SYMMETRIC_H_

#include <Eigen/Core>
#include <cmath>
#include <limits>
#include <utility>

namespace plumbline {

/// x with A x = b for a symmetric positive definite 3 x 3 matrix, of which the
/// lower triangle is read: `matrix.ldlt().solve(right)`, the same numbers to
/// the last bit where nothing is contracted, in a fifth of the time. What is
/// zero on the diagonal of the decomposition gives a zero.
inline Eigen::Vector3d SolveSymmetric(const Eigen::Matrix3d& matrix,
                                      const Eigen::Vector3d& right) {
  double d0 = matrix(0, 0), d1 = matrix(1, 1), d2 = matrix(2, 2);
  double l10 = matrix(1, 0), l20 = matrix(2, 0), l21 = matrix(2, 1);
  double x0 = right[0], x1 = right[1], x2 = right[2];
  // The largest of the diagonal comes first, then the larger one of the rest as
  // it stood.
  int first = std::abs(d1) > std::abs(d0) ? 1 : 0;
  if (std::abs(d2) > std::abs(first == 1 ? d1 : d0)) first = 2;
  if (first == 1) {
    std::swap(d0, d1);
    std::swap(l20, l21);
    std::swap(x0, x1);
  } else if (first == 2) {
    std::swap(d0, d2);
    std::swap(l10, l21);
    std::swap(x0, x2);
  }
  if (d0 != 0.0) {
    l10 /= d0;
    l20 /= d0;
  }
  const bool is_swapped = std::abs(d2) > std::abs(d1);
  if (is_swapped) {
    std::swap(l10, l20);
    std::swap(d1, d2);
    std::swap(x1, x2);
  }
  const double scaled = d0 * l10;
  d1 -= l10 * scaled;
  l21 -= l20 * scaled;
  if (d1 != 0.0) l21 /= d1;
  d2 -= l20 * (d0 * l20) + l21 * (d1 * l21);
  // Down, by the diagonal, and up.
  x1 -= l10 * x0;
  x2 -= l20 * x0 + l21 * x1;
  constexpr double kLeast = std::numeric_limits<double>::min();
  x0 = std::abs(d0) > kLeast ? x0 / d0 : 0.0;
  x1 = std::abs(d1) > kLeast ? x1 / d1 : 0.0;
  x2 = std::abs(d2) > kLeast ? x2 / d2 : 0.0;
  x1 -= l21 * x2;
  x0 -= l10 * x1 + l20 * x2;
  if (is_swapped) std::swap(x1, x2);
  if (first == 1) {
    std::swap(x0, x1);
  } else if (first == 2) {
    std::swap(x0, x2);
  }
  return {x0, x1, x2};
}

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_SOLVE_SYMMETRIC_H_
