#include <plumbline/frontend/part_evidence.h>
#include <plumbline/frontend/place_grid.h>

#include <algorithm>
#include <utility>

namespace plumbline {
namespace {

// As the check of the finished map has it (MapCheckOptions).
constexpr double kSpacing = 1.2;
constexpr double kRadius = 4.0;
constexpr std::size_t kFewestOthers = 4;
constexpr std::size_t kMostOthers = 12;
constexpr int kFewestReturns = 15;
constexpr double kMostIntruders = 0.3;
constexpr double kMostSeenThrough = 0.4;

// So many that contradict are no chance.
constexpr int kDoubts = 5;

// The key scans of one part against those of the other.
PartEvidence CompareWith(const TrackSearch& search,
                         const std::vector<std::size_t>& part,
                         const std::vector<std::size_t>& others) {
  std::vector<Pose2> poses;
  poses.reserve(others.size());
  for (const std::size_t k : others) poses.push_back(search.seen()[k].pose);
  const PlaceGrid grid(poses, kRadius);
  PartEvidence evidence;
  const Pose2* last = nullptr;
  for (const std::size_t k : part) {
    const Pose2& pose = search.seen()[k].pose;
    if (last != nullptr && (pose - *last).head<2>().norm() < kSpacing) continue;
    if (search.Stops()) return {};
    last = &pose;
    std::vector<std::pair<double, std::size_t>> near;
    grid.Around(pose.head<2>(), [&](std::size_t i) {
      const double distance = (poses[i] - pose).head<2>().norm();
      if (distance <= kRadius) near.emplace_back(distance, others[i]);
    });
    if (near.size() < kFewestOthers) continue;
    std::sort(near.begin(), near.end());
    near.resize(std::min(near.size(), kMostOthers));
    std::vector<std::size_t> around;
    for (const auto& [distance, i] : near) around.push_back(i);
    const ScanAgreement seen = search.CompareKey(k, around);
    const int known = seen.hits + seen.intruders;
    const bool has_returns = known >= kFewestReturns;
    const bool has_seen = seen.seen >= kFewestReturns;
    if (!has_returns && !has_seen) continue;
    const bool contradicts =
        (has_returns && seen.intruders > kMostIntruders * known) ||
        (has_seen && seen.seen_through > kMostSeenThrough * seen.seen);
    ++(contradicts ? evidence.contradicting : evidence.agreeing);
  }
  return evidence;
}

}  // namespace

double PartEvidence::Doubt() const {
  return contradicting < kDoubts
             ? 0.0
             : static_cast<double>(contradicting) / (agreeing + contradicting);
}

PartEvidence CompareParts(const TrackSearch& search,
                          const std::vector<std::size_t>& a,
                          const std::vector<std::size_t>& b) {
  PartEvidence evidence = CompareWith(search, a, b);
  evidence.Add(CompareWith(search, b, a));
  return evidence;
}

}  // namespace plumbline
