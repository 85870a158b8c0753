#include <plumbline/core/parallel_for.h>
#include <plumbline/frontend/peak_search.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <initializer_list>
#include <limits>
#include <tuple>
#include <utility>

// Compiled once more for processors that add 16 numbers at a time, the same
// sums: which of the two runs is decided when the program starts, earlier than
// a sanitizer is ready.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define PLUMBLINE_FOR_WIDE_LANES \
  __attribute__((target_clones("avx2", "default")))
#else
#define PLUMBLINE_FOR_WIDE_LANES
#endif
#define PLUMBLINE_INLINE __attribute__((always_inline)) inline

namespace plumbline {
namespace {

constexpr int kLevels = 3;
static_assert(kPeakPad == 1 << (kLevels - 1));
constexpr double kMostScore = 255.0;
// The error at the farthest point that a step of the rotation makes, m, and its
// bounds, rad.
constexpr double kRotationError = 0.15;
constexpr double kLeastRotation = DegToRad(1.0);
constexpr double kMostRotation = DegToRad(3.0);
// Search nodes after which the search is given up, how many of the coarsest
// ones, whose scores are added up together, count as one, and nodes between two
// questions whether to stop: some hundredths of a second.
constexpr int kMaxNodes = 3000000;
constexpr std::int64_t kTogether = 16;
constexpr int kNodesAtOnce = 20000;
// One in so many rotations is looked at first.
constexpr int kFewTurns = 8;
// Rotations looked at beside each other, between which none learns from another
// what is good enough.
constexpr int kTurnsAtOnce = 8;

// Cells whose scores a lane of 16 bits can hold the sum of.
constexpr std::size_t kMostInLane = 32767 / static_cast<int>(kMostScore);
// Points of which the bounds of a node's parts are added up between two looks
// whether one of them can still be good enough.
constexpr std::size_t kPointsAtOnce = 16;

// Nodes whose scores are added up together: few enough that what they are added
// from stays at hand from one point to the next.
constexpr std::size_t kNodesTogether = 4096;

// Rounded down.
int FloorDivided(int x, int by) {
  return x >= 0 ? x / by : -((by - 1 - x) / by);
}

// Coarsest nodes of a row: [column, column + count).
struct NodeRun {
  int column;
  int row;
  int count;
};

// The coarsest scores in the order in which PeakSearch adds them up: those of
// cells that are a node apart lie beside each other.
class StridedScores {
 public:
  static constexpr int kStride = kPeakPad;
  // Nodes that are added to at a time.
  static constexpr int kLanes = 16;

  // Where the scores of a point lie that the nodes give it.
  struct Place {
    // Of the row and column before which (0, 0) is the point's first node.
    std::size_t begin;
    int row;
    int column;
  };

  StridedScores(const std::vector<std::int16_t>& scores, int columns, int rows)
      : columns_((columns + kStride - 1) / kStride),
        rows_((rows + kStride - 1) / kStride),
        pitch_(static_cast<std::size_t>(columns_ + 2 * kLanes)),
        scores_(pitch_ * static_cast<std::size_t>(rows_ * kStride * kStride)) {
    for (int y = 0; y < rows; ++y) {
      const std::int16_t* from = &scores[static_cast<std::size_t>(y) * columns];
      for (int first = 0; first < kStride; ++first) {
        std::int16_t* to =
            &scores_[Begin(first, y % kStride) +
                     pitch_ * static_cast<std::size_t>(y / kStride)];
        for (int x = first; x < columns; x += kStride) *to++ = from[x];
      }
    }
  }

  // Of a cell that may lie outside of the grid.
  Place PlaceOf(int x, int y) const {
    const int column = FloorDivided(x, kStride);
    const int row = FloorDivided(y, kStride);
    return {Begin(x - kStride * column, y - kStride * row), row, column};
  }

