#include <plumbline/core/parallel_for.h>
#include <plumbline/frontend/peak_search.h>
#include <plumbline/frontend/strided_scores.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <initializer_list>
#include <limits>
#include <tuple>
#include <utility>

namespace plumbline {
namespace {

constexpr int kLevels = 3;
static_assert(kPeakPad == 1 << (kLevels - 1));
static_assert(kPeakPad == StridedScores::kStride);
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

// Open nodes that are put on the heap at first, and how many times as many are
// the next time.
constexpr std::size_t kFirstInHeap = 4096;
constexpr std::size_t kMoreInHeap = 4;
// Nodes that are looked at ahead of the search, as a share of the parts it has
// looked at, and how many a thread takes at a time.
constexpr std::int64_t kPartsPerAhead = 32;
constexpr std::int64_t kLeastAhead = 4;
constexpr std::int64_t kMostAhead = 1024;
constexpr std::size_t kAheadAtOnce = 64;
// Points of which the bounds of a node's parts are added up between two looks
// whether one of them can still be good enough.
constexpr std::size_t kPointsAtOnce = 16;

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
        unit_(StridedScores::kMostScore * static_cast<double>(points.size())),
        share_(share),
        least_(minimum_score * unit_),
        team_(ThreadsHere()) {
    double farthest = 1.0;
    for (const Eigen::Vector2d& point : points) {
      farthest = std::max(farthest, point.norm());
    }
    const double step =
        std::clamp(kRotationError / farthest, kLeastRotation, kMostRotation);
    rotations_ = static_cast<int>(std::ceil(rotation_window / step));
    cells_.resize(2 * rotations_ + 1);
    offsets_.resize(cells_.size());
    boxes_.resize(cells_.size());
    for (std::size_t k = 0; k < cells_.size(); ++k) {
      cells_[k] = CellsAt(points, Angle(static_cast<int>(k)));
      for (const Cell& cell : cells_[k]) {
        offsets_[k].push_back(std::ptrdiff_t{cell.y} * grid.columns + cell.x);
        boxes_[k].Add(cell);
      }
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
        team_.For(static_cast<std::size_t>(at_once), [&](std::size_t i) {
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
  }

  // The peaks, best first, that have the share of the best one's score.
  std::vector<ScoredPose> Run(int max_peaks,
                              const std::function<bool()>& stop) {
    std::vector<ScoredPose> peaks;
    std::int64_t asked_at = nodes_;
    while (static_cast<int>(peaks.size()) < max_peaks && nodes_ < kMaxNodes &&
           parts() < max_parts_) {
      if (stop && nodes_ - asked_at >= kNodesAtOnce) {
        if (stop()) return {};
        asked_at = nodes_;
      }
      if (!LookAhead(peaks)) break;
      const NodeAhead node = ahead_.back();
      ahead_.pop_back();
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
  // The least and the largest of cells.
  struct CellBounds {
    int least_x = std::numeric_limits<int>::max();
    int least_y = std::numeric_limits<int>::max();
    int most_x = std::numeric_limits<int>::lowest();
    int most_y = std::numeric_limits<int>::lowest();
    void Add(const Cell& cell) {
      least_x = std::min(least_x, cell.x);
      least_y = std::min(least_y, cell.y);
      most_x = std::max(most_x, cell.x);
      most_y = std::max(most_y, cell.y);
    }
  };
  // Cells beside each other in a row: both parts of a node are among them.
  static constexpr int kRowLanes = 4;
  using RowLanes = std::int16_t
      __attribute__((vector_size(kRowLanes * sizeof(std::int16_t))));
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

  // A node and the bounds of its parts.
  struct NodeAhead : Node {
    std::array<int, 4> parts;
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
      blocks_.scores().Sum(turn->places, &blocks[begin], end - begin,
                           std::max(least_, 1.0), &turn->sums);
      turn->spans.clear();
      const std::int32_t* bounds = turn->sums.data();
      for (; begin < end; ++begin) {
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
    std::sort(turn->places.begin(), turn->places.end(),
              [](const auto& a, const auto& b) {
                return std::tie(a.row, a.begin) < std::tie(b.row, b.begin);
              });
  }

  // Opens those of the nodes left at a rotation that may hold a peak, and goes
  // from the best of them down to a pose.
  void OpenRotation(Turn* turn) const {
    const std::vector<NodeRun>& runs = turn->left;
    turn->open.clear();
    Node best{0, kLevels - 1, turn->rotation, 0, 0};
    FillPlaces(coarsest_, turn);
    coarsest_.Sum(turn->places, runs.data(), runs.size(), least_, &turn->sums);
    const std::int32_t* bounds = turn->sums.data();
    for (const NodeRun& run : runs) {
      for (int k = 0; k < run.count; ++k) {
        if (bounds[k] < least_ || bounds[k] <= 0) continue;
        const Node node{bounds[k], kLevels - 1, turn->rotation,
                        FirstOf(run.column + k), FirstOf(run.row)};
        turn->open.push_back(node);
        if (best < node) best = node;
      }
      bounds += StridedScores::LanesOf(run);
    }
    while (best.bound > 0 && best.level > 0) best = BestPart(best);
    turn->best = best;
  }

  // Calls `visit(part)` with the four parts of a node, of these bounds, that
  // are in the window and may score `least` and more than nothing.
  template <typename Visit>
  void VisitParts(const Node& node, const std::array<int, 4>& bounds,
                  double least, const Visit& visit) const {
    const int level = node.level - 1;
    const int half = 1 << level;
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
    const CellBounds& box = boxes_[node.rotation];
    const bool is_inside = box.least_x + node.x >= 0 &&
                           box.least_y + node.y >= 0 &&
                           box.most_x + node.x + kRowLanes <= grid_.columns &&
                           box.most_y + node.y + kRowLanes <= grid_.rows;
    if (!is_inside) return BoundsAtEdge(node, least);
    return node.level == 2 ? BoundsInside<2>(node, least)
                           : BoundsInside<1>(node, least);
  }

  // Of a node all of which brings all points onto the grid, and parts of
  // `kHalf` cells each way.
  template <int kHalf>
  std::array<int, 4> BoundsInside(const Node& node, double least) const {
    const std::int16_t* const scores = grid_.levels[node.level - 1].data() +
                                       std::ptrdiff_t{node.y} * grid_.columns +
                                       node.x;
    const std::int16_t* const above =
        scores + std::ptrdiff_t{kHalf} * grid_.columns;
    const std::vector<std::ptrdiff_t>& offsets = offsets_[node.rotation];
    // A point gives a node what it gives the best part of it.
    std::array<int, 4> bounds;
    bounds.fill(node.bound);
    for (std::size_t begin = 0; begin < offsets.size();
         begin += kPointsAtOnce) {
      const std::size_t end = std::min(offsets.size(), begin + kPointsAtOnce);
      RowLanes lower_loss{};
      RowLanes upper_loss{};
      for (std::size_t i = begin; i < end; ++i) {
        RowLanes lower, upper;
        std::memcpy(&lower, scores + offsets[i], sizeof(lower));
        std::memcpy(&upper, above + offsets[i], sizeof(upper));
        const RowLanes most = lower > upper ? lower : upper;
        const RowLanes other = __builtin_shufflevector(
            most, most, 0 ^ kHalf, 1 ^ kHalf, 2 ^ kHalf, 3 ^ kHalf);
        const RowLanes best = most > other ? most : other;
        lower_loss += best - lower;
        upper_loss += best - upper;
      }
      bounds[0] -= lower_loss[0];
      bounds[1] -= lower_loss[kHalf];
      bounds[2] -= upper_loss[0];
      bounds[3] -= upper_loss[kHalf];
      if (*std::max_element(bounds.begin(), bounds.end()) < least) return {};
    }
    return bounds;
  }

  std::array<int, 4> BoundsAtEdge(const Node& node, double least) const {
    const int half = 1 << (node.level - 1);
    const std::int16_t* const scores = grid_.levels[node.level - 1].data();
    const auto score_at = [&](int x, int y) {
      const bool is_in =
          x >= 0 && y >= 0 && x < grid_.columns && y < grid_.rows;
      return is_in ? int{scores[std::ptrdiff_t{y} * grid_.columns + x]} : 0;
    };
    const std::vector<Cell>& cells = cells_[node.rotation];
    std::array<int, 4> bounds;
    bounds.fill(node.bound);
    for (std::size_t begin = 0; begin < cells.size(); begin += kPointsAtOnce) {
      const std::size_t end = std::min(cells.size(), begin + kPointsAtOnce);
      for (std::size_t i = begin; i < end; ++i) {
        const int x = cells[i].x + node.x;
        const int y = cells[i].y + node.y;
        const std::array<int, 4> parts = {score_at(x, y), score_at(x + half, y),
                                          score_at(x, y + half),
                                          score_at(x + half, y + half)};
        const int best = *std::max_element(parts.begin(), parts.end());
        for (std::size_t k = 0; k < 4; ++k) bounds[k] -= best - parts[k];
      }
      if (*std::max_element(bounds.begin(), bounds.end()) < least) return {};
    }
    return bounds;
  }

  Node BestPart(const Node& node) const {
    Node best{0, node.level - 1, node.rotation, node.x, node.y};
    VisitParts(node, BoundsOfParts(node, 0.0), 0.0, [&](const Node& part) {
      if (part.bound > best.bound) best = part;
    });
    return best;
  }

  void Split(const NodeAhead& node) {
    nodes_ += 4;
    VisitParts(node, node.parts, least_, [&](const Node& part) {
      heap_.push_back(part);
      std::push_heap(heap_.begin(), heap_.end());
    });
  }

  // Moves the best open nodes to the heap when others than its own may be the
  // best of all.
  void FillHeap() {
    while (!open_.empty() &&
           (heap_.empty() || heap_.front() < least_in_heap_)) {
      const auto count = static_cast<std::ptrdiff_t>(
          std::min<std::size_t>(open_.size(), heaped_));
      const auto middle = open_.end() - count;
      std::nth_element(open_.begin(), middle, open_.end());
      least_in_heap_ = *middle;
      heap_.insert(heap_.end(), middle, open_.end());
      open_.erase(middle, open_.end());
      std::make_heap(heap_.begin(), heap_.end());
      heaped_ *= kMoreInHeap;
    }
  }

  // Sees to it that the last one of ahead_ is the best of all nodes, with the
  // bounds of its parts; false when there are none. Those that come after it
  // mostly are seen to at once, in the order in which their scores lie.
  bool LookAhead(const std::vector<ScoredPose>& peaks) {
    FillHeap();
    if (heap_.empty()) return !ahead_.empty();
    if (!ahead_.empty() && heap_.front() < ahead_.back()) return true;
    const auto most = static_cast<std::size_t>(std::clamp<std::int64_t>(
        parts() / kPartsPerAhead, kLeastAhead, kMostAhead));
    fresh_.clear();
    while (fresh_.size() < most) {
      FillHeap();
      if (heap_.empty() || heap_.front().bound < least_) break;
      std::pop_heap(heap_.begin(), heap_.end());
      if (!IsBesideAny(heap_.back(), peaks)) {
        fresh_.push_back({heap_.back(), {}});
      }
      heap_.pop_back();
    }
    std::sort(fresh_.begin(), fresh_.end(), [](const Node& a, const Node& b) {
      return std::tie(a.rotation, a.y, a.x) < std::tie(b.rotation, b.y, b.x);
    });
    team_.For((fresh_.size() + kAheadAtOnce - 1) / kAheadAtOnce,
              [&](std::size_t part) {
                const std::size_t end =
                    std::min(fresh_.size(), (part + 1) * kAheadAtOnce);
                for (std::size_t k = part * kAheadAtOnce; k < end; ++k) {
                  NodeAhead& node = fresh_[k];
                  if (node.level > 0) node.parts = BoundsOfParts(node, least_);
                }
              });
    ahead_.insert(ahead_.end(), fresh_.begin(), fresh_.end());
    std::sort(ahead_.begin(), ahead_.end());
    return !ahead_.empty();
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
  // Of these from the first cell of the grid on.
  std::vector<std::vector<std::ptrdiff_t>> offsets_;
  std::vector<CellBounds> boxes_;
  std::vector<Node> open_;
  // The best of these and all parts of nodes; all that are at least
  // least_in_heap_ are there, and so many come next.
  std::vector<Node> heap_;
  Node least_in_heap_;
  std::size_t heaped_ = kFirstInHeap;
  // Nodes that were taken from the heap, the best one last.
  std::vector<NodeAhead> ahead_;
  std::vector<NodeAhead> fresh_;
  ThreadTeam team_;
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
