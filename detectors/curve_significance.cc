#include <plumbline/detectors/curve_significance.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

namespace plumbline {
namespace {

// Points over which false alarms are counted, however many there are: what is
// found in a building does not depend on how many others are on the map.
constexpr double kPointsPerFalseAlarm = 1000.0;
// Gaps longer than so many times the usual spacing open a circle.
constexpr double kGapPerSpacing = 3.0;
// Chains of lines that are compared with a circle, and between how many places
// their sides are looked for.
constexpr int kMaxSides = 4;
constexpr std::size_t kMaxBreaks = 32;

// Places along a curve: how much of it the points cover.
struct Coverage {
  // m; gaps are left out.
  double length = 0.0;
  // Points that are `separation` apart from each other, and gaps between them.
  int separated = 0;
  bool is_closed = false;
  // Angle from the first to the last point of a circle, rad.
  double arc = 0.0;
};

// Sums of points, for the line that fits a run of them.
struct Moments {
  double n = 0.0, x = 0.0, y = 0.0, xx = 0.0, yy = 0.0, xy = 0.0;

  void Add(const Eigen::Vector2d& p) {
    n += 1.0;
    x += p.x();
    y += p.y();
    xx += p.x() * p.x();
    yy += p.y() * p.y();
    xy += p.x() * p.y();
  }
  Moments Minus(const Moments& other) const {
    Moments result;
    result.n = n - other.n;
    result.x = x - other.x;
    result.y = y - other.y;
    result.xx = xx - other.xx;
    result.yy = yy - other.yy;
    result.xy = xy - other.xy;
    return result;
  }
  // Sum of squared distances from the best line.
  double LineError() const {
    if (n < 2.5) return 0.0;
    const double cxx = xx - x * x / n;
    const double cyy = yy - y * y / n;
    const double cxy = xy - x * y / n;
    const double difference = cxx - cyy;
    const double root = std::sqrt(difference * difference + 4.0 * cxy * cxy);
    return std::max(0.0, 0.5 * (cxx + cyy - root));
  }
};

// Whether a chain of up to kMaxSides lines explains the points, which are in
// order along the circle, better than the circle does by the Bayesian
// information criterion: a corner is not an arc.
bool IsPolygon(const std::vector<Eigen::Vector2d>& points,
               const PlanarCurve& circle) {
  // Where sides may end: not at every point when there are many.
  std::vector<Moments> sums(1);
  const std::size_t stride = (points.size() + kMaxBreaks - 1) / kMaxBreaks;
  Moments sum;
  double circle_error = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    sum.Add(points[i] - circle.position);
    const double distance = circle.SignedDistance(points[i]);
    circle_error += distance * distance;
    if ((i + 1) % stride == 0 || i + 1 == points.size()) sums.push_back(sum);
  }
  const auto n = static_cast<double>(points.size());
  // Below this, distances are rounding.
  const double floor = n * 1e-12 * circle.radius * circle.radius;
  const auto criterion = [&](double error, int parameters) {
    return n * std::log(error + floor) + parameters * std::log(n);
  };
  const double limit = criterion(circle_error, 3);
  const std::size_t breaks = sums.size();
  // Of the line from one break to another.
  std::vector<double> side_errors(breaks * breaks, 0.0);
  for (std::size_t end = 1; end < breaks; ++end) {
    for (std::size_t begin = 0; begin < end; ++begin) {
      side_errors[end * breaks + begin] =
          sums[end].Minus(sums[begin]).LineError();
    }
  }
  // Smallest error of the points before each break with so many sides.
  std::vector<double> errors(breaks, std::numeric_limits<double>::infinity());
  errors[0] = 0.0;
  for (int sides = 1; sides <= kMaxSides; ++sides) {
    std::vector<double> next(breaks, std::numeric_limits<double>::infinity());
    for (std::size_t end = 1; end < breaks; ++end) {
      for (std::size_t begin = 0; begin < end; ++begin) {
        next[end] = std::min(next[end],
                             errors[begin] + side_errors[end * breaks + begin]);
      }
    }
    errors.swap(next);
    // Two parameters a side, and where each but the last ends.
    if (criterion(errors.back(), 3 * sides - 1) < limit) return true;
  }
  return false;
}

// `places`: along the curve, with the points there; comes back in order, on
// a circle from the end of the longest gap.
Coverage Cover(const CurvePoints& points, const PlanarCurve& curve,
               double separation, std::vector<std::pair<double, int>>* places) {
  Coverage coverage;
  std::sort(places->begin(), places->end());
  std::vector<double> along;
  for (const auto& place : *places) along.push_back(place.first);
  double limit = points.GapLimit(along);
  if (curve.kind == CurveKind::kCircle) {
    const double around = 2.0 * kPi * curve.radius;
    double longest = along.front() + around - along.back();
    std::size_t first = 0;
    for (std::size_t i = 1; i < along.size(); ++i) {
      if (along[i] - along[i - 1] > longest) {
        longest = along[i] - along[i - 1];
        first = i;
      }
    }
    const auto offset = static_cast<std::ptrdiff_t>(first);
    for (std::size_t i = 0; i < first; ++i) along[i] += around;
    std::rotate(along.begin(), along.begin() + offset, along.end());
    std::rotate(places->begin(), places->begin() + offset, places->end());
    limit = std::max(std::min(points.options().max_gap, curve.radius),
                     kGapPerSpacing * MedianGap(along));
    coverage.arc = (around - longest) / curve.radius;
    coverage.is_closed = longest <= limit;
    if (coverage.is_closed) coverage.length = longest;
  }
  double last = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < along.size(); ++i) {
    if (i > 0 && along[i] - along[i - 1] <= limit) {
      coverage.length += along[i] - along[i - 1];
    }
    if (along[i] - last >= separation) {
      ++coverage.separated;
      last = along[i];
    }
  }
  return coverage;
}

}  // namespace

