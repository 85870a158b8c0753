#include <plumbline/detectors/curve_points.h>

#include <algorithm>
#include <cmath>

namespace plumbline {
namespace {

// Gaps longer than so many times the usual spacing end a line.
constexpr double kGapPerSpacing = 3.0;

}  // namespace

double MedianGap(const std::vector<double>& along) {
  std::vector<double> gaps;
  for (std::size_t i = 1; i < along.size(); ++i) {
    gaps.push_back(along[i] - along[i - 1]);
  }
  if (gaps.empty()) return 0.0;
  const auto middle =
      gaps.begin() + static_cast<std::ptrdiff_t>(gaps.size() / 2);
  std::nth_element(gaps.begin(), middle, gaps.end());
  return *middle;
}

CurvePoints::CurvePoints(const PointGraph& points,
                         const std::vector<bool>& is_claimed,
                         const CurveSearchOptions& options)
    : points_(points),
      options_(options),
      is_free_(static_cast<std::size_t>(points.size())) {
  for (std::size_t i = 0; i < is_free_.size(); ++i)
    is_free_[i] = !is_claimed[i];
}

std::size_t CurvePoints::MinPoints(CurveKind kind) const {
  return static_cast<std::size_t>(kind == CurveKind::kLine
                                      ? options_.min_line_points
                                      : options_.min_circle_points);
}

bool CurvePoints::Fit(const std::vector<int>& indices,
                      PlanarCurve* curve) const {
  std::vector<Eigen::Vector2d> positions;
  positions.reserve(indices.size());
  for (const int i : indices) positions.push_back(points_.position(i));
  PlanarCurve fitted;
  const bool is_fitted = curve->kind == CurveKind::kLine
                             ? FitLine(positions, &fitted)
                             : FitCircle(positions, &fitted);
  if (!is_fitted || fitted.radius > options_.max_radius) return false;
  *curve = fitted;
  return true;
}

double CurvePoints::GapLimit(const std::vector<double>& along) const {
  return std::max(options_.max_gap, kGapPerSpacing * MedianGap(along));
}

void CurvePoints::CutAtGaps(const PlanarCurve& line,
                            std::vector<int>* indices) const {
  const CurveRuler ruler(line);
  std::vector<std::pair<double, int>> order;
  std::vector<double> along;
  for (const int i : *indices) {
    order.emplace_back(ruler.Along(points_.position(i)), i);
  }
  std::sort(order.begin(), order.end());
  for (const auto& entry : order) along.push_back(entry.first);
  const double limit = GapLimit(along);
  std::size_t best_begin = 0, best_end = 0, begin = 0;
  for (std::size_t i = 1; i <= order.size(); ++i) {
    if (i < order.size() && along[i] - along[i - 1] <= limit) continue;
    if (i - begin > best_end - best_begin) {
      best_begin = begin;
      best_end = i;
    }
    begin = i;
  }
  indices->clear();
  for (std::size_t i = best_begin; i < best_end; ++i) {
    indices->push_back(order[i].second);
  }
}

double CurvePoints::SquaredSum(const PlanarCurve& curve,
                               const std::vector<int>& indices) const {
  const CurveRuler ruler(curve);
  double sum = 0.0;
  for (const int i : indices) {
    const double distance = ruler.SignedDistance(points_.position(i));
    sum += distance * distance;
  }
  return sum;
}

GapReach::GapReach(const CurvePoints& points)
    : points_(points), stamps_(static_cast<std::size_t>(points.size()), 0) {}

const std::vector<int>& GapReach::From(int point) {
  ++stamp_;
  stamps_[static_cast<std::size_t>(point)] = stamp_;
  reached_.assign(1, point);
  std::size_t begin = 0;
  for (int step = 0; step <= points_.options().max_gap_points; ++step) {
    const std::size_t end = reached_.size();
    for (; begin < end; ++begin) {
      for (const int i : points_.neighbors(reached_[begin])) {
        int& visited = stamps_[static_cast<std::size_t>(i)];
        if (visited == stamp_) continue;
        visited = stamp_;
        reached_.push_back(i);
      }
    }
  }
  return reached_;
}

}  // namespace plumbline
