#include <gtest/gtest.h>
#include <plumbline/factors/solve_symmetric.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <random>

namespace plumbline {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Those that Eigen pivots in every order, with columns of very different size.
TEST(SolveSymmetricTest, IsWhatEigenGives) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 20000; ++i) {
    Matrix3d factor;
    for (int k = 0; k < 9; ++k) {
      factor(k / 3, k % 3) = normal(random) * std::exp(2.0 * normal(random));
    }
    Matrix3d matrix = factor * factor.transpose();
    if (i % 7 == 0) matrix(0, 1) = matrix(1, 0) = 0.0;
    if (i % 11 == 0) matrix(1, 1) = matrix(0, 0);
    const Vector3d right(normal(random), normal(random), normal(random));
    const Vector3d expected = matrix.ldlt().solve(right);
    const Vector3d solved = SolveSymmetric(matrix, right);
    const double size = expected.cwiseAbs().maxCoeff();
    for (int k = 0; k < 3; ++k) {
      // Nothing is asked of compilers that contract products and sums, but that
      // it is as exact.
      ASSERT_NEAR(solved[k], expected[k],
                  1e-9 * size * std::max(1.0, matrix.trace()))
          << matrix;
    }
#if defined(__x86_64__) && !defined(__FMA__)
    ASSERT_EQ(solved, expected) << matrix;
#endif
  }
}

TEST(SolveSymmetricTest, WhatIsNotDeterminedIsZero) {
  EXPECT_EQ(SolveSymmetric(Matrix3d::Zero(), Vector3d::Ones()),
            Vector3d::Zero());
  const Matrix3d flat = Vector3d(0.0, 4.0, 2.0).asDiagonal();
  EXPECT_EQ(SolveSymmetric(flat, Vector3d(1.0, 2.0, 3.0)),
            Vector3d(0.0, 0.5, 1.5));
}

}  // namespace
}  // namespace plumbline
