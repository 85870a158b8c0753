#include <plumbline/core/parallel_for.h>
#include <plumbline/core/wall.h>
#include <plumbline/frontend/cell_index.h>
#include <plumbline/frontend/driven_way.h>
#include <plumbline/frontend/range_noise.h>
#include <plumbline/frontend/return_cells.h>
#include <plumbline/frontend/wall_completion.h>
#include <plumbline/frontend/wall_kinks.h>

#include <Eigen/LU>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <limits>
#include <optional>
#include <utility>

namespace plumbline {
namespace {

constexpr double kIndexCell = 1.0;
constexpr double kCoveragePiece = 0.1;
// A wall has at least so many cells.
constexpr std::size_t kFewestCells = 6;
// Scans and seeds that are looked at by all threads together, before what was
// found is taken in.
constexpr std::size_t kScansAtOnce = 256;
constexpr std::size_t kSeedsAtOnce = 12;
constexpr std::size_t kMostSeedsAtOnce = 48;
// A cell is no seed any more once it lay on so many lines that came to nothing:
// so close to them, in scatters, and turned against them by no more than this.
constexpr std::uint8_t kSpentBy = 3;
constexpr double kSpentScatters = 2.0;
constexpr double kSpentTurn = DegToRad(5.0);
constexpr std::size_t kWordBits = 64;
// Where the robot went through, and this far to either side, m, no wall stands.
constexpr double kHalfRobot = 0.15;
// Standard deviations of a range at which a return is no longer one of a wall.
constexpr double kExplainedSigmas = 5.0;

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
          const int next = static_cast<int>(cells_.size());
          const int number =
              cell_of_.FindOrAdd(CellKey(column + dx, row + dy), next);
          if (number == next) cells_.emplace_back();
          std::vector<int>& cell = cells_[number];
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
      const int found = cell_of_.Find(key);
      *last = {true, key, found < 0 ? nullptr : &cells_[found]};
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
  CellIndex cell_of_;
  std::vector<std::vector<int>> cells_;
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

  void FitTo(const LineFit& fit) {
    fit.Solve(&mean, &direction, &across, &along);
  }
  Eigen::Vector2d point() const { return origin + mean; }
  double Along(const Eigen::Vector2d& place) const {
    return direction.dot(place - origin - mean);
  }
  double Distance(const Eigen::Vector2d& place) const {
    return std::abs(Cross(direction, place - origin - mean));
  }
};

// A wall that a cell has grown to.
struct GrownWall {
  GrownLine line;
  std::vector<int> cells;
  double begin = 0.0, end = 0.0;
  // Towards the lasers that saw it.
  Eigen::Vector2d view = Eigen::Vector2d::Zero();
};

// What came of a seed. Kept for its memory.
struct Trial {
  // The seed's place among all.
  std::size_t position = 0;
  bool is_made = false;
  std::optional<GrownWall> wall;
  // Without a wall: cells that lay on the line which did not become one.
  std::vector<int> spent;
};

// Grows walls from cells of returns.
class WallGrower {
 public:
  // What growing needs, kept for its memory.
  struct alignas(kCacheLine) Scratch {
    ReturnCells::Marks marks;
    std::vector<int> members;
    // What was grown last, wall or not.
    GrownLine line;
  };

  // Of walls whose cells scatter by at most `scatter`, m.
  WallGrower(const WallCompletionOptions& options, double scatter,
             const ReturnCells& returns, const DrivenWay& way)
      : options_(options), scatter_(scatter), returns_(returns), way_(way) {
    kinks_.min_turn = options.min_kink;
    kinks_.min_sigmas = options.kink_sigmas;
    kinks_.min_length = options.min_length;
    kinks_.min_end = options.min_end;
    kinks_.max_end_share = options.max_end_share;
    kinks_.min_step = options.min_step;
  }

  // What lies in line with a cell, when it is long, whole and straight enough
  // for a wall.
  std::optional<GrownWall> Grow(int seed, Scratch* scratch) const {
    GrownWall wall;
    GrownLine& line = wall.line;
    line.origin = Of(seed).mean;
    line.direction = Of(seed).direction;
    CollectInLine(seed, &line, scratch);
    wall.cells = FitFinally(scratch->members, &line);
    scratch->line = line;
    while (IsWall(&wall)) {
      if (!CutWhereDriven(&wall)) return wall;
      wall.cells = FitFinally(wall.cells, &line);
    }
    return std::nullopt;
  }

