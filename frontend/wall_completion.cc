#include <plumbline/core/parallel_for.h>
#include <plumbline/core/wall.h>
#include <plumbline/frontend/range_noise.h>
#include <plumbline/frontend/wall_completion.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <optional>
#include <unordered_map>
#include <utility>

namespace plumbline {
namespace {

constexpr double kIndexCell = 1.0;
constexpr double kCoveragePiece = 0.1;
constexpr double kRounding = 1e-9;
// Cells that are compared at a time, and what single precision may be off by.
constexpr int kBlock = 4;
constexpr float kFloatMargin = 1.001f;
// A wall has at least so many cells.
constexpr std::size_t kFewestCells = 6;
// Scans and seeds that are looked at by all threads together, before what was
// found is taken in.
constexpr std::size_t kScansAtOnce = 256;
constexpr std::size_t kSeedsAtOnce = 64;
constexpr std::size_t kMostSeedsAtOnce = 1024;
constexpr std::size_t kWordBits = 64;
// Standard deviations of a range at which a return is no longer one of a wall.
constexpr double kExplainedSigmas = 5.0;

std::int64_t CellKey(std::int64_t column, std::int64_t row) {
  // Unsigned, since a negative column cannot be shifted.
  return static_cast<std::int64_t>(
      static_cast<std::uint64_t>(column) << 32 |
      (static_cast<std::uint64_t>(row) & 0xffffffffu));
}

struct IndexedWall : Wall {
  FeatureId id = kNoId;

  IndexedWall(FeatureId id, const Wall& wall) : Wall(wall), id(id) {}
};

// Walls by the index cells that they pass through.
class WallIndex {
 public:
  WallIndex(const Graph& graph, double reach) : reach_(reach) {
    for (const Feature* feature : graph.Features()) {
      if (!feature->type->Is(FeatureRole::kWall) ||
          !feature->type->traits.is_one_sided || feature->is_virtual) {
        continue;
      }
      Insert({feature->id, *WallOf(*feature)});
    }
    num_known_ = walls_.size();
  }

  void Insert(const IndexedWall& wall) {
    walls_.push_back(wall);
    const int i = static_cast<int>(walls_.size()) - 1;
    const double begin = wall.begin - reach_;
    const double end = wall.end + reach_;
    const int steps =
        static_cast<int>(std::ceil((end - begin) / (0.5 * kIndexCell)));
    for (int k = 0; k <= steps; ++k) {
      const double t = begin + (end - begin) * k / std::max(1, steps);
      const auto column =
          static_cast<std::int64_t>(std::floor(wall.At(t).x() / kIndexCell));
      const auto row =
          static_cast<std::int64_t>(std::floor(wall.At(t).y() / kIndexCell));
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx) {
          std::vector<int>& cell = cells_[CellKey(column + dx, row + dy)];
          if (cell.empty() || cell.back() != i) cell.push_back(i);
        }
      }
    }
  }

  // The cell asked for last: neighbouring returns mostly fall into one.
  struct LastCell {
    bool is_known = false;
    std::int64_t key = 0;
    const std::vector<int>* walls = nullptr;
  };

  bool Explains(const Eigen::Vector2d& point, double offset, double gap,
                LastCell* last) const {
    const std::int64_t key =
        CellKey(static_cast<std::int64_t>(std::floor(point.x() / kIndexCell)),
                static_cast<std::int64_t>(std::floor(point.y() / kIndexCell)));
    if (!last->is_known || key != last->key) {
      const auto found = cells_.find(key);
      *last = {true, key, found == cells_.end() ? nullptr : &found->second};
    }
    if (last->walls == nullptr) return false;
    for (const int index : *last->walls) {
      const Wall& wall = walls_[index];
      if (std::abs(wall.Across(point)) > offset) continue;
      const double along = wall.Along(point);
      if (along >= wall.begin - gap && along <= wall.end + gap) return true;
    }
    return false;
  }

  const std::vector<IndexedWall>& walls() const { return walls_; }
  // The first so many are features of the graph, the others are new.
  std::size_t num_known() const { return num_known_; }

 private:
  const double reach_;
  std::size_t num_known_ = 0;
  std::vector<IndexedWall> walls_;
  std::unordered_map<std::int64_t, std::vector<int>> cells_;
};

// Returns gathered in one cell.
struct Cell {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  // Towards the lasers that saw it.
  Eigen::Vector2d view = Eigen::Vector2d::Zero();
  int returns = 0;
  // Scans that saw it, ascending.
  std::vector<std::size_t> scans;
  // Direction of the surface; only where it is straight.
  Eigen::Vector2d direction = Eigen::Vector2d::Zero();
  double straightness = 0.0;
  bool used = false;
  int bucket = 0;

  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
};

