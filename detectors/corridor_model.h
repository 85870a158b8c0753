#ifndef PLUMBLINE_DETECTORS_CORRIDOR_MODEL_H_
#define PLUMBLINE_DETECTORS_CORRIDOR_MODEL_H_

#include <plumbline/detectors/corridor_axis.h>

#include <Eigen/Core>
#include <cstddef>
#include <vector>

namespace plumbline {

/// The faces of a corridor and the corridor as random variables, Gaussian and
/// linear about where they stand: (axis to the left at its origin, its turn,
/// half the width, and for each face its offset to its own left and its turn),
/// m and rad. Ties of faces to their sides enter one by one, and each can be
/// judged by its innovation before it does (core/method.md, section 9).
class CorridorModel {
 public:
  /// `covariance`: of the three of the corridor and the two of each face.
  /// `tolerances`: standard deviations of each face against its side, offset
  /// and direction.
  CorridorModel(std::vector<SideFace> faces, Eigen::MatrixXd covariance,
                std::vector<Eigen::Vector2d> tolerances);

  /// A corridor of which nothing is known before a face is tied to it.
  /// `of_faces`: covariance of the two of each face.
  static CorridorModel OfNewCorridor(std::vector<SideFace> faces,
                                     const Eigen::MatrixXd& of_faces,
                                     std::vector<Eigen::Vector2d> tolerances);

  /// Difference of a face from its side without a tie to it.
  struct Innovation {
    /// How far past the side, m, and turned against it, rad.
    Eigen::Vector2d error = Eigen::Vector2d::Zero();
    /// Predicted, with the tolerances in it.
    Eigen::Matrix2d covariance = Eigen::Matrix2d::Identity();
    double chi_square = 0.0;
  };
  Innovation Predict(std::size_t face) const;

  /// Ties a face to its side.
  void Tie(std::size_t face);

  /// Ties the faces whose innovation is within the gate (chi-square, 2 degrees
  /// of freedom), the most certain one first, and returns them in their order.
  /// `first`: faces that are tied before all others, in this order; when one of
  /// them does not fit none is returned.
  std::vector<SideFace> TieFitting(const std::vector<std::size_t>& first,
                                   double gate);

  /// How far the ties have moved the axis to the left (m) and turned it (rad),
  /// and by how much half the width has grown (m).
  Eigen::Vector3d Correction() const { return mean_.head<3>(); }

 private:
  using Rows = Eigen::Matrix<double, 2, Eigen::Dynamic>;

  Rows RowsOf(std::size_t face) const;

  std::vector<SideFace> faces_;
  Eigen::MatrixXd covariance_;
  std::vector<Eigen::Vector2d> tolerances_;
  Eigen::VectorXd mean_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_CORRIDOR_MODEL_H_