  // After Grow came to nothing: the cells from which it would most likely come
  // to the same line once more.
  void FindCellsOf(const Scratch& failed, std::vector<int>* cells) const {
    const double cos_turn = std::cos(kSpentTurn);
    cells->clear();
    for (const int index : failed.members) {
      const ReturnCells::Cell& cell = Of(index);
      if (std::abs(cell.direction.dot(failed.line.direction)) >= cos_turn &&
          failed.line.Distance(cell.mean) <= kSpentScatters * scatter_) {
        cells->push_back(index);
      }
    }
  }

 private:
  const ReturnCells::Cell& Of(int index) const {
    return returns_.cells()[index];
  }

  // Whether the cells that a line was fitted to are long, whole and straight
  // enough: takes its ends and its view from them.
  bool IsWall(GrownWall* wall) const {
    const GrownLine& line = wall->line;
    const std::vector<int>& on = wall->cells;
    if (on.empty() || line.across > scatter_ * scatter_) return false;
    std::vector<double> places;
    wall->view.setZero();
    for (const int index : on) {
      places.push_back(line.Along(Of(index).mean));
      wall->view += Of(index).view;
    }
    std::sort(places.begin(), places.end());
    const double length = places.back() - places.front();
    if (length < options_.min_length || !IsCovered(places)) return false;
    wall->begin = places.front();
    wall->end = places.back();
    // The direction must be as certain as that of any other wall.
    const double end_variance = line.across * length * length /
                                (static_cast<double>(on.size()) * line.along);
    return end_variance <= options_.max_end_sigma * options_.max_end_sigma *
                               (scatter_ / options_.max_scatter);
  }

  // Leaves the longest of the pieces between which the robot went through;
  // false when it went nowhere through the wall.
  bool CutWhereDriven(GrownWall* wall) const {
    const GrownLine& line = wall->line;
    const std::vector<double> cuts =
        way_.Crossings(line.point(), line.direction, wall->begin, wall->end);
    if (cuts.empty()) return false;
    double begin = wall->begin;
    Interval longest(begin, begin);
    const auto take = [&](double end, double next) {
      if (end - begin > longest.second - longest.first) longest = {begin, end};
      begin = next;
    };
    for (const double cut : cuts) take(cut - kHalfRobot, cut + kHalfRobot);
    take(wall->end, wall->end);
    wall->cells.erase(
        std::remove_if(wall->cells.begin(), wall->cells.end(),
                       [&](int index) {
                         const double along = line.Along(Of(index).mean);
                         return along < longest.first || along > longest.second;
                       }),
        wall->cells.end());
    return true;
  }

  // Cells in line with the seed, each within the gap of another one, become the
  // members. Fits the line to them on the way.
  void CollectInLine(int seed, GrownLine* line, Scratch* scratch) const {
    std::vector<int>& members = scratch->members;
    members.assign(1, seed);
    ReturnCells::Marks& marks = scratch->marks;
    returns_.Mark(seed, &marks);
    const Eigen::Vector2d view = Of(seed).view;
    LineFit fit;
    fit.Add(Eigen::Vector2d::Zero(), 1.0);
    const double cos_turn = std::cos(options_.max_turn);
    const double squared_gap = options_.max_gap * options_.max_gap;
    // Reach of the line.
    const double reach = ReachAcross();
    for (std::size_t k = 0; k < members.size(); ++k) {
      const Eigen::Vector2d& mean = Of(members[k]).mean;
      const std::size_t size = members.size();
      const auto look = [&](int index, const Eigen::Vector2d& place,
                            std::size_t slot) {
        if ((place - mean).squaredNorm() > squared_gap ||
            line->Distance(place) > reach) {
          return;
        }
        const ReturnCells::Cell& other = Of(index);
        // Seen from the same side.
        if (other.view.dot(view) < 0.0) {
          marks.Settle(slot);
          return;
        }
        if (other.direction.squaredNorm() > 0.0 &&
            std::abs(other.direction.dot(line->direction)) < cos_turn) {
          return;
        }
        marks.Settle(slot);
        members.push_back(index);
        fit.Add(place - line->origin, 1.0);
      };
      returns_.VisitAlong(members[k], squared_gap, line->point(),
                          line->direction, reach, &marks, look);
      if (members.size() >= kFewestCells && members.size() > size) {
        line->FitTo(fit);
      }
    }
    marks.Clear();
  }

