#include <plumbline/frontend/scan_matcher.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <functional>
#include <initializer_list>
#include <limits>
#include <tuple>
#include <utility>

namespace plumbline {
namespace {

// Beyond this the reference is dropped, so that one wild return cannot blow up
// the grids, m.
constexpr double kReferenceReach = 120.0;

// No grid goes so far; fits an integer.
constexpr double kFarthestBucket = 1e9;

// Distance at which a return's likelihood in the search has fallen to
// exp(-1/2), in cells.
constexpr double kFieldSigmaCells = 1.0;
constexpr int kFieldRadius = 3;

// A beam says that all is free up to so far before its return, m, and no
// farther away than this: grazing beams are not where they seem to be.
constexpr double kFreeMargin = 0.3;
constexpr double kFreeReach = 20.0;
// Likelihood from which on a return lies on something: two cells away.
constexpr int kHitLikelihood = 34;
// Returns that are compared lie so far apart, m.
constexpr double kCompareSpacing = 0.15;
// Bearings of a scan for what it looks through, and the share of the distance
// that counts as margin.
constexpr int kBearings = 360;
constexpr double kFreeShare = 0.03;

// Peaks: levels of the pyramid, the cells that it reaches beyond the grid, what
// a point costs where the reference has looked through, the error at the
// farthest point that a step of the rotation makes, m, and its bounds, rad.
constexpr int kLevels = 4;
constexpr int kLevelPad = 1 << (kLevels - 1);
constexpr std::int16_t kThrough = -128;
constexpr double kRotationError = 0.15;
constexpr double kLeastRotation = DegToRad(1.0);
constexpr double kMostRotation = DegToRad(3.0);
// Search nodes after which Peaks gives up, how many of the coarsest ones, whose
// scores are added up together, count as one, and nodes between two questions
// whether to stop: some hundredths of a second.
constexpr int kMaxNodes = 3000000;
constexpr std::int64_t kTogether = 4;
constexpr int kNodesAtOnce = 20000;
// A point's most score, the points between two looks at what a pose can still
// come to, and the step in which points are taken.
constexpr int kMostScore = 255;
constexpr std::size_t kBoundBlock = 16;
constexpr std::size_t kSpread = 8;
// Peaks: one in so many rotations is looked at first.
constexpr int kFewTurns = 8;
// Search: one in so many poses of the lattice, each way, is looked at first.
constexpr int kFewSteps = 3;
constexpr int kFewRotations = 3;
// Where the window has at least so many steps each way, squares of poses of
// this side are left out together.
constexpr int kManySteps = 8;
constexpr int kSquare = 4;

// Cosine of the largest angle between the normals of partners.
constexpr double kSameSide = 0.7;
// The reference points around a point are kept when it moved by less than this
// since it was looked up last, m, and those so much farther away than its
// partner, m.
constexpr double kListStep = 0.02;
constexpr double kListMargin = 0.004;
// The list serves until the normal has changed by so much.
constexpr double kListTurn = 0.05;
constexpr double kRounding = 1e-9;

// Reference points that are compared at a time, and what single precision may
// be off by within kReferenceReach, m.
constexpr int kBlock = 4;
constexpr double kFloatMargin = 2e-4;

// The nearest reference point found so far. Of two at the same distance the
// first of the reference, whatever the order of the search.
struct Nearest {
  int index;
  double squared_distance;
  bool IsBetter(int i, double distance) const {
    return distance < squared_distance ||
           (distance == squared_distance && index >= 0 && i < index);
  }
};

// The same points in an order in which those of every surface are spread over
// the whole: what does not fit shows early.
std::vector<Eigen::Vector2d> Spread(
    const std::vector<Eigen::Vector2d>& points) {
  std::vector<Eigen::Vector2d> spread;
  spread.reserve(points.size());
  for (std::size_t first = 0; first < kSpread; ++first) {
    for (std::size_t i = first; i < points.size(); i += kSpread) {
      spread.push_back(points[i]);
    }
  }
  return spread;
}

// The coarsest scores in the order in which PeakSearch adds them up: those of
// cells that are a node apart lie beside each other.
class StridedScores {
 public:
  static constexpr int kStride = 1 << (kLevels - 1);

  StridedScores(const std::vector<std::int16_t>& scores, int columns, int rows)
      : columns_((columns + kStride - 1) / kStride),
        rows_((rows + kStride - 1) / kStride),
        scores_(static_cast<std::size_t>(columns_) * rows_ * kStride *
                kStride) {
    for (int y = 0; y < rows; ++y) {
      const std::int16_t* from = &scores[static_cast<std::size_t>(y) * columns];
      for (int first = 0; first < kStride; ++first) {
        std::int16_t* to = &scores_[Begin(first, y % kStride, y / kStride)];
        for (int x = first; x < columns; x += kStride) *to++ = from[x];
      }
    }
  }

  // Adds the scores of the cells (x + kStride * j, y) for j in [0, count).
  void AddTo(int x, int y, int count, std::int32_t* sums) const {
    const int row = FloorDivided(y);
    if (row < 0 || row >= rows_) return;
    const int column = FloorDivided(x);
    const int begin = std::max(0, -column);
    const int end = std::min(count, columns_ - column);
    if (begin >= end) return;
    const std::int16_t* scores =
        &scores_[Begin(x - kStride * column, y - kStride * row, row) +
                 static_cast<std::size_t>(column + begin)];
    for (int j = begin; j < end; ++j) sums[j] += *scores++;
  }

 private:
  static int FloorDivided(int x) {
    return x >= 0 ? x / kStride : -((kStride - 1 - x) / kStride);
  }
  // Index of the first score of a row of those at (x, y) modulo kStride.
  std::size_t Begin(int x, int y, int row) const {
    return ((static_cast<std::size_t>(y) * kStride + x) * rows_ + row) *
           columns_;
  }

