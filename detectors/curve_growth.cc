#include <plumbline/detectors/curve_growth.h>
#include <plumbline/detectors/planar_curve.h>
#include <plumbline/factors/angle.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <map>
#include <vector>

namespace plumbline {
namespace {

// Of the tangent at the foot of a point, rad.
double Direction(const PlanarCurve& curve, const Eigen::Vector2d& point) {
  if (curve.kind == CurveKind::kLine) return curve.direction;
  const Eigen::Vector2d arm = point - curve.position;
  return std::atan2(arm.x(), -arm.y());
}

// What was tied wrongly may be off by so many gates from where it belongs.
constexpr double kUnsure = 2.0;
constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();

// What becomes of a point near a curve.
struct Terms {
  // It joins the curve when it is as near as this, m.
  double gate = 0.0;
  // The curve that it leaves; kNone: none.
  std::size_t leaves = kNone;
  // False: it is only to leave.
  bool joins = true;
};
constexpr Terms kLeftAlone = {-1.0, kNone, false};

// Whether a point has neighbors on a curve to both sides along it.
bool IsBetween(const PointGraph& points, const SupportedCurves& curves, int i,
               std::size_t curve) {
  const CurveRuler ruler(curves[curve].found.curve);
  const double own = ruler.Along(points.position(i));
  bool is_before = false;
  bool is_behind = false;
  for (const int j : points.neighbors(i)) {
    const std::vector<std::size_t>& on = curves.On(j);
    if (std::find(on.begin(), on.end(), curve) == on.end()) continue;
    (ruler.Along(points.position(j)) < own ? is_before : is_behind) = true;
  }
  return is_before && is_behind;
}

// Curves that a point supports, and those that its neighbors do; ascending.
std::vector<std::size_t> CurvesAround(const PointGraph& points,
                                      const SupportedCurves& curves, int i) {
  std::vector<std::size_t> around = curves.On(i);
  for (const int j : points.neighbors(i)) {
    const std::vector<std::size_t>& on = curves.On(j);
    around.insert(around.end(), on.begin(), on.end());
  }
  std::sort(around.begin(), around.end());
  around.erase(std::unique(around.begin(), around.end()), around.end());
  return around;
}

// Where curves cross, some point of one lies near the other by chance, and
// tying it there would hold the one by the other along its own direction, in
// which nothing else may: by as much as the map is off. Such a point is on the
// curve that it has neighbors on to both sides; at the ends of both nobody
// knows, and it is on neither until it is near one of them only. Without a
// neighbor on a curve it leaves no other for it.
Terms TermsOf(const PointGraph& points, const SupportedCurves& curves,
              const CurveSearchOptions& options, std::size_t curve, int i) {
  Terms terms;
  terms.gate = options.gate;
  const Eigen::Vector2d& position = points.position(i);
  const PlanarCurve& own = curves[curve].found.curve;
  const std::vector<std::size_t>& on = curves.On(i);
  const std::vector<std::size_t> around = CurvesAround(points, curves, i);
  const bool is_beside =
      std::binary_search(around.begin(), around.end(), curve);
  for (const std::size_t other : around) {
    if (other == curve) continue;
    const PlanarCurve& its = curves[other].found.curve;
    const bool is_on = std::find(on.begin(), on.end(), other) != on.end();
    if (!is_on &&
        std::abs(its.SignedDistance(position)) > kUnsure * options.gate) {
      continue;
    }
    const double angle =
        NormalizeAxial(Direction(own, position) - Direction(its, position));
    if (std::abs(angle) <= options.min_corner) {
      if (is_on) terms.gate = std::min(terms.gate, 0.5 * options.gate);
      continue;
    }
    if (points.are_virtual()) {
      if (is_on) terms.gate = std::min(terms.gate, options.sigma);
      continue;
    }
    const bool is_between = IsBetween(points, curves, i, curve);
    if (IsBetween(points, curves, i, other)) return kLeftAlone;
    terms.joins = terms.joins && is_between;
    if (is_on) {
      if (!is_beside || on.size() > 1 || own.kind != its.kind) {
        return kLeftAlone;
      }
      terms.leaves = other;
      if (!terms.joins) terms.gate = kUnsure * options.gate;
    }
  }
  return terms;
}

}  // namespace

CurveGrowth::CurveGrowth(const PointGraph& points,
                         const CurveSearchOptions& options)
    : points_(points),
      options_(options),
      stamps_(static_cast<std::size_t>(points.size()), 0) {}

bool CurveGrowth::Extend(std::size_t curve, SupportedCurves* curves) {
  FoundCurve& found = (*curves)[curve].found;
  bool has_changed = false;
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
      const Terms terms = distance <= kUnsure * options_.gate
                              ? TermsOf(points_, *curves, options_, curve, i)
                              : kLeftAlone;
      const bool is_near =
          distance <= terms.gate &&
          (points_.position(i) - points_.position(step.from)).norm() <= limit;
      if (is_near && terms.leaves != kNone) {
        has_changed = true;
        curves->TakeOut(terms.leaves, i);
      }
      if (is_near && terms.joins) {
        has_changed = true;
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
  return has_changed;
}

}  // namespace plumbline