  // For each node of the runs, kLanes at a time, the sum of the scores that it
  // gives to the points at the places; `sums` is as long as LanesOf says.
  // False, and not all are added up, when none of them can be `least`.
  PLUMBLINE_FOR_WIDE_LANES bool Sum(const std::vector<Place>& places,
                                    const NodeRun* runs, std::size_t num_runs,
                                    double least,
                                    std::vector<std::int16_t>* lanes,
                                    std::vector<std::int32_t>* sums) const {
    std::size_t size = 0;
    for (std::size_t r = 0; r < num_runs; ++r) size += LanesOf(runs[r]);
    sums->assign(size, 0);
    for (std::size_t begin = 0; begin < places.size(); begin += kMostInLane) {
      const std::size_t end = std::min(places.size(), begin + kMostInLane);
      lanes->assign(size, 0);
      for (std::size_t i = begin; i < end; ++i) {
        Add(places[i], runs, num_runs, lanes->data());
      }
      std::int32_t most = std::numeric_limits<std::int32_t>::lowest();
      for (std::size_t k = 0; k < size; ++k) {
        (*sums)[k] += (*lanes)[k];
        most = std::max(most, (*sums)[k]);
      }
      if (most + kMostScore * static_cast<double>(places.size() - end) <
          least) {
        return false;
      }
    }
    return true;
  }

  static std::size_t LanesOf(const NodeRun& run) {
    return static_cast<std::size_t>((run.count + kLanes - 1) / kLanes * kLanes);
  }

 private:
  // Numbers of 16 bits, which compilers add in one instruction or two.
  using Lanes = std::int16_t __attribute__((vector_size(32)));
  static_assert(sizeof(Lanes) == kLanes * sizeof(std::int16_t));

  // Index of the first score of the cells at (x, y) modulo kStride. Before and
  // behind each row are kLanes of no score.
  std::size_t Begin(int x, int y) const {
    return static_cast<std::size_t>(y * kStride + x) * pitch_ *
               static_cast<std::size_t>(rows_) +
           kLanes;
  }

  PLUMBLINE_INLINE void Add(const Place& place, const NodeRun* runs,
                            std::size_t num_runs, std::int16_t* lanes) const {
    for (const NodeRun* run = runs; run != runs + num_runs; ++run) {
      const int row = place.row + run->row;
      const int column = place.column + run->column;
      std::int16_t* const first = lanes;
      lanes += LanesOf(*run);
      if (static_cast<unsigned>(row) >= static_cast<unsigned>(rows_)) continue;
      const std::int16_t* const scores =
          scores_.data() + place.begin + pitch_ * static_cast<std::size_t>(row);
      for (int k = 0; k < run->count; k += kLanes) {
        const int at = column + k;
        if (at <= -kLanes || at >= columns_) continue;
        AddLanes(scores + at, first + k);
      }
    }
  }

  PLUMBLINE_INLINE static void AddLanes(const std::int16_t* scores,
                                        std::int16_t* to) {
    Lanes part, sum;
    std::memcpy(&part, scores, sizeof(part));
    std::memcpy(&sum, to, sizeof(sum));
    sum += part;
    std::memcpy(to, &sum, sizeof(sum));
  }

  int columns_;
  int rows_;
  // Of one row to the next.
  std::size_t pitch_;
  std::vector<std::int16_t> scores_;
};

// For blocks of the coarsest nodes, kStride each way, how good the best of them
// can be. Scores are those of squares of kStride cells, so that they are few.
class BlockScores {
 public:
  static constexpr int kStride = StridedScores::kStride;

  // `scores`: of the coarsest level, by rows.
  BlockScores(const std::vector<std::int16_t>& scores, int columns, int rows)
      : columns_((columns + kStride - 1) / kStride + kBefore),
        rows_((rows + kStride - 1) / kStride + kBefore),
        scores_(BestAround(scores, columns), columns_, rows_) {}

  // Of a cell that the first node of the first block brings a point to.
  StridedScores::Place PlaceOf(int x, int y) const {
    return scores_.PlaceOf(FloorDivided(x, kStride) + kBefore,
                           FloorDivided(y, kStride) + kBefore);
  }
  const StridedScores& scores() const { return scores_; }

 private:
  // A square, and those that a block beginning somewhere in it reaches into.
  static constexpr int kReach = kStride + 1;
  // Blocks that begin before the grid may reach into it.
  static constexpr int kBefore = kReach - 1;

