#include <plumbline/core/error.h>
#include <plumbline/core/parallel_for.h>
#include <plumbline/frontend/map_check.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

namespace plumbline {
namespace {

// A step between key scans counts as no more way than this, m: where the robot
// was lost the trajectory may jump.
constexpr double kLongestStep = 2.0;

// Between two times that `stop` is asked.
constexpr std::size_t kScansAtOnce = 64;

// Key scans by the cell of a grid that they were made in.
class PlaceGrid {
 public:
  PlaceGrid(const std::vector<Pose2>& poses, double cell) : cell_(cell) {
    for (std::size_t k = 0; k < poses.size(); ++k) {
      entries_.emplace_back(CellOf(poses[k].head<2>()), k);
    }
    std::sort(entries_.begin(), entries_.end());
  }

  // Calls `visit` with each index in the cells around a position.
  template <typename Visit>
  void Around(const Eigen::Vector2d& position, const Visit& visit) const {
    const Cell middle = CellOf(position);
    for (long x = middle.first - 1; x <= middle.first + 1; ++x) {
      for (long y = middle.second - 1; y <= middle.second + 1; ++y) {
        const Cell cell(x, y);
        auto entry = std::lower_bound(entries_.begin(), entries_.end(),
                                      std::make_pair(cell, std::size_t{0}));
        for (; entry != entries_.end() && entry->first == cell; ++entry) {
          visit(entry->second);
        }
      }
    }
  }

 private:
  using Cell = std::pair<long, long>;
  Cell CellOf(const Eigen::Vector2d& position) const {
    return {std::lround(position.x() / cell_),
            std::lround(position.y() / cell_)};
  }

  double cell_;
  std::vector<std::pair<Cell, std::size_t>> entries_;
};

enum class Verdict { kUnknown, kAgrees, kContradicts };

Verdict Judge(const ScanAgreement& agreement, const MapCheckOptions& options) {
  const int known = agreement.hits + agreement.intruders;
  if (known < options.min_returns && agreement.seen < options.min_returns) {
    return Verdict::kUnknown;
  }
  const bool contradicts =
      (known >= options.min_returns &&
       agreement.intruders > options.max_intruders * known) ||
      (agreement.seen >= options.min_returns &&
       agreement.seen_through > options.max_seen_through * agreement.seen);
  return contradicts ? Verdict::kContradicts : Verdict::kAgrees;
}

}  // namespace

std::vector<MapContradiction> FindContradictions(
    const std::vector<Scan>& scans, const std::vector<int>& keys,
    const std::vector<Pose2>& poses, const MapCheckOptions& options,
    const std::function<bool()>& stop) {
  if (keys.size() != poses.size()) {
    throw PLUMBLINE_ERROR(
        std::to_string(poses.size()) + " poses",
        "one for each of " + std::to_string(keys.size()) + " key scans");
  }
  std::vector<double> way(keys.size(), 0.0);
  std::vector<std::size_t> looked_at;
  for (std::size_t k = 0; k < keys.size(); ++k) {
    if (k > 0) {
      way[k] =
          way[k - 1] +
          std::min(kLongestStep, (poses[k] - poses[k - 1]).head<2>().norm());
    }
    if (looked_at.empty() ||
        way[k] - way[looked_at.back()] >= options.spacing) {
      looked_at.push_back(k);
    }
  }
  const PlaceGrid grid(poses, options.radius);
  std::vector<Verdict> verdicts(looked_at.size(), Verdict::kUnknown);
  const auto judge = [&](std::size_t i) {
    const std::size_t k = looked_at[i];
    std::vector<std::pair<double, std::size_t>> others;
    grid.Around(poses[k].head<2>(), [&](std::size_t j) {
      const double distance = (poses[j] - poses[k]).head<2>().norm();
      if (distance <= options.radius &&
          std::abs(way[j] - way[k]) >= options.least_way) {
        others.emplace_back(distance, j);
      }
    });
    if (static_cast<int>(others.size()) < options.min_others) return;
    std::sort(others.begin(), others.end());
    if (static_cast<int>(others.size()) > options.max_others) {
      others.resize(static_cast<std::size_t>(options.max_others));
    }
    std::vector<ScanPoint> points;
    std::vector<ScanPoint> reference;
    std::vector<Viewpoint> viewpoints;
    for (const auto& [distance, j] : others) {
      const Scan& scan = scans[static_cast<std::size_t>(keys[j])];
      ExtractScanPoints(scan, options.points, &points);
      const PoseTransform transform(poses[j]);
      viewpoints.push_back(
          {transform.Point(scan.laser_offset.head<2>()), reference.size()});
      for (const ScanPoint& point : points) {
        reference.push_back(Moved(point, transform));
      }
    }
    ScanMatcher matcher(options.matcher);
    matcher.SetReference(std::move(reference), std::move(viewpoints));
    const Scan& scan = scans[static_cast<std::size_t>(keys[k])];
    ExtractScanPoints(scan, options.points, &points);
    verdicts[i] =
        Judge(matcher.Compare(points, poses[k], scan.laser_offset.head<2>()),
              options);
  };
  for (std::size_t begin = 0; begin < looked_at.size(); begin += kScansAtOnce) {
    if (stop && stop()) return {};
    ParallelFor(std::min(kScansAtOnce, looked_at.size() - begin),
                options.num_threads, [&](std::size_t i) { judge(begin + i); });
  }

  std::vector<MapContradiction> found;
  std::size_t i = 0;
  while (i < verdicts.size()) {
    if (verdicts[i] != Verdict::kContradicts) {
      ++i;
      continue;
    }
    const std::size_t begin = i;
    std::size_t last = i;
    int contradictions = 0;
    for (int passed = 0; i < verdicts.size() && passed <= 1; ++i) {
      if (verdicts[i] == Verdict::kContradicts) {
        ++contradictions;
        last = i;
        passed = 0;
      } else {
        ++passed;
      }
    }
    if (contradictions >= options.min_scans) {
      found.push_back({keys[looked_at[begin]], keys[looked_at[last]]});
    }
  }
  return found;
}

}  // namespace plumbline