  int columns_;
  int rows_;
  std::vector<std::int16_t> scores_;
};

// What PeakSearch looks at.
struct PeakGrid {
  // By level: the best score of 2^level cells each way from a cell on.
  const std::vector<std::vector<std::int16_t>>& levels;
  // Size with the pad, cells.
  int columns;
  int rows;
  // Of the first cell that is not of the pad, m.
  Eigen::Vector2d origin;
  double resolution;
  const std::vector<Viewpoint>& viewpoints;
};

// Branch and bound over translations and rotations of points on a grid.
class PeakSearch {
 public:
  // `minimum_score`: the least of a peak, of a share of what all points on
  // surfaces would have; `share`: of the best one's score.
  PeakSearch(const PeakGrid& grid, const std::vector<Eigen::Vector2d>& points,
             const Pose2& center, double translation_window,
             double rotation_window, double minimum_score, double share)
      : grid_(grid),
        coarsest_(grid.levels.back(), grid.columns, grid.rows),
        center_(center),
        window_(
            static_cast<int>(std::ceil(translation_window / grid.resolution))),
        rotation_window_(rotation_window),
        unit_(255.0 * static_cast<double>(points.size())),
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
    std::int64_t count = 0;
    for (const NodeRun& run : runs) count += run.count;
    count *= static_cast<std::int64_t>(cells_.size());
    nodes_ = std::min<std::int64_t>(count / kTogether, kMaxNodes);
    if (nodes_ >= kMaxNodes) return;
    // What some rotations lead to leaves little to open at the others.
    for (const int step : {kFewTurns, 1}) {
      open_.clear();
      for (int k = 0; k < static_cast<int>(cells_.size()); k += step) {
        if (stop && stop()) {
          open_.clear();
          return;
        }
        OpenRotation(k, runs);
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
           nodes_ < kMaxNodes) {
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
      cells.push_back({static_cast<int>(std::floor(x)) + kLevelPad,
                       static_cast<int>(std::floor(y)) + kLevelPad});
    }
    return cells;
  }

  int Bound(int level, int rotation, int x, int y) const {
    const std::vector<std::int16_t>& scores = grid_.levels[level];
    const int columns = grid_.columns;
    const int rows = grid_.rows;
    int sum = 0;
    for (const Cell& cell : cells_[rotation]) {
      const int column = cell.x + x;
      const int row = cell.y + y;
      if (static_cast<unsigned>(column) < static_cast<unsigned>(columns) &&
          static_cast<unsigned>(row) < static_cast<unsigned>(rows)) {
        sum += scores[static_cast<std::size_t>(row) * columns + column];
      }
    }
    return sum;
  }

  // No peak has less than its share of what some pose has.
  void Raise(int score) { least_ = std::max(least_, share_ * score); }

  // Nodes at the corners (x + kStride * j, y), j in [0, count).
  struct NodeRun {
    int x;
    int y;
    int count;
  };

  // Opens those of the nodes at a rotation that may hold a peak, and goes from
  // the best of them down to a pose.
  void OpenRotation(int rotation, const std::vector<NodeRun>& runs) {
    Node best{0, kLevels - 1, rotation, 0, 0};
    for (const NodeRun& run : runs) {
      sums_.assign(static_cast<std::size_t>(run.count), 0);
      for (const Cell& cell : cells_[rotation]) {
        coarsest_.AddTo(cell.x + run.x, cell.y + run.y, run.count,
                        sums_.data());
      }
      for (int j = 0; j < run.count; ++j) {
        const int bound = sums_[static_cast<std::size_t>(j)];
        if (bound < least_ || bound <= 0) continue;
        const Node node{bound, kLevels - 1, rotation, run.x + kStride * j,
                        run.y};
        open_.push_back(node);
        if (best < node) best = node;
      }
    }
    while (best.bound > 0 && best.level > 0) best = BestPart(best);
    Raise(best.bound);
  }

  // Calls `visit(x, y)` with the four parts of a node that are in the window.
  template <typename Visit>
  void VisitParts(const Node& node, const Visit& visit) const {
    const int half = 1 << (node.level - 1);
    for (int y = node.y; y <= std::min(node.y + half, window_); y += half) {
      for (int x = node.x; x <= std::min(node.x + half, window_); x += half) {
        visit(x, y);
      }
    }
  }

  Node BestPart(const Node& node) const {
    Node best{0, node.level - 1, node.rotation, node.x, node.y};
    VisitParts(node, [&](int x, int y) {
      const int bound = Bound(best.level, node.rotation, x, y);
      if (bound > best.bound) best = {bound, best.level, node.rotation, x, y};
    });
    return best;
  }

