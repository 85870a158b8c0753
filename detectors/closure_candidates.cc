#include <plumbline/core/disjoint_sets.h>
#include <plumbline/detectors/closure_candidates.h>

#include <algorithm>
#include <cstdint>
#include <limits>

namespace plumbline {
namespace {

// Wider searches wait until the narrowest are done; this much wider is the
// same.
constexpr double kSameWidth = 2.0;

}  // namespace

bool ClosureCandidates::Add(int first, int second, const WallMatch& match,
                            double search, double evidence) {
  if (first == second || walls_->AreOne(first, second)) return false;
  ClosureCandidate candidate;
  candidate.pair = std::minmax(first, second);
  candidate.along = match.along;
  if (candidate.pair.second != second) {
    // The point given along the second wall, found on the other.
    candidate.along =
        Geometry(walls_->wall(first))
            .Along(Geometry(walls_->wall(second)).At(match.along));
  }
  candidate.search = search;
  candidate.evidence = evidence;
  const auto inserted = candidates_.emplace(candidate.pair, candidate);
  ClosureCandidate& there = inserted.first->second;
  if (search < there.search ||
      (search == there.search && evidence > there.evidence)) {
    there = candidate;
  }
  return true;
}

double ClosureCandidates::Widest(double width) const {
  double narrowest = std::numeric_limits<double>::infinity();
  for (const auto& [pair, candidate] : candidates_) {
    if (walls_->WasBroken(pair)) continue;
    narrowest = std::min(narrowest, candidate.search);
  }
  return std::max(width, kSameWidth * narrowest);
}

std::vector<ClosureCandidate> ClosureCandidates::Choose(
    double width, const DetectionScope& scope) const {
  const double widest = Widest(width);
  std::vector<ClosureCandidate> chosen;
  for (const auto& [pair, candidate] : candidates_) {
    if (candidate.search <= widest) chosen.push_back(candidate);
  }
  std::stable_sort(chosen.begin(), chosen.end(),
                   [](const ClosureCandidate& a, const ClosureCandidate& b) {
                     return a.evidence > b.evidence;
                   });
  DisjointSets classes(static_cast<std::size_t>(walls_->size()));
  for (int i = 0; i < walls_->size(); ++i) {
    classes.Join(static_cast<std::size_t>(i), walls_->ClassOf(i));
  }
  // One constraint is enough to make two classes one.
  std::vector<ClosureCandidate> needed;
  for (const ClosureCandidate& candidate : chosen) {
    if (walls_->WasBroken(candidate.pair) ||
        classes.Join(static_cast<std::size_t>(candidate.pair.first),
                     static_cast<std::size_t>(candidate.pair.second))) {
      needed.push_back(candidate);
    }
  }
  scope.Count("candidates", static_cast<std::int64_t>(candidates_.size()));
  scope.Count("candidates refused: wider search than the narrowest",
              static_cast<std::int64_t>(candidates_.size() - chosen.size()));
  scope.Count("candidates refused: others make the walls one",
              static_cast<std::int64_t>(chosen.size() - needed.size()));
  return needed;
}

}  // namespace plumbline
