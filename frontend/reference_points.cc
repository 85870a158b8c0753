#include <plumbline/frontend/reference_points.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <utility>

namespace plumbline {
namespace {

// Cosine of the largest angle between the normals of points that are one.
constexpr double kOneSurface = 0.9;

// Buckets farther away have no number, m.
constexpr double kFarthest = 1e8;

// Rows or columns up to which points are sorted by counting.
constexpr int kMostCounted = 1 << 16;

// Sorts entries stably by `key`, which has values from `least` on, up to
// `most`.
template <typename Entry, typename Key>
void SortByCounting(int least, int most, const Key& key,
                    std::vector<Entry>* entries) {
  std::vector<int> begin(static_cast<std::size_t>(most - least) + 2, 0);
  for (const Entry& entry : *entries) ++begin[key(entry) - least + 1];
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  std::vector<Entry> sorted(entries->size());
  for (const Entry& entry : *entries)
    sorted[begin[key(entry) - least]++] = entry;
  entries->swap(sorted);
}

}  // namespace

// By rows, in each by columns, and in a bucket as they were given.
std::vector<ReferencePoints::Entry> ReferencePoints::Sorted(
    const std::vector<ReferencePoint>& points) {
  std::vector<Entry> entries;
  entries.reserve(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector2d& position = points[i].position;
    if (!(std::abs(position.x()) < kFarthest &&
          std::abs(position.y()) < kFarthest)) {
      continue;
    }
    entries.push_back({static_cast<int>(std::floor(position.y() / kBucketSize)),
                       static_cast<int>(std::floor(position.x() / kBucketSize)),
                       static_cast<int>(i)});
  }
  if (entries.empty()) return entries;
  int low_row = entries[0].row, high_row = low_row;
  int low_column = entries[0].column, high_column = low_column;
  for (const Entry& entry : entries) {
    low_row = std::min(low_row, entry.row);
    high_row = std::max(high_row, entry.row);
    low_column = std::min(low_column, entry.column);
    high_column = std::max(high_column, entry.column);
  }
  // One wild return must not ask for memory.
  if (high_row / 2 - low_row / 2 > kMostCounted ||
      high_column / 2 - low_column / 2 > kMostCounted) {
    std::stable_sort(
        entries.begin(), entries.end(), [](const Entry& a, const Entry& b) {
          return std::pair(a.row, a.column) < std::pair(b.row, b.column);
        });
    return entries;
  }
  SortByCounting(
      low_column, high_column, [](const Entry& entry) { return entry.column; },
      &entries);
  SortByCounting(
      low_row, high_row, [](const Entry& entry) { return entry.row; },
      &entries);
  return entries;
}

// Makes one of points that lie near each other and look the same way: their
// mean. What was seen often is a band as wide as its noise, in which whatever
// lies there has a partner to hand: it creeps to its place, past many that say
// the same. The bucket is the last one so far.
void ReferencePoints::Merge(const ReferencePoint& point, Bucket* bucket) {
  const auto is_one = [&](std::size_t k) {
    return (point.position - points_[k].position).squaredNorm() <
               merge_distance_ * merge_distance_ &&
           point.normal.dot(points_[k].normal) >= kOneSurface;
  };
  const auto first = static_cast<std::size_t>(bucket->begin);
  // Mostly with the one before it.
  auto k = static_cast<std::size_t>(bucket->last);
  if (k >= points_.size() || !is_one(k)) {
    k = first;
    while (k < points_.size() && !is_one(k)) ++k;
  }
  bucket->last = static_cast<int>(k);
  if (k == points_.size()) {
    points_.push_back(point);
    shares_.push_back(1);
    return;
  }
  ReferencePoint& mean = points_[k];
  const int share = ++shares_[k];
  mean.position += (point.position - mean.position) / share;
  mean.normal =
      (mean.normal + (point.normal - mean.normal) / share).normalized();
}

void ReferencePoints::Add(std::vector<ReferencePoint> points) {
  const std::vector<Entry> entries = Sorted(points);
  std::vector<ReferencePoint> old_points;
  std::vector<int> old_shares;
  std::vector<Bucket> old_buckets;
  old_points.swap(points_);
  old_shares.swap(shares_);
  old_buckets.swap(buckets_);
  points_.reserve(old_points.size() + points.size());
  shares_.reserve(old_points.size() + points.size());
  buckets_.reserve(old_buckets.size() + entries.size());
  auto old = old_buckets.begin();
  // Takes over the old buckets up to `end`.
  const auto keep_up_to = [&](std::vector<Bucket>::iterator end) {
    if (old == end) return;
    const auto first = static_cast<std::ptrdiff_t>(old->begin);
    const auto last = end == old_buckets.end()
                          ? static_cast<std::ptrdiff_t>(old_points.size())
                          : static_cast<std::ptrdiff_t>(end->begin);
    const int shift = static_cast<int>(points_.size()) - old->begin;
    points_.insert(points_.end(), old_points.begin() + first,
                   old_points.begin() + last);
    shares_.insert(shares_.end(), old_shares.begin() + first,
                   old_shares.begin() + last);
    for (; old != end; ++old) {
      buckets_.push_back(
          {old->row, old->column, old->begin + shift, old->last + shift});
    }
  };
  for (auto next = entries.begin(); next != entries.end();) {
    const int row = next->row;
    const int column = next->column;
    auto here = old;
    while (here != old_buckets.end() &&
           (here->row < row || (here->row == row && here->column < column))) {
      ++here;
    }
    if (here != old_buckets.end() && here->row == row &&
        here->column == column) {
      keep_up_to(here + 1);
    } else {
      keep_up_to(here);
      const int begin = static_cast<int>(points_.size());
      buckets_.push_back({row, column, begin, begin});
    }
    for (; next != entries.end() && next->row == row && next->column == column;
         ++next) {
      Merge(points[static_cast<std::size_t>(next->point)], &buckets_.back());
    }
  }
  keep_up_to(old_buckets.end());
  if (given_.empty()) {
    given_ = std::move(points);
  } else {
    given_.insert(given_.end(), points.begin(), points.end());
  }
}

}  // namespace plumbline
