#ifndef PLUMBLINE_FACTORS_INFORMATION_H_
#define PLUMBLINE_FACTORS_INFORMATION_H_

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/Householder>
#include <cmath>
#include <stdexcept>

namespace plumbline {

/// Bound of rounding errors in information matrices: asymmetry, and
/// eigenvalues below zero, after the matrix has been scaled to a unit diagonal.
/// The scaling makes the judgement independent of units (metres and radians in
/// one matrix).
constexpr double kInformationTolerance = 1e-8;

/// Scaled eigenvalues up to this count as zero: the direction is unobserved.
constexpr double kInformationRankTolerance = 1e-10;

namespace internal {

template <typename Derived>
using SquareMatrix =
    Eigen::Matrix<double, Derived::RowsAtCompileTime,
                  Derived::RowsAtCompileTime, 0, Derived::MaxRowsAtCompileTime,
                  Derived::MaxRowsAtCompileTime>;

template <typename Derived>
using ColumnVector = Eigen::Matrix<double, Derived::RowsAtCompileTime, 1, 0,
                                   Derived::MaxRowsAtCompileTime, 1>;

// Square, not empty, finite, symmetric, no negative diagonal element, and no
// element larger than its diagonal elements allow.
template <typename Derived>
bool IsSymmetricInformation(const Eigen::MatrixBase<Derived>& matrix) {
  if (matrix.rows() != matrix.cols() || matrix.rows() == 0) return false;
  if (!matrix.allFinite()) return false;
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    if (matrix(i, i) < 0.0) return false;
    for (Eigen::Index j = 0; j < i; ++j) {
      const double bound = std::sqrt(matrix(i, i)) * std::sqrt(matrix(j, j));
      if (std::abs(matrix(i, j) - matrix(j, i)) > kInformationTolerance * bound)
        return false;
      if (std::abs(matrix(i, j)) > (1.0 + kInformationTolerance) * bound)
        return false;
    }
  }
  return true;
}

// The diagonal matrix S (as a vector) that makes inverse(S) matrix inverse(S)
// of unit diagonal; rows without information get the scale 1.
template <typename Derived>
ColumnVector<Derived> InformationScale(
    const Eigen::MatrixBase<Derived>& matrix) {
  ColumnVector<Derived> scale(matrix.rows());
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    scale[i] = matrix(i, i) > 0.0 ? std::sqrt(matrix(i, i)) : 1.0;
  }
  return scale;
}

// Eigen decomposition of the scaled matrix.
template <typename Derived>
Eigen::SelfAdjointEigenSolver<SquareMatrix<Derived>> ScaledEigenSolver(
    const Eigen::MatrixBase<Derived>& matrix,
    const ColumnVector<Derived>& scale) {
  SquareMatrix<Derived> scaled = matrix;
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    for (Eigen::Index j = 0; j < matrix.cols(); ++j) {
      scaled(i, j) = matrix(i, j) / scale[i] / scale[j];
    }
  }
  return Eigen::SelfAdjointEigenSolver<SquareMatrix<Derived>>(scaled);
}

// Turns a square matrix into the upper triangular one with the same square, by
// Householder reflections; what is below the diagonal is left over. As
// Eigen::HouseholderQR for sizes below its block size of 48, without the code
// for larger ones, which takes seconds to compile.
template <typename Matrix>
void MakeTriangular(Matrix* matrix) {
  const Eigen::Index size = matrix->rows();
  auto block = matrix->block(0, 0, size, size);
  Eigen::Matrix<double, 1, Matrix::ColsAtCompileTime, Eigen::RowMajor, 1,
                Matrix::MaxColsAtCompileTime>
      workspace(size);
  for (Eigen::Index k = 0; k < size; ++k) {
    double tau;
    double beta;
    block.col(k).tail(size - k).makeHouseholderInPlace(tau, beta);
    block(k, k) = beta;
    block.bottomRightCorner(size - k, size - k - 1)
        .applyHouseholderOnTheLeft(block.col(k).tail(size - k - 1), tau,
                                   workspace.data() + k + 1);
  }
}

// Square root of a positive definite matrix of a size known at run time, where
// it is one of the usual ones: without the room that such matrices ask for.
// False for all others.
template <int kSize, typename Matrix>
bool SqrtOfSize(const Matrix& information, Matrix* root) {
  using Fixed = Eigen::Matrix<double, kSize, kSize>;
  const Fixed fixed = information;
  if (!IsSymmetricInformation(fixed)) return false;
  const Eigen::LLT<Fixed> llt(fixed);
  if (llt.info() != Eigen::Success) return false;
  *root = llt.matrixU();
  return true;
}

template <typename Matrix>
bool UsualSqrtInformation(const Matrix& information, Matrix* root) {
  if constexpr (Matrix::SizeAtCompileTime == Eigen::Dynamic) {
    if (information.rows() != information.cols()) return false;
    switch (information.rows()) {
      case 1:
        return SqrtOfSize<1>(information, root);
      case 2:
        return SqrtOfSize<2>(information, root);
      case 3:
        return SqrtOfSize<3>(information, root);
    }
  }
  return false;
}