// Total least squares line through cells, each with the weight of its returns.
struct Fit {
  double n = 0.0;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double xx = 0.0, xy = 0.0, yy = 0.0;

  void Add(const Eigen::Vector2d& p, double weight) {
    n += weight;
    sum += weight * p;
    xx += weight * p.x() * p.x();
    xy += weight * p.x() * p.y();
    yy += weight * p.y() * p.y();
  }
  void Solve(Eigen::Vector2d* mean, Eigen::Vector2d* direction, double* across,
             double* along) const {
    *mean = sum / n;
    const double sxx = xx / n - mean->x() * mean->x();
    const double sxy = xy / n - mean->x() * mean->y();
    const double syy = yy / n - mean->y() * mean->y();
    const double angle = 0.5 * std::atan2(2.0 * sxy, sxx - syy);
    const double radical = std::hypot(0.5 * (sxx - syy), sxy);
    *direction = {std::cos(angle), std::sin(angle)};
    *across = std::max(0.0, 0.5 * (sxx + syy) - radical);
    *along = 0.5 * (sxx + syy) + radical;
  }
};

// Sums of a least squares line through samples along and across a wall, m.
struct LineSums {
  double n = 0.0, x = 0.0, y = 0.0, xx = 0.0, xy = 0.0, yy = 0.0;

  void Add(double along, double across) {
    n += 1.0;
    x += along;
    y += across;
    xx += along * along;
    xy += along * across;
    yy += across * across;
  }
  LineSums operator-(const LineSums& o) const {
    return {n - o.n, x - o.x, y - o.y, xx - o.xx, xy - o.xy, yy - o.yy};
  }
  // Sum of squares of the way along around its mean, m^2.
  double Spread() const { return std::max(xx - x * x / n, 1e-12); }
  double Slope() const { return (xy - x * y / n) / Spread(); }
  double SquaredError() const {
    const double cross = xy - x * y / n;
    return std::max(yy - y * y / n - cross * cross / Spread(), 0.0);
  }
};

double Cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

// A line that grows from a cell.
struct GrownLine {
  // The cell's mean: sums are taken about it, so that they are as exact far
  // from the map's origin.
  Eigen::Vector2d origin = Eigen::Vector2d::Zero();
  // Of the line's cells, from there.
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  Eigen::Vector2d direction = Eigen::Vector2d::UnitX();
  // Variances of the cells, m^2.
  double across = 0.0;
  double along = 0.0;

  void FitTo(const Fit& fit) { fit.Solve(&mean, &direction, &across, &along); }
  Eigen::Vector2d point() const { return origin + mean; }
  double Along(const Eigen::Vector2d& place) const {
    return direction.dot(place - origin - mean);
  }
  double Distance(const Eigen::Vector2d& place) const {
    return std::abs(Cross(direction, place - origin - mean));
  }
};

class Completion {
 public:
  Completion(const Graph& graph, const Registry& registry,
             const WallCompletionOptions& options,
             const std::function<bool()>& stop)
      : registry_(registry),
        options_(options),
        stop_(stop),
        index_(graph, options.explained_gap) {}

  Transaction Run(const std::vector<Scan>& scans,
                  const std::vector<Pose2>& poses) {
    const std::size_t count = std::min(scans.size(), poses.size());
    // Stretch by stretch first: poses of one visit agree better with each
    // other than with those of the next. Stretches overlap by half.
    std::vector<std::size_t> half_way = {0};
    double way = 0.0;
    for (std::size_t i = 1; i < count; ++i) {
      way += (poses[i] - poses[i - 1]).head<2>().norm();
      if (way >= 0.5 * options_.stretch) {
        half_way.push_back(i);
        way = 0.0;
      }
    }
    half_way.push_back(count);
    NumberReturns(scans, count);
    for (std::size_t k = 0; k + 2 < half_way.size(); ++k) {
      Look(scans, poses, half_way[k], half_way[k + 2], {1.0});
    }
    // Then all together, also what scans from poses less exact have smeared.
    Look(scans, poses, 0, count, {1.0, 2.0});
    if (is_stopped_) return {};
    return std::move(transaction_);
  }

 private:
  bool IsStopped() {
    if (!is_stopped_ && stop_ && stop_()) is_stopped_ = true;
    return is_stopped_;
  }