  // The best of kReach squares each way from each square on.
  std::vector<std::int16_t> BestAround(const std::vector<std::int16_t>& scores,
                                       int columns) const {
    std::vector<std::int16_t> best(static_cast<std::size_t>(columns_) * rows_);
    for (int y = kBefore; y < rows_; ++y) {
      const std::int16_t* const from =
          &scores[static_cast<std::size_t>(kStride * (y - kBefore)) * columns];
      std::int16_t* const to = &best[static_cast<std::size_t>(y) * columns_];
      for (int x = kBefore; x < columns_; ++x) {
        to[x] = from[kStride * (x - kBefore)];
      }
      for (int x = 0; x < columns_; ++x) {
        const int last = std::min(columns_, x + kReach);
        to[x] = *std::max_element(to + x, to + last);
      }
    }
    for (int y = 0; y < rows_; ++y) {
      std::int16_t* const to = &best[static_cast<std::size_t>(y) * columns_];
      for (int k = 1; k < kReach && y + k < rows_; ++k) {
        const std::int16_t* const above =
            to + static_cast<std::ptrdiff_t>(k) * columns_;
        for (int x = 0; x < columns_; ++x) to[x] = std::max(to[x], above[x]);
      }
    }
    return best;
  }

  int columns_;
  int rows_;
  StridedScores scores_;
};

// Branch and bound over translations and rotations of points on a grid.
class PeakSearch {
 public:
  // `minimum_score`: the least of a peak, of a share of what all points on
  // surfaces would have; `share`: of the best one's score.
  PeakSearch(const PeakGrid& grid, const std::vector<Eigen::Vector2d>& points,
             const Pose2& center, double translation_window,
             double rotation_window, double minimum_score, double share,
             std::int64_t max_parts)
      : max_parts_(max_parts),
        grid_(grid),
        coarsest_(grid.levels.back(), grid.columns, grid.rows),
        blocks_(grid.levels.back(), grid.columns, grid.rows),
        center_(center),
        window_(
            static_cast<int>(std::ceil(translation_window / grid.resolution))),
        rotation_window_(rotation_window),
        unit_(kMostScore * static_cast<double>(points.size())),
        share_(share),
        least_(minimum_score * unit_) {
    double farthest = 1.0;
    for (const Eigen::Vector2d& point : points) {
      farthest = std::max(farthest, point.norm());
    }
    const double step =
        std::clamp(kRotationError / farthest, kLeastRotation, kMostRotation);
    rotations_ = static_cast<int>(std::ceil(rotation_window / step));
    cells_.resize(2 * rotations_ + 1);
    for (std::size_t k = 0; k < cells_.size(); ++k) {
      cells_[k] = CellsAt(points, Angle(static_cast<int>(k)));
    }
  }

  // Opens the coarsest nodes of the window that are within `reach`, m, of a
  // viewpoint. Once `stop` has returned true there are none.
  void OpenAll(double reach, const std::function<bool()>& stop) {
    const std::vector<NodeRun> runs = NearNodes(reach);
    const std::vector<NodeRun> blocks = BlocksOf(runs);
    std::int64_t count = 0;
    for (const NodeRun& run : runs) count += run.count;
    count *= static_cast<std::int64_t>(cells_.size());
    nodes_ = std::min<std::int64_t>(count / kTogether, kMaxNodes);
    opened_ = nodes_;
    if (nodes_ >= kMaxNodes) return;
    ThreadTeam team(ThreadsHere());
    std::vector<Turn> turns(kTurnsAtOnce);
    // What some rotations lead to leaves little to open at the others.
    for (const int step : {kFewTurns, 1}) {
      open_.clear();
      const int size = static_cast<int>(cells_.size());
      for (int first = 0; first < size; first += step * kTurnsAtOnce) {
        if (stop && stop()) {
          open_.clear();
          return;
        }
        const int at_once =
            std::min(kTurnsAtOnce, (size - first + step - 1) / step);
        team.For(static_cast<std::size_t>(at_once), [&](std::size_t i) {
          Turn& turn = turns[i];
          turn.rotation = first + static_cast<int>(i) * step;
          FindLeft(runs, blocks, &turn);
          OpenRotation(&turn);
        });
        for (int i = 0; i < at_once; ++i) {
          const Turn& turn = turns[static_cast<std::size_t>(i)];
          open_.insert(open_.end(), turn.open.begin(), turn.open.end());
          Raise(turn.best.bound);
          clearest_ = std::max(clearest_, turn.best.bound);
        }
      }
    }
    const auto is_left = [this](const Node& node) {
      return node.bound >= least_;
    };
    open_.erase(std::partition(open_.begin(), open_.end(), is_left),
                open_.end());
    std::make_heap(open_.begin(), open_.end());
  }

