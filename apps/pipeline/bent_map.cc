#include <plumbline/factors/angle.h>
#include <plumbline/frontend/way_lengths.h>
#include <plumbline/pipeline/bent_map.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>

namespace plumbline {
namespace {

constexpr double kBentShare = 0.25;
constexpr double kBentWay = 10.0;
constexpr double kBent = DegToRad(3.0);
// A longer one between two poses is a jump, not a way, m.
constexpr double kLongestStep = 1.0;

// What walls may turn a way by against what the scans say, at the median: on
// logs of buildings with straight corridors, spoilt ones among them, it is up
// to 0.15 degrees over 30 m and 0.18 over 60; in corridors that bend by 0.05
// degrees a metre and are mapped straight 0.2 to 0.4 over 30 m and 0.4 to 0.8
// over 60, in those that bend by less 0.19 to 0.32 over 60.
struct Straightened {
  double way = 0.0;   // m
  double turn = 0.0;  // rad
};
constexpr Straightened kStraightened[] = {{30.0, DegToRad(0.19)},
                                          {60.0, DegToRad(0.21)}};

// How much the poses of a map turn otherwise than others over the ways of this
// length, m: the value that this share of them does not exceed, rad; 0 where
// there is no such way.
double TurnAgainst(const std::vector<Pose2>& map,
                   const std::vector<Pose2>& others, double length,
                   double share) {
  const std::vector<double> way = WayLengths(others, kLongestStep);
  std::vector<double> turns;
  std::size_t begin = 0;
  for (std::size_t end = 0; end < others.size(); ++end) {
    if (way[end] - way[begin] < length) continue;
    while (way[end] - way[begin + 1] >= length) ++begin;
    turns.push_back(
        std::abs(NormalizeAngle(Between(map[begin], map[end])[2] -
                                Between(others[begin], others[end])[2])));
  }
  if (turns.empty()) return 0.0;
  const auto which =
      turns.begin() + static_cast<std::ptrdiff_t>(
                          share * static_cast<double>(turns.size() - 1));
  std::nth_element(turns.begin(), which, turns.end());
  return *which;
}

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
  return TurnAgainst(map, odometry, kBentWay, 1.0 - kBentShare) > kBent;
}

bool HasKink(const std::vector<Pose2>& map,
             const std::vector<Pose2>& odometry) {
  return TurnAgainst(map, odometry, kBentWay, 1.0) > kBent;
}

bool AreBentByWalls(const std::vector<Pose2>& with_walls,
                    const std::vector<Pose2>& by_scans) {
  return std::any_of(std::begin(kStraightened), std::end(kStraightened),
                     [&](const Straightened& limit) {
                       return TurnAgainst(with_walls, by_scans, limit.way,
                                          0.5) > limit.turn;
                     });
}

}  // namespace plumbline
