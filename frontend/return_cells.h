#ifndef PLUMBLINE_FRONTEND_RETURN_CELLS_H_
#define PLUMBLINE_FRONTEND_RETURN_CELLS_H_

#include <plumbline/core/parallel_for.h>
#include <plumbline/frontend/cell_index.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

namespace plumbline {

/// Total least squares line through points with weights, m.
struct LineFit {
  /// Sum of the weights.
  double n = 0.0;
  /// Weighted sum of the points, m.
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  /// Weighted sum of the products of coordinates, m^2.
  double xx = 0.0;
  double xy = 0.0;  ///< See xx.
  double yy = 0.0;  ///< See xx.

  /// Adds a point.
  void Add(const Eigen::Vector2d& p, double weight) {
    n += weight;
    sum += weight * p;
    xx += weight * p.x() * p.x();
    xy += weight * p.x() * p.y();
    yy += weight * p.y() * p.y();
  }
  /// Mean of the points, direction of the line, and their variances across and
  /// along it, m^2.
  void Solve(Eigen::Vector2d* mean, Eigen::Vector2d* direction, double* across,
             double* along) const;
};

/// Laser returns of many scans gathered in the cells of a grid, with searches
/// for cells near a place or along a line. Map frame, m. Searches may run on
/// several threads between changes.
class ReturnCells {
 public:
  /// Returns gathered in one cell.
  struct Cell {
    /// Of their positions.
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    /// Towards the lasers that saw it.
    Eigen::Vector2d view = Eigen::Vector2d::Zero();
    int returns = 0;
    /// The last scan that saw it; none before the first.
    std::size_t last_scan = std::numeric_limits<std::size_t>::max();
    /// Direction of the surface; zero where it is not straight.
    Eigen::Vector2d direction = Eigen::Vector2d::Zero();
    /// Larger for straighter surroundings; 0 where they are not straight.
    double straightness = 0.0;
    /// Taken by a wall: no search finds it any more.
    bool used = false;
    /// The bucket that it lies in.
    int bucket = 0;
  };

  /// Cells that are compared at a time.
  static constexpr int kBlock = 8;

  /// What a search along lines marks, kept for its memory. All 0 between two
  /// searches.
  struct Marks {
    /// By block of slots, a bit each: taken in, or never to be.
    std::vector<std::uint8_t> is_settled;
    /// Slots that are not 0.
    std::vector<std::size_t> settled;
    /// Slots that a search is to look at.
    std::vector<std::size_t> near;

    /// Marks a slot.
    void Settle(std::size_t slot) {
      std::uint8_t& block = is_settled[slot / kBlock];
      block = static_cast<std::uint8_t>(block | 1u << (slot % kBlock));
      settled.push_back(slot);
    }
    /// Takes all marks away.
    void Clear() {
      for (const std::size_t slot : settled) is_settled[slot / kBlock] = 0;
      settled.clear();
    }
  };

  /// Cells of side `cell_size`; surroundings are those within `normal_radius`,
  /// and searches along lines bridge gaps up to `max_gap`, m.
  ReturnCells(double cell_size, double normal_radius, double max_gap)
      : cell_size_(cell_size),
        normal_radius_(normal_radius),
        bucket_size_(std::max(normal_radius, max_gap)) {}

  /// Takes out everything.
  void Clear();

  /// Sets memory aside for the cells of so many returns: a log has some twenty
  /// or more in a cell.
  void Reserve(std::size_t num_returns) { cells_.reserve(num_returns / 20); }

  /// Adds a return of a scan; `ray` points from the laser to it and has the
  /// length 1. Scans come in ascending order.
  void Add(const Eigen::Vector2d& point, const Eigen::Vector2d& ray,
           std::size_t scan) {
    Add(KeyOf(point), point, ray, scan);
  }
  /// Add with the KeyOf() the point, found before.
  void Add(std::int64_t key, const Eigen::Vector2d& point,
           const Eigen::Vector2d& ray, std::size_t scan);
  /// Key of the cell of a point.
  std::int64_t KeyOf(const Eigen::Vector2d& point) const {
    return CellKey(
        static_cast<std::int64_t>(std::floor(point.x() / cell_size_)),
        static_cast<std::int64_t>(std::floor(point.y() / cell_size_)));
  }

  /// Prepares searches, and fits directions. To be called once all returns are
  /// in. No search finds cells with less than `least_share` of the returns that
  /// one of their surroundings has: strays beside what stands there. The result
  /// is the same with any team of threads (null: the caller's alone).
  void Finish(double least_share = 0.0, ThreadTeam* team = nullptr);