  // The peaks, best first, that have the share of the best one's score.
  std::vector<ScoredPose> Run(int max_peaks,
                              const std::function<bool()>& stop) {
    std::vector<ScoredPose> peaks;
    std::int64_t asked_at = nodes_;
    while (!open_.empty() && static_cast<int>(peaks.size()) < max_peaks &&
           nodes_ < kMaxNodes && parts() < max_parts_) {
      if (stop && nodes_ - asked_at >= kNodesAtOnce) {
        if (stop()) return {};
        asked_at = nodes_;
      }
      std::pop_heap(open_.begin(), open_.end());
      const Node node = open_.back();
      open_.pop_back();
      if (node.bound < least_) break;
      if (IsBesideAny(node, peaks)) continue;
      if (node.level == 0) {
        if (peaks.empty()) Raise(node.bound);
        peaks.push_back({PoseOf(node), node.bound / unit_});
      } else {
        Split(node);
      }
    }
    return peaks;
  }

  // Of some pose, once all are open.
  double clearest() const { return clearest_ / unit_; }
  // Parts of nodes that were looked at.
  std::int64_t parts() const { return nodes_ - opened_; }

 private:
  // Of the coarsest nodes, cells.
  static constexpr int kStride = StridedScores::kStride;

  struct Cell {
    int x;
    int y;
  };
  // Translations by [x, x + 2^level) and [y, y + 2^level) cells at one
  // rotation; none of them scores more than `bound`.
  struct Node {
    int bound;
    int level;
    int rotation;
    int x;
    int y;
    bool operator<(const Node& other) const {
      return std::tie(bound, other.level, other.rotation, other.x, other.y) <
             std::tie(other.bound, level, rotation, x, y);
    }
  };

  // What is opened at a rotation; all but that is kept for its memory.
  struct Turn {
    int rotation = 0;
    std::vector<Node> open;
    // Where the best of them leads to.
    Node best;
    std::vector<NodeRun> left;
    std::vector<StridedScores::Place> places;
    std::vector<std::pair<int, int>> spans;
    std::vector<std::int16_t> lanes;
    std::vector<std::int32_t> sums;
  };

  double Angle(int rotation) const {
    return center_[2] + (rotations_ > 0 ? (rotation - rotations_) *
                                              (rotation_window_ / rotations_)
                                        : 0.0);
  }

  Pose2 PoseOf(const Node& node) const {
    return Pose2(center_[0] + node.x * grid_.resolution,
                 center_[1] + node.y * grid_.resolution,
                 NormalizeAngle(Angle(node.rotation)));
  }

  // Cells of the points, the pad included.
  std::vector<Cell> CellsAt(const std::vector<Eigen::Vector2d>& points,
                            double angle) const {
    const double c = std::cos(angle) / grid_.resolution;
    const double s = std::sin(angle) / grid_.resolution;
    const Eigen::Vector2d shift =
        (center_.head<2>() - grid_.origin) / grid_.resolution;
    std::vector<Cell> cells;
    cells.reserve(points.size());
    for (const Eigen::Vector2d& point : points) {
      const double x = shift.x() + c * point.x() - s * point.y();
      const double y = shift.y() + s * point.x() + c * point.y();
      cells.push_back({static_cast<int>(std::floor(x)) + kPeakPad,
                       static_cast<int>(std::floor(y)) + kPeakPad});
    }
    return cells;
  }

