#include <plumbline/factors/angle.h>
#include <plumbline/frontend/way_lengths.h>
#include <plumbline/pipeline/bent_map.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace plumbline {
namespace {

constexpr double kBentShare = 0.25;
constexpr double kBentWay = 10.0;
constexpr double kBent = DegToRad(3.0);
// A longer one between two poses is a jump, not a way, m.
constexpr double kLongestStep = 1.0;

}  // namespace

std::vector<Pose2> PosesByMotions(const std::vector<KeyScanRecord>& records,
                                  const std::vector<Pose2>& keys) {
  std::vector<Pose2> poses;
  for (std::size_t k = 0; k < records.size(); ++k) {
    const std::size_t from =
        records[k].from < 0 ? k - 1 : static_cast<std::size_t>(records[k].from);
    poses.push_back(k == 0 ? keys.front()
                           : Compose(poses[from], records[k].motion.mean));
  }
  return poses;
}

bool IsBent(const std::vector<Pose2>& map, const std::vector<Pose2>& odometry) {
  const std::vector<double> way = WayLengths(odometry, kLongestStep);
  std::vector<double> turns;
  std::size_t begin = 0;
  for (std::size_t end = 0; end < odometry.size(); ++end) {
    if (way[end] - way[begin] < kBentWay) continue;
    while (way[end] - way[begin + 1] >= kBentWay) ++begin;
    turns.push_back(
        std::abs(NormalizeAngle(Between(map[begin], map[end])[2] -
                                Between(odometry[begin], odometry[end])[2])));
  }
  if (turns.empty()) return false;
  const auto bend = turns.begin() + static_cast<std::ptrdiff_t>(
                                        (1.0 - kBentShare) *
                                        static_cast<double>(turns.size() - 1));
  std::nth_element(turns.begin(), bend, turns.end());
  return *bend > kBent;
}

}  // namespace plumbline
