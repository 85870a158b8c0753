#include <plumbline/core/error.h>
#include <plumbline/core/parallel_for.h>
#include <plumbline/frontend/place_grid.h>
#include <plumbline/frontend/way_check.h>
#include <plumbline/frontend/way_lengths.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <optional>
#include <string>
#include <utility>

namespace plumbline {
namespace {

// Between two times that `stop` is asked.
constexpr std::size_t kCrossingsAtOnce = 64;

// Where a piece has less than this share of the returns that a piece of the
// wall has in the middle, they are from what stood in an opening: the leaf of a
// door, people.
constexpr double kSolidShare = 0.1;

// Crossings lie at least this far from the ends of a wall, m.
constexpr double kMargin = 0.2;

// A step of the way across a wall.
struct Crossing {
  // The key scan before it, and the wall.
  std::size_t key = 0;
  std::size_t wall = 0;
  // Where, along the wall from the beginning of its visible part, m.
  double along = 0.0;
};

// The pieces of a wall around a crossing, and what is known of them.
struct Pieces {
  // Returns of other visits, returns of the visit that crosses, its beams that
  // went through.
  std::vector<int> solid;
  std::vector<int> kept;
  std::vector<int> passed;
};

class WayCheck {
 public:
  // All must outlive it.
  WayCheck(const std::vector<Scan>& scans, const std::vector<int>& keys,
           const std::vector<Pose2>& poses, const std::vector<Wall>& walls,
           const WayCheckOptions& options)
      : scans_(scans),
        keys_(keys),
        poses_(poses),
        walls_(walls),
        options_(options),
        grid_(poses, options.radius),
        way_(WayLengths(poses, options.max_step)) {}

  // All crossings, in the order of the way.
  std::vector<Crossing> FindCrossings() const {
    std::vector<Crossing> found;
    std::vector<std::size_t> near;
    for (std::size_t w = 0; w < walls_.size(); ++w) {
      const Wall& wall = walls_[w];
      if (!(wall.length() > 2.0 * kMargin) || !std::isfinite(wall.length())) {
        continue;
      }
      near.clear();
      const int count =
          1 + static_cast<int>(std::ceil(wall.length() / options_.radius));
      for (int i = 0; i < count; ++i) {
        grid_.Around(
            wall.At(wall.begin + wall.length() * i / std::max(1, count - 1)),
            [&near](std::size_t k) { near.push_back(k); });
      }
      std::sort(near.begin(), near.end());
      near.erase(std::unique(near.begin(), near.end()), near.end());
      for (const std::size_t k : near) {
        const std::optional<double> along = AlongOfStep(wall, k);
        if (along) found.push_back({k, w, *along});
      }
    }
    std::sort(found.begin(), found.end(),
              [](const Crossing& a, const Crossing& b) {
                return std::pair(a.key, a.wall) < std::pair(b.key, b.wall);
              });
    return found;
  }

  // The wall was solid where the way crosses it, by more than a door.
  std::optional<BlockedWay> Judge(const Crossing& crossing) const {
    const Wall& wall = walls_[crossing.wall];
    const auto size = static_cast<std::size_t>(
        std::ceil(wall.length() / options_.piece) + 1.0);
    Pieces pieces{std::vector<int>(size, 0), std::vector<int>(size, 0),
                  std::vector<int>(size, 0)};
    const std::size_t k = crossing.key;
    const Eigen::Vector2d place = wall.At(wall.begin + crossing.along);
    std::vector<std::pair<double, std::size_t>> others;
    grid_.Around(place, [&](std::size_t j) {
      const double distance = (poses_[j].head<2>() - place).norm();
      if (distance > options_.radius) return;
      if (std::abs(way_[j] - way_[k]) > options_.visit) {
        others.emplace_back(distance, j);
      } else {
        AddVisit(j, wall, &pieces);
      }
    });
    std::sort(others.begin(), others.end());
    if (static_cast<int>(others.size()) > options_.max_others) {
      others.resize(static_cast<std::size_t>(options_.max_others));
    }
    std::vector<std::vector<std::size_t>> hits(others.size());
    for (std::size_t i = 0; i < others.size(); ++i) {
      hits[i] = PiecesHit(others[i].second, wall);
      for (const std::size_t piece : hits[i]) ++pieces.solid[piece];
    }
    const std::pair<std::size_t, std::size_t> run =
        LongestRun(pieces, crossing.along);
    if (static_cast<double>(run.second - run.first) * options_.piece <
        options_.min_width) {
      return std::nullopt;
    }
    std::optional<std::size_t> seen;
    for (std::size_t i = 0; i < others.size(); ++i) {
      const bool counts = std::any_of(
          hits[i].begin(), hits[i].end(), [&run](std::size_t piece) {
            return piece >= run.first && piece < run.second;
          });
      const std::size_t j = others[i].second;
      if (counts && (!seen || Distance(j, k) < Distance(*seen, k))) seen = j;
    }
    return BlockedWay{keys_[k], keys_[*seen]};
  }

 private:
  static std::size_t Distance(std::size_t a, std::size_t b) {
    return a < b ? b - a : a - b;
  }

  // Where the step after key scan `k` crosses a wall, from the beginning of its
  // visible part, m.
  std::optional<double> AlongOfStep(const Wall& wall, std::size_t k) const {
    if (k + 1 >= poses_.size()) return std::nullopt;
    const Eigen::Vector2d from = poses_[k].head<2>();
    const Eigen::Vector2d to = poses_[k + 1].head<2>();
    if ((to - from).norm() > options_.max_step) return std::nullopt;
    const double a = wall.Across(from);
    const double b = wall.Across(to);
    if ((a < 0.0) == (b < 0.0)) return std::nullopt;
    const double along =
        wall.Along(from + a / (a - b) * (to - from)) - wall.begin;
    if (along < kMargin || along > wall.length() - kMargin) return std::nullopt;
    return along;
  }

