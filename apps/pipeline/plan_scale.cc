#include <plumbline/pipeline/plan_scale.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstddef>

namespace plumbline {
namespace {

// Unknowns: the plan's pose and its scale; walls that it takes at least.
constexpr std::size_t kUnknowns = 4;
constexpr std::size_t kLeastWalls = 3 * kUnknowns;
// A share of the largest eigenvalue below which something is not told.
constexpr double kLeastInformation = 1e-9;

}  // namespace

std::optional<PlanScale> FindPlanScale(
    const std::vector<WallBesideLine>& walls) {
  if (walls.size() < kLeastWalls) return std::nullopt;
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  for (const WallBesideLine& wall : walls) middle += wall.point;
  middle /= static_cast<double>(walls.size());
  double most_lever = 0.0;
  for (const WallBesideLine& wall : walls) {
    most_lever =
        std::max(most_lever, std::abs(wall.normal.dot(wall.point - middle)));
  }
  if (!(most_lever > 0.0)) return std::nullopt;
  // Moved, turned and drawn larger the line comes nearer; in units of the
  // largest lever, so that all unknowns weigh alike.
  const auto row_of = [&](const WallBesideLine& wall) {
    const Eigen::Vector2d arm = (wall.point - middle) / most_lever;
    return Eigen::Vector4d(
        wall.normal.x(), wall.normal.y(),
        wall.normal.y() * arm.x() - wall.normal.x() * arm.y(),
        -wall.normal.dot(arm));
  };
  Eigen::Matrix4d information = Eigen::Matrix4d::Zero();
  Eigen::Vector4d sum = Eigen::Vector4d::Zero();
  for (const WallBesideLine& wall : walls) {
    const Eigen::Vector4d row = row_of(wall);
    information += row * row.transpose();
    sum += wall.across * row;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> solver(information);
  if (solver.eigenvalues()[0] < kLeastInformation * solver.eigenvalues()[3]) {
    return std::nullopt;
  }
  const Eigen::Matrix4d covariance =
      solver.eigenvectors() * solver.eigenvalues().cwiseInverse().asDiagonal() *
      solver.eigenvectors().transpose();
  const Eigen::Vector4d solution = covariance * sum;
  double squares = 0.0;
  for (const WallBesideLine& wall : walls) {
    squares += std::pow(wall.across - row_of(wall).dot(solution), 2);
  }
  const double variance =
      squares / static_cast<double>(walls.size() - kUnknowns);
  PlanScale scale;
  scale.excess = solution[3] / most_lever;
  scale.sigma = std::sqrt(variance * covariance(3, 3)) / most_lever;
  scale.most_offset = std::abs(solution[3]);
  return scale;
}

}  // namespace plumbline