  void Look(const std::vector<Scan>& scans, const std::vector<Pose2>& poses,
            std::size_t begin, std::size_t end,
            std::initializer_list<double> smears) {
    Gather(scans, poses, begin, end);
    FillBuckets();
    FitDirections();
    // The straightest surroundings first; ties by the order of scans.
    std::vector<int> order;
    for (std::size_t i = 0; i < cells_.size(); ++i) {
      if (cells_[i].straightness > 0.0) order.push_back(static_cast<int>(i));
    }
    std::sort(order.begin(), order.end(), [this](int a, int b) {
      return cells_[a].straightness != cells_[b].straightness
                 ? cells_[a].straightness > cells_[b].straightness
                 : a < b;
    });
    for (const double smear : smears) {
      scatter_ = smear * options_.max_scatter;
      GrowAll(order);
      if (is_stopped_) return;
    }
  }

  // Grows a wall from each of these cells in turn that is not used by then.
  // Most seeds come to nothing and change nothing, so that many are tried at a
  // time; those after the first that makes a wall are tried once more.
  void GrowAll(const std::vector<int>& seeds) {
    const auto threads =
        static_cast<std::size_t>(std::max(1, options_.num_threads));
    std::size_t at_once = kSeedsAtOnce;
    std::vector<int> tried;
    std::vector<std::optional<GrownWall>> grown;
    scratch_.resize(threads);
    for (std::size_t k = 0; k < seeds.size() && !IsStopped();) {
      tried.clear();
      std::size_t end = k;
      while (end < seeds.size() && tried.size() < at_once) {
        if (!cells_[seeds[end]].used) tried.push_back(static_cast<int>(end));
        ++end;
      }
      const std::size_t share = (tried.size() + threads - 1) / threads;
      grown.assign(threads, std::nullopt);
      ParallelFor(threads, options_.num_threads, [&](std::size_t t) {
        const std::size_t last = std::min(tried.size(), (t + 1) * share);
        for (std::size_t i = t * share; i < last && !grown[t]; ++i) {
          grown[t] = Grow(seeds[tried[i]], &scratch_[t]);
          if (grown[t]) grown[t]->position = tried[i];
        }
      });
      const auto first =
          std::find_if(grown.begin(), grown.end(),
                       [](const auto& wall) { return wall.has_value(); });
      if (first == grown.end()) {
        k = end;
        at_once = std::min(2 * at_once, kMostSeedsAtOnce);
      } else {
        k = (*first)->position + 1;
        Keep(**first);
        at_once = kSeedsAtOnce;
      }
    }
  }

  // A bit of each return says when nobody need look at it again.
  void NumberReturns(const std::vector<Scan>& scans, std::size_t count) {
    first_word_.assign(1, 0);
    for (std::size_t i = 0; i < count; ++i) {
      first_word_.push_back(first_word_.back() +
                            (scans[i].ranges.size() + kWordBits - 1) /
                                kWordBits);
    }
    is_done_.assign(first_word_.back(), 0);
  }

  // Sorts the returns that no wall explains into cells.
  void Gather(const std::vector<Scan>& scans, const std::vector<Pose2>& poses,
              std::size_t begin, std::size_t end) {
    cells_.clear();
    cell_of_.clear();
    std::vector<std::vector<Return>> unexplained(kScansAtOnce);
    for (std::size_t i = begin; i < end && !IsStopped(); i += kScansAtOnce) {
      const std::size_t count = std::min(kScansAtOnce, end - i);
      ParallelFor(count, options_.num_threads, [&](std::size_t k) {
        FindUnexplained(scans[i + k], poses[i + k],
                        is_done_.data() + first_word_[i + k], &unexplained[k]);
      });
      for (std::size_t k = 0; k < count; ++k) {
        for (const Return& one : unexplained[k]) AddToCell(one, i + k);
      }
    }
  }

  struct Return {
    Eigen::Vector2d point;
    // From the laser, of length 1.
    Eigen::Vector2d ray;
  };

  // Those of a scan, at this pose. Explained once is explained for good, as
  // walls only come.
  void FindUnexplained(const Scan& scan, const Pose2& pose,
                       std::uint64_t* is_done,
                       std::vector<Return>* unexplained) const {
    unexplained->clear();
    const Pose2 laser = Compose(pose, scan.laser_offset);
    WallIndex::LastCell last;
    for (std::size_t beam = 0; beam < scan.ranges.size(); ++beam) {
      std::uint64_t& word = is_done[beam / kWordBits];
      const std::uint64_t bit = std::uint64_t{1} << (beam % kWordBits);
      if ((word & bit) != 0) continue;
      const double range = scan.ranges[beam];
      if (!(range >= options_.points.minimum_range) ||
          range > options_.points.usable_range) {
        word |= bit;
        continue;
      }
      const double angle =
          scan.bearings.empty()
              ? laser[2] + scan.start_angle + beam * scan.angle_step
              : laser[2] + scan.bearings[beam];
      const Eigen::Vector2d ray(std::cos(angle), std::sin(angle));
      const Eigen::Vector2d point = laser.head<2>() + range * ray;
      if (index_.Explains(point, options_.explained_offset,
                          options_.explained_gap, &last)) {
        word |= bit;
      } else {
        unexplained->push_back({point, ray});
      }
    }
  }

