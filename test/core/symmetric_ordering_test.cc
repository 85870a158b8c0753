#include <gtest/gtest.h>
#include <plumbline/core/symmetric_ordering.h>

#include <Eigen/Core>
#include <algorithm>
#include <random>
#include <vector>

namespace plumbline {
namespace {

// A random symmetric matrix that is positive definite, lower triangle.
Eigen::SparseMatrix<double> RandomMatrix(int size, int seed) {
  std::mt19937 random(seed);
  std::uniform_int_distribution<int> index(0, size - 1);
  std::vector<Eigen::Triplet<double>> entries;
  for (int i = 0; i < size; ++i) entries.emplace_back(i, i, 20.0);
  for (int k = 0; k < 2 * size; ++k) {
    const int a = index(random), b = index(random);
    if (a != b) entries.emplace_back(std::max(a, b), std::min(a, b), 0.1);
  }
  Eigen::SparseMatrix<double> matrix(size, size);
  matrix.setFromTriplets(entries.begin(), entries.end());
  return matrix;
}

// The factors have the same bytes, so that nothing depends on which it is.
TEST(SymmetricOrderingTest, IsThatOfEigen) {
  for (int seed = 1; seed <= 20; ++seed) {
    const Eigen::SparseMatrix<double> matrix = RandomMatrix(10 * seed, seed);
    const SymmetricFactor<double> ours(matrix);
    const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> eigen(matrix);
    ASSERT_EQ(ours.info(), Eigen::Success);
    EXPECT_EQ(ours.permutationP().indices(), eigen.permutationP().indices());
    const Eigen::VectorXd right = Eigen::VectorXd::LinSpaced(10 * seed, -1, 1);
    const Eigen::VectorXd solution = ours.solve(right);
    EXPECT_EQ(solution, eigen.solve(right));
    EXPECT_LT((matrix.selfadjointView<Eigen::Lower>() * solution - right)
                  .lpNorm<Eigen::Infinity>(),
              1e-12);
  }
}

}  // namespace
}  // namespace plumbline
