// Three walls of a corner in a ceres::Problem of our own. That they share
// a direction, or stand at a right angle to it, is a hypothesis: it straightens
// the two walls for which it is true, and lets go of the third.
#include <ceres/problem.h>
#include <ceres/solver.h>
#include <plumbline/factors/angle.h>
#include <plumbline/factors/angle_manifold.h>
#include <plumbline/factors/chi_square.h>
#include <plumbline/factors/delta_loss.h>
#include <plumbline/factors/line_manifold.h>
#include <plumbline/factors/line_orientation.h>
#include <plumbline/factors/point_line_distance.h>

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstdio>
#include <vector>

using plumbline::DegToRad;
using plumbline::RadToDeg;

namespace {

constexpr double kPointSigma = 0.05;                // m
constexpr double kTolerance = DegToRad(0.2);        // rad
constexpr double kRightAngle = plumbline::kPi / 2;  // rad

struct Wall {
  // Laser points on it, m.
  std::vector<std::array<double, 2>> points;
  // The line's parameters d, alpha (m, rad) are relative to this point.
  Eigen::Vector2d anchor;
  std::array<double, 2> line;
  // From the wall to the orientation that it is taken to have, rad.
  double angle;
};

// 2 m of wall around `center`, seen in the direction `seen` (rad).
Wall MakeWall(const Eigen::Vector2d& center, double seen, double angle) {
  Wall wall;
  for (int i = -4; i <= 4; ++i) {
    wall.points.push_back({center.x() + 0.25 * i * std::cos(seen),
                           center.y() + 0.25 * i * std::sin(seen)});
  }
  wall.anchor = center;
  wall.line = {0.0, seen};
  wall.angle = angle;
  return wall;
}

double Delta(const Wall& wall, double orientation) {
  const double error =
      plumbline::NormalizeAxial(orientation - wall.line[1] - wall.angle);
  return plumbline::ChiSquarePValue(std::pow(error / kTolerance, 2), 1);
}

}  // namespace

int main() {
  std::vector<Wall> walls = {
      MakeWall({0.0, 0.0}, DegToRad(0.3), 0.0),
      MakeWall({1.0, 1.0}, DegToRad(89.7), kRightAngle),
      MakeWall({0.0, 2.0}, DegToRad(20.0), 0.0),
  };
  double orientation = 0.0;

  //! [bare problem]
  ceres::Problem problem;
  for (Wall& wall : walls) {
    for (std::array<double, 2>& point : wall.points) {
      problem.AddResidualBlock(plumbline::PointLineDistance::Create(
                                   0.0, wall.anchor, 1.0 / kPointSigma),
                               nullptr, point.data(), wall.line.data());
      problem.SetParameterBlockConstant(point.data());
    }
    problem.AddResidualBlock(
        plumbline::LineOrientation::Create(wall.angle, 1.0 / kTolerance),
        new plumbline::ContinuousDeltaLoss(1), wall.line.data(), &orientation);
    problem.SetManifold(wall.line.data(), new plumbline::LineManifold);
  }
  problem.SetManifold(&orientation, new plumbline::AngleManifold);
  //! [bare problem]

  ceres::Solver::Summary summary;
  ceres::Solve(ceres::Solver::Options(), &problem, &summary);

  for (const Wall& wall : walls) {
    std::printf("wall at %7.3f degrees, delta %.3f\n", RadToDeg(wall.line[1]),
                Delta(wall, orientation));
  }
  const double corner = RadToDeg(walls[1].line[1] - walls[0].line[1]);
  std::printf("corner of %.3f degrees, seen as 89.4\n", corner);
  const bool straight = std::abs(corner - 90.0) < 0.1;
  const bool let_go = Delta(walls[2], orientation) < 1e-6 &&
                      std::abs(RadToDeg(walls[2].line[1]) - 20.0) < 0.01;
  return summary.IsSolutionUsable() && straight && let_go ? 0 : 1;
}