  void Split(const Node& node) {
    const int level = node.level - 1;
    VisitParts(node, [&](int x, int y) {
      ++nodes_;
      const int bound = Bound(level, node.rotation, x, y);
      if (bound < least_ || bound <= 0) return;
      open_.push_back({bound, level, node.rotation, x, y});
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
          runs.push_back({j * kStride - window_, i * kStride - window_, 0});
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
      return center_[axis] +
             (node * kStride - window_ + 0.5 * kStride) * grid_.resolution;
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

  const PeakGrid& grid_;
  const StridedScores coarsest_;
  const Pose2 center_;
  // Cells each way.
  const int window_;
  const double rotation_window_;
  // The largest sum of scores.
  const double unit_;
  const double share_;
  double least_;
  // Each way.
  int rotations_ = 0;
  // By rotation.
  std::vector<std::vector<Cell>> cells_;
  // A heap once all are open.
  std::vector<Node> open_;
  std::int64_t nodes_ = 0;
  // Of OpenRotation, kept for its memory.
  std::vector<std::int32_t> sums_;
};

// A likelihood field, and where on it a search begins, cells.
struct FieldView {
  const std::vector<std::uint8_t>& likelihood;
  int columns;
  int rows;
  double resolution;
  Eigen::Vector2d begin;

  // The likelihood of a cell; 0 where it is not on the field.
  int At(int column, int row) const {
    return static_cast<unsigned>(column) < static_cast<unsigned>(columns) &&
                   static_cast<unsigned>(row) < static_cast<unsigned>(rows)
               ? likelihood[static_cast<std::size_t>(row) * columns + column]
               : 0;
  }
};

// The best likelihood of the cells from (column, row) on, so many each way.
class BestAround {
 public:
  BestAround(const FieldView& field, int size)
      : size_(size),
        columns_(field.columns + size),
        rows_(field.rows + size),
        best_(static_cast<std::size_t>(columns_) * rows_, 0) {
    // First along the rows, then down the columns.
    std::vector<std::uint8_t> along(best_.size(), 0);
    for (int y = 0; y < field.rows; ++y) {
      const std::uint8_t* const from =
          &field.likelihood[static_cast<std::size_t>(y) * field.columns];
      for (int k = 0; k < size; ++k) {
        std::uint8_t* const to =
            &along[static_cast<std::size_t>(y + size) * columns_ + size - k];
        for (int x = 0; x < field.columns; ++x) {
          to[x] = std::max(to[x], from[x]);
        }
      }
    }
    for (int y = 0; y < rows_; ++y) {
      std::uint8_t* const to = &best_[static_cast<std::size_t>(y) * columns_];
      for (int k = y; k < std::min(y + size, rows_); ++k) {
        const std::uint8_t* const from =
            &along[static_cast<std::size_t>(k) * columns_];
        for (int x = 0; x < columns_; ++x) to[x] = std::max(to[x], from[x]);
      }
    }
  }

  // From the cell of a position on, cells; what is rounded is within the one
  // cell more.
  int At(double column, double row) const {
    const int x = static_cast<int>(column + size_);
    const int y = static_cast<int>(row + size_);
    return static_cast<unsigned>(x) < static_cast<unsigned>(columns_) &&
                   static_cast<unsigned>(y) < static_cast<unsigned>(rows_)
               ? best_[static_cast<std::size_t>(y) * columns_ + x]
               : 0;
  }

 private:
  int size_;
  int columns_;
  int rows_;
  std::vector<std::uint8_t> best_;
};

// A pose of the lattice, by its steps from the middle, and its score.
struct LatticePose {
  double score = 0.0;
  int rotation = 0;
  int row = 0;
  int column = 0;
};

// The best of all translations and rotations of a lattice.
class LatticeSearch {
 public:
  // `field` must outlive it. The lattice goes `steps` steps of `step`, m, each
  // way.
  LatticeSearch(const FieldView& field,
                const std::vector<Eigen::Vector2d>& points, double heading,
                double rotation_window, double rotation_step, int steps,
                double step)
      : field_(field),
        points_(points),
        heading_(heading),
        rotation_window_(rotation_window),
        rotations_(
            static_cast<int>(std::ceil(rotation_window / rotation_step))),
        steps_(steps),
        step_(step),
        normalization_(1.0 / (kMostScore * points.size())),
        rotated_(points.size()) {
    const int side = 2 * steps + 1;
    penalties_.reserve(static_cast<std::size_t>(side) * side);
    for (int iy = -steps; iy <= steps; ++iy) {
      for (int ix = -steps; ix <= steps; ++ix) {
        penalties_.push_back(0.03 * std::hypot(ix * step, iy * step) / 0.5);
      }
    }
  }

  double Angle(int rotation) const {
    return rotations_ > 0 ? rotation * (rotation_window_ / rotations_) : 0.0;
  }

  // The first of the best ones; the middle, with score 0, where nothing fits.
  LatticePose Run() {
    if (steps_ >= kManySteps) {
      SearchSquares();
    } else {
      SearchAll();
    }
    return best_;
  }

 private:
  void SearchAll() {
    // What the best pose has at least: that of the best of a few.
    for (int k = -rotations_; k <= rotations_; k += kFewRotations) {
      Rotate(k);
      for (int iy = -steps_; iy <= steps_; iy += kFewSteps) {
        for (int ix = -steps_; ix <= steps_; ix += kFewSteps) {
          least_ = std::max(least_, ScoreOf(k, ix, iy));
        }
      }
    }
    for (int k = -rotations_; k <= rotations_; ++k) {
      Rotate(k);
      LookAt(k, -steps_, -steps_, 2 * steps_ + 1);
    }
  }

  void SearchSquares() {
    // Cells that a point comes to at the poses of a square, and one more: cells
    // are rounded towards zero.
    const BestAround around(
        field_,
        static_cast<int>(std::ceil((kSquare - 1) * step_ / field_.resolution)) +
            2);
    for (int k = -rotations_; k <= rotations_; k += kFewRotations) {
      VisitSquares(around, k, [&](int ix, int iy) {
        least_ = std::max(least_, ScoreOf(k, std::min(ix + 1, steps_),
                                          std::min(iy + 1, steps_)));
      });
    }
    for (int k = -rotations_; k <= rotations_; ++k) {
      VisitSquares(around, k,
                   [&](int ix, int iy) { LookAt(k, ix, iy, kSquare); });
    }
  }

  // Calls `visit(ix, iy)` with the first corners of the squares of poses at a
  // rotation that may hold the best pose.
  template <typename Visit>
  void VisitSquares(const BestAround& around, int rotation,
                    const Visit& visit) {
    Rotate(rotation);
    const auto best_at = [&](double x, double y) { return around.At(x, y); };
    for (int iy = -steps_; iy <= steps_; iy += kSquare) {
      for (int ix = -steps_; ix <= steps_; ix += kSquare) {
        // The share of the pose of the square that is nearest to the middle.
        const double share = ShareOf(rotation, Nearest(ix), Nearest(iy));
        if (SumOf(ix, iy, share, best_at) >= least_) visit(ix, iy);
      }
    }
  }

  // The step nearest to the middle of those of a square that begins here.
  int Nearest(int first) const {
    const int last = std::min(first + kSquare - 1, steps_);
    return first > 0 ? first : std::min(last, 0);
  }

  // Takes the best of a square of poses, unless there is a better one.
  void LookAt(int k, int first_x, int first_y, int size) {
    for (int iy = first_y; iy < std::min(first_y + size, steps_ + 1); ++iy) {
      for (int ix = first_x; ix < std::min(first_x + size, steps_ + 1); ++ix) {
        const double score = ScoreOf(k, ix, iy);
        if (score < least_ || score <= 0.0) continue;
        least_ = score;
        const bool is_first =
            std::make_tuple(k, iy, ix) <
            std::make_tuple(best_.rotation, best_.row, best_.column);
        if (score > best_.score || is_first) best_ = {score, k, iy, ix};
      }
    }
  }

  // Ties go to the pose nearest to the prediction.
  double ShareOf(int k, int ix, int iy) const {
    return 1.0 - 0.05 * std::abs(Angle(k)) / DegToRad(30.0) -
           penalties_[static_cast<std::size_t>(iy + steps_) * (2 * steps_ + 1) +
                      (ix + steps_)];
  }

  // The score of a pose whose points are rotated; something below least_ when
  // it is less than that.
  double ScoreOf(int k, int ix, int iy) const {
    return SumOf(ix, iy, ShareOf(k, ix, iy), [this](double x, double y) {
      return field_.At(static_cast<int>(x), static_cast<int>(y));
    });
  }

  template <typename At>
  double SumOf(int ix, int iy, double share, const At& at) const {
    const double cx = ix * step_ / field_.resolution;
    const double cy = iy * step_ / field_.resolution;
    int sum = 0;
    for (std::size_t begin = 0; begin < rotated_.size(); begin += kBoundBlock) {
      const std::size_t end = std::min(begin + kBoundBlock, rotated_.size());
      const int most =
          sum + kMostScore * static_cast<int>(rotated_.size() - begin);
      const double bound = most * normalization_ * share;
      if (bound < least_) return bound;
      for (std::size_t i = begin; i < end; ++i) {
        sum += at(rotated_[i].x() + cx, rotated_[i].y() + cy);
      }
    }
    return sum * normalization_ * share;
  }

  void Rotate(int k) {
    const double theta = heading_ + Angle(k);
    const double c = std::cos(theta) / field_.resolution;
    const double s = std::sin(theta) / field_.resolution;
    for (std::size_t i = 0; i < points_.size(); ++i) {
      rotated_[i] = field_.begin +
                    Eigen::Vector2d(c * points_[i].x() - s * points_[i].y(),
                                    s * points_[i].x() + c * points_[i].y());
    }
  }

  const FieldView& field_;
  const std::vector<Eigen::Vector2d>& points_;
  const double heading_;
  const double rotation_window_;
  // Each way.
  const int rotations_;
  const int steps_;
  const double step_;
  const double normalization_;
  std::vector<double> penalties_;
  std::vector<Eigen::Vector2d> rotated_;
  // What the best pose has at least.
  double least_ = 0.0;
  LatticePose best_;
};

// Share of the points with a normal that are returns, which alone inform.
double OwnShare(const std::vector<ScanPoint>& scan) {
  int points = 0;
  int returns = 0;
  for (const ScanPoint& point : scan) {
    if (point.normal.squaredNorm() == 0.0) continue;
    ++points;
    if (!point.is_between) ++returns;
  }
  return points > 0 ? static_cast<double>(returns) / points : 1.0;
}

}  // namespace

ScanMatcher::ScanMatcher(const ScanMatcherOptions& options)
    : options_(options) {}

void ScanMatcher::SetReference(std::vector<ScanPoint> points) {
  SetReference(std::move(points), {});
}

void ScanMatcher::SetReference(std::vector<ScanPoint> points,
                               std::vector<Viewpoint> viewpoints) {
  viewpoints_ = std::move(viewpoints);
  rays_.clear();
  if (!viewpoints_.empty()) {
    rays_.reserve(points.size());
    for (const ScanPoint& point : points) {
      rays_.push_back({point.position, point.normal});
    }
  }
  free_valid_ = false;
  levels_.clear();
  reference_.clear();
  bucket_begin_.assign(1, 0);
  bucket_columns_ = 0;
  bucket_rows_ = 0;
  field_valid_ = false;
  if (points.empty()) return;
  // The grids reach so far around the middle of the points: one wild return
  // cannot blow them up.
  std::vector<double> xs, ys;
  xs.reserve(points.size());
  ys.reserve(points.size());
  for (const ScanPoint& point : points) {
    xs.push_back(point.position.x());
    ys.push_back(point.position.y());
  }
  const auto middle = static_cast<std::ptrdiff_t>(points.size() / 2);
  std::nth_element(xs.begin(), xs.begin() + middle, xs.end());
  std::nth_element(ys.begin(), ys.begin() + middle, ys.end());
  const Eigen::Vector2d center(xs[middle], ys[middle]);
  const Eigen::Vector2d reach = Eigen::Vector2d::Constant(kReferenceReach);
  Eigen::Vector2d minimum = center;
  Eigen::Vector2d maximum = center;
  for (const ScanPoint& point : points) {
    minimum = minimum.cwiseMin(point.position);
    maximum = maximum.cwiseMax(point.position);
  }
  minimum = minimum.cwiseMax(center - reach);
  maximum = maximum.cwiseMin(center + reach);
  const double margin = 1.0;
  origin_ = minimum.array() - margin;
  const Eigen::Vector2d size = (maximum - minimum).array() + 2.0 * margin;
  bucket_columns_ = static_cast<int>(std::ceil(size.x() / bucket_size_)) + 1;
  bucket_rows_ = static_cast<int>(std::ceil(size.y() / bucket_size_)) + 1;
  const std::size_t cells =
      static_cast<std::size_t>(bucket_columns_) * bucket_rows_;
  bucket_begin_.assign(cells + 1, 0);
  std::vector<int> cell_of(points.size(), -1);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector2d local = (points[i].position - origin_) / bucket_size_;
    if (!(local.x() >= 0.0 && local.y() >= 0.0 && local.x() < bucket_columns_ &&
          local.y() < bucket_rows_)) {
      continue;
    }
    const int column = static_cast<int>(local.x());
    const int row = static_cast<int>(local.y());
    cell_of[i] = row * bucket_columns_ + column;
    ++bucket_begin_[cell_of[i] + 1];
  }
  for (std::size_t c = 0; c < cells; ++c) {
    bucket_begin_[c + 1] += bucket_begin_[c];
  }
  reference_.resize(bucket_begin_[cells]);
  std::vector<int> next(bucket_begin_.begin(), bucket_begin_.end() - 1);
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (cell_of[i] < 0) continue;
    reference_[next[cell_of[i]]++] = {points[i].position, points[i].normal};
  }
  // The last block may be read beyond the end.
  reference_x_.assign(reference_.size() + kBlock, 0.0f);
  reference_y_.assign(reference_.size() + kBlock, 0.0f);
  for (std::size_t i = 0; i < reference_.size(); ++i) {
    const Eigen::Vector2d local = reference_[i].position - origin_;
    reference_x_[i] = static_cast<float>(local.x());
    reference_y_[i] = static_cast<float>(local.y());
  }
}

template <typename Look>
void ScanMatcher::VisitBuckets(const Eigen::Vector2d& point,
                               const double* squared_radius,
                               const Look& look) const {
  const Eigen::Vector2d local = point - origin_;
  // Of coordinates left of the first bucket the first.
  const double buckets_per_metre = 1.0 / bucket_size_;
  const auto cell = [&](double value) {
    return static_cast<int>(
        std::clamp(value * buckets_per_metre, 0.0, kFarthestBucket));
  };
  const int own_row = cell(local.y());
  // Rows outwards from there.
  const double reach = std::sqrt(*squared_radius);
  const int row_begin = std::max(0, cell(local.y() - reach));
  const int row_end = std::min(bucket_rows_ - 1, cell(local.y() + reach));
  const auto look_at_row = [&](int row) {
    const double low = row * bucket_size_ - local.y();
    const double across = std::max({low, -low - bucket_size_, 0.0});
    const double left = *squared_radius - across * across;
    if (left < 0.0) return;
    const double half = std::sqrt(left);
    const int begin = cell(local.x() - half);
    const int end = std::min(bucket_columns_ - 1, cell(local.x() + half));
    if (begin > end) return;
    const int base = row * bucket_columns_;
    look(bucket_begin_[base + begin], bucket_begin_[base + end + 1]);
  };
  for (int step = 0; own_row - step >= row_begin || own_row + step <= row_end;
       ++step) {
    if (own_row - step >= row_begin && own_row - step <= row_end) {
      look_at_row(own_row - step);
    }
    if (step > 0 && own_row + step >= row_begin && own_row + step <= row_end) {
      look_at_row(own_row + step);
    }
  }
}

template <typename Look>
void ScanMatcher::VisitNear(int begin, int end, const Eigen::Vector2d& point,
                            const double* squared_radius,
                            const Look& look) const {
  using Block = Eigen::Array<float, kBlock, 1>;
  const Eigen::Vector2f local = (point - origin_).cast<float>();
  double radius = -1.0;
  float bound = 0.0f;
  for (int i = begin; i < end; i += kBlock) {
    if (radius != *squared_radius) {
      radius = *squared_radius;
      const double reach = std::sqrt(radius) + kFloatMargin;
      bound = static_cast<float>(reach * reach);
    }
    const Block x = Eigen::Map<const Block>(&reference_x_[i]) - local.x();
    const Block y = Eigen::Map<const Block>(&reference_y_[i]) - local.y();
    if ((x * x + y * y).minCoeff() > bound) continue;
    const int block_end = std::min(i + kBlock, end);
    for (int j = i; j < block_end; ++j) look(j);
  }
}

int ScanMatcher::NearestReference(const Eigen::Vector2d& point,
                                  const Eigen::Vector2d& normal, double radius,
                                  int hint) const {
  if (reference_.empty()) return -1;
  const bool has_normal = normal.squaredNorm() > 0.0;
  Nearest nearest{-1, radius * radius};
  const auto consider = [&](int i) {
    const Surface& candidate = reference_[i];
    const double distance = (candidate.position - point).squaredNorm();
    if (!nearest.IsBetter(i, distance)) return;
    if (has_normal && candidate.normal.dot(normal) < kSameSide) return;
    nearest = {i, distance};
  };
  if (hint >= 0) consider(hint);
  VisitBuckets(point, &nearest.squared_distance, [&](int begin, int end) {
    VisitNear(begin, end, point, &nearest.squared_distance, consider);
  });
  return nearest.index;
}

int ScanMatcher::AnyReference(const Eigen::Vector2d& point,
                              const Eigen::Vector2d& normal, double radius,
                              int hint) const {
  if (reference_.empty()) return -1;
  const double squared_radius = radius * radius;
  const auto fits = [&](int i) {
    return (reference_[i].position - point).squaredNorm() < squared_radius &&
           !(reference_[i].normal.dot(normal) < kSameSide);
  };
  if (hint >= 0 && fits(hint)) return hint;
  int found = -1;
  double left = squared_radius;
  VisitBuckets(point, &left, [&](int begin, int end) {
    for (int i = begin; i < end && found < 0; ++i) {
      if (fits(i)) found = i;
    }
    if (found >= 0) left = -1.0;
  });
  return found;
}

int ScanMatcher::NearestAgain(const Eigen::Vector2d& point,
                              const Eigen::Vector2d& normal, double radius,
                              int hint, Lookup* lookup) const {
  if (reference_.empty()) return -1;
  if (lookup->reach >= 0.0 &&
      (normal - lookup->normal).squaredNorm() < kListTurn * kListTurn) {
    // What is not in the list is farther away than this, whatever was rounded.
    const double known =
        lookup->reach - (point - lookup->center).norm() - kRounding;
    Nearest nearest{-1, radius * radius};
    for (int k = lookup->begin; k < lookup->end; ++k) {
      const Neighbour& candidate = around_[k];
      const double distance =
          (candidate.surface.position - point).squaredNorm();
      if (!nearest.IsBetter(candidate.index, distance) ||
          candidate.surface.normal.dot(normal) < kSameSide) {
        continue;
      }
      nearest = {candidate.index, distance};
    }
    if (known > 0.0 && nearest.squared_distance < known * known) {
      return nearest.index;
    }
  }
  const int partner = NearestReference(point, normal, radius, hint);
  // A list pays once the point hardly moves.
  lookup->reach = -1.0;
  const double step = (point - lookup->last).norm();
  if (step < kListStep) {
    lookup->center = point;
    lookup->normal = normal;
    lookup->begin = static_cast<int>(around_.size());
    lookup->reach =
        std::max(2.0 * step, kListMargin) +
        (partner >= 0 ? (reference_[partner].position - point).norm() : radius);
    const double squared_reach = lookup->reach * lookup->reach;
    VisitBuckets(point, &squared_reach, [&](int begin, int end) {
      VisitNear(begin, end, point, &squared_reach, [&](int i) {
        const Surface& candidate = reference_[i];
        if ((candidate.position - point).squaredNorm() <= squared_reach &&
            candidate.normal.dot(normal) >= kSameSide - kListTurn - kRounding) {
          around_.push_back({candidate, i});
        }
      });
    });
    lookup->end = static_cast<int>(around_.size());
  }
  return partner;
}

MatchResult ScanMatcher::Refine(const std::vector<ScanPoint>& scan,
                                const Pose2& guess,
                                const MatchPrior& prior) const {
  MatchResult result;
  result.pose = guess;
  lookups_.assign(scan.size(), Lookup());
  around_.clear();
  const double inverse_variance =
      1.0 / (options_.point_sigma * options_.point_sigma);
  Eigen::Matrix3d information;
  // Far apart they share less; points between them add nothing of their own.
  const double independence = std::min(options_.independence, OwnShare(scan));
  for (int iteration = 0; iteration < options_.max_iterations; ++iteration) {
    // The gate shrinks over the first iterations: wide to be pulled in, narrow
    // to be exact.
    const double progress = std::min(1.0, iteration / 6.0);
    const double radius =
        options_.initial_radius +
        progress * (options_.final_radius - options_.initial_radius);
    const double c = std::cos(result.pose[2]);
    const double s = std::sin(result.pose[2]);
    information.setZero();
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    double cost = 0.0;
    int inliers = 0;
    int tried = 0;
    int neighbour = -1;
    for (std::size_t i = 0; i < scan.size(); ++i) {
      const ScanPoint& point = scan[i];
      if (point.normal.squaredNorm() == 0.0) continue;
      ++tried;
      const Eigen::Vector2d rotated(
          c * point.position.x() - s * point.position.y(),
          s * point.position.x() + c * point.position.y());
      const Eigen::Vector2d position = rotated + result.pose.head<2>();
      const Eigen::Vector2d normal(c * point.normal.x() - s * point.normal.y(),
                                   s * point.normal.x() + c * point.normal.y());
      // The partner that it had is near, as is that of the beam before.
      Lookup& lookup = lookups_[i];
      const int index = NearestAgain(
          position, normal, radius,
          lookup.partner >= 0 ? lookup.partner : neighbour, &lookup);
      lookup.partner = index;
      lookup.last = position;
      neighbour = index;
      if (index < 0) {
        cost += 4.0;
        continue;
      }
      const Surface& partner = reference_[index];
      const Eigen::Vector2d n = partner.normal;
      const double error = n.dot(position - partner.position);
      const double squared = error * error * inverse_variance;
      // Cauchy weight.
      const double weight = 1.0 / (1.0 + squared / 4.0);
      cost += std::min(4.0, squared);
      ++inliers;
      const Eigen::Vector3d jacobian(n.x(), n.y(),
                                     n.y() * rotated.x() - n.x() * rotated.y());
      information.noalias() +=
          (weight * inverse_variance) * jacobian * jacobian.transpose();
      gradient.noalias() += (weight * inverse_variance * error) * jacobian;
    }
    information *= independence;
    gradient *= independence;
    result.inliers = inliers;
    result.inlier_ratio = tried > 0 ? static_cast<double>(inliers) / tried : 0;
    result.cost = tried > 0 ? cost / tried : 4.0;
    Eigen::Vector3d difference = result.pose - prior.pose;
    difference[2] = NormalizeAngle(difference[2]);
    // The prior is heavy tailed: odometry that is plainly wrong (a slip, a
    // turn, a direction of travel with the wrong sign) must not drag along.
    const double prior_squared = difference.dot(prior.information * difference);
    const double prior_weight = 1.0 / (1.0 + prior_squared / 3.0);
    Eigen::Matrix3d hessian = information + prior_weight * prior.information;
    gradient += prior_weight * (prior.information * difference);
    hessian.diagonal().array() += 1e-9;
    const Eigen::Vector3d step = hessian.ldlt().solve(-gradient);
    result.information = information;
    result.covariance = hessian.inverse();
    if (!step.allFinite()) break;
    result.pose += step;
    result.pose[2] = NormalizeAngle(result.pose[2]);
    if (progress >= 1.0 && step.head<2>().norm() < options_.convergence &&
        std::abs(step[2]) < options_.convergence) {
      break;
    }
  }
  return result;
}

double ScanMatcher::Overlap(const std::vector<ScanPoint>& scan,
                            const Pose2& pose) const {
  const PoseTransform transform(pose);
  int tried = 0;
  int found = 0;
  int neighbour = -1;
  for (const ScanPoint& point : scan) {
    if (point.normal.squaredNorm() == 0.0) continue;
    ++tried;
    neighbour = AnyReference(transform.Point(point.position),
                             transform.Direction(point.normal),
                             options_.initial_radius, neighbour);
    if (neighbour >= 0) ++found;
  }
  return tried > 0 ? static_cast<double>(found) / tried : 0.0;
}

void ScanMatcher::BuildField() const {
  const double resolution = options_.grid_resolution;
  field_columns_ =
      static_cast<int>(bucket_columns_ * bucket_size_ / resolution) + 1;
  field_rows_ = static_cast<int>(bucket_rows_ * bucket_size_ / resolution) + 1;
  field_.assign(static_cast<std::size_t>(field_columns_) * field_rows_, 0);
  std::uint8_t kernel[2 * kFieldRadius + 1][2 * kFieldRadius + 1];
  for (int y = -kFieldRadius; y <= kFieldRadius; ++y) {
    for (int x = -kFieldRadius; x <= kFieldRadius; ++x) {
      kernel[y + kFieldRadius][x + kFieldRadius] = static_cast<std::uint8_t>(
          std::lround(255.0 * std::exp(-0.5 * (x * x + y * y) /
                                       (kFieldSigmaCells * kFieldSigmaCells))));
    }
  }
  for (const Surface& point : reference_) {
    const Eigen::Vector2d local = (point.position - origin_) / resolution;
    const int column = static_cast<int>(local.x());
    const int row = static_cast<int>(local.y());
    if (column < kFieldRadius || row < kFieldRadius ||
        column >= field_columns_ - kFieldRadius ||
        row >= field_rows_ - kFieldRadius) {
      continue;
    }
    std::uint8_t& center =
        field_[static_cast<std::size_t>(row) * field_columns_ + column];
    if (center == 255) continue;
    for (int y = -kFieldRadius; y <= kFieldRadius; ++y) {
      std::uint8_t* cells =
          &field_[static_cast<std::size_t>(row + y) * field_columns_ + column -
                  kFieldRadius];
      for (int x = 0; x <= 2 * kFieldRadius; ++x) {
        cells[x] = std::max(cells[x], kernel[y + kFieldRadius][x]);
      }
    }
  }
  field_valid_ = true;
}

void ScanMatcher::BuildFree() const {
  if (!field_valid_) BuildField();
  const double resolution = options_.grid_resolution;
  free_.assign(field_.size(), 0);
  const auto is_on_grid = [this](const Eigen::Vector2d& cell) {
    return cell.x() >= 0.0 && cell.y() >= 0.0 && cell.x() < field_columns_ &&
           cell.y() < field_rows_;
  };
  for (std::size_t v = 0; v < viewpoints_.size(); ++v) {
    const Eigen::Vector2d origin =
        (viewpoints_[v].position - origin_) / resolution;
    const std::size_t end =
        v + 1 < viewpoints_.size() ? viewpoints_[v + 1].begin : rays_.size();
    for (std::size_t i = viewpoints_[v].begin; i < end; ++i) {
      const Eigen::Vector2d ray =
          (rays_[i].position - origin_) / resolution - origin;
      const double length = ray.norm();
      const double reach =
          std::min(length - kFreeMargin / resolution, kFreeReach / resolution);
      if (!(reach > 0.0)) continue;
      const Eigen::Vector2d step = ray / length;
      const auto mark = [&](const Eigen::Vector2d& cell) {
        free_[static_cast<std::size_t>(cell.y()) * field_columns_ +
              static_cast<std::size_t>(cell.x())] = 1;
      };
      const int count = static_cast<int>(std::ceil(reach));
      if (is_on_grid(origin) && is_on_grid(origin + (count - 1) * step)) {
        for (int k = 0; k < count; ++k) mark(origin + k * step);
        continue;
      }
      for (int k = 0; k < count; ++k) {
        const Eigen::Vector2d cell = origin + k * step;
        if (!is_on_grid(cell)) break;
        mark(cell);
      }
    }
  }
  free_valid_ = true;
}

void ScanMatcher::BuildLevels() const {
  if (!free_valid_) BuildFree();
  const int columns = field_columns_ + kLevelPad;
  const int rows = field_rows_ + kLevelPad;
  levels_.assign(kLevels, {});
  levels_[0].assign(static_cast<std::size_t>(columns) * rows, 0);
  for (int y = 0; y < field_rows_; ++y) {
    for (int x = 0; x < field_columns_; ++x) {
      const std::size_t cell = static_cast<std::size_t>(y) * field_columns_ + x;
      levels_[0][static_cast<std::size_t>(y + kLevelPad) * columns + x +
                 kLevelPad] = field_[cell] == 0 && free_[cell] != 0
                                  ? kThrough
                                  : static_cast<std::int16_t>(field_[cell]);
    }
  }
  for (int level = 1; level < kLevels; ++level) {
    const std::vector<std::int16_t>& finer = levels_[level - 1];
    std::vector<std::int16_t>& best = levels_[level];
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
}

std::vector<ScoredPose> ScanMatcher::Peaks(
    const std::vector<Eigen::Vector2d>& points, const Pose2& center,
    double translation_window, double rotation_window, double minimum_score,
    double share, int max_peaks, double reach,
    const std::function<bool()>& stop) const {
  if (reference_.empty() || points.empty()) return {};
  if (levels_.empty()) BuildLevels();
  const PeakGrid grid{
      levels_, field_columns_ + kLevelPad, field_rows_ + kLevelPad,
      origin_, options_.grid_resolution,   viewpoints_};
  PeakSearch search(grid, points, center, translation_window, rotation_window,
                    minimum_score, share);
  search.OpenAll(reach, stop);
  return search.Run(max_peaks, stop);
}

ScanAgreement ScanMatcher::Compare(const std::vector<ScanPoint>& scan,
                                   const Pose2& pose,
                                   const Eigen::Vector2d& laser,
                                   std::vector<bool>* intruders) const {
  ScanAgreement agreement;
  if (intruders != nullptr) intruders->assign(scan.size(), false);
  if (reference_.empty() || scan.empty()) return agreement;
  if (!free_valid_) BuildFree();
  const double resolution = options_.grid_resolution;
  const PoseTransform transform(pose);
  Eigen::Vector2d last = Eigen::Vector2d::Constant(1e9);
  // Nearest and farthest return by bearing.
  std::vector<double> nearest(kBearings, 0.0);
  for (const ScanPoint& point : scan) {
    const Eigen::Vector2d ray = point.position - laser;
    const int bearing = static_cast<int>((std::atan2(ray.y(), ray.x()) + kPi) *
                                         (kBearings / (2.0 * kPi))) %
                        kBearings;
    double& range = nearest[bearing];
    if (range == 0.0 || ray.norm() < range) range = ray.norm();
    const bool counts = (last - point.position).squaredNorm() >=
                        kCompareSpacing * kCompareSpacing;
    if (counts) last = point.position;
    if (!counts && intruders == nullptr) continue;
    const Eigen::Vector2d local =
        (transform.Point(point.position) - origin_) / resolution;
    bool hits = false;
    bool intrudes = false;
    if (local.x() >= 0.0 && local.y() >= 0.0 && local.x() < field_columns_ &&
        local.y() < field_rows_) {
      const std::size_t cell =
          static_cast<std::size_t>(local.y()) * field_columns_ +
          static_cast<std::size_t>(local.x());
      hits = field_[cell] >= kHitLikelihood;
      intrudes = field_[cell] == 0 && free_[cell] != 0;
    }
    if (intruders != nullptr) (*intruders)[&point - scan.data()] = intrudes;
    if (counts) {
      ++(hits       ? agreement.hits
         : intrudes ? agreement.intruders
                    : agreement.unknown);
    }
  }
  // The other way round; beside a beam its neighbours must look through too.
  const Pose2 inverse = Inverse(pose);
  const PoseTransform back(inverse);
  last = Eigen::Vector2d::Constant(1e9);
  const Eigen::Vector2d eye = transform.Point(laser);
  for (const Surface& surface : rays_) {
    const Eigen::Vector2d& position = surface.position;
    // Surfaces that look away have been seen from behind.
    if (surface.normal.dot(eye - position) < 0.0) continue;
    if ((last - position).squaredNorm() < kCompareSpacing * kCompareSpacing) {
      continue;
    }
    last = position;
    const Eigen::Vector2d ray = back.Point(position) - laser;
    const double distance = ray.norm();
    const int bearing = static_cast<int>((std::atan2(ray.y(), ray.x()) + kPi) *
                                         (kBearings / (2.0 * kPi))) %
                        kBearings;
    double range = std::numeric_limits<double>::infinity();
    for (int step = -1; step <= 1; ++step) {
      range =
          std::min(range, nearest[(bearing + step + kBearings) % kBearings]);
    }
    const double margin = kFreeMargin + kFreeShare * distance;
    if (distance > kFreeReach || range == 0.0 || distance > range + margin) {
      continue;
    }
    ++agreement.seen;
    if (distance < range - margin) ++agreement.seen_through;
  }
  return agreement;
}

Pose2 ScanMatcher::Search(const std::vector<ScanPoint>& scan,
                          const Pose2& center, double translation_window,
                          double rotation_window, double* score) const {
  if (score != nullptr) *score = 0.0;
  if (reference_.empty()) return center;
  if (!field_valid_) BuildField();
  // Thin the scan out: near walls carry many returns that say the same.
  std::vector<Eigen::Vector2d> points;
  points.reserve(scan.size());
  for (const ScanPoint& point : scan) {
    if (points.empty() ||
        (points.back() - point.position).squaredNorm() > 0.15 * 0.15) {
      points.push_back(point.position);
    }
  }
  if (points.empty()) return center;

  points = Spread(points);

  const int steps = static_cast<int>(
      std::ceil(translation_window / options_.search_step - 1e-9));
  const FieldView field{
      field_, field_columns_, field_rows_, options_.grid_resolution,
      (center.head<2>() - origin_) / options_.grid_resolution};
  LatticeSearch search(field, points, center[2], rotation_window,
                       options_.rotation_step, steps, options_.search_step);
  const LatticePose best = search.Run();
  if (score != nullptr) *score = best.score;
  // Where nothing fits at all the prediction stands.
  return Pose2(center[0] + best.column * options_.search_step,
               center[1] + best.row * options_.search_step,
               NormalizeAngle(center[2] + search.Angle(best.rotation)));
}

}  // namespace plumbline
