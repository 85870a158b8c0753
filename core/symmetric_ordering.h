#ifndef PLUMBLINE_CORE_SYMMETRIC_ORDERING_H_
#define PLUMBLINE_CORE_SYMMETRIC_ORDERING_H_

#include <Eigen/OrderingMethods>
#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>

namespace plumbline {

/// The order of elimination of Eigen::AMDOrdering, for its decompositions of
/// symmetric matrices. These give it the whole matrix, which it would take for
/// any matrix, and add to its transpose: most of the time that it takes.
struct SymmetricOrdering {
  /// As Eigen asks for it.
  using PermutationType = Eigen::AMDOrdering<int>::PermutationType;

  /// `matrix`: n x n, symmetric. The order is written to `permutation`.
  template <typename Matrix>
  void operator()(const Matrix& matrix, PermutationType& permutation) const {
    Eigen::AMDOrdering<int>()(matrix.template selfadjointView<Eigen::Lower>(),
                              permutation);
  }
};

/// LDL' of a matrix of which the lower triangle is given.
template <typename Scalar>
using SymmetricFactor = Eigen::SimplicialLDLT<Eigen::SparseMatrix<Scalar>,
                                              Eigen::Lower, SymmetricOrdering>;

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_SYMMETRIC_ORDERING_H_
