#include <plumbline/frontend/principal_axis.h>
#include <plumbline/frontend/return_cells.h>

#include <algorithm>
#include <cmath>

namespace plumbline {

void LineFit::Solve(Eigen::Vector2d* mean, Eigen::Vector2d* direction,
                    double* across, double* along) const {
  *mean = sum / n;
  const double sxx = xx / n - mean->x() * mean->x();
  const double sxy = xy / n - mean->x() * mean->y();
  const double syy = yy / n - mean->y() * mean->y();
  const PrincipalAxis axis = PrincipalAxisOf(sxx, sxy, syy);
  *direction = axis.direction;
  *across = axis.across;
  *along = axis.along;
}

void ReturnCells::Clear() {
  cells_.clear();
  cell_of_.Clear();
  looks_.clear();
}

void ReturnCells::Add(const Eigen::Vector2d& point, const Eigen::Vector2d& ray,
                      std::size_t scan) {
  const auto column =
      static_cast<std::int64_t>(std::floor(point.x() / cell_size_));
  const auto row =
      static_cast<std::int64_t>(std::floor(point.y() / cell_size_));
  const int next = static_cast<int>(cells_.size());
  const int index = cell_of_.FindOrAdd(CellKey(column, row), next);
  if (index == next) cells_.emplace_back();
  Cell& cell = cells_[index];
  cell.sum += point;
  cell.view -= ray;
  ++cell.returns;
  if (cell.last_scan != scan) {
    cell.last_scan = scan;
    looks_.emplace_back(index, scan);
  }
}

void ReturnCells::Finish(double least_share) {
  SortLooks();
  FillBuckets();
  if (least_share > 0.0) DropStrays(least_share);
  FitDirections();
}

void ReturnCells::SortLooks() {
  scans_begin_.assign(cells_.size() + 1, 0);
  for (const auto& look : looks_) ++scans_begin_[look.first + 1];
  for (std::size_t k = 0; k < cells_.size(); ++k) {
    scans_begin_[k + 1] += scans_begin_[k];
  }
  scans_.resize(looks_.size());
  std::vector<std::size_t> next(scans_begin_.begin(), scans_begin_.end() - 1);
  for (const auto& [cell, scan] : looks_) scans_[next[cell]++] = scan;
}

void ReturnCells::FillBuckets() {
  bucket_of_.Clear();
  buckets_.clear();
  for (std::size_t i = 0; i < cells_.size(); ++i) {
    Cell& cell = cells_[i];
    cell.mean = cell.sum / cell.returns;
    const int next = static_cast<int>(buckets_.size());
    cell.bucket = bucket_of_.FindOrAdd(BucketKey(cell.mean, 0, 0), next);
    if (cell.bucket == next) {
      buckets_.emplace_back();
      buckets_.back().middle =
          bucket_size_ * ((cell.mean / bucket_size_).array().floor() + 0.5);
    }
    buckets_[cell.bucket].entries.push_back({cell.mean, static_cast<int>(i)});
  }
  num_slots_ = 0;
  for (Bucket& bucket : buckets_) {
    bucket.around = BucketsAround(bucket.middle);
    bucket.FillLocal();
    bucket.first_slot = num_slots_;
    num_slots_ += bucket.x.size();
  }
}

std::int64_t ReturnCells::BucketKey(const Eigen::Vector2d& point, int dx,
                                    int dy) const {
  return CellKey(
      static_cast<std::int64_t>(std::floor(point.x() / bucket_size_)) + dx,
      static_cast<std::int64_t>(std::floor(point.y() / bucket_size_)) + dy);
}

std::array<int, 9> ReturnCells::BucketsAround(
    const Eigen::Vector2d& point) const {
  std::array<int, 9> around;
  int k = 0;
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) {
      around[k++] = bucket_of_.Find(BucketKey(point, dx, dy));
    }
  }
  return around;
}

void ReturnCells::Use(int index) {
  Cell& cell = cells_[index];
  if (cell.used) return;
  cell.used = true;
  used_up_.push_back(cell.bucket);
}

void ReturnCells::DropUsed() {
  std::sort(used_up_.begin(), used_up_.end());
  used_up_.erase(std::unique(used_up_.begin(), used_up_.end()), used_up_.end());
  for (const int k : used_up_) {
    std::vector<Bucket::Entry>& entries = buckets_[k].entries;
    entries.erase(std::remove_if(entries.begin(), entries.end(),
                                 [this](const Bucket::Entry& entry) {
                                   return cells_[entry.index].used;
                                 }),
                  entries.end());
    buckets_[k].FillLocal();
  }
  used_up_.clear();
}

void ReturnCells::DropStrays(double least_share) {
  for (std::size_t i = 0; i < cells_.size(); ++i) {
    int most = 0;
    VisitBuckets(
        cells_[i].mean, buckets_[cells_[i].bucket].around, normal_radius_,
        [&](int index) { most = std::max(most, cells_[index].returns); });
    if (cells_[i].returns < least_share * most) Use(static_cast<int>(i));
  }
  DropUsed();
}

void ReturnCells::FitDirections() {
  for (Cell& cell : cells_) {
    if (cell.used) continue;
    LineFit fit;
    int count = 0;
    const Eigen::Vector2d origin = cell.mean;
    VisitBuckets(origin, buckets_[cell.bucket].around, normal_radius_,
                 [&](int index) {
                   fit.Add(cells_[index].mean - origin, 1.0);
                   ++count;
                 });
    if (count < 4) continue;
    Eigen::Vector2d mean, direction;
    double across, along;
    fit.Solve(&mean, &direction, &across, &along);
    if (along <= 0.0 || across > 0.08 * along) continue;
    cell.direction = direction;
    cell.straightness = along - 10.0 * across;
  }
}

}  // namespace plumbline