  // The piece of a wall that lies at `along` it; none outside.
  std::optional<std::size_t> PieceAt(const Wall& wall, double along) const {
    if (!(along >= wall.begin && along <= wall.end)) return std::nullopt;
    return static_cast<std::size_t>((along - wall.begin) / options_.piece);
  }

  // The pieces that returns of a key scan lie on, one entry for each return.
  std::vector<std::size_t> PiecesHit(std::size_t j, const Wall& wall) const {
    std::vector<std::size_t> hit;
    VisitReturns(j, [&](const Eigen::Vector2d&, const Eigen::Vector2d& end) {
      if (std::abs(wall.Across(end)) > options_.thickness) return;
      if (const auto piece = PieceAt(wall, wall.Along(end))) {
        hit.push_back(*piece);
      }
    });
    return hit;
  }

  // Adds a key scan of the visit that crosses.
  void AddVisit(std::size_t j, const Wall& wall, Pieces* pieces) const {
    VisitReturns(
        j, [&](const Eigen::Vector2d& laser, const Eigen::Vector2d& end) {
          const double to = wall.Across(end);
          if (std::abs(to) <= options_.thickness) {
            if (const auto piece = PieceAt(wall, wall.Along(end))) {
              ++pieces->kept[*piece];
            }
            return;
          }
          const double from = wall.Across(laser);
          if ((from < 0.0) == (to < 0.0) || std::abs(to) < options_.passed)
            return;
          const Eigen::Vector2d at = laser + from / (from - to) * (end - laser);
          if (const auto piece = PieceAt(wall, wall.Along(at))) {
            ++pieces->passed[*piece];
          }
        });
  }

  // Calls `visit(laser, end)` with each return of a key scan, map frame.
  template <typename Visit>
  void VisitReturns(std::size_t j, const Visit& visit) const {
    const Scan& scan = scans_[static_cast<std::size_t>(keys_[j])];
    std::vector<ScanPoint> points;
    ExtractScanPoints(scan, options_.points, &points);
    const PoseTransform transform(poses_[j]);
    const Eigen::Vector2d laser = transform.Point(scan.laser_offset.head<2>());
    for (const ScanPoint& point : points) {
      visit(laser, transform.Point(point.position));
    }
  }

  // Returns from which on a piece is solid.
  int LeastSolid(std::vector<int> solid) const {
    solid.erase(
        std::remove_if(solid.begin(), solid.end(),
                       [this](int hits) { return hits < options_.min_beams; }),
        solid.end());
    if (solid.empty()) return options_.min_beams;
    const auto middle =
        solid.begin() + static_cast<std::ptrdiff_t>(solid.size() / 2);
    std::nth_element(solid.begin(), middle, solid.end());
    return std::max(options_.min_beams,
                    static_cast<int>(std::ceil(kSolidShare * *middle)));
  }

  // Begin and end of the pieces in a row, gaps of one allowed, that were solid
  // and passed, around the place of a crossing; the same twice for none.
  std::pair<std::size_t, std::size_t> LongestRun(const Pieces& pieces,
                                                 double along) const {
    const int least = LeastSolid(pieces.solid);
    const auto contradicts = [&](std::size_t i) {
      return pieces.solid[i] >= least &&
             pieces.passed[i] >= options_.min_beams &&
             pieces.passed[i] > 3 * pieces.kept[i];
    };
    const std::size_t size = pieces.solid.size();
    const auto here = static_cast<std::size_t>(along / options_.piece);
    std::size_t begin = here;
    std::size_t end = here;
    for (std::size_t i = here; i < size && i <= end + 1; ++i) {
      if (contradicts(i)) end = i + 1;
    }
    for (std::size_t i = here + 1; i-- > 0 && i + 2 >= begin;) {
      if (contradicts(i)) begin = i;
    }
    return {begin, end};
  }

  const std::vector<Scan>& scans_;
  const std::vector<int>& keys_;
  const std::vector<Pose2>& poses_;
  const std::vector<Wall>& walls_;
  const WayCheckOptions& options_;
  PlaceGrid grid_;
  std::vector<double> way_;
};

}  // namespace

std::vector<BlockedWay> FindBlockedWays(const std::vector<Scan>& scans,
                                        const std::vector<int>& keys,
                                        const std::vector<Pose2>& poses,
                                        const std::vector<Wall>& walls,
                                        const WayCheckOptions& options,
                                        const std::function<bool()>& stop) {
  if (keys.size() != poses.size()) {
    throw PLUMBLINE_ERROR(
        std::to_string(poses.size()) + " poses",
        "one for each of " + std::to_string(keys.size()) + " key scans");
  }
  const WayCheck check(scans, keys, poses, walls, options);
  const std::vector<Crossing> crossings = check.FindCrossings();
  std::vector<std::optional<BlockedWay>> judged(crossings.size());
  for (std::size_t begin = 0; begin < crossings.size();
       begin += kCrossingsAtOnce) {
    if (stop && stop()) return {};
    ParallelFor(std::min(kCrossingsAtOnce, crossings.size() - begin),
                options.num_threads, [&](std::size_t i) {
                  judged[begin + i] = check.Judge(crossings[begin + i]);
                });
  }
  std::vector<BlockedWay> found;
  for (const std::optional<BlockedWay>& way : judged) {
    if (way) found.push_back(*way);
  }
  return found;
}

}  // namespace plumbline
