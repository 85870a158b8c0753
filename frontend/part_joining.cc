#include <plumbline/frontend/part_evidence.h>
#include <plumbline/frontend/part_joining.h>

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <optional>
#include <set>
#include <string>
#include <utility>

namespace plumbline {
namespace {

// Key scans of a window of a part that is looked for.
constexpr std::size_t kWindow = 24;
// Parts that are looked for, at most.
constexpr int kMostLateParts = 24;
// A part is looked for again when the rest has grown by this factor.
constexpr double kMoreRest = 1.25;
// Nodes of the searches for all windows of a part.
constexpr std::int64_t kLateNodes = 12000000;
// A tie that is known worse than this is a rough one: the part is still loose,
// m and rad.
constexpr double kLateSigma = 0.5;
constexpr double kLateAngle = DegToRad(5.0);
// A rough one that is known worse than this is not taken: a guess is as good.
constexpr double kRoughSigma = 10.0;
constexpr double kRoughAngle = DegToRad(20.0);

// Shares that contradict (PartEvidence::Doubt) from which on a part is not
// taken; drift makes a third of the scans contradict at times. Of one that
// hangs on another tie: of that one's.
constexpr double kMostDoubt = 0.5;
constexpr double kLessDoubt = 0.5;

// Where no window is clear: quality of a place that one may have at least,
// windows that have to agree on a place, and places that are looked at.
constexpr double kLeastQuality = 0.3;
constexpr std::size_t kFewestAgreed = 3;
constexpr std::size_t kMostPlaces = 6;
// How many scans that agree one that contradicts takes back, and how many have
// to be left.
constexpr int kContradictionWeight = 3;
constexpr int kLeastWeight = 12;
// What another place may have of that: in a building of equal rooms the right
// place need not be among those that were seen.
constexpr double kMostOfRival = 0.25;

// On the covariance of a tie that is held against odometry: what neighbouring
// matches have in common adds up faster than a random walk.
constexpr double kGenerous = 4.0;

double Square(double x) { return x * x; }

// The largest of a tie's variances, as shares of those of a rough one.
double VarianceOf(const LateTie& tie) {
  const Eigen::Matrix3d& covariance = tie.since_key.covariance;
  return std::max({covariance(0, 0) / Square(kLateSigma),
                   covariance(1, 1) / Square(kLateSigma),
                   covariance(2, 2) / Square(kLateAngle)});
}

// Joins parts one after the other.
class PartJoining {
 public:
  PartJoining(const TrackingOptions& tracking, const MatchDrift& drift,
              const std::vector<int>& loose_of,
              const std::vector<BlindWay>& blind, TrackSearch* search,
              std::vector<LooseTrack>* loose, const CutTies& cut)
      : tracking_(tracking),
        drift_(drift),
        loose_of_(loose_of),
        blind_(blind),
        search_(search),
        loose_(loose),
        cut_(cut) {}

  std::vector<LateTie> Run();

 private:
  // Where a window of a part's key scans lies in the rest: its middle one.
  struct LateVote {
    std::size_t middle;
    FoundTrack found;
  };

