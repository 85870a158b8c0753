#include <plumbline/detectors/curve_search_region.h>
#include <plumbline/detectors/planar_curve.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

namespace plumbline {

CurveSearchRegion::CurveSearchRegion(const PointGraph& points,
                                     const CurveSearchOptions& options)
    : points_(points),
      options_(options),
      stamps_(static_cast<std::size_t>(points.size()), 0),
      steps_(stamps_.size(), 0),
      is_claimed_(stamps_.size(), false),
      is_unsearched_(stamps_.size(), true) {}

void CurveSearchRegion::Touch(const SupportedCurve& curve) {
  touched_.insert(touched_.end(), curve.found.support.begin(),
                  curve.found.support.end());
}

std::vector<bool> CurveSearchRegion::Take(const SupportedCurves& curves) {
  UpdateClaimed(curves);
  UpdateUnsearched();
  std::vector<bool> is_out = is_claimed_;
  for (std::size_t i = 0; i < is_out.size(); ++i) {
    is_out[i] = is_out[i] || !is_unsearched_[i];
  }
  is_unsearched_.assign(is_unsearched_.size(), false);
  return is_out;
}

// Visits the points of `queue` and those within `reach` constraints of them;
// after that `queue` holds them all.
template <typename Visit>
void CurveSearchRegion::Spread(int reach, std::vector<int>* queue,
                               const Visit& visit) {
  ++stamp_;
  std::size_t count = 0;
  for (const int i : *queue) {
    const auto k = static_cast<std::size_t>(i);
    if (stamps_[k] == stamp_) continue;
    stamps_[k] = stamp_;
    steps_[k] = 0;
    (*queue)[count++] = i;
  }
  queue->resize(count);
  for (std::size_t q = 0; q < queue->size(); ++q) {
    const int from = (*queue)[q];
    visit(from);
    const int step = steps_[static_cast<std::size_t>(from)] + 1;
    if (step > reach) continue;
    for (const int i : points_.neighbors(from)) {
      const auto k = static_cast<std::size_t>(i);
      if (stamps_[k] == stamp_) continue;
      stamps_[k] = stamp_;
      steps_[k] = step;
      queue->push_back(i);
    }
  }
}

// Points that support a curve or are left over of one.
void CurveSearchRegion::UpdateClaimed(const SupportedCurves& curves) {
  is_claimed_.assign(is_claimed_.size(), false);
  for (const int i : curves.outliers()) {
    is_claimed_[static_cast<std::size_t>(i)] = true;
  }
  std::vector<int> queue;
  for (const SupportedCurve& curve : curves.all()) {
    const FoundCurve& found = curve.found;
    const CurveRuler ruler(found.curve);
    double sum = 0.0;
    for (const int i : found.support) {
      const double distance = ruler.SignedDistance(points_.position(i));
      sum += distance * distance;
      is_claimed_[static_cast<std::size_t>(i)] = true;
    }
    const double near = std::max(
        options_.gate,
        3.0 * std::sqrt(sum / static_cast<double>(found.support.size())));
    queue = found.support;
    Spread(options_.max_gap_points, &queue, [&](int i) {
      if (std::abs(ruler.SignedDistance(points_.position(i))) <= near) {
        is_claimed_[static_cast<std::size_t>(i)] = true;
      }
    });
  }
}

// Marks the points of which a search may say something else than the last
// one: those connected, past points that are not claimed, with one that is as
// near to a change as a curve may reach over a gap.
void CurveSearchRegion::UpdateUnsearched() {
  std::vector<int> queue = std::move(touched_);
  touched_.clear();
  // A claim reaches as far as a gap, and what it ends is next to it.
  Spread(2 * options_.max_gap_points + 2, &queue, [&](int i) {
    if (!is_claimed_[static_cast<std::size_t>(i)]) {
      is_unsearched_[static_cast<std::size_t>(i)] = true;
    }
  });
  for (std::size_t q = 0; q < queue.size(); ++q) {
    if (!is_unsearched_[static_cast<std::size_t>(queue[q])]) continue;
    for (const int i : points_.neighbors(queue[q])) {
      const auto k = static_cast<std::size_t>(i);
      if (is_claimed_[k] || is_unsearched_[k]) continue;
      is_unsearched_[k] = true;
      queue.push_back(i);
    }
  }
}

}  // namespace plumbline
