#ifndef PLUMBLINE_CORE_NORMAL_MATRIX_H_
#define PLUMBLINE_CORE_NORMAL_MATRIX_H_

#include <plumbline/core/flat_problem.h>

#include <Eigen/Core>
#include <memory>
#include <vector>

namespace plumbline {

/// The normal matrix J'J of a FlatProblem and its factorization (CHOLMOD). The
/// pattern, the order of elimination and the symbolic factorization are kept
/// while the variables are the same and each product of Jacobians has a place.
class NormalMatrix {
 public:
  NormalMatrix();
  NormalMatrix(const NormalMatrix&) = delete;
  NormalMatrix& operator=(const NormalMatrix&) = delete;
  ~NormalMatrix();

  /// Whether there is a factorization that may be kept.
  bool is_analysed() const;
  /// Symbolic analyses so far.
  int num_analyses() const { return num_analyses_; }

  /// Looks up where the products of the terms' Jacobians go, after the problem
  /// was read with the same variables; false when there is no place for one.
  bool FindPlaces(const FlatProblem& problem);

  /// Orders the variables, lays out the matrix and analyses it; false when it
  /// is too large.
  bool Analyse(const FlatProblem& problem);

  /// First column of a variable in the tangent space, which has the variables
  /// in the order of elimination.
  int ColumnOf(int variable) const { return column_[variable]; }

  /// Makes all entries zero.
  void SetZero();

  /// Adds the products of a term's Jacobians with respect to tangents, one for
  /// each of its arguments (row by row; none for constant ones), and to the
  /// gradient J'r, which has a number for each column, those with its residual.
  void Add(const FlatProblem& problem, const FlatProblem::Term& term,
           const double* const* jacobians, const double* residual,
           double* gradient);

  /// Exchanges the entries for a second set, which is there to be set to zero
  /// and filled in while the first one may still be needed.
  void SwapEntries() { values_.swap(other_values_); }

  /// An entry of the diagonal.
  double Diagonal(int column) const { return values_[diagonal_[column]]; }

  /// Solves (S J'J S + D) y = right with the diagonal matrices S of `scale` and
  /// D of `damping`; false when that matrix cannot be factorized.
  bool SolveDamped(const Eigen::VectorXd& scale, const Eigen::VectorXd& damping,
                   const Eigen::VectorXd& right, Eigen::VectorXd* y);

  /// Solves with the last factorization, of whatever entries it was.
  bool SolveAgain(const Eigen::VectorXd& right, Eigen::VectorXd* y);

  /// The least pivot of the last factorization over the largest.
  double LeastPivot();

 private:
  struct Factorization;

  // Where the product of two variables' Jacobians goes in the values.
  struct Place {
    // -1: nowhere.
    int begin = -1;
    // How far apart its columns are.
    int stride = 0;
    // Whether the second variable has the rows.
    bool is_turned = false;
  };

  Place PlaceOf(int a, int b) const;
  bool LookUp(const FlatProblem& problem, const FlatProblem::Term& term);
  void BlockPattern(const FlatProblem& problem, bool has_lower);
  bool Order(const FlatProblem& problem);
  void LayOut(const FlatProblem& problem, bool has_lower);

  // Variables in the order of elimination, the place of each there, and its
  // column.
  std::vector<int> by_rank_;
  std::vector<int> rank_;
  std::vector<int> column_;
  // One triangle by columns, with whole blocks on the diagonal; the blocks in
  // it by ranks, where they begin in the values, and how far apart columns of a
  // variable are.
  bool is_lower_ = false;
  std::vector<int> column_begin_;
  std::vector<int> rows_;
  std::vector<double> values_;
  std::vector<double> other_values_;
  std::vector<double> damped_;
  std::vector<int> diagonal_;
  std::vector<int> block_begin_;
  std::vector<int> block_rows_;
  std::vector<int> block_places_;
  std::vector<int> stride_;
  // Of products, now and at the last reading.
  std::vector<Place> places_;
  std::vector<Place> old_places_;
  std::unique_ptr<Factorization> factorization_;
  int num_analyses_ = 0;
};

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_NORMAL_MATRIX_H_