  // No peak has less than its share of what some pose has.
  void Raise(int score) { least_ = std::max(least_, share_ * score); }

  // First cell of a coarsest node along an axis.
  int FirstOf(int node) const { return node * kStride - window_; }

  // The blocks that nodes of the runs, which are in the order of rows, lie in.
  static std::vector<NodeRun> BlocksOf(const std::vector<NodeRun>& runs) {
    std::vector<NodeRun> blocks;
    std::vector<std::pair<int, int>> spans;
    for (std::size_t begin = 0; begin < runs.size();) {
      const int row = BlockOf(runs[begin].row);
      spans.clear();
      std::size_t end = begin;
      for (; end < runs.size() && BlockOf(runs[end].row) == row; ++end) {
        const NodeRun& run = runs[end];
        spans.emplace_back(BlockOf(run.column),
                           BlockOf(run.column + run.count - 1) + 1);
      }
      std::sort(spans.begin(), spans.end());
      int last = std::numeric_limits<int>::lowest();
      for (const auto& [from, to] : spans) {
        if (from > last) blocks.push_back({from, row, 0});
        last = std::max(last, to);
        blocks.back().count = last - blocks.back().column;
      }
      begin = end;
    }
    return blocks;
  }

  // Nodes have numbers from 0 on.
  static int BlockOf(int node) { return node / BlockScores::kStride; }

  // Those of the nodes at a rotation that lie in a block which may hold a peak.
  void FindLeft(const std::vector<NodeRun>& runs,
                const std::vector<NodeRun>& blocks, Turn* turn) const {
    FillPlaces(blocks_, turn);
    turn->left.clear();
    std::size_t run = 0;
    for (std::size_t begin = 0; begin < blocks.size();) {
      // Of one row of blocks.
      const int row = blocks[begin].row;
      std::size_t end = begin;
      while (end < blocks.size() && blocks[end].row == row) ++end;
      const bool is_any = blocks_.scores().Sum(
          turn->places, &blocks[begin], end - begin, std::max(least_, 1.0),
          &turn->lanes, &turn->sums);
      turn->spans.clear();
      const std::int32_t* bounds = turn->sums.data();
      for (; begin < end; ++begin) {
        if (!is_any) continue;
        AddSpans(blocks[begin], bounds, &turn->spans);
        bounds += StridedScores::LanesOf(blocks[begin]);
      }
      for (; run < runs.size() && BlockOf(runs[run].row) == row; ++run) {
        const int last = runs[run].column + runs[run].count;
        for (const auto& [from, to] : turn->spans) {
          const int first = std::max(from, runs[run].column);
          const int count = std::min(to, last) - first;
          if (count > 0) turn->left.push_back({first, runs[run].row, count});
        }
      }
    }
  }

  // Appends the columns of nodes, [from, to), of those blocks of a run that may
  // hold a peak.
  void AddSpans(const NodeRun& blocks, const std::int32_t* bounds,
                std::vector<std::pair<int, int>>* spans) const {
    for (int k = 0; k < blocks.count; ++k) {
      if (bounds[k] < least_ || bounds[k] <= 0) continue;
      const int from = BlockScores::kStride * (blocks.column + k);
      // Nodes are added up by lanes: shorter gaps cost nothing.
      if (spans->empty() ||
          spans->back().second + StridedScores::kLanes < from) {
        spans->emplace_back(from, from);
      }
      spans->back().second = from + BlockScores::kStride;
    }
  }

  // Where the points' scores at the rotation lie.
  template <typename Scores>
  void FillPlaces(const Scores& scores, Turn* turn) const {
    turn->places.clear();
    for (const Cell& cell : cells_[turn->rotation]) {
      turn->places.push_back(
          scores.PlaceOf(cell.x + FirstOf(0), cell.y + FirstOf(0)));
    }
    // Neighbours look at the same scores.
    std::sort(turn->places.begin(), turn->places.end(),
              [](const auto& a, const auto& b) {
                return std::tie(a.begin, a.row, a.column) <
                       std::tie(b.begin, b.row, b.column);
              });
  }

