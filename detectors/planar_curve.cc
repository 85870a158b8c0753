#include <plumbline/detectors/planar_curve.h>
#include <plumbline/factors/angle.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

namespace plumbline {
namespace {

// Circles so much larger than the spread of their points are lines to double
// precision.
constexpr double kMaxRadiusPerSpread = 1e4;

Eigen::Vector2d Mean(const std::vector<Eigen::Vector2d>& points) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& point : points) mean += point;
  return mean / static_cast<double>(points.size());
}

// Taubin's fit: the smallest root of its characteristic polynomial by Newton's
// method from 0 (Chernov 2010, Sect. 5.10).
bool TaubinCircle(const std::vector<Eigen::Vector2d>& points,
                  const Eigen::Vector2d& mean, PlanarCurve* circle) {
  double xx = 0.0, yy = 0.0, xy = 0.0, xz = 0.0, yz = 0.0, zz = 0.0;
  for (const Eigen::Vector2d& point : points) {
    const Eigen::Vector2d p = point - mean;
    const double z = p.squaredNorm();
    xx += p.x() * p.x();
    yy += p.y() * p.y();
    xy += p.x() * p.y();
    xz += p.x() * z;
    yz += p.y() * z;
    zz += z * z;
  }
  const auto n = static_cast<double>(points.size());
  xx /= n, yy /= n, xy /= n, xz /= n, yz /= n, zz /= n;
  const double z = xx + yy;
  const double determinant = xx * yy - xy * xy;
  if (!(determinant > 1e-12 * z * z)) return false;
  const double variance = zz - z * z;
  const double a3 = 4.0 * z;
  const double a2 = -3.0 * z * z - zz;
  const double a1 =
      variance * z + 4.0 * determinant * z - xz * xz - yz * yz + z * z * z;
  const double a0 = xz * (xz * yy - yz * xy) + yz * (yz * xx - xz * xy) -
                    variance * determinant;
  double root = 0.0;
  double value = a0;
  for (int i = 0; i < 50; ++i) {
    const double slope = a1 + root * (2.0 * a2 + root * 3.0 * a3);
    const double next = root - value / slope;
    if (!std::isfinite(next) || next == root) break;
    const double next_value = a0 + next * (a1 + next * (a2 + next * a3));
    if (std::abs(next_value) >= std::abs(value)) break;
    root = next;
    value = next_value;
  }
  const double denominator = 2.0 * (root * root - root * z + determinant);
  const Eigen::Vector2d center((xz * (yy - root) - yz * xy) / denominator,
                               (yz * (xx - root) - xz * xy) / denominator);
  circle->kind = CurveKind::kCircle;
  circle->position = mean + center;
  circle->radius = std::sqrt(center.squaredNorm() + z);
  return std::isfinite(circle->radius) &&
         circle->radius < kMaxRadiusPerSpread * std::sqrt(z);
}

}  // namespace

double PlanarCurve::SignedDistance(const Eigen::Vector2d& point) const {
  return CurveRuler(*this).SignedDistance(point);
}

double PlanarCurve::Along(const Eigen::Vector2d& point) const {
  return CurveRuler(*this).Along(point);
}

bool FitLine(const std::vector<Eigen::Vector2d>& points, PlanarCurve* line) {
  if (points.size() < 2) return false;
  const Eigen::Vector2d mean = Mean(points);
  double xx = 0.0, yy = 0.0, xy = 0.0;
  for (const Eigen::Vector2d& point : points) {
    const Eigen::Vector2d p = point - mean;
    xx += p.x() * p.x();
    yy += p.y() * p.y();
    xy += p.x() * p.y();
  }
  // The difference of the two eigenvalues: none means no direction.
  const double difference = std::hypot(xx - yy, 2.0 * xy);
  if (!(difference > 1e-9 * (xx + yy))) return false;
  line->kind = CurveKind::kLine;
  line->position = mean;
  line->direction = NormalizeAxial(0.5 * std::atan2(2.0 * xy, xx - yy));
  line->radius = 0.0;
  return std::isfinite(line->direction) && mean.allFinite();
}

bool FitCircle(const std::vector<Eigen::Vector2d>& points,
               PlanarCurve* circle) {
  if (points.size() < 3) return false;
  const Eigen::Vector2d mean = Mean(points);
  PlanarCurve best;
  if (!TaubinCircle(points, mean, &best)) return false;
  double best_error = RootMeanSquareDistance(best, points);
  for (int i = 0; i < 5; ++i) {
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (const Eigen::Vector2d& point : points) {
      const Eigen::Vector2d p = point - best.position;
      const double distance = p.norm();
      if (distance == 0.0) continue;
      const Eigen::Vector3d row(p.x() / distance, p.y() / distance, 1.0);
      normal += row * row.transpose();
      right += row * (distance - best.radius);
    }
    const Eigen::Vector3d step = normal.ldlt().solve(right);
    if (!step.allFinite()) break;
    PlanarCurve next = best;
    next.position += step.head<2>();
    next.radius += step[2];
    if (!(next.radius > 0.0)) break;
    const double error = RootMeanSquareDistance(next, points);
    if (!(error < best_error)) break;
    const bool has_converged = best_error - error < 1e-6 * best_error;
    best = next;
    best_error = error;
    if (has_converged) break;
  }
  *circle = best;
  return true;
}

bool CircleThrough(const Eigen::Vector2d& a, const Eigen::Vector2d& b,
                   const Eigen::Vector2d& c, PlanarCurve* circle) {
  const Eigen::Vector2d p = b - a;
  const Eigen::Vector2d q = c - a;
  const double cross = p.x() * q.y() - p.y() * q.x();
  const double spread = std::max(p.squaredNorm(), q.squaredNorm());
  if (!(std::abs(cross) > spread / kMaxRadiusPerSpread)) return false;
  const double pp = p.squaredNorm();
  const double qq = q.squaredNorm();
  const Eigen::Vector2d center((q.y() * pp - p.y() * qq) / (2.0 * cross),
                               (p.x() * qq - q.x() * pp) / (2.0 * cross));
  circle->kind = CurveKind::kCircle;
  circle->position = a + center;
  circle->radius = center.norm();
  return std::isfinite(circle->radius) && circle->radius > 0.0;
}

double RootMeanSquareDistance(const PlanarCurve& curve,
                              const std::vector<Eigen::Vector2d>& points) {
  if (points.empty()) return 0.0;
  const CurveRuler ruler(curve);
  double sum = 0.0;
  for (const Eigen::Vector2d& point : points) {
    const double distance = ruler.SignedDistance(point);
    sum += distance * distance;
  }
  return std::sqrt(sum / static_cast<double>(points.size()));
}

}  // namespace plumbline