double CurveSignificance(const CurvePoints& points,
                         const CurveHypothesis& hypothesis,
                         const std::vector<bool>* is_owned) {
  const auto is_available = [is_owned](int i) {
    return is_owned == nullptr || !(*is_owned)[static_cast<std::size_t>(i)];
  };
  constexpr double kNone = -std::numeric_limits<double>::infinity();
  const PlanarCurve& curve = hypothesis.curve;
  const CurveRuler ruler(curve);
  const double e = hypothesis.tolerance;
  std::vector<std::pair<double, int>> places;
  for (const int i : hypothesis.inliers) {
    if (is_available(i)) {
      places.emplace_back(ruler.Along(points.position(i)), i);
    }
  }
  if (places.size() < points.MinPoints(curve.kind)) return kNone;
  const auto count = static_cast<double>(places.size());
  double misses = 0.0;
  for (const int i : hypothesis.bystanders) {
    if (is_available(i)) misses += 1.0;
  }
  // While curves are not told apart, strangers may well be on others.
  if (is_owned != nullptr) {
    for (const int i : hypothesis.strangers) {
      if (is_available(i)) misses += 1.0;
    }
  }

  const bool is_circle = curve.kind == CurveKind::kCircle;
  // Centre and circle are told apart from a blob only by a larger radius.
  if (is_circle && curve.radius < 2.0 * e) return kNone;
  // Slightly less than 2 e, for points that are just so far apart.
  const Coverage coverage = Cover(points, curve, 1.999 * e, &places);
  if (is_circle && coverage.arc < points.options().min_arc) return kNone;
  if (!(coverage.length > 0.0)) return kNone;
  const int steps = coverage.separated - (coverage.is_closed ? 0 : 1);
  if (steps < 1) return kNone;
  const double spacing = std::max(2.0 * e, coverage.length / steps);
  const double p = 2.0 / kPi * std::asin(e / spacing);
  const double share = count / (count + misses);
  if (share <= p) return kNone;
  const double trials = coverage.separated / share;
  double divergence = share * std::log(share / p);
  if (share < 1.0) {
    divergence += (1.0 - share) * std::log((1.0 - share) / (1.0 - p));
  }
  // Places where a curve of this size could begin, its offset there, its
  // direction and bend by what the tolerance can tell, and the tolerances.
  const double resolution = std::max(1.0, coverage.length / e);
  double tests = std::max(1.0, kPointsPerFalseAlarm / count) / p * resolution *
                 kCurveStarts * kCurveLevelsPerStart;
  if (is_circle) tests *= std::sqrt(resolution);
  const double significance =
      (trials * divergence - std::log(tests)) / std::log(10.0);
  if (is_circle && significance >= -points.options().max_log_false_alarms) {
    std::vector<Eigen::Vector2d> positions;
    for (const auto& place : places) {
      positions.push_back(points.position(place.second));
    }
    if (IsPolygon(positions, curve)) return kNone;
  }
  return significance;
}

}  // namespace plumbline