  // Opens those of the nodes left at a rotation that may hold a peak, and goes
  // from the best of them down to a pose.
  void OpenRotation(Turn* turn) const {
    const std::vector<NodeRun>& runs = turn->left;
    turn->open.clear();
    Node best{0, kLevels - 1, turn->rotation, 0, 0};
    FillPlaces(coarsest_, turn);
    std::size_t begin = 0;
    while (begin < runs.size()) {
      std::size_t end = begin;
      std::size_t size = 0;
      while (end < runs.size() && size < kNodesTogether) {
        size += StridedScores::LanesOf(runs[end++]);
      }
      if (!coarsest_.Sum(turn->places, &runs[begin], end - begin, least_,
                         &turn->lanes, &turn->sums)) {
        begin = end;
        continue;
      }
      const std::int32_t* bounds = turn->sums.data();
      for (; begin < end; ++begin) {
        const NodeRun& run = runs[begin];
        for (int k = 0; k < run.count; ++k) {
          if (bounds[k] < least_ || bounds[k] <= 0) continue;
          const Node node{bounds[k], kLevels - 1, turn->rotation,
                          FirstOf(run.column + k), FirstOf(run.row)};
          turn->open.push_back(node);
          if (best < node) best = node;
        }
        bounds += StridedScores::LanesOf(run);
      }
    }
    while (best.bound > 0 && best.level > 0) best = BestPart(best);
    turn->best = best;
  }

  // Calls `visit(part)` with the four parts of a node that are in the window
  // and may score `least` and more than nothing.
  template <typename Visit>
  void VisitParts(const Node& node, double least, const Visit& visit) const {
    const int level = node.level - 1;
    const int half = 1 << level;
    const std::array<int, 4> bounds = BoundsOfParts(node, least);
    for (int part = 0; part < 4; ++part) {
      const int x = node.x + half * (part % 2);
      const int y = node.y + half * (part / 2);
      const int bound = bounds[static_cast<std::size_t>(part)];
      if (x <= window_ && y <= window_ && bound >= least && bound > 0) {
        visit(Node{bound, level, node.rotation, x, y});
      }
    }
  }

  // None where no part can score `least`.
  std::array<int, 4> BoundsOfParts(const Node& node, double least) const {
    const int half = 1 << (node.level - 1);
    const std::int16_t* const scores = grid_.levels[node.level - 1].data();
    const int columns = grid_.columns;
    const int rows = grid_.rows;
    const std::vector<Cell>& cells = cells_[node.rotation];
    std::array<int, 4> sums{};
    for (std::size_t begin = 0; begin < cells.size(); begin += kPointsAtOnce) {
      const int best = *std::max_element(sums.begin(), sums.end());
      if (best + kMostScore * static_cast<double>(cells.size() - begin) <
          least) {
        return {};
      }
      const std::size_t end = std::min(cells.size(), begin + kPointsAtOnce);
      for (std::size_t i = begin; i < end; ++i) {
        const int x = cells[i].x + node.x;
        const int y = cells[i].y + node.y;
        const auto is_in = [](int at, int size) {
          return static_cast<unsigned>(at) < static_cast<unsigned>(size);
        };
        const std::int64_t at = std::int64_t{y} * columns + x;
        if (is_in(x, columns - half) && is_in(y, rows - half)) {
          const std::int16_t* const first = scores + at;
          const std::int16_t* const above =
              first + static_cast<std::ptrdiff_t>(half) * columns;
          sums[0] += first[0];
          sums[1] += first[half];
          sums[2] += above[0];
          sums[3] += above[half];
          continue;
        }
        for (int part = 0; part < 4; ++part) {
          const int dx = half * (part % 2);
          const int dy = half * (part / 2);
          if (is_in(x + dx, columns) && is_in(y + dy, rows)) {
            sums[static_cast<std::size_t>(part)] +=
                scores[at + std::int64_t{dy} * columns + dx];
          }
        }
      }
    }
    return sums;
  }

