#include <plumbline/frontend/map_check.h>
#include <plumbline/frontend/part_evidence.h>
#include <plumbline/frontend/place_grid.h>

#include <algorithm>
#include <utility>

namespace plumbline {
namespace {

// So many that contradict are no chance.
constexpr int kDoubts = 5;

// The key scans of one part against those of the other.
PartEvidence CompareWith(const TrackSearch& search,
                         const std::vector<std::size_t>& part,
                         const std::vector<std::size_t>& others) {
  // As the finished map is checked.
  const MapCheckOptions options;
  std::vector<Pose2> poses;
  poses.reserve(others.size());
  for (const std::size_t k : others) poses.push_back(search.seen()[k].pose);
  const PlaceGrid grid(poses, options.radius);
  PartEvidence evidence;
  const Pose2* last = nullptr;
  for (const std::size_t k : part) {
    const Pose2& pose = search.seen()[k].pose;
    if (last != nullptr && (pose - *last).head<2>().norm() < options.spacing) {
      continue;
    }
    if (search.Stops()) return {};
    last = &pose;
    std::vector<std::pair<double, std::size_t>> near;
    grid.Around(pose.head<2>(), [&](std::size_t i) {
      const double distance = (poses[i] - pose).head<2>().norm();
      if (distance <= options.radius) near.emplace_back(distance, others[i]);
    });
    if (static_cast<int>(near.size()) < options.min_others) continue;
    std::sort(near.begin(), near.end());
    near.resize(
        std::min(near.size(), static_cast<std::size_t>(options.max_others)));
    std::vector<std::size_t> around;
    for (const auto& [distance, i] : near) around.push_back(i);
    switch (JudgeScan(search.CompareKey(k, around), options)) {
      case ScanVerdict::kUnknown:
        break;
      case ScanVerdict::kAgrees:
        ++evidence.agreeing;
        break;
      case ScanVerdict::kContradicts:
        ++evidence.contradicting;
        break;
    }
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