  std::size_t num_parts() const { return loose_of_.size() + 1; }
  // Key scans by part.
  std::vector<std::vector<std::size_t>> Parts() const;
  // Whether they were one part before ties were cut.
  bool HungTogether(std::size_t a, std::size_t b) const {
    return cut_.before[a] == cut_.before[b];
  }
  // Where the second part lies in the first.
  bool JoinPart(const std::vector<std::size_t>& rest,
                const std::vector<std::size_t>& part);
  // How many windows of this size are looked for of so many key scans.
  std::size_t NumLateWindows(std::size_t keys, std::size_t size) const;
  // Starts of the windows of a part that fit somewhere at all, the clearest one
  // first.
  std::vector<std::size_t> WindowsOf(const std::vector<TrackKey>& keys,
                                     std::size_t size,
                                     const TrackSearch::SearchArea& rest) const;
  // The tie that follows from a match.
  LateTie LateTieOf(const std::vector<std::size_t>& rest,
                    const std::vector<std::size_t>& part,
                    const LateVote& vote) const;
  // Whether a blind way between the two cannot lead to where a window says that
  // the part lies.
  bool IsAgainstOdometry(const std::vector<std::size_t>& rest,
                         const std::vector<std::size_t>& part,
                         const LateVote& vote) const;
  // Takes a part in where a window says, unless that is too uncertain or
  // contradicted.
  bool Take(const std::vector<std::size_t>& rest,
            const std::vector<std::size_t>& part, const LateVote& vote,
            LateTie tie);
  // `is_rough`: it says little more than where to look.
  void AddLateTie(const std::vector<std::size_t>& rest,
                  const std::vector<std::size_t>& part, const LateTie& tie,
                  bool is_rough);
  // Whether two windows of a part say the same of it.
  static bool Agree(const std::vector<TrackKey>& keys, const LateVote& a,
                    const LateVote& b);
  // Where no window is clear by itself: the place that most of them may have,
  // if what all of the part and the rest saw speaks for it and for no other.
  bool MostAgreed(const std::vector<TrackKey>& keys,
                  const std::vector<std::size_t>& rest,
                  const std::vector<std::size_t>& part,
                  const std::vector<LateVote>& candidates,
                  LateVote* most) const;
  // By which the part moves to where a window says, and what is seen of it
  // there.
  Pose2 ShiftOf(const LateVote& vote,
                const std::vector<std::size_t>& part) const;
  PartEvidence EvidenceOf(const LateVote& vote,
                          const std::vector<std::size_t>& rest,
                          const std::vector<std::size_t>& part) const;
  void Move(const std::vector<std::size_t>& part, const Pose2& shift) const;
  // The entry of the later one of two parts.
  int LooseOf(const std::vector<std::size_t>& a,
              const std::vector<std::size_t>& b) const;

