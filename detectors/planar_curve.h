#ifndef PLUMBLINE_DETECTORS_PLANAR_CURVE_H_
#define PLUMBLINE_DETECTORS_PLANAR_CURVE_H_

#include <Eigen/Core>
#include <cmath>
#include <vector>

namespace plumbline {

enum class CurveKind { kLine, kCircle };

/// A line or a circle of the plane, as a model for points.
struct PlanarCurve {
  CurveKind kind = CurveKind::kLine;
  /// A point of the line, or the centre of the circle; m, map frame.
  Eigen::Vector2d position = Eigen::Vector2d::Zero();
  /// Direction of a line, rad.
  double direction = 0.0;
  /// Of a circle, m.
  double radius = 0.0;

  /// Distance from the curve, m: positive to the left of a line's direction and
  /// outside a circle.
  double SignedDistance(const Eigen::Vector2d& point) const;

  /// Where the foot of the point on the curve lies: m along a line from
  /// `position`; angle about a circle's centre in (-pi, pi] times the radius.
  double Along(const Eigen::Vector2d& point) const;
};

/// Measures many points against one curve: PlanarCurve works out the direction
/// of a line anew for each.
class CurveRuler {
 public:
  /// Of the curve as it is now.
  explicit CurveRuler(const PlanarCurve& curve)
      : kind_(curve.kind),
        position_(curve.position),
        radius_(curve.radius),
        cos_(curve.kind == CurveKind::kLine ? std::cos(curve.direction) : 0.0),
        sin_(curve.kind == CurveKind::kLine ? std::sin(curve.direction) : 0.0) {
  }

  /// PlanarCurve::SignedDistance.
  double SignedDistance(const Eigen::Vector2d& point) const {
    const Eigen::Vector2d p = point - position_;
    if (kind_ == CurveKind::kCircle) return p.norm() - radius_;
    return p.y() * cos_ - p.x() * sin_;
  }

  /// PlanarCurve::Along.
  double Along(const Eigen::Vector2d& point) const {
    const Eigen::Vector2d p = point - position_;
    if (kind_ == CurveKind::kCircle) return radius_ * std::atan2(p.y(), p.x());
    return p.x() * cos_ + p.y() * sin_;
  }

 private:
  CurveKind kind_;
  Eigen::Vector2d position_;
  double radius_;
  double cos_;
  double sin_;
};

/// The line through the points with the smallest sum of squared orthogonal
/// distances; its position is their mean, its direction is in
/// (-pi/2, pi/2]. False when the points do not tell a direction.
bool FitLine(const std::vector<Eigen::Vector2d>& points, PlanarCurve* line);

/// The circle with the smallest sum of squared distances: Taubin's estimate
/// (Taubin 1991), refined by Gauss-Newton steps. False when the points do not
/// tell one: fewer than three, all on a line or on one spot.
bool FitCircle(const std::vector<Eigen::Vector2d>& points, PlanarCurve* circle);

/// The circle through three points. False when they are on a line.
bool CircleThrough(const Eigen::Vector2d& a, const Eigen::Vector2d& b,
                   const Eigen::Vector2d& c, PlanarCurve* circle);

/// Root of the mean squared distance from the curve, m; 0 for no points.
double RootMeanSquareDistance(const PlanarCurve& curve,
                              const std::vector<Eigen::Vector2d>& points);

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_PLANAR_CURVE_H_
