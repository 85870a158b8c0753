#include <plumbline/detectors/corridor_model.h>

#include <Eigen/Cholesky>
#include <limits>
#include <utility>

namespace plumbline {
namespace {

using Eigen::Vector2d;

// Variances with which the axis (m^2, rad^2) and half the width (m^2) are known
// before any face is on them.
constexpr double kOpen = 1e4;

}  // namespace

CorridorModel::CorridorModel(std::vector<SideFace> faces,
                             Eigen::MatrixXd covariance,
                             std::vector<Vector2d> tolerances)
    : faces_(std::move(faces)),
      covariance_(std::move(covariance)),
      tolerances_(std::move(tolerances)),
      mean_(Eigen::VectorXd::Zero(covariance_.rows())) {}

CorridorModel CorridorModel::OfNewCorridor(std::vector<SideFace> faces,
                                           const Eigen::MatrixXd& of_faces,
                                           std::vector<Vector2d> tolerances) {
  Eigen::MatrixXd covariance =
      Eigen::MatrixXd::Zero(3 + of_faces.rows(), 3 + of_faces.cols());
  covariance.topLeftCorner<3, 3>() = kOpen * Eigen::Matrix3d::Identity();
  covariance.bottomRightCorner(of_faces.rows(), of_faces.cols()) = of_faces;
  return CorridorModel(std::move(faces), std::move(covariance),
                       std::move(tolerances));
}

CorridorModel::Innovation CorridorModel::Predict(std::size_t face) const {
  const Rows rows = RowsOf(face);
  Innovation innovation;
  innovation.error =
      Vector2d(faces_[face].past, faces_[face].turn) + rows * mean_;
  innovation.covariance = rows * covariance_ * rows.transpose();
  // Tolerances are standard deviations.
  innovation.covariance.diagonal() +=
      tolerances_[face].cwiseProduct(tolerances_[face]);
  innovation.chi_square = innovation.error.dot(
      innovation.covariance.ldlt().solve(innovation.error));
  return innovation;
}

void CorridorModel::Tie(std::size_t face) {
  const Rows rows = RowsOf(face);
  const Innovation innovation = Predict(face);
  const Eigen::MatrixXd cross = covariance_ * rows.transpose();
  const Eigen::MatrixXd gain =
      innovation.covariance.ldlt().solve(cross.transpose()).transpose();
  mean_ -= gain * innovation.error;
  covariance_ -= gain * cross.transpose();
  covariance_ = (0.5 * (covariance_ + covariance_.transpose())).eval();
}

std::vector<SideFace> CorridorModel::TieFitting(
    const std::vector<std::size_t>& first, double gate) {
  std::vector<bool> is_tied(faces_.size(), false);
  for (const std::size_t k : first) {
    if (!(Predict(k).chi_square <= gate)) return {};
    Tie(k);
    is_tied[k] = true;
  }
  while (true) {
    std::size_t best = faces_.size();
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < faces_.size(); ++k) {
      if (is_tied[k]) continue;
      const Innovation innovation = Predict(k);
      if (!(innovation.chi_square <= gate)) continue;
      const double size = innovation.covariance.determinant();
      if (size < least) {
        least = size;
        best = k;
      }
    }
    if (best == faces_.size()) break;
    Tie(best);
    is_tied[best] = true;
  }
  std::vector<SideFace> fitting;
  for (std::size_t k = 0; k < faces_.size(); ++k) {
    if (is_tied[k]) fitting.push_back(faces_[k]);
  }
  return fitting;
}

// Derivative of how far a face lies past its side and of its turn.
CorridorModel::Rows CorridorModel::RowsOf(std::size_t face) const {
  const double sign = CorridorSideSign(faces_[face].side);
  const Eigen::Index own = 3 + 2 * static_cast<Eigen::Index>(face);
  Rows rows = Rows::Zero(2, covariance_.cols());
  rows(0, 0) = sign;
  rows(0, 1) = sign * faces_[face].along;
  rows(0, 2) = -1.0;
  rows(0, own) = -1.0;
  rows(1, 1) = -1.0;
  rows(1, own + 1) = 1.0;
  return rows;
}

}  // namespace plumbline