  Node BestPart(const Node& node) const {
    Node best{0, node.level - 1, node.rotation, node.x, node.y};
    VisitParts(node, 0.0, [&](const Node& part) {
      if (part.bound > best.bound) best = part;
    });
    return best;
  }

  void Split(const Node& node) {
    nodes_ += 4;
    VisitParts(node, least_, [&](const Node& part) {
      open_.push_back(part);
      std::push_heap(open_.begin(), open_.end());
    });
  }

  // Coarsest nodes along an axis, [begin, end): from -window_ on in steps.
  struct NodeRange {
    int begin;
    int end;
    std::size_t size() const {
      return static_cast<std::size_t>(std::max(0, end - begin));
    }
  };

  // Those that bring some point onto the grid, of so many cells.
  NodeRange NodesOnGrid(int Cell::*axis, int size) const {
    int low = std::numeric_limits<int>::max();
    int high = std::numeric_limits<int>::lowest();
    for (const std::vector<Cell>& cells : cells_) {
      for (const Cell& cell : cells) {
        low = std::min(low, cell.*axis);
        high = std::max(high, cell.*axis);
      }
    }
    const std::int64_t first =
        std::max<std::int64_t>(0, std::int64_t{window_} - high + kStride - 1);
    const std::int64_t last =
        window_ + std::min<std::int64_t>(window_, std::int64_t{size} - 1 - low);
    if (last < 0) return {0, 0};
    return {static_cast<int>(first / kStride),
            static_cast<int>(last / kStride + 1)};
  }

  // The coarsest nodes of which some pose may be within reach, m, of a
  // viewpoint.
  std::vector<NodeRun> NearNodes(double reach) const {
    // Where no point is on the grid no pose has a score.
    const NodeRange columns = NodesOnGrid(&Cell::x, grid_.columns);
    const NodeRange rows = NodesOnGrid(&Cell::y, grid_.rows);
    const std::vector<char> is_near = AreNear(reach, columns, rows);
    std::vector<NodeRun> runs;
    std::size_t node = 0;
    for (int i = rows.begin; i < rows.end; ++i) {
      bool was_near = false;
      for (int j = columns.begin; j < columns.end; ++j) {
        const bool now = is_near[node++] != 0;
        if (now && !was_near) {
          runs.push_back({j, i, 0});
        }
        if (now) ++runs.back().count;
        was_near = now;
      }
    }
    return runs;
  }

  // By node, a row of columns after the other: whether some pose of it may be
  // within reach, m, of a viewpoint.
  std::vector<char> AreNear(double reach, const NodeRange& columns,
                            const NodeRange& rows) const {
    std::vector<char> is_near(columns.size() * rows.size(),
                              std::isfinite(reach) ? 0 : 1);
    if (is_near.empty() || !std::isfinite(reach)) return is_near;
    const double size = kStride * grid_.resolution;
    const auto middle = [&](int node, int axis) {
      return center_[axis] + (FirstOf(node) + 0.5 * kStride) * grid_.resolution;
    };
    // From the middle of a node its corners are so far.
    const double radius = reach + std::sqrt(0.5) * size;
    const auto clamped = [](double node, const NodeRange& range) {
      return static_cast<int>(std::clamp<double>(node, range.begin, range.end));
    };
    for (const Viewpoint& viewpoint : grid_.viewpoints) {
      const Eigen::Vector2d at =
          (viewpoint.position - Eigen::Vector2d(middle(0, 0), middle(0, 1))) /
          size;
      const double far = radius / size + 1.0;
      const int last_row = clamped(at.y() + far, rows);
      const int last_column = clamped(at.x() + far, columns);
      for (int i = clamped(at.y() - far, rows); i < last_row; ++i) {
        for (int j = clamped(at.x() - far, columns); j < last_column; ++j) {
          const Eigen::Vector2d node(middle(j, 0), middle(i, 1));
          if ((viewpoint.position - node).norm() <= radius) {
            is_near[static_cast<std::size_t>(i - rows.begin) * columns.size() +
                    static_cast<std::size_t>(j - columns.begin)] = 1;
          }
        }
      }
    }
    return is_near;
  }