  const TrackingOptions& tracking_;
  const MatchDrift& drift_;
  const std::vector<int>& loose_of_;
  const std::vector<BlindWay>& blind_;
  TrackSearch* search_;
  std::vector<LooseTrack>* loose_;
  const CutTies& cut_;
  std::vector<LateTie> ties_;
};

std::vector<std::vector<std::size_t>> PartJoining::Parts() const {
  std::vector<std::vector<std::size_t>> parts(num_parts());
  for (std::size_t k = 0; k < search_->seen().size(); ++k) {
    parts[static_cast<std::size_t>(search_->seen()[k].part)].push_back(k);
  }
  return parts;
}

std::vector<LateTie> PartJoining::Run() {
  // The largest part takes in others, largest first, until none is found.
  const std::vector<LooseTrack> loose = *loose_;
  // Key scans that a part was looked for in, by part.
  std::vector<std::size_t> tried(num_parts(), 0);
  bool is_joined = num_parts() > 1;
  // Something lies elsewhere than when all parts were looked for.
  bool is_moved = cut_.before.empty();
  int looked_for = 0;
  while (is_joined) {
    is_joined = false;
    std::vector<std::vector<std::size_t>> parts = Parts();
    std::stable_sort(
        parts.begin(), parts.end(),
        [](const auto& a, const auto& b) { return a.size() > b.size(); });
    for (std::size_t p = 1; p < parts.size() && !is_joined; ++p) {
      if (parts[p].empty()) break;
      const auto number = [&](std::size_t i) {
        return static_cast<std::size_t>(search_->seen()[parts[i].front()].part);
      };
      if (!is_moved && !HungTogether(number(0), number(p))) continue;
      std::size_t& before = tried[number(p)];
      const std::size_t rest = parts[0].size();
      if (static_cast<double>(rest) < kMoreRest * static_cast<double>(before)) {
        continue;
      }
      before = rest;
      // A log of many parts comes to an end, too.
      if (++looked_for > kMostLateParts) break;
      if (search_->Stops()) break;
      is_joined = JoinPart(parts[0], parts[p]);
      is_moved = is_moved || is_joined;
    }
  }
  if (search_->Stops()) {
    *loose_ = loose;
    ties_.clear();
  }
  std::sort(ties_.begin(), ties_.end(),
            [](const LateTie& a, const LateTie& b) { return a.scan < b.scan; });
  return std::move(ties_);
}

bool PartJoining::JoinPart(const std::vector<std::size_t>& rest,
                           const std::vector<std::size_t>& part) {
  const auto least = static_cast<std::size_t>(tracking_.first_global_keys);
  if (part.size() < least || rest.size() < TrackSearch::kShortestVisit)
    return false;
  const std::vector<TrackKey> keys = search_->Unpacked(part);
  const std::size_t size = std::min(kWindow, part.size());
  const TrackSearch::SearchArea view = search_->AreaOf(rest);
  const std::vector<std::size_t> windows = WindowsOf(keys, size, view);
  // What a window says stands when another one says the same, or the part is
  // too short for another: one that fits nowhere is no reason to believe it.
  const bool is_short = NumLateWindows(part.size(), size) == 1;
  std::vector<LateVote> votes;
  std::vector<LateVote> candidates;
  LateVote best_vote;
  std::optional<LateTie> best;
  std::int64_t nodes = kLateNodes;
  for (const std::size_t begin : windows) {
    if (search_->Stops()) return false;
    if (nodes <= 0) break;
    // A jump within a window is none of the track's: parts are whole.
    LateVote vote{begin + size / 2, {}};
    std::vector<FoundTrack> hypotheses =
        search_->FindAll(keys, view, begin, begin + size, 0.0, &nodes);
    // Where it cannot be is no rival of where it is.
    hypotheses.erase(
        std::remove_if(
            hypotheses.begin(), hypotheses.end(),
            [&](const FoundTrack& hypothesis) {
              return IsAgainstOdometry(rest, part, {vote.middle, hypothesis});
            }),
        hypotheses.end());
    for (const FoundTrack& hypothesis : hypotheses) {
      if (hypothesis.quality >= kLeastQuality)
        candidates.push_back({vote.middle, hypothesis});
    }
    if (!search_->IsClear(hypotheses, &vote.found)) continue;
    search_->Trace("LATE window found");
    std::vector<const LateVote*> agreeing;
    for (const LateVote& other : votes) {
      if (Agree(keys, vote, other)) agreeing.push_back(&other);
    }
    if (!agreeing.empty() || is_short) {
      agreeing.push_back(&vote);
      for (const LateVote* other : agreeing) {
        const LateTie tie = LateTieOf(rest, part, *other);
        const bool is_narrow = VarianceOf(tie) <= 1.0;
        const bool is_better =
            !best || (is_narrow && VarianceOf(*best) <= 1.0
                          ? other->found.quality > best_vote.found.quality
                          : VarianceOf(tie) < VarianceOf(*best));
        if (is_better) {
          best = tie;
          best_vote = *other;
        }
      }
      if (VarianceOf(*best) <= 1.0) break;
    }
    votes.push_back(vote);
  }
  if (!best && MostAgreed(keys, rest, part, candidates, &best_vote)) {
    best = LateTieOf(rest, part, best_vote);
  }
  return best && Take(rest, part, best_vote, *best);
}

bool PartJoining::Take(const std::vector<std::size_t>& rest,
                       const std::vector<std::size_t>& part,
                       const LateVote& vote, LateTie tie) {
  if (tie.since_key.covariance.diagonal().head<2>().maxCoeff() >
          Square(kRoughSigma) ||
      tie.since_key.covariance(2, 2) > Square(kRoughAngle)) {
    return false;
  }
  const bool is_rough = VarianceOf(tie) > 1.0;
  tie.loose = LooseOf(rest, part);
  const auto held = cut_.doubts.find(tie.loose);
  const bool is_held = held != cut_.doubts.end();
  // The match that it hangs on is more than where to look.
  if (is_rough && is_held) return false;
  if (EvidenceOf(vote, rest, part).Doubt() >
      (is_held ? kLessDoubt * held->second : kMostDoubt)) {
    search_->Trace("NOT JOINED: contradicted");
    return false;
  }
  Move(part, ShiftOf(vote, part));
  AddLateTie(rest, part, tie, is_rough);
  return true;
}

bool PartJoining::IsAgainstOdometry(const std::vector<std::size_t>& rest,
                                    const std::vector<std::size_t>& part,
                                    const LateVote& vote) const {
  if (blind_.empty()) return false;
  const LateTie tie = LateTieOf(rest, part, vote);
  const std::vector<SeenKey>& seen = search_->seen();
  const auto find = [&](int scan) {
    return std::find_if(seen.begin(), seen.end(),
                        [&](const SeenKey& key) { return key.scan == scan; });
  };
  const int into = seen[rest.front()].part;
  const int own = seen[part.front()].part;
  const Pose2 shift = ShiftOf(vote, part);
  return std::any_of(blind_.begin(), blind_.end(), [&](const BlindWay& way) {
    const auto from = find(way.from);
    const auto to = find(way.to);
    if (from == seen.end() || to == seen.end()) return false;
    const bool leads_to = from->part == into && to->part == own;
    if (!leads_to && !(from->part == own && to->part == into)) return false;
    Pose2 left = (leads_to ? Between(from->pose, Compose(shift, to->pose))
                           : Between(Compose(shift, from->pose), to->pose)) -
                 way.motion.mean;
    left[2] = NormalizeAngle(left[2]);
    const Eigen::Matrix3d covariance =
        way.motion.covariance + kGenerous * tie.since_key.covariance;
    return std::abs(left[2]) > way.most_wrong_turn ||
           left.dot(covariance.inverse() * left) > tracking_.max_innovation;
  });
}

bool PartJoining::Agree(const std::vector<TrackKey>& keys, const LateVote& a,
                        const LateVote& b) {
  const Pose2 between = Between(keys[b.middle].pose, keys[a.middle].pose);
  const Pose2 apart = Between(Compose(b.found.pose, between), a.found.pose);
  return apart.head<2>().norm() < TrackSearch::kVisitDistance &&
         std::abs(apart[2]) < TrackSearch::kVisitRotation;
}

bool PartJoining::MostAgreed(const std::vector<TrackKey>& keys,
                             const std::vector<std::size_t>& rest,
                             const std::vector<std::size_t>& part,
                             const std::vector<LateVote>& candidates,
                             LateVote* most) const {
  // By candidate: windows that say the same.
  std::vector<std::pair<std::size_t, const LateVote*>> counted;
  for (const LateVote& candidate : candidates) {
    std::set<std::size_t> windows;
    for (const LateVote& other : candidates) {
      if (Agree(keys, candidate, other)) windows.insert(other.middle);
    }
    if (windows.size() >= kFewestAgreed) {
      counted.emplace_back(windows.size(), &candidate);
    }
  }
  std::stable_sort(
      counted.begin(), counted.end(), [](const auto& a, const auto& b) {
        return a.first != b.first
                   ? a.first > b.first
                   : a.second->found.quality > b.second->found.quality;
      });
  std::vector<const LateVote*> places;
  int best = 0;
  int second = 0;
  for (const auto& [windows, candidate] : counted) {
    if (places.size() == kMostPlaces || search_->Stops()) break;
    if (std::any_of(places.begin(), places.end(), [&](const LateVote* place) {
          return Agree(keys, *candidate, *place);
        })) {
      continue;
    }
    places.push_back(candidate);
    const PartEvidence evidence = EvidenceOf(*candidate, rest, part);
    search_->Trace("LATE place of " + std::to_string(windows) +
                   " windows: agree " + std::to_string(evidence.agreeing) +
                   " contradict " + std::to_string(evidence.contradicting));
    const int weight =
        evidence.agreeing - kContradictionWeight * evidence.contradicting;
    if (weight > best) {
      second = best;
      best = weight;
      *most = *candidate;
    } else {
      second = std::max(second, weight);
    }
  }
  return best >= kLeastWeight && second <= kMostOfRival * best;
}

Pose2 PartJoining::ShiftOf(const LateVote& vote,
                           const std::vector<std::size_t>& part) const {
  return Compose(vote.found.pose,
                 Inverse(search_->seen()[part[vote.middle]].pose));
}

PartEvidence PartJoining::EvidenceOf(
    const LateVote& vote, const std::vector<std::size_t>& rest,
    const std::vector<std::size_t>& part) const {
  const Pose2 shift = ShiftOf(vote, part);
  Move(part, shift);
  const PartEvidence evidence = CompareParts(*search_, part, rest);
  Move(part, Inverse(shift));
  return evidence;
}

void PartJoining::Move(const std::vector<std::size_t>& part,
                       const Pose2& shift) const {
  for (const std::size_t k : part) {
    search_->seen()[k].pose = Compose(shift, search_->seen()[k].pose);
  }
}

int PartJoining::LooseOf(const std::vector<std::size_t>& a,
                         const std::vector<std::size_t>& b) const {
  // Parts are numbered in the order in which they began.
  const int number = search_->seen()[std::max(a.front(), b.front())].part;
  return loose_of_[static_cast<std::size_t>(number) - 1];
}

std::size_t PartJoining::NumLateWindows(std::size_t keys,
                                        std::size_t size) const {
  return std::min(static_cast<std::size_t>(tracking_.max_late_windows),
                  1 + 2 * (keys - size) / size);
}

std::vector<std::size_t> PartJoining::WindowsOf(
    const std::vector<TrackKey>& keys, std::size_t size,
    const TrackSearch::SearchArea& rest) const {
  const std::size_t room = keys.size() - size;
  const std::size_t windows = NumLateWindows(keys.size(), size);
  std::vector<std::pair<double, std::size_t>> scored;
  for (std::size_t w = 0; w < windows; ++w) {
    if (search_->Stops()) return {};
    const std::size_t begin = windows > 1 ? w * room / (windows - 1) : 0;
    scored.emplace_back(
        windows > 1 ? search_->Clearness(keys, begin, begin + size, rest) : 1.0,
        begin);
  }
  std::stable_sort(
      scored.begin(), scored.end(),
      [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<std::size_t> begins;
  for (const auto& [score, begin] : scored) {
    if (score >= tracking_.min_tie_score) begins.push_back(begin);
  }
  return begins;
}

LateTie PartJoining::LateTieOf(const std::vector<std::size_t>& rest,
                               const std::vector<std::size_t>& part,
                               const LateVote& vote) const {
  // The match says where the part's key scan is among the rest. The one of the
  // two that begins later hangs on what was seen before it began.
  const std::size_t at_rest = search_->NearestOf(vote.found, rest);
  const std::size_t at_part = part[vote.middle];
  const Pose2 match = Between(search_->seen()[at_rest].pose, vote.found.pose);
  const bool is_later = part.front() > rest.front();
  const std::vector<std::size_t>& later = is_later ? part : rest;
  const std::vector<std::size_t>& earlier = is_later ? rest : part;
  const std::size_t at_later = is_later ? at_part : at_rest;
  const std::size_t at_earlier = is_later ? at_rest : at_part;
  const auto last_before = std::prev(
      std::lower_bound(earlier.begin(), earlier.end(), later.front()));
  const std::size_t since = std::min(*last_before, at_earlier);
  const auto along = [&](const std::vector<std::size_t>& keys, std::size_t from,
                         std::size_t to) {
    std::vector<Pose2> poses;
    for (const std::size_t k : keys) {
      if (std::min(from, to) <= k && k <= std::max(from, to)) {
        poses.push_back(search_->seen()[k].pose);
      }
    }
    if (to < from) std::reverse(poses.begin(), poses.end());
    return DriftAlong(poses, drift_);
  };
  UncertainPose2 tie{match,
                     TieCovariance(vote.found, search_->seen()[at_rest].pose)};
  if (!is_later) tie = Inverse(tie);
  LateTie late;
  late.scan = search_->seen()[later.front()].scan;
  late.since = search_->seen()[since].scan;
  late.since_key = Compose(Compose(along(earlier, since, at_earlier), tie),
                           along(later, at_later, later.front()));
  return late;
}

void PartJoining::AddLateTie(const std::vector<std::size_t>& rest,
                             const std::vector<std::size_t>& part,
                             const LateTie& tie, bool is_rough) {
  ties_.push_back(tie);
  search_->Trace("JOINED scan " + std::to_string(tie.scan) + " since " +
                 std::to_string(tie.since) + (is_rough ? " roughly" : ""));
  const bool is_later = part.front() > rest.front();
  const std::vector<std::size_t>& later = is_later ? part : rest;
  const std::vector<std::size_t>& earlier = is_later ? rest : part;
  LooseTrack& loose = (*loose_)[static_cast<std::size_t>(tie.loose)];
  loose.why = loose.why.substr(0, loose.why.find(';')) +
              "; found again on what was seen later";
  if (is_rough) {
    loose.why += ", roughly";
  } else {
    loose.found = true;
    loose.end = tie.scan;
  }
  const int into = search_->seen()[earlier.front()].part;
  for (const std::size_t k : later) search_->seen()[k].part = into;
}

}  // namespace

std::vector<LateTie> JoinParts(
    const TrackingOptions& tracking, const MatchDrift& drift,
    const std::vector<int>& loose_of, const std::vector<BlindWay>& blind,
    TrackSearch* search, std::vector<LooseTrack>* loose, const CutTies& cut) {
  return PartJoining(tracking, drift, loose_of, blind, search, loose, cut)
      .Run();
}

}  // namespace plumbline