  void AddToCell(const Return& one, std::size_t scan) {
    const auto column = static_cast<std::int64_t>(
        std::floor(one.point.x() / options_.cell_size));
    const auto row = static_cast<std::int64_t>(
        std::floor(one.point.y() / options_.cell_size));
    const auto inserted = cell_of_.try_emplace(CellKey(column, row),
                                               static_cast<int>(cells_.size()));
    if (inserted.second) cells_.emplace_back();
    Cell& cell = cells_[inserted.first->second];
    cell.sum += one.point;
    cell.view -= one.ray;
    ++cell.returns;
    if (cell.scans.empty() || cell.scans.back() != scan) {
      cell.scans.push_back(scan);
    }
  }

  // Cells by buckets as wide as the largest neighbourhood asked for.
  void FillBuckets() {
    bucket_size_ = std::max(options_.normal_radius, options_.max_gap);
    bucket_of_.clear();
    buckets_.clear();
    for (std::size_t i = 0; i < cells_.size(); ++i) {
      Cell& cell = cells_[i];
      cell.mean = cell.sum / cell.returns;
      const auto inserted = bucket_of_.try_emplace(
          BucketKey(cell.mean, 0, 0), static_cast<int>(buckets_.size()));
      if (inserted.second) {
        buckets_.emplace_back();
        buckets_.back().middle =
            bucket_size_ * ((cell.mean / bucket_size_).array().floor() + 0.5);
      }
      cell.bucket = inserted.first->second;
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

  std::int64_t BucketKey(const Eigen::Vector2d& point, int dx, int dy) const {
    return CellKey(
        static_cast<std::int64_t>(std::floor(point.x() / bucket_size_)) + dx,
        static_cast<std::int64_t>(std::floor(point.y() / bucket_size_)) + dy);
  }

  // The bucket of a point and those beside it; -1 for one without cells.
  std::array<int, 9> BucketsAround(const Eigen::Vector2d& point) const {
    std::array<int, 9> around;
    int k = 0;
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        const auto found = bucket_of_.find(BucketKey(point, dx, dy));
        around[k++] = found == bucket_of_.end() ? -1 : found->second;
      }
    }
    return around;
  }

  // Cells that were used up are left out.
  template <typename Function>
  void ForNeighbors(const Eigen::Vector2d& center,
                    const std::array<int, 9>& around, double radius,
                    Function function) const {
    for (const int bucket : around) {
      if (bucket < 0) continue;
      for (const Bucket::Entry& entry : buckets_[bucket].entries) {
        if ((entry.mean - center).squaredNorm() <= radius * radius) {
          function(entry.index);
        }
      }
    }
  }

  void Use(int index) {
    Cell& cell = cells_[index];
    if (cell.used) return;
    cell.used = true;
    used_up_.push_back(cell.bucket);
  }

