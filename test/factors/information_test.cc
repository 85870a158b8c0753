#include <gtest/gtest.h>
#include <plumbline/factors/information.h>

#include <Eigen/Core>
#include <Eigen/LU>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "factors/factors_test_util.h"

namespace plumbline {
namespace {

using testing::Random;

// Sizes are known at run time wherever a test does not ask for another: the
// decompositions of each fixed size take seconds to compile.
using Matrix = Eigen::MatrixXd;

void ExpectUpperRoot(const Matrix& information, double tolerance = 1e-12) {
  const Matrix root = SqrtInformation(information);
  EXPECT_LT((root.transpose().lazyProduct(root) - information).norm(),
            tolerance * (1.0 + information.norm()))
      << root;
  for (Eigen::Index i = 0; i < root.rows(); ++i) {
    EXPECT_GE(root(i, i), 0.0);
    for (Eigen::Index j = 0; j < i; ++j) EXPECT_EQ(root(i, j), 0.0);
  }
}

TEST(SqrtInformationTest, FullMatrixByHand) {
  // [4 2; 2 5] = L' L with L = [2 1; 0 2].
  Matrix information(2, 2);
  information << 4.0, 2.0, 2.0, 5.0;
  const Matrix root = SqrtInformation(information);
  EXPECT_DOUBLE_EQ(root(0, 0), 2.0);
  EXPECT_DOUBLE_EQ(root(0, 1), 1.0);
  EXPECT_EQ(root(1, 0), 0.0);
  EXPECT_DOUBLE_EQ(root(1, 1), 2.0);

  // e' information e = 4 + 8 + 20 = 32 for e = (1, 2); the lower factor, an
  // easy mistake, gives |(2, 5)|^2 = 29.
  const Eigen::Vector2d error(1.0, 2.0);
  EXPECT_DOUBLE_EQ((root * error).squaredNorm(), 32.0);
  EXPECT_DOUBLE_EQ((root.transpose() * error).squaredNorm(), 29.0);
}

TEST(SqrtInformationTest, ThreeByThreeKeepsTheQuadraticForm) {
  Matrix information(3, 3);
  information << 4.0, 1.0, 0.5,  //
      1.0, 3.0, -0.5,            //
      0.5, -0.5, 2.0;
  const Eigen::Vector3d error(1.0, 2.0, -1.0);
  // 4 + 12 + 2 + 2 (1*2*1 + 1*(-1)*0.5 + 2*(-1)*(-0.5)) = 18 + 2 * 2.5 = 23.
  EXPECT_NEAR((SqrtInformation(information) * error).squaredNorm(), 23.0,
              1e-12);
  EXPECT_GT(
      std::abs(
          (SqrtInformation(information).transpose() * error).squaredNorm() -
          23.0),
      0.5);
  ExpectUpperRoot(information);
}

TEST(SqrtInformationTest, FixedSizeAndExpression) {
  using Scalar = Eigen::Matrix<double, 1, 1>;
  const Scalar scalar(9.0);
  const Scalar root = SqrtInformation(scalar);
  EXPECT_DOUBLE_EQ(root(0, 0), 3.0);
  EXPECT_DOUBLE_EQ(SqrtInformation(4.0 * scalar)(0, 0), 6.0);
  Eigen::Matrix2d covariance;
  covariance << 5.0, 0.5, 0.5, 0.25;
  const Eigen::Matrix2d of_covariance =
      SqrtInformationFromCovariance(covariance);
  EXPECT_EQ(Matrix(of_covariance),
            SqrtInformationFromCovariance(Matrix(covariance)));
}

TEST(SqrtInformationTest, RandomMatricesOfAllRanks) {
  Random random(31);
  for (int size = 1; size <= 6; ++size) {
    for (int rank = 0; rank <= size; ++rank) {
      Matrix rows(rank, size);
      for (int i = 0; i < rank; ++i) {
        for (int j = 0; j < size; ++j) rows(i, j) = random.Uniform(-2.0, 2.0);
      }
      const Matrix information = rows.transpose().lazyProduct(rows);
      EXPECT_TRUE(IsValidInformation(information));
      EXPECT_EQ(InformationRank(information), rank);
      ExpectUpperRoot(information, 1e-9);
    }
  }
}

TEST(SqrtInformationTest, WallSaysNothingAlongIt) {
  // Information 100 across a wall at 30 degrees, none along it.
  const Eigen::Vector2d normal(-0.5, std::sqrt(0.75));
  const Matrix information = 100.0 * normal * normal.transpose();
  EXPECT_EQ(InformationRank(information), 1);
  const Matrix root = SqrtInformation(information);
  EXPECT_NEAR((root * normal).norm(), 10.0, 1e-6);
  EXPECT_NEAR((root * Eigen::Vector2d(std::sqrt(0.75), 0.5)).norm(), 0.0, 1e-6);
}

TEST(SqrtInformationTest, ZeroIsValid) {
  EXPECT_TRUE(IsValidInformation(Matrix::Zero(3, 3)));
  EXPECT_EQ(InformationRank(Matrix::Zero(3, 3)), 0);
  EXPECT_EQ(SqrtInformation(Matrix::Zero(3, 3)), Matrix::Zero(3, 3));
}

TEST(SqrtInformationTest, RankDoesNotDependOnUnits) {
  Matrix information = Matrix::Zero(3, 3);
  information.diagonal() << 1e-9, 1e9, 1.0;
  EXPECT_EQ(InformationRank(information), 3);
  ExpectUpperRoot(information);
  information(2, 2) = 0.0;
  EXPECT_EQ(InformationRank(information), 2);
  const Matrix root = SqrtInformation(information);
  EXPECT_NEAR(root(0, 0), std::sqrt(1e-9), 1e-15);
  EXPECT_NEAR(root(1, 1), std::sqrt(1e9), 1e-6);
  EXPECT_EQ(root(2, 2), 0.0);
}

TEST(SqrtInformationTest, RefusesWhatIsNoInformation) {
  Matrix asymmetric(2, 2);
  asymmetric << 1.0, 0.5, 0.0, 1.0;
  Matrix indefinite(2, 2);
  indefinite << 1.0, 2.0, 2.0, 1.0;
  Matrix negative(2, 2);
  negative << 1.0, 0.0, 0.0, -1e-3;
  Matrix off_zero(2, 2);
  off_zero << 0.0, 0.1, 0.1, 1.0;
  Matrix nan = Matrix::Identity(2, 2);
  nan(1, 1) = std::numeric_limits<double>::quiet_NaN();
  Matrix infinite = Matrix::Identity(2, 2);
  infinite(0, 0) = std::numeric_limits<double>::infinity();
  for (const Matrix& matrix :
       {asymmetric, indefinite, negative, off_zero, nan, infinite}) {
    EXPECT_FALSE(IsValidInformation(matrix)) << matrix;
    EXPECT_THROW(SqrtInformation(matrix), std::invalid_argument) << matrix;
    EXPECT_THROW(InformationRank(matrix), std::invalid_argument) << matrix;
    EXPECT_THROW(SqrtInformationFromCovariance(matrix), std::invalid_argument)
        << matrix;
  }
  // Every pair is possible, all three together are not.
  Matrix triple(3, 3);
  triple << 1.0, 0.9, 0.9,  //
      0.9, 1.0, -0.9,       //
      0.9, -0.9, 1.0;
  EXPECT_FALSE(IsValidInformation(triple));
  EXPECT_THROW(SqrtInformation(triple), std::invalid_argument);

  EXPECT_FALSE(IsValidInformation(Matrix::Identity(2, 3)));
  EXPECT_FALSE(IsValidInformation(Matrix(0, 0)));
  EXPECT_THROW(SqrtInformation(Matrix(Matrix::Identity(2, 3))),
               std::invalid_argument);
}

TEST(SqrtInformationTest, ToleratesRounding) {
  Matrix information(2, 2);
  information << 4.0, 2.0 + 1e-12, 2.0, 5.0;
  EXPECT_TRUE(IsValidInformation(information));
  // Singular, and by a rounding error indefinite.
  Matrix singular(2, 2);
  singular << 1.0, 1.0 + 1e-13, 1.0 + 1e-13, 1.0;
  EXPECT_TRUE(IsValidInformation(singular));
  EXPECT_EQ(InformationRank(singular), 1);
  ExpectUpperRoot(singular, 1e-9);
}

TEST(SqrtInformationFromCovarianceTest, ByHand) {
  // covariance = U U' with U = [2 1; 0 0.5], so L = inverse(U) = [0.5 -1; 0 2].
  Matrix covariance(2, 2);
  covariance << 5.0, 0.5, 0.5, 0.25;
  const Matrix root = SqrtInformationFromCovariance(covariance);
  EXPECT_NEAR(root(0, 0), 0.5, 1e-14);
  EXPECT_NEAR(root(0, 1), -1.0, 1e-14);
  EXPECT_EQ(root(1, 0), 0.0);
  EXPECT_NEAR(root(1, 1), 2.0, 1e-14);
}

TEST(SqrtInformationFromCovarianceTest, AgreesWithTheInverse) {
  Random random(32);
  for (int size = 1; size <= 6; ++size) {
    Matrix rows(size, size);
    for (int i = 0; i < size; ++i) {
      for (int j = 0; j < size; ++j) rows(i, j) = random.Uniform(-2.0, 2.0);
    }
    const Matrix covariance =
        rows.transpose().lazyProduct(rows) + 0.1 * Matrix::Identity(size, size);
    const Matrix root = SqrtInformationFromCovariance(covariance);
    EXPECT_LT(
        (root.transpose() * root * covariance - Matrix::Identity(size, size))
            .norm(),
        1e-11);
    EXPECT_LT((root - SqrtInformation(covariance.inverse().eval())).norm(),
              1e-9);
  }
}

TEST(SqrtInformationFromCovarianceTest, RefusesSingularCovariance) {
  EXPECT_THROW(SqrtInformationFromCovariance(Matrix::Zero(2, 2)),
               std::invalid_argument);
  EXPECT_THROW(SqrtInformationFromCovariance(Matrix::Ones(2, 2)),
               std::invalid_argument);
}

}  // namespace
}  // namespace plumbline
