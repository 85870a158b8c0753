#ifndef PLUMBLINE_CORE_INFORMATION_FACTOR_H_
#define PLUMBLINE_CORE_INFORMATION_FACTOR_H_

#include <plumbline/core/symmetric_ordering.h>

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <vector>

namespace plumbline {

/// Neighbouring rows of an information matrix: the variables of one feature.
struct InformationRows {
  int begin = 0;
  int count = 0;
};

/// A sparse information matrix, factorized so that parts of its inverse, the
/// covariance, can be asked for. Directions of which it says nothing get a
/// prior of their own.
class InformationFactor {
 public:
  /// Factorizes a matrix of which the lower triangle is given. Where the pivots
  /// are what rounding leaves, nothing is known: there the diagonal is raised
  /// by a prior of this variance, or a smaller one where that would be lost in
  /// rounding. Throws Error when the matrix cannot be factorized with priors
  /// either.
  void Factorize(Eigen::SparseMatrix<double> information,
                 double prior_variance);

  /// Rows of the matrix; 0 before Factorize.
  int size() const { return size_; }

  /// The inverse times `right` (size x any), which is zero but in the rows of
  /// `sources`; the product is right in the rows of `sources` and `wanted`
  /// only. What is zero, and what nobody wants, is not computed: substitution
  /// goes up the elimination tree from the sources and comes down to what is
  /// wanted, which in a thin graph is a small part of the factor. For dynamic
  /// and for three columns.
  template <typename Right>
  Right SolveAt(const Right& right, const std::vector<InformationRows>& sources,
                const std::vector<InformationRows>& wanted) const;

  /// The blocks of the inverse on the diagonal in these rows, for many at the
  /// cost of one pass over the factor. The rows of a block must be coupled with
  /// each other in the matrix, zeros included.
  std::vector<Eigen::MatrixXd> InverseBlocks(
      const std::vector<InformationRows>& blocks) const;

 private:
  // Entries of the inverse at the places where the factor has entries: below
  // the diagonal in the pattern of L, and the diagonal.
  struct InverseOnPattern {
    std::vector<double> below;
    Eigen::VectorXd diagonal;
  };
  InverseOnPattern InvertOnPattern() const;

  int size_ = 0;
  SymmetricFactor<double> ldlt_;
};

extern template Eigen::MatrixXd InformationFactor::SolveAt(
    const Eigen::MatrixXd&, const std::vector<InformationRows>&,
    const std::vector<InformationRows>&) const;
extern template Eigen::Matrix<double, Eigen::Dynamic, 3>
InformationFactor::SolveAt(const Eigen::Matrix<double, Eigen::Dynamic, 3>&,
                           const std::vector<InformationRows>&,
                           const std::vector<InformationRows>&) const;

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_INFORMATION_FACTOR_H_