  // Fits the line once more, to what lies on it, returns counted, and cuts it
  // at kinks. The cells that it ends with; none when they do not do.
  std::vector<int> FitFinally(const std::vector<int>& members,
                              GrownLine* line) const {
    if (members.size() < kFewestCells) return {};
    std::vector<int> on;
    for (const int index : members) {
      if (line->Distance(Of(index).mean) <= ReachAcross()) {
        on.push_back(index);
      }
    }
    do {
      if (on.size() < kFewestCells) return {};
      LineFit fit;
      int returns = 0;
      for (const int index : on) {
        fit.Add(Of(index).mean - line->origin, Of(index).returns);
        returns += Of(index).returns;
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

  // Leaves the longer one of two pieces when a line with a kink explains the
  // cells far better than a straight one does; false when that will do.
  bool CutAtKink(const Eigen::Vector2d& point, const Eigen::Vector2d& direction,
                 std::vector<int>* on) const {
    std::vector<WallSample> samples;
    samples.reserve(on->size());
    for (const int index : *on) {
      const Eigen::Vector2d d = Of(index).mean - point;
      samples.push_back({direction.dot(d), Cross(direction, d), index});
    }
    std::sort(samples.begin(), samples.end(),
              [](const WallSample& a, const WallSample& b) {
                return a.along != b.along ? a.along < b.along
                                          : a.index < b.index;
              });
    const std::size_t cut = FindWallKink(samples, kinks_);
    if (cut == 0) return false;
    const std::size_t n = samples.size();
    const bool keeps_left = samples[cut - 1].along - samples[0].along >=
                            samples[n - 1].along - samples[cut].along;
    on->clear();
    for (std::size_t k = keeps_left ? 0 : cut; k < (keeps_left ? cut : n);
         ++k) {
      on->push_back(samples[k].index);
    }
    return true;
  }

  // How far from a line its cells may lie, m.
  double ReachAcross() const { return 2.5 * scatter_; }

  const WallCompletionOptions& options_;
  const double scatter_;
  const ReturnCells& returns_;
  const DrivenWay& way_;
  WallKinkOptions kinks_;
};

class Completion {
 public:
  Completion(const Graph& graph, const Registry& registry,
             const WallCompletionOptions& options,
             const std::vector<Pose2>& poses, const std::function<bool()>& stop)
      : registry_(registry),
        options_(options),
        stop_(stop),
        team_(options.num_threads),
        way_(poses),
        index_(graph, options.explained_gap),
        returns_(options.cell_size, options.normal_radius, options.max_gap) {}

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
    LookAtAll(scans, poses, half_way);
    if (!IsStopped() &&
        ExplainedShare(scans, poses) < options_.least_explained) {
      stray_share_ = options_.stray_share;
      LookAtAll(scans, poses, half_way);
    }
    if (is_stopped_) return {};
    return std::move(transaction_);
  }

 private:
  bool IsStopped() {
    if (!is_stopped_ && stop_ && stop_()) is_stopped_ = true;
    return is_stopped_;
  }

  void LookAtAll(const std::vector<Scan>& scans,
                 const std::vector<Pose2>& poses,
                 const std::vector<std::size_t>& half_way) {
    for (std::size_t k = 0; k + 2 < half_way.size(); ++k) {
      Look(scans, poses, half_way[k], half_way[k + 2], options_.near_range,
           {1.0});
    }
    // Then all together, also what scans from poses less exact have smeared.
    Look(scans, poses, 0, half_way.back(),
         std::numeric_limits<double>::infinity(), {1.0, 2.0});
  }

  // Share of the returns in reach that walls explain.
  double ExplainedShare(const std::vector<Scan>& scans,
                        const std::vector<Pose2>& poses) {
    std::vector<Return> unexplained;
    double explained = 0.0;
    double all = 0.0;
    for (std::size_t i = 0; i + 1 < first_word_.size() && !IsStopped(); ++i) {
      FindUnexplained(scans[i], poses[i],
                      std::numeric_limits<double>::infinity(),
                      is_done_.data() + first_word_[i], &unexplained);
      const auto in_reach = static_cast<double>(std::count_if(
          scans[i].ranges.begin(), scans[i].ranges.end(), [this](float range) {
            return range >= options_.points.minimum_range &&
                   range <= options_.points.usable_range;
          }));
      explained += in_reach - static_cast<double>(unexplained.size());
      all += in_reach;
    }
    return all > 0.0 ? explained / all : 1.0;
  }

  // At returns up to `reach`, m.
  void Look(const std::vector<Scan>& scans, const std::vector<Pose2>& poses,
            std::size_t begin, std::size_t end, double reach,
            std::initializer_list<double> smears) {
    Gather(scans, poses, begin, end, reach);
    returns_.Finish(stray_share_, &team_);
    const std::vector<ReturnCells::Cell>& cells = returns_.cells();
    // The straightest surroundings first; ties by the order of scans.
    std::vector<int> order;
    for (std::size_t i = 0; i < cells.size(); ++i) {
      if (cells[i].straightness > 0.0) order.push_back(static_cast<int>(i));
    }
    std::sort(order.begin(), order.end(), [&](int a, int b) {
      return cells[a].straightness != cells[b].straightness
                 ? cells[a].straightness > cells[b].straightness
                 : a < b;
    });
    for (const double smear : smears) {
      GrowAll(
          WallGrower(options_, smear * options_.max_scatter, returns_, way_),
          order);
      if (is_stopped_) return;
    }
  }

  // Grows a wall from each of these cells in turn that is not used or spent by
  // then. Most seeds come to nothing, so that several threads try many at a
  // time; what the first ones would have spared is not looked at, and those
  // after the first that makes a wall are tried once more.
  void GrowAll(const WallGrower& grower, const std::vector<int>& seeds) {
    const auto threads =
        static_cast<std::size_t>(std::max(1, options_.num_threads));
    const std::size_t fewest = threads > 1 ? kSeedsAtOnce * threads : 1;
    const std::size_t most = threads > 1 ? kMostSeedsAtOnce * threads : 1;
    std::size_t at_once = fewest;
    std::vector<std::uint8_t> spent(returns_.cells().size(), 0);
    std::vector<Trial> trials(most);
    scratch_.resize(threads);
    for (std::size_t k = 0; k < seeds.size() && !IsStopped();) {
      std::size_t count = 0;
      std::size_t end = k;
      for (; end < seeds.size() && count < at_once; ++end) {
        if (returns_.cells()[seeds[end]].used || spent[seeds[end]] >= kSpentBy)
          continue;
        trials[count].position = end;
        trials[count].is_made = false;
        ++count;
      }
      // In turn: all before the first that makes a wall are tried.
      std::atomic<std::size_t> next{0};
      std::atomic<bool> is_found{false};
      team_.For(threads, [&](std::size_t t) {
        while (!is_found) {
          const std::size_t i = next++;
          if (i >= count) break;
          Trial& trial = trials[i];
          trial.is_made = true;
          trial.wall = grower.Grow(seeds[trial.position], &scratch_[t]);
          if (trial.wall) {
            is_found = true;
          } else {
            grower.FindCellsOf(scratch_[t], &trial.spent);
          }
        }
      });
      at_once = std::min(2 * at_once, most);
      k = end;
      for (std::size_t i = 0; i < count; ++i) {
        const Trial& trial = trials[i];
        // After one that made a wall, but lay on others which came to nothing.
        if (!trial.is_made) {
          k = trial.position;
          break;
        }
        if (spent[seeds[trial.position]] >= kSpentBy) continue;
        if (trial.wall) {
          k = trial.position + 1;
          Keep(*trial.wall);
          at_once = fewest;
          break;
        }
        for (const int cell : trial.spent) {
          spent[cell] = std::min<std::uint8_t>(kSpentBy, spent[cell] + 1);
        }
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

  // Sorts the returns that no wall explains into cells: while those of some
  // scans are looked for, those of the scans before are sorted in.
  void Gather(const std::vector<Scan>& scans, const std::vector<Pose2>& poses,
              std::size_t begin, std::size_t end, double reach) {
    returns_.Clear();
    if (begin < end) {
      returns_.Reserve((end - begin) * scans[begin].ranges.size());
    }
    std::vector<ReturnsOfScan> found(kScansAtOnce);
    std::vector<ReturnsOfScan> before(kScansAtOnce);
    std::size_t first_before = begin;
    std::size_t num_before = 0;
    const auto sort_in = [&] {
      for (std::size_t k = 0; k < num_before; ++k) {
        for (const Return& one : before[k].returns) {
          returns_.Add(one.key, one.point, one.ray, first_before + k);
        }
      }
    };
    for (std::size_t i = begin; i < end && !IsStopped(); i += kScansAtOnce) {
      const std::size_t count = std::min(kScansAtOnce, end - i);
      team_.For(count + 1, [&](std::size_t job) {
        if (job == 0) return sort_in();
        const std::size_t k = job - 1;
        FindUnexplained(scans[i + k], poses[i + k], reach,
                        is_done_.data() + first_word_[i + k],
                        &found[k].returns);
      });
      std::swap(found, before);
      first_before = i;
      num_before = count;
    }
    sort_in();
  }

  struct Return {
    std::int64_t key;
    Eigen::Vector2d point;
    // From the laser, of length 1.
    Eigen::Vector2d ray;
  };

  // Each filled by one thread.
  struct alignas(kCacheLine) ReturnsOfScan {
    std::vector<Return> returns;
  };

  // Those of a scan up to `reach`, at this pose. Explained once is explained
  // for good, as walls only come.
  void FindUnexplained(const Scan& scan, const Pose2& pose, double reach,
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
      if (range > reach) continue;
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
        unexplained->push_back({returns_.KeyOf(point), point, ray});
      }
    }
  }

  void Keep(const GrownWall& wall) {
    const GrownLine& line = wall.line;
    for (const int index : wall.cells) returns_.Use(index);
    UseUp(line.point(), line.direction, wall.begin, wall.end);
    returns_.DropUsed();

    const double middle = 0.5 * (wall.begin + wall.end);
    const Eigen::Vector2d position = line.point() + middle * line.direction;
    // y towards the side from which it was seen.
    Eigen::Vector2d direction = line.direction;
    if (Cross(direction, wall.view) < 0.0) direction = -direction;
    Add(Pose2(position.x(), position.y(),
              std::atan2(direction.y(), direction.x())),
        wall.end - wall.begin, CountScans(wall.cells));
  }

  int CountScans(const std::vector<int>& cells) const {
    std::vector<std::size_t> scans;
    for (const int index : cells) {
      const auto [first, last] = returns_.ScansOf(index);
      scans.insert(scans.end(), first, last);
    }
    std::sort(scans.begin(), scans.end());
    return static_cast<int>(std::unique(scans.begin(), scans.end()) -
                            scans.begin());
  }

  // What the new wall explains is no other wall.
  void UseUp(const Eigen::Vector2d& point, const Eigen::Vector2d& direction,
             double begin, double end) {
    const double step = 0.5 * returns_.bucket_size();
    const int steps = static_cast<int>(std::ceil((end - begin) / step));
    for (int k = 0; k <= steps; ++k) {
      const Eigen::Vector2d center =
          point + (begin + std::min(end - begin, k * step)) * direction;
      returns_.VisitNear(center, returns_.bucket_size(), [&](int index) {
        const Eigen::Vector2d d = returns_.cells()[index].mean - point;
        const double along = direction.dot(d);
        if (std::abs(Cross(direction, d)) <= options_.explained_offset &&
            along >= begin - options_.explained_gap &&
            along <= end + options_.explained_gap) {
          returns_.Use(index);
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
  ThreadTeam team_;
  bool is_stopped_ = false;
  double stray_share_ = 0.0;
  DrivenWay way_;
  WallIndex index_;
  ReturnCells returns_;
  std::vector<WallGrower::Scratch> scratch_;
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
  min_step *= scale;
  max_end_sigma *= scale;
}

Transaction FindGlimpsedWalls(const Graph& graph, const Registry& registry,
                              const std::vector<Scan>& scans,
                              const std::vector<Pose2>& poses,
                              const WallCompletionOptions& options,
                              const std::function<bool()>& stop) {
  return Completion(graph, registry, options, poses, stop).Run(scans, poses);
}

double ExplainedShare(const Graph& graph, const std::vector<Scan>& scans,
                      const std::vector<Pose2>& poses,
                      const WallCompletionOptions& options) {
  const WallIndex walls(graph, options.explained_gap);
  std::int64_t explained = 0;
  std::int64_t all = 0;
  for (std::size_t i = 0; i < std::min(scans.size(), poses.size()); ++i) {
    const Scan& scan = scans[i];
    const Pose2 laser = Compose(poses[i], scan.laser_offset);
    WallIndex::LastCell last;
    for (std::size_t beam = 0; beam < scan.ranges.size(); ++beam) {
      const double range = scan.ranges[beam];
      if (!(range >= options.points.minimum_range) ||
          range > options.points.usable_range) {
        continue;
      }
      const double angle = laser[2] + scan.Bearing(beam);
      const Eigen::Vector2d point =
          laser.head<2>() +
          range * Eigen::Vector2d(std::cos(angle), std::sin(angle));
      ++all;
      if (walls.Explains(point, options.explained_offset, options.explained_gap,
                         &last)) {
        ++explained;
      }
    }
  }
  return all > 0 ? static_cast<double>(explained) / static_cast<double>(all)
                 : 1.0;
}

}  // namespace plumbline
