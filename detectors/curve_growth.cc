#include <plumbline/detectors/curve_growth.h>
#include <plumbline/detectors/planar_curve.h>
#include <plumbline/factors/angle.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <deque>
#include <map>

namespace plumbline {
namespace {

// Of the tangent at the foot of a point, rad.
double Direction(const PlanarCurve& curve, const Eigen::Vector2d& point) {
  if (curve.kind == CurveKind::kLine) return curve.direction;
  const Eigen::Vector2d arm = point - curve.position;
  return std::atan2(arm.x(), -arm.y());
}

// How near to a curve a point must be to join it. Where curves cross, some
// point of one lies near the other by chance, and tying it there would hold
// the one by the other along its own direction, in which nothing else may.
double JoinGate(const PointGraph& points, const SupportedCurves& curves,
                const CurveSearchOptions& options, const PlanarCurve& curve,
                int i) {
  double gate = options.gate;
  for (const std::size_t other : curves.On(i)) {
    const Eigen::Vector2d& position = points.position(i);
    const double angle =
        NormalizeAxial(Direction(curve, position) -
                       Direction(curves[other].found.curve, position));
    gate = std::min(gate, std::abs(angle) > options.min_corner
                              ? options.sigma
                              : 0.5 * options.gate);
  }
  return gate;
}

}  // namespace

CurveGrowth::CurveGrowth(const PointGraph& points,
                         const CurveSearchOptions& options)
    : points_(points),
      options_(options),
      stamps_(static_cast<std::size_t>(points.size()), 0) {}

bool CurveGrowth::Extend(std::size_t curve, SupportedCurves* curves) {
  FoundCurve& found = (*curves)[curve].found;
  const std::size_t before = found.support.size();
  const double limit = curves->GapLimit(found, options_.max_gap);
  const CurveRuler ruler(found.curve);
  ++stamp_;
  struct Step {
    int point;
    // The last one on the curve on the way, and the points off it since.
    int from;
    int gap;
  };
  std::deque<Step> queue;
  for (const int i : found.support) {
    stamps_[static_cast<std::size_t>(i)] = stamp_;
    queue.push_back({i, i, 0});
  }
  std::map<int, int> gaps;
  while (!queue.empty()) {
    const Step step = queue.front();
    queue.pop_front();
    for (const int i : points_.neighbors(step.point)) {
      const auto k = static_cast<std::size_t>(i);
      if (stamps_[k] == stamp_) continue;
      const double distance =
          std::abs(ruler.SignedDistance(points_.position(i)));
      if (distance <= JoinGate(points_, *curves, options_, found.curve, i) &&
          (points_.position(i) - points_.position(step.from)).norm() <= limit) {
        stamps_[k] = stamp_;
        curves->AddPoint(curve, i);
        queue.push_front({i, i, 0});
        continue;
      }
      const int gap = step.gap + 1;
      if (gap > options_.max_gap_points) continue;
      const auto visited = gaps.emplace(i, gap);
      if (!visited.second) {
        if (visited.first->second <= gap) continue;
        visited.first->second = gap;
      }
      queue.push_back({i, step.from, gap});
    }
  }
  std::sort(found.support.begin(), found.support.end());
  return found.support.size() > before;
}

}  // namespace plumbline
