#include <plumbline/core/parallel_for.h>
#include <plumbline/frontend/principal_axis.h>
#include <plumbline/frontend/return_cells.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace plumbline {
namespace {

// Whose directions one thread fits before it takes others.
constexpr std::size_t kCellsAtOnce = 250;

}  // namespace

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

void ReturnCells::Add(std::int64_t key, const Eigen::Vector2d& point,
                      const Eigen::Vector2d& ray, std::size_t scan) {
  const int next = static_cast<int>(cells_.size());
  const int index = cell_of_.FindOrAdd(key, next);
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

void ReturnCells::Finish(double least_share, ThreadTeam* team) {
  SortLooks();
  FillBuckets();
  if (least_share > 0.0) DropStrays(least_share);
  FitDirections(team);
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
    bucket.first_slot = num_slots_;
    num_slots_ += (bucket.entries.size() + kBlock - 1) / kBlock * kBlock;
  }
  cell_at_.resize(num_slots_);
  local_x_.resize(num_slots_);
  local_y_.resize(num_slots_);
  for (const Bucket& bucket : buckets_) FillSlots(bucket);
}

void ReturnCells::FillSlots(const Bucket& bucket) {
  constexpr float kNowhere = 1e6f;
  std::size_t slot = bucket.first_slot;
  for (const Bucket::Entry& entry : bucket.entries) {
    const Eigen::Vector2d local = entry.mean - bucket.middle;
    cell_at_[slot] = entry.index;
    local_x_[slot] = static_cast<float>(local.x());
    local_y_[slot] = static_cast<float>(local.y());
    ++slot;
  }
  for (; slot % kBlock != 0; ++slot) {
    cell_at_[slot] = -1;
    local_x_[slot] = local_y_[slot] = kNowhere;
  }
}

void ReturnCells::FindAlong(int index, double squared_gap,
                            const Eigen::Vector2d& point,
                            const Eigen::Vector2d& direction, double reach,
                            Marks* marks) const {
  using Block = Eigen::Array<float, kBlock, 1>;
  constexpr std::uint8_t kAllSettled = 0xff;
  static_assert(kBlock == 8);
  const Block bits = (Block() << 1, 2, 4, 8, 16, 32, 64, 128).finished();
  std::vector<std::size_t>& near = marks->near;
  near.clear();
  const Cell& cell = cells_[index];
  const Bucket& own = buckets_[cell.bucket];
  // Reach of a bucket's square along the axes and across the line.
  const double half = 0.5 * bucket_size_ + kRounding;
  const double farthest_across =
      reach + kRounding +
      half * (std::abs(direction.x()) + std::abs(direction.y()));
  const Eigen::Vector2d from_line = own.middle - point;
  const double own_across =
      direction.x() * from_line.y() - direction.y() * from_line.x();
  const Eigen::Vector2d own_place = cell.mean - own.middle;
  const Eigen::Vector2f along = direction.cast<float>();
  const auto per_gap = static_cast<float>(1.0 / squared_gap);
  const auto per_reach = static_cast<float>(1.0 / reach);
  for (int n = 0; n < 9; ++n) {
    const int k = own.around[n];
    if (k < 0) continue;
    const Eigen::Vector2d step(bucket_size_ * (n % 3 - 1),
                               bucket_size_ * (n / 3 - 1));
    const double across =
        own_across + direction.x() * step.y() - direction.y() * step.x();
    if (std::abs(across) > farthest_across) continue;
    const Eigen::Vector2d place = own_place - step;
    const double outside_x = std::max(std::abs(place.x()) - half, 0.0);
    const double outside_y = std::max(std::abs(place.y()) - half, 0.0);
    if (outside_x * outside_x + outside_y * outside_y > squared_gap) continue;
    const Bucket& bucket = buckets_[k];
    const Eigen::Vector2f local = place.cast<float>();
    const auto offset = static_cast<float>(across);
    const std::size_t end = bucket.first_slot + bucket.entries.size();
    for (std::size_t i = bucket.first_slot; i < end; i += kBlock) {
      const std::uint8_t settled = marks->is_settled[i / kBlock];
      if (settled == kAllSettled) continue;
      const Eigen::Map<const Block> x(&local_x_[i]);
      const Eigen::Map<const Block> y(&local_y_[i]);
      const Block gaps =
          ((x - local.x()).square() + (y - local.y()).square()) * per_gap;
      const Block offsets =
          (offset + (along.x() * y - along.y() * x)).abs() * per_reach;
      // A bit for each that is near: 1 or 0 of it is left, so that nothing
      // branches.
      constexpr float kSteep = 1e30f;
      const Block is_near = ((kFloatMargin - gaps.max(offsets)) * kSteep)
                                .max(Block::Zero())
                                .min(Block::Ones());
      const auto hits =
          static_cast<unsigned>(static_cast<int>((is_near * bits).sum()));
      std::size_t slot = i;
      for (unsigned open = hits & ~static_cast<unsigned>(settled); open != 0;
           open >>= 1, ++slot) {
        if ((open & 1u) != 0) near.push_back(slot);
      }
    }
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
    FillSlots(buckets_[k]);
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

void ReturnCells::FitDirections(ThreadTeam* team) {
  const auto fit = [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) FitDirection(&cells_[k]);
  };
  if (team == nullptr) return fit(0, cells_.size());
  const std::size_t blocks = (cells_.size() + kCellsAtOnce - 1) / kCellsAtOnce;
  team->For(blocks, [&](std::size_t block) {
    const std::size_t begin = block * kCellsAtOnce;
    fit(begin, std::min(cells_.size(), begin + kCellsAtOnce));
  });
}

void ReturnCells::FitDirection(Cell* cell) const {
  if (cell->used) return;
  LineFit fit;
  int count = 0;
  const Eigen::Vector2d origin = cell->mean;
  VisitBuckets(origin, buckets_[cell->bucket].around, normal_radius_,
               [&](int index) {
                 fit.Add(cells_[index].mean - origin, 1.0);
                 ++count;
               });
  if (count < 4) return;
  Eigen::Vector2d mean, direction;
  double across, along;
  fit.Solve(&mean, &direction, &across, &along);
  if (along <= 0.0 || across > 0.08 * along) return;
  cell->direction = direction;
  cell->straightness = along - 10.0 * across;
}

}  // namespace plumbline