  // Whether all of the node lies beside one of the peaks.
  bool IsBesideAny(const Node& node,
                   const std::vector<ScoredPose>& peaks) const {
    const double heading = Angle(node.rotation);
    const double size = ((1 << node.level) - 1) * grid_.resolution;
    return std::any_of(peaks.begin(), peaks.end(), [&](const ScoredPose& peak) {
      const double dx = center_[0] + node.x * grid_.resolution - peak.pose[0];
      const double dy = center_[1] + node.y * grid_.resolution - peak.pose[1];
      return std::abs(NormalizeAngle(heading - peak.pose[2])) <
                 ScanMatcher::kPeakRotation &&
             std::hypot(std::max(std::abs(dx), std::abs(dx + size)),
                        std::max(std::abs(dy), std::abs(dy + size))) <
                 ScanMatcher::kPeakDistance;
    });
  }

  const std::int64_t max_parts_;
  const PeakGrid& grid_;
  const StridedScores coarsest_;
  const BlockScores blocks_;
  const Pose2 center_;
  // Cells each way.
  const int window_;
  const double rotation_window_;
  // The largest sum of scores.
  const double unit_;
  const double share_;
  double least_;
  int clearest_ = 0;
  // Each way.
  int rotations_ = 0;
  // By rotation.
  std::vector<std::vector<Cell>> cells_;
  // A heap once all are open.
  std::vector<Node> open_;
  std::int64_t nodes_ = 0;
  // Of these, those that were opened at first.
  std::int64_t opened_ = 0;
};

}  // namespace

std::vector<std::vector<std::int16_t>> ScoreLevels(
    std::vector<std::int16_t> scores, int columns, int rows) {
  std::vector<std::vector<std::int16_t>> levels(kLevels);
  levels[0] = std::move(scores);
  for (int level = 1; level < kLevels; ++level) {
    const std::vector<std::int16_t>& finer = levels[level - 1];
    std::vector<std::int16_t>& best = levels[level];
    best.resize(finer.size());
    const int half = 1 << (level - 1);
    // Beyond the grid nothing is known.
    const std::vector<std::int16_t> beyond(static_cast<std::size_t>(columns),
                                           0);
    std::vector<std::int16_t> both(static_cast<std::size_t>(columns + half), 0);
    for (int y = 0; y < rows; ++y) {
      const std::int16_t* const upper =
          &finer[static_cast<std::size_t>(y) * columns];
      const std::int16_t* const lower =
          y + half < rows ? &finer[static_cast<std::size_t>(y + half) * columns]
                          : beyond.data();
      for (int x = 0; x < columns; ++x) both[x] = std::max(upper[x], lower[x]);
      std::int16_t* const row = &best[static_cast<std::size_t>(y) * columns];
      for (int x = 0; x < columns; ++x) {
        row[x] = std::max(both[x], both[x + half]);
      }
    }
  }
  return levels;
}

std::vector<ScoredPose> FindPeaks(
    const PeakGrid& grid, const std::vector<Eigen::Vector2d>& points,
    const Pose2& center, double translation_window, double rotation_window,
    const PeakOptions& options, const std::function<bool()>& stop) {
  const std::int64_t most = options.nodes != nullptr
                                ? std::max<std::int64_t>(0, *options.nodes)
                                : kMaxNodes;
  PeakSearch search(grid, points, center, translation_window, rotation_window,
                    options.minimum_score, options.share, most);
  search.OpenAll(options.reach, stop);
  std::vector<ScoredPose> peaks = search.Run(options.max_peaks, stop);
  if (options.nodes != nullptr) *options.nodes -= search.parts();
  return peaks;
}

double ClearestScore(const PeakGrid& grid,
                     const std::vector<Eigen::Vector2d>& points,
                     const Pose2& center, double translation_window,
                     double rotation_window, double reach,
                     const std::function<bool()>& stop) {
  // Nothing is left open but what is as good as the best so far.
  PeakSearch search(grid, points, center, translation_window, rotation_window,
                    0.0, 1.0, kMaxNodes);
  search.OpenAll(reach, stop);
  return search.clearest();
}

}  // namespace plumbline