  // Takes what has been used out of the buckets.
  void DropUsed() {
    std::sort(used_up_.begin(), used_up_.end());
    used_up_.erase(std::unique(used_up_.begin(), used_up_.end()),
                   used_up_.end());
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

  void FitDirections() {
    for (Cell& cell : cells_) {
      Fit fit;
      int count = 0;
      const Eigen::Vector2d origin = cell.mean;
      ForNeighbors(origin, buckets_[cell.bucket].around, options_.normal_radius,
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

  // A wall that a cell has grown to.
  struct GrownWall {
    GrownLine line;
    std::vector<int> cells;
    double begin = 0.0, end = 0.0;
    // Towards the lasers that saw it.
    Eigen::Vector2d view = Eigen::Vector2d::Zero();
    // The seed's place among all.
    std::size_t position = 0;
  };

  // What growing needs, kept for its memory.
  struct Scratch {
    // By slot: taken in, or never to be. All 0 between two calls.
    std::vector<std::uint8_t> is_settled;
    std::vector<std::size_t> settled;
    std::vector<int> members;
  };

  // What lies in line with a cell, when it is long, whole and straight enough
  // for a wall.
  std::optional<GrownWall> Grow(int seed, Scratch* scratch) const {
    GrownWall wall;
    GrownLine& line = wall.line;
    line.origin = cells_[seed].mean;
    line.direction = cells_[seed].direction;
    CollectInLine(seed, &line, scratch);
    wall.cells = FitFinally(scratch->members, &line);
    const std::vector<int>& on = wall.cells;
    if (on.empty() || line.across > scatter_ * scatter_) return std::nullopt;
    std::vector<double> places;
    for (const int index : on) {
      places.push_back(line.Along(cells_[index].mean));
      wall.view += cells_[index].view;
    }
    std::sort(places.begin(), places.end());
    const double length = places.back() - places.front();
    if (length < options_.min_length || !IsCovered(places)) return std::nullopt;
    // The direction must be as certain as that of any other wall.
    const double end_variance = line.across * length * length /
                                (static_cast<double>(on.size()) * line.along);
    if (end_variance > options_.max_end_sigma * options_.max_end_sigma *
                           (scatter_ / options_.max_scatter)) {
      return std::nullopt;
    }
    wall.begin = places.front();
    wall.end = places.back();
    return wall;
  }

  void Keep(const GrownWall& wall) {
    const GrownLine& line = wall.line;
    for (const int index : wall.cells) Use(index);
    UseUp(line.point(), line.direction, wall.begin, wall.end);
    DropUsed();

    const double middle = 0.5 * (wall.begin + wall.end);
    const Eigen::Vector2d position = line.point() + middle * line.direction;
    // y towards the side from which it was seen.
    Eigen::Vector2d direction = line.direction;
    if (Cross(direction, wall.view) < 0.0) direction = -direction;
    Add(Pose2(position.x(), position.y(),
              std::atan2(direction.y(), direction.x())),
        wall.end - wall.begin, CountScans(wall.cells));
  }

  // Cells in line with the seed, each within the gap of another one, become the
  // members. Fits the line to them on the way.
  void CollectInLine(int seed, GrownLine* line, Scratch* scratch) const {
    std::vector<int>& members = scratch->members;
    members.assign(1, seed);
    std::vector<std::uint8_t>& is_settled = scratch->is_settled;
    is_settled.resize(num_slots_, 0);
    const auto settle = [&](std::size_t slot) {
      is_settled[slot] = 1;
      scratch->settled.push_back(slot);
    };
    const Bucket& first = buckets_[cells_[seed].bucket];
    settle(first.first_slot + first.SlotOf(seed));
    const Eigen::Vector2d view = cells_[seed].view;
    Fit fit;
    fit.Add(Eigen::Vector2d::Zero(), 1.0);
    const double cos_turn = std::cos(options_.max_turn);
    const double squared_gap = options_.max_gap * options_.max_gap;
    // Reach of the line.
    const double reach = ReachAcross();
    for (std::size_t k = 0; k < members.size(); ++k) {
      const Cell& cell = cells_[members[k]];
      const std::size_t size = members.size();
      // Reach of a bucket's square across the line.
      const double half_width =
          0.5 * bucket_size_ *
              (std::abs(line->direction.x()) + std::abs(line->direction.y())) +
          kRounding;
      for (const int k_bucket : buckets_[cell.bucket].around) {
        if (k_bucket < 0) continue;
        const Bucket& bucket = buckets_[k_bucket];
        const double across =
            Cross(line->direction, bucket.middle - line->point());
        if (std::abs(across) > reach + half_width) continue;
        const auto look = [&](const Bucket::Entry& entry, std::size_t slot) {
          if ((entry.mean - cell.mean).squaredNorm() > squared_gap ||
              line->Distance(entry.mean) > reach) {
            return;
          }
          const Cell& other = cells_[entry.index];
          // Seen from the same side.
          if (other.view.dot(view) < 0.0) {
            settle(slot);
            return;
          }
          if (other.direction.squaredNorm() > 0.0 &&
              std::abs(other.direction.dot(line->direction)) < cos_turn) {
            return;
          }
          settle(slot);
          members.push_back(entry.index);
          fit.Add(entry.mean - line->origin, 1.0);
        };
        bucket.VisitNear(cell.mean, squared_gap, line->direction, across, reach,
                         is_settled, look);
      }
      if (members.size() >= kFewestCells && members.size() > size) {
        line->FitTo(fit);
      }
    }
    for (const std::size_t slot : scratch->settled) is_settled[slot] = 0;
    scratch->settled.clear();
  }

  // Fits the line once more, to what lies on it, returns counted, and cuts it
  // at kinks. The cells that it ends with; none when they do not do.
  std::vector<int> FitFinally(const std::vector<int>& members,
                              GrownLine* line) const {
    if (members.size() < kFewestCells) return {};
    std::vector<int> on;
    for (const int index : members) {
      if (line->Distance(cells_[index].mean) <= ReachAcross()) {
        on.push_back(index);
      }
    }
    do {
      if (on.size() < kFewestCells) return {};
      Fit fit;
      int returns = 0;
      for (const int index : on) {
        fit.Add(cells_[index].mean - line->origin, cells_[index].returns);
        returns += cells_[index].returns;
      }
      if (returns < options_.min_returns) return {};
      line->FitTo(fit);
    } while (CutAtKink(line->point(), line->direction, &on));
    return on;
  }

  // Whether places along a line, ascending, leave few gaps.
  bool IsCovered(const std::vector<double>& places) const {
    int pieces = 0;
    std::int64_t last = -1;
    for (const double place : places) {
      const auto piece =
          static_cast<std::int64_t>((place - places.front()) / kCoveragePiece);
      if (piece != last) ++pieces;
      last = piece;
    }
    const double length = places.back() - places.front();
    return pieces >= options_.min_coverage * (length / kCoveragePiece);
  }

  int CountScans(const std::vector<int>& cells) const {
    std::vector<std::size_t> scans;
    for (const int index : cells) {
      scans.insert(scans.end(), cells_[index].scans.begin(),
                   cells_[index].scans.end());
    }
    std::sort(scans.begin(), scans.end());
    return static_cast<int>(std::unique(scans.begin(), scans.end()) -
                            scans.begin());
  }

  // How far from a line its cells may lie, m.
  double ReachAcross() const { return 2.5 * scatter_; }

  // A cell along and across a line.
  struct Sample {
    double along, across;
    int index;
  };

  // Leaves the longer one of two pieces when a line with a kink explains the
  // cells far better than a straight one does; false when that will do.
  bool CutAtKink(const Eigen::Vector2d& point, const Eigen::Vector2d& direction,
                 std::vector<int>* on) const {
    std::vector<Sample> samples;
    samples.reserve(on->size());
    for (const int index : *on) {
      const Eigen::Vector2d d = cells_[index].mean - point;
      samples.push_back({direction.dot(d), Cross(direction, d), index});
    }
    const std::size_t n = samples.size();
    if (n < 12) return false;
    std::sort(
        samples.begin(), samples.end(), [](const Sample& a, const Sample& b) {
          return a.along != b.along ? a.along < b.along : a.index < b.index;
        });
    LineSums all;
    for (const Sample& sample : samples) all.Add(sample.along, sample.across);
    std::size_t cut = FindKink(samples, all);
    if (cut == 0) cut = FindKinkNearEnd(samples, all);
    if (cut == 0) return false;
    const bool keeps_left = samples[cut - 1].along - samples[0].along >=
                            samples[n - 1].along - samples[cut].along;
    on->clear();
    for (std::size_t k = keeps_left ? 0 : cut; k < (keeps_left ? cut : n);
         ++k) {
      on->push_back(samples[k].index);
    }
    return true;
  }

  // First sample of the second of two walls, both long enough to have a
  // direction of their own; 0 where one wall will do.
  std::size_t FindKink(const std::vector<Sample>& samples,
                       const LineSums& all) const {
    const std::size_t n = samples.size();
    LineSums left;
    double best = all.SquaredError();
    std::size_t cut = 0;
    LineSums best_left, best_right;
    for (std::size_t k = 1; k < n; ++k) {
      left.Add(samples[k - 1].along, samples[k - 1].across);
      if (samples[k - 1].along - samples[0].along < options_.min_length ||
          samples[n - 1].along - samples[k].along < options_.min_length) {
        continue;
      }
      const LineSums right = all - left;
      const double error = left.SquaredError() + right.SquaredError();
      if (error < best) {
        best = error;
        cut = k;
        best_left = left;
        best_right = right;
      }
    }
    if (cut == 0) return 0;
    const double turn = std::abs(best_left.Slope() - best_right.Slope());
    const double sigma =
        std::sqrt(best / static_cast<double>(n - 4) *
                  (1.0 / best_left.Spread() + 1.0 / best_right.Spread()));
    return IsKink(turn, sigma) ? cut : 0;
  }

  // The same for an end of another wall that is too short for a direction of
  // its own: one line that turns (across = a + b x + c max(0, x - x0)) has the
  // turn c at twice the precision.
  std::size_t FindKinkNearEnd(const std::vector<Sample>& samples,
                              const LineSums& all) const {
    const std::size_t n = samples.size();
    const double begin = samples.front().along;
    const double end = samples.back().along;
    const double cross = all.xy - all.x * all.y / all.n;
    LineSums left;
    double best = 0.0, turn = 0.0, best_information = 0.0;
    std::size_t cut = 0;
    for (std::size_t k = 1; k < n; ++k) {
      left.Add(samples[k - 1].along, samples[k - 1].across);
      const double shorter =
          std::min(samples[k - 1].along - begin, end - samples[k].along);
      if (shorter < options_.min_end ||
          shorter > options_.max_end_share * (end - begin)) {
        continue;
      }
      const LineSums right = all - left;
      const double x0 = 0.5 * (samples[k - 1].along + samples[k].along);
      // Sums of z = max(0, x - x0), reduced for a and b.
      const double z = right.x - x0 * right.n;
      const double zz = right.xx - 2.0 * x0 * right.x + x0 * x0 * right.n;
      const double xz = right.xx - x0 * right.x - all.x * z / all.n;
      const double information = zz - z * z / all.n - xz * xz / all.Spread();
      if (information <= 1e-9) continue;
      const double score = right.xy - x0 * right.y - all.y * z / all.n -
                           xz * cross / all.Spread();
      if (score * score / information > best) {
        best = score * score / information;
        turn = std::abs(score / information);
        best_information = information;
        cut = k;
      }
    }
    if (cut == 0) return 0;
    const double residual = std::max(all.SquaredError() - best, 0.0);
    const double sigma =
        std::sqrt(residual / static_cast<double>(n - 3) / best_information);
    return IsKink(turn, sigma) ? cut : 0;
  }

  bool IsKink(double turn, double sigma) const {
    return turn >= options_.min_kink && turn >= options_.kink_sigmas * sigma;
  }

  // What the new wall explains is no other wall.
  void UseUp(const Eigen::Vector2d& point, const Eigen::Vector2d& direction,
             double begin, double end) {
    const double step = 0.5 * bucket_size_;
    const int steps = static_cast<int>(std::ceil((end - begin) / step));
    for (int k = 0; k <= steps; ++k) {
      const Eigen::Vector2d center =
          point + (begin + std::min(end - begin, k * step)) * direction;
      ForNeighbors(center, BucketsAround(center), bucket_size_, [&](int index) {
        const Eigen::Vector2d d = cells_[index].mean - point;
        const double along = direction.dot(d);
        if (std::abs(Cross(direction, d)) <= options_.explained_offset &&
            along >= begin - options_.explained_gap &&
            along <= end + options_.explained_gap) {
          Use(index);
        }
      });
    }
  }

  void Add(const Pose2& pose, double length, int num_scans) {
    std::vector<std::pair<double, const IndexedWall*>> nearest;
    for (std::size_t k = 0; k < index_.num_known(); ++k) {
      const IndexedWall& wall = index_.walls()[k];
      nearest.emplace_back((wall.Middle() - pose.head<2>()).norm(), &wall);
    }
    const std::size_t links =
        std::min<std::size_t>(nearest.size(), options_.links);
    std::partial_sort(nearest.begin(), nearest.begin() + links, nearest.end(),
                      [](const auto& a, const auto& b) {
                        return a.first != b.first ? a.first < b.first
                                                  : a.second->id < b.second->id;
                      });
    Feature feature;
    feature.type = &registry_.GetFeature("segment");
    feature.parameters = {pose[0], pose[1], pose[2]};
    feature.extent_begin = -0.5 * length;
    feature.extent_end = 0.5 * length;
    feature.observations = num_scans;
    feature.source = "wall_completion";
    const FeatureId id = transaction_.AddFeature(feature);
    for (std::size_t k = 0; k < links; ++k) {
      const IndexedWall& wall = *nearest[k].second;
      const double offset =
          options_.link_offset_sigma * options_.link_offset_sigma;
      const double angle =
          options_.link_angle_sigma * options_.link_angle_sigma;
      const Eigen::Vector3d information(1.0 / offset, 1.0 / offset,
                                        1.0 / angle);
      transaction_.AddConstraint(MakeMeasurement(
          registry_.GetRelation("pose_pose"), {wall.id, id},
          Between(wall.pose(), pose),
          (information / static_cast<double>(links)).asDiagonal(),
          "wall_completion"));
    }
    index_.Insert({id, MakeWall(pose, -0.5 * length, 0.5 * length)});
  }

  const Registry& registry_;
  const WallCompletionOptions options_;
  const std::function<bool()>& stop_;
  bool is_stopped_ = false;
  WallIndex index_;
  std::vector<Cell> cells_;
  std::unordered_map<std::int64_t, int> cell_of_;
  double scatter_ = 0.0;
  double bucket_size_ = 0.0;
  // Cells that have not been used up, by place.
  struct Bucket {
    struct Entry {
      Eigen::Vector2d mean;
      int index;
    };
    std::vector<Entry> entries;
    Eigen::Vector2d middle;
    // Itself and those beside it, -1 for none.
    std::array<int, 9> around;
    // The means once more, from the middle on, to leave out what is clearly too
    // far away several at a time.
    std::vector<float> x, y;
    // Number of its first entry's slot; every place in x has one.
    std::size_t first_slot = 0;

    // Place of a cell that is among the entries.
    std::size_t SlotOf(int index) const {
      std::size_t slot = 0;
      while (entries[slot].index != index) ++slot;
      return slot;
    }

    // After every change of the entries.
    void FillLocal() {
      constexpr float kNowhere = 1e6f;
      x.assign(entries.size() + kBlock, kNowhere);
      y.assign(entries.size() + kBlock, kNowhere);
      for (std::size_t i = 0; i < entries.size(); ++i) {
        const Eigen::Vector2d local = entries[i].mean - middle;
        x[i] = static_cast<float>(local.x());
        y[i] = static_cast<float>(local.y());
      }
    }

    // Calls `look(entry, slot)`, in their order, with those within the gap of a
    // place and within `reach` of a line that are not settled, and some more
    // that are not. The line has a direction and passes the middle at `across`,
    // which is to its left.
    template <typename Look>
    void VisitNear(const Eigen::Vector2d& place, double squared_gap,
                   const Eigen::Vector2d& direction, double across,
                   double reach, const std::vector<std::uint8_t>& is_settled,
                   const Look& look) const {
      using Block = Eigen::Array<float, kBlock, 1>;
      const Eigen::Vector2f local = (place - middle).cast<float>();
      const Eigen::Vector2f along = direction.cast<float>();
      const auto offset = static_cast<float>(across);
      const auto per_gap = static_cast<float>(1.0 / squared_gap);
      const auto per_reach = static_cast<float>(1.0 / reach);
      const std::size_t count = entries.size();
      for (std::size_t i = 0; i < count; i += kBlock) {
        std::uint32_t settled;
        static_assert(sizeof(settled) == kBlock);
        std::memcpy(&settled, &is_settled[first_slot + i], sizeof(settled));
        if (settled == 0x01010101u) continue;
        const Eigen::Map<const Block> own_x(&x[i]);
        const Eigen::Map<const Block> own_y(&y[i]);
        const Block dx = own_x - local.x();
        const Block dy = own_y - local.y();
        const Block gaps = (dx * dx + dy * dy) * per_gap;
        const Block offsets =
            (offset + (along.x() * own_y - along.y() * own_x)).abs() *
            per_reach;
        const Block farthest = gaps.max(offsets);
        if (farthest.minCoeff() > kFloatMargin) continue;
        const std::size_t end = std::min<std::size_t>(i + kBlock, count);
        for (std::size_t j = i; j < end; ++j) {
          if (is_settled[first_slot + j] == 0 &&
              farthest[static_cast<Eigen::Index>(j - i)] <= kFloatMargin) {
            look(entries[j], first_slot + j);
          }
        }
      }
    }
  };
  std::vector<Bucket> buckets_;
  std::unordered_map<std::int64_t, int> bucket_of_;
  // Buckets that hold cells which have been used.
  std::vector<int> used_up_;
  std::size_t num_slots_ = 0;
  std::vector<Scratch> scratch_;
  // Words of the returns' bits: the first one of each scan.
  std::vector<std::size_t> first_word_;
  std::vector<std::uint64_t> is_done_;
  Transaction transaction_;
};

}  // namespace

void WallCompletionOptions::ScaleToNoise(double scale) {
  points.ScaleToNoise(scale);
  // Farther off a wall than this no noise of the laser takes its returns.
  explained_offset =
      std::max(explained_offset, kExplainedSigmas * scale * kUsualRangeNoise);
  max_scatter *= scale;
  max_end_sigma *= scale;
}

Transaction FindGlimpsedWalls(const Graph& graph, const Registry& registry,
                              const std::vector<Scan>& scans,
                              const std::vector<Pose2>& poses,
                              const WallCompletionOptions& options,
                              const std::function<bool()>& stop) {
  return Completion(graph, registry, options, stop).Run(scans, poses);
}

}  // namespace plumbline
