#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/missed_motion.h>

#include <cmath>
#include <cstddef>
#include <vector>

namespace plumbline {
namespace {

// m for a turn by one rad on the spot.
constexpr double kWayOfTurn = 0.5;

double WayOf(const Pose2& step) {
  return step.head<2>().norm() + kWayOfTurn * std::abs(step[2]);
}

void Spread(const BlindRun& run, std::vector<RefinedScan>* refined) {
  const auto begin = static_cast<std::size_t>(run.begin);
  const auto end = static_cast<std::size_t>(run.end);
  const RefinedScan& matched = (*refined)[end];
  const Pose2 predicted = Compose(matched.pose, Inverse(run.missed));
  // In the frame of all of them.
  Pose2 missed = matched.pose - predicted;
  missed[2] = run.missed[2];
  std::vector<double> ways;
  double whole = 0.0;
  for (std::size_t i = begin + 1; i <= end; ++i) {
    const Pose2& here = i == end ? predicted : (*refined)[i].pose;
    whole += WayOf(Between((*refined)[i - 1].pose, here));
    ways.push_back(whole);
  }
  if (whole == 0.0) return;
  for (std::size_t i = begin + 1; i < end; ++i) {
    RefinedScan& scan = (*refined)[i];
    const Pose2 before = scan.pose;
    scan.pose += ways[i - begin - 1] / whole * missed;
    scan.pose[2] = NormalizeAngle(scan.pose[2]);
    scan.since_key.mean =
        Compose(scan.since_key.mean, Between(before, scan.pose));
  }
}

}  // namespace

std::vector<BlindRun> FindBlindRuns(const std::vector<RefinedScan>& refined) {
  std::vector<BlindRun> runs;
  for (std::size_t end = 1; end < refined.size(); ++end) {
    if (refined[end].missed_since < 0) continue;
    auto begin = static_cast<std::size_t>(refined[end].missed_since);
    // A key scan anchors what follows.
    for (std::size_t i = begin + 1; i < end; ++i) {
      if (refined[i].is_key) begin = i;
    }
    runs.push_back(
        {static_cast<int>(begin), static_cast<int>(end), refined[end].missed});
  }
  return runs;
}

void SpreadMissedMotion(std::vector<RefinedScan>* refined) {
  for (const BlindRun& run : FindBlindRuns(*refined)) Spread(run, refined);
}

}  // namespace plumbline
