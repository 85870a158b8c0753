#include <plumbline/frontend/late_metre.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace plumbline {
namespace {

// Shorter motions have no parts, m.
constexpr double kLeastWay = 1e-3;

// The metre on the way of each use, as all of them show it.
std::vector<double> Smoothed(const std::vector<MetreUse>& uses) {
  std::vector<double> metres(uses.size());
  for (std::size_t k = uses.size(); k-- > 0;) {
    const MetreUse& use = uses[k];
    metres[k] = use.learnt;
    if (k + 1 == uses.size()) continue;
    const double predicted = use.variance + uses[k + 1].added_variance;
    if (predicted <= 0.0) continue;
    metres[k] += use.variance / predicted * (metres[k + 1] - use.learnt);
  }
  return metres;
}

}  // namespace

LateMetre FindLateMetre(const std::vector<MetreUse>& uses,
                        const LateMetreOptions& options) {
  const std::vector<double> metres = Smoothed(uses);
  LateMetre late;
  // What stretches from the beginning on gain, and how long they are, m.
  std::vector<double> gained = {0.0};
  std::vector<double> ways = {0.0};
  std::size_t first = 0;
  for (std::size_t k = 0; k < uses.size(); ++k) {
    const MetreUse& use = uses[k];
    const double off = metres[k] - use.used;
    late.corrections.push_back({use.scan, off * use.change});
    gained.push_back(gained.back() + off * use.change.head<2>().norm());
    ways.push_back(ways.back() + use.way);
    while (ways.back() - ways[first] > options.window) ++first;
    late.largest_change =
        std::max(late.largest_change, std::abs(gained.back() - gained[first]));
  }
  if (late.largest_change <= options.least_change) late.corrections.clear();
  return late;
}

void CorrectMotions(const std::vector<MotionCorrection>& corrections,
                    std::vector<RefinedScan>* refined) {
  if (corrections.empty()) return;
  std::vector<RefinedScan>& scans = *refined;
  const std::vector<RefinedScan> before = scans;
  // Of each scan the change of the motion that it is a part of, and the length
  // of that; those before another track begins are part of none.
  std::vector<Pose2> changes(scans.size(), Pose2::Zero());
  for (const MotionCorrection& correction : corrections) {
    const auto end = static_cast<std::size_t>(correction.scan);
    if (end >= scans.size() || before[end].tie != TrackTie::kNone) continue;
    const double way = before[end].since_key.mean.head<2>().norm();
    changes[end] += correction.change;
    for (std::size_t i = end; i-- > 0 && !before[i].is_key;) {
      const double own = before[i].since_key.mean.head<2>().norm();
      changes[i] += Pose2(std::min(1.0, own / std::max(way, kLeastWay)) *
                          correction.change);
    }
  }
  std::size_t key = 0;
  for (std::size_t i = 1; i < scans.size(); ++i) {
    if (before[i].tie != TrackTie::kNone || before[i].since >= 0) {
      scans[i].pose = Compose(scans[i - 1].pose,
                              Between(before[i - 1].pose, before[i].pose));
    } else {
      scans[i].since_key.mean += changes[i];
      scans[i].pose = Compose(scans[key].pose, scans[i].since_key.mean);
    }
    if (before[i].is_key) key = i;
  }
}

}  // namespace plumbline