  /// The cells in the order in which they were first seen.
  const std::vector<Cell>& cells() const { return cells_; }
  /// The scans that saw a cell, ascending: [first, second). To be asked for
  /// after Finish.
  std::pair<const std::size_t*, const std::size_t*> ScansOf(int index) const {
    return {scans_.data() + scans_begin_[index],
            scans_.data() + scans_begin_[index + 1]};
  }
  /// Side of the buckets in which searches look, m.
  double bucket_size() const { return bucket_size_; }

  /// Calls `look(index)` with the cells within `radius` (at most bucket_size())
  /// of a place.
  template <typename Look>
  void VisitNear(const Eigen::Vector2d& place, double radius,
                 const Look& look) const {
    VisitBuckets(place, BucketsAround(place), radius, look);
  }

  /// Prepares marks, and marks a cell.
  void Mark(int index, Marks* marks) const {
    marks->is_settled.resize(num_slots_ / kBlock, 0);
    const Bucket& bucket = buckets_[cells_[index].bucket];
    marks->Settle(bucket.first_slot + bucket.SlotOf(index));
  }

  /// Calls `look(index, mean, slot)` with cells that are not marked, those
  /// within the gap (its square is given, m^2) of the cell `index` and within
  /// `reach`, m, of a line among them. The line goes through `point` and has
  /// the direction `direction`, which `look` must not change.
  template <typename Look>
  void VisitAlong(int index, double squared_gap, const Eigen::Vector2d& point,
                  const Eigen::Vector2d& direction, double reach, Marks* marks,
                  const Look& look) const {
    // What `look` does changes nothing of what is near, but its marks, each
    // cell its own.
    FindAlong(index, squared_gap, point, direction, reach, marks);
    for (const std::size_t slot : marks->near) {
      const int near = cell_at_[slot];
      look(near, cells_[near].mean, slot);
    }
  }

  /// Marks a cell as taken by a wall.
  void Use(int index);
  /// Takes the cells that were used out of searches.
  void DropUsed();

 private:
  static constexpr double kRounding = 1e-9;
  // What single precision may be off by.
  static constexpr float kFloatMargin = 1.001f;

  // Cells that have not been used up, by place.
  struct Bucket {
    /// A cell with returns.
    struct Entry {
      /// Mean of its returns, m.
      Eigen::Vector2d mean;
      /// Its number.
      int index;
    };
    std::vector<Entry> entries;
    Eigen::Vector2d middle;
    // Itself and those beside it, -1 for none.
    std::array<int, 9> around;
    // Number of its first entry's slot.
    std::size_t first_slot = 0;

    // Place of a cell that is among the entries.
    std::size_t SlotOf(int index) const {
      std::size_t slot = 0;
      while (entries[slot].index != index) ++slot;
      return slot;
    }
  };

  std::int64_t BucketKey(const Eigen::Vector2d& point, int dx, int dy) const;
  // The bucket of a point and those beside it; -1 for one without cells.
  std::array<int, 9> BucketsAround(const Eigen::Vector2d& point) const;
  // Puts the slots of what VisitAlong looks at into `marks`, those clearly too
  // far away left out several at a time.
  void FindAlong(int index, double squared_gap, const Eigen::Vector2d& point,
                 const Eigen::Vector2d& direction, double reach,
                 Marks* marks) const;
  // After every change of a bucket's entries.
  void FillSlots(const Bucket& bucket);
  void SortLooks();
  void FillBuckets();
  void DropStrays(double least_share);
  void FitDirections(ThreadTeam* team);
  void FitDirection(Cell* cell) const;

  template <typename Look>
  void VisitBuckets(const Eigen::Vector2d& place,
                    const std::array<int, 9>& around, double radius,
                    const Look& look) const {
    for (const int bucket : around) {
      if (bucket < 0) continue;
      for (const typename Bucket::Entry& entry : buckets_[bucket].entries) {
        if ((entry.mean - place).squaredNorm() <= radius * radius) {
          look(entry.index);
        }
      }
    }
  }

  const double cell_size_;
  const double normal_radius_;
  const double bucket_size_;
  std::vector<Cell> cells_;
  CellIndex cell_of_;
  // Each scan with each cell that it saw, as they came in, and once sorted by
  // cells: those of cell k begin at scans_begin_[k].
  std::vector<std::pair<int, std::size_t>> looks_;
  std::vector<std::size_t> scans_;
  std::vector<std::size_t> scans_begin_;
  std::vector<Bucket> buckets_;
  CellIndex bucket_of_;
  // Buckets that hold cells which have been used.
  std::vector<int> used_up_;
  // By slot: the cell, and its mean from the middle of its bucket on. Every
  // bucket has whole blocks of slots; those without an entry are nowhere.
  std::size_t num_slots_ = 0;
  std::vector<int> cell_at_;
  std::vector<float> local_x_, local_y_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_RETURN_CELLS_H_