[[noreturn]] inline void ThrowInvalidInformation() {
  throw std::invalid_argument(
      "information matrix: expected a finite, symmetric, positive "
      "semidefinite matrix");
}

}  // namespace internal

/// True when the matrix can be an information matrix (or a covariance): square,
/// not empty, finite, symmetric and positive semidefinite, up to
/// kInformationTolerance. Zero is an information matrix.
template <typename Derived>
bool IsValidInformation(const Eigen::MatrixBase<Derived>& expression) {
  const auto& matrix = expression.eval();
  // Most are positive definite, which costs least to show.
  internal::SquareMatrix<Derived> root;
  if (internal::UsualSqrtInformation(matrix, &root)) return true;
  if (!internal::IsSymmetricInformation(matrix)) return false;
  const Eigen::LLT<internal::SquareMatrix<Derived>> llt(matrix);
  if (llt.info() == Eigen::Success) return true;
  const auto solver =
      internal::ScaledEigenSolver(matrix, internal::InformationScale(matrix));
  return solver.info() == Eigen::Success &&
         solver.eigenvalues()[0] >= -kInformationTolerance;
}

/// The number of directions that an information matrix says something about:
/// the chi-square degrees of freedom of its residual. Does not depend on the
/// units of the rows. Throws std::invalid_argument when the matrix is not a
/// valid information matrix.
template <typename Derived>
int InformationRank(const Eigen::MatrixBase<Derived>& expression) {
  const auto& information = expression.eval();
  if (!internal::IsSymmetricInformation(information)) {
    internal::ThrowInvalidInformation();
  }
  const auto solver = internal::ScaledEigenSolver(
      information, internal::InformationScale(information));
  if (solver.info() != Eigen::Success ||
      solver.eigenvalues()[0] < -kInformationTolerance) {
    internal::ThrowInvalidInformation();
  }
  return static_cast<int>(
      (solver.eigenvalues().array() > kInformationRankTolerance).count());
}

/// Square root of an information matrix: the upper triangular L with
/// L' L = information, so that |L e|^2 = e' information e. The other Cholesky
/// factor, with L L' = information, whitens nothing unless the matrix is
/// diagonal. A semidefinite matrix (a wall says nothing about the way along it)
/// gives a singular L. Fixed-size in, fixed-size out. Throws
/// std::invalid_argument when the matrix is not a valid information matrix.
template <typename Derived>
internal::SquareMatrix<Derived> SqrtInformation(
    const Eigen::MatrixBase<Derived>& expression) {
  using Matrix = internal::SquareMatrix<Derived>;
  const auto& information = expression.eval();
  Matrix definite;
  if (internal::UsualSqrtInformation(information, &definite)) return definite;
  if (!internal::IsSymmetricInformation(information)) {
    internal::ThrowInvalidInformation();
  }
  const Eigen::LLT<Matrix> llt(information);
  if (llt.info() == Eigen::Success) return llt.matrixU();

  const auto scale = internal::InformationScale(information);
  const auto solver = internal::ScaledEigenSolver(information, scale);
  if (solver.info() != Eigen::Success ||
      solver.eigenvalues()[0] < -kInformationTolerance) {
    internal::ThrowInvalidInformation();
  }
  // With the scaled matrix V D V' and B = sqrt(D) V', B' B is the matrix; the
  // triangular factor of B has the same square.
  Matrix root = solver.eigenvectors().transpose();
  for (Eigen::Index i = 0; i < root.rows(); ++i) {
    const double value = solver.eigenvalues()[i];
    root.row(i) *= value > kInformationRankTolerance ? std::sqrt(value) : 0.0;
  }
  internal::MakeTriangular(&root);
  Matrix factor = root.template triangularView<Eigen::Upper>();
  factor *= scale.asDiagonal();
  for (Eigen::Index i = 0; i < factor.rows(); ++i) {
    if (factor(i, i) < 0.0) factor.row(i) = -factor.row(i);
  }
  return factor;
}

/// Square root of the inverse of a covariance: the upper triangular L with
/// L' L = inverse(covariance), without forming the inverse. Throws
/// std::invalid_argument unless the covariance is finite, symmetric and
/// positive definite.
template <typename Derived>
internal::SquareMatrix<Derived> SqrtInformationFromCovariance(
    const Eigen::MatrixBase<Derived>& expression) {
  using Matrix = internal::SquareMatrix<Derived>;
  const auto& covariance = expression.eval();
  if (internal::IsSymmetricInformation(covariance)) {
    // With rows and columns in reverse order, the lower factor of the reversed
    // matrix is an upper U with U U' = covariance; L is its inverse.
    const Eigen::LLT<Matrix> llt(covariance.reverse());
    if (llt.info() == Eigen::Success) {
      const Matrix lower = llt.matrixL();
      const Matrix upper = lower.reverse();
      const Matrix root = upper.template triangularView<Eigen::Upper>().solve(
          Matrix::Identity(covariance.rows(), covariance.cols()));
      if (root.allFinite()) return root;
    }
  }
  throw std::invalid_argument(
      "covariance: expected a finite, symmetric, positive definite matrix");
}

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_INFORMATION_H_
