#include <plumbline/frontend/key_views.h>
#include <plumbline/frontend/track_placement.h>
#include <plumbline/pipeline/guessed_parts.h>
#include <plumbline/pipeline/placement_tie.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <map>
#include <numeric>
#include <optional>
#include <set>
#include <string>
#include <utility>

namespace plumbline {
namespace {

// A part of fewer windows says too little.
constexpr std::size_t kLeastWindows = 3;
// A part is looked for again when it or the rest has grown by this factor, and
// no more than so many are in all, in the largest part and in others.
constexpr double kMoreRest = 1.1;
constexpr int kMostPlacements = 24;
constexpr int kMostPairs = 12;
// Windows that have to agree (twice as many where another place has any), and
// the share that may contradict: places that were found by parts of carried
// robots and were wrong had up to 7, and 0.4.
constexpr int kLeastAgreeing = 6;
constexpr double kMostContradicting = 0.25;
// Of a part that is a guess: windows that have to agree for it to be put there
// all the same, still as a guess; the share of the returns compared that
// contradict, that of the windows that agree at another place where hardly more
// do, and, where fewer agree than to be found, their distances from where the
// part has them (RMS), m, at most. Of 700 pieces of two logs, each looked for
// in another piece of its log, 114 that are not found are put so, two of them
// where they were not; of 24 where six windows agree none.
constexpr int kLeastRough = 2;
constexpr double kMostRoughContradicted = 0.06;
constexpr double kMostRoughRival = 0.5;
constexpr double kMostRoughMisfit = 0.1;
// A part of fewer windows than are looked for is a guess that is put where so
// many keys each agree, if they say at least this share of its place along the
// walls. Of 440 pieces of 16 and 32 key scans of three logs, each looked for in
// all the rest, 232 are put so, all where they were.
constexpr int kShortWindow = 8;
constexpr double kLeastShortInformation = 0.1;
// Of a long part one window is looked for in so many key scans at least, as the
// rest may be seen from a small piece of it.
constexpr int kKeysPerSearch = 48;
// Scans that are missing for so long, s, may be those of another place.
constexpr double kLongGap = 10.0;
// What odometry missed while nothing could be matched, m and rad.
constexpr double kMissed = 0.5;
constexpr double kMissedTurn = DegToRad(10.0);
// A part whose place was found by a few of its scans lies elsewhere when this
// many times as many windows agree there as where it was found.
constexpr int kMoreToMove = 2;
// Windows that are looked for in the whole map of a part that nothing speaks
// against, to see whether it would fit elsewhere, too.
constexpr int kRivalSearches = 8;
// So many windows that contradict, more than agree, refute that.
constexpr int kLeastRefuting = 2;
// Windows that have to agree, less those that contradict by their weight, at a
// place where a part is put, as a guess, in place of one that more speaks
// against than for.
constexpr double kLeastBetter = 2.0;
// How far they may lie from where such a part has them (RMS), m: parts that
// were never compared are bent.
constexpr double kMostBetterMisfit = 0.5;
// It lies where it was found when it is no farther from there, m and rad.
constexpr double kSamePlace = 1.5;
constexpr double kSamePlaceTurn = DegToRad(5.0);
// Longest piece of wall, m, that contradicts.
constexpr double kLongestContradicting = 2.5;
// Length of all these pieces, m, for each window that agrees: at right places
// of carried robots up to 0.26, at wrong ones 0.33 and 0.35.
constexpr double kContradictingPerWindow = 0.3;
// What the returns say of the place in the direction that they say least of, as
// a share of what they say across it: a corridor with few doors is enough, as
// other corridors of the building would be rivals.
constexpr double kLeastInformation = 0.05;
// Poses of parts that were never compared with each other are bent by so many
// times as much as those of whole logs.
constexpr double kMoreMisfit = 3.0;
// More than any number of windows.
constexpr int kNever = 1000000;

// Whether scans are missing for so long before this record that the robot may
// have been carried, though it seemed to go on.
bool IsAfterLongGap(const std::vector<Scan>& scans,
                    const std::vector<KeyScanRecord>& records, std::size_t k) {
  if (k == 0) return false;
  const auto end = static_cast<std::size_t>(records[k].scan);
  auto at = static_cast<std::size_t>(records[k - 1].scan);
  for (; at < end; ++at) {
    if (scans[at + 1].timestamp - scans[at].timestamp > kLongGap) return true;
  }
  return false;
}

// Whether odometry alone had placed scans before this record, and was wrong by
// so much that the match after it may be of another place.
bool IsAfterMissedMotion(const LogSolverResult& result, std::size_t k) {
  if (k == 0) return false;
  const auto end = static_cast<std::size_t>(result.records[k].scan);
  auto at = static_cast<std::size_t>(result.records[k - 1].scan) + 1;
  for (; at <= end; ++at) {
    const RefinedScan& scan = result.refined[at];
    if (scan.missed_since >= 0 && (scan.missed.head<2>().norm() > kMissed ||
                                   std::abs(scan.missed[2]) > kMissedTurn)) {
      return true;
    }
  }
  return false;
}

// Whether a track begins with this record whose place is a guess, or was found
// by a few of its scans.
bool IsUnsure(const std::vector<Scan>& scans, const LogSolverResult& result,
              std::size_t k, const std::set<int>& sure) {
  const int scan = result.records[k].scan;
  const TrackTie tie = result.refined[static_cast<std::size_t>(scan)].tie;
  if (tie == TrackTie::kLoose) return true;
  return (tie == TrackTie::kMatched ||
          IsAfterLongGap(scans, result.records, k) ||
          IsAfterMissedMotion(result, k)) &&
         sure.count(scan) == 0;
}

std::size_t Keys(int number) { return static_cast<std::size_t>(number); }

// Joins the parts of one log.
class PartPlacing {
 public:
  PartPlacing(const std::vector<Scan>& scans,
              const TrackPlacementOptions& options,
              const std::function<bool()>& stop, LogSolverResult* result,
              std::vector<Pose2>* poses, PartTies* ties)
      : scans_(scans),
        options_(options),
        stop_(stop),
        result_(*result),
        poses_(*poses),
        ties_(*ties) {
    std::vector<int> keys;
    for (const KeyScanRecord& record : result_.records) {
      keys.push_back(record.scan);
    }
    views_ = MakeKeyViews(scans, keys, poses_, options_.points);
    NumberParts();
  }

  bool Run() {
    bool grows = true;
    while (grows) {
      std::vector<std::vector<std::size_t>> parts = Parts();
      std::stable_sort(
          parts.begin(), parts.end(),
          [](const auto& a, const auto& b) { return a.size() > b.size(); });
      grows = JoinAny(parts) || JoinAnyRoughly(parts);
    }
    if (any_moved_) Finish();
    return any_moved_;
  }

  // Tells of parts that were found by a few of their scans where all others
  // speak against it, or would fit elsewhere, too.
  void TellOfDoubts() {
    const std::vector<std::vector<std::size_t>> parts = Parts();
    const std::vector<std::size_t>& rest = *std::max_element(
        parts.begin(), parts.end(),
        [](const auto& a, const auto& b) { return a.size() < b.size(); });
    const int claim = ClaimOf(rest);
    for (const std::vector<std::size_t>& part : parts) {
      if (part.empty() || part == rest || part.front() == 0 ||
          ClaimOf(part) != claim || (stop_ && stop_())) {
        continue;
      }
      const PlaceSupport support =
          JudgePlace(ViewsOf(rest), ViewsOf(part), Pose2::Zero(), options_);
      const auto doubt = ties_.doubts.find(record(part.front()).scan);
      if (IsRefuted(support)) {
        TellOfRefuted(part.front(), record(part.back()).scan);
      } else if (IsContested(support)) {
        TellOfSupport(part.front(), support);
      } else if (doubt != ties_.doubts.end() &&
                 support.agreeing >= kLeastAgreeing) {
        TellOfDoubt(part.front(), doubt->second);
      }
    }
    for (const FoundPart& found : ties_.found) {
      if (stop_ && stop_()) return;
      TellOfContradicting(found);
      if (ClaimOf(found.part) != claim) TellOfGuess(found);
    }
    for (std::size_t k = 1; k < result_.records.size(); ++k) {
      const auto doubt = ties_.doubts.find(record(k).scan);
      if (doubt != ties_.doubts.end() &&
          ties_.sure.count(record(k).scan) != 0) {
        TellOfDoubt(k, doubt->second);
      }
    }
  }

  // Tells of parts that lie where they agree with what was seen before, but
  // whose doors stand elsewhere in the same walls.
  void TellOfMovedDoors() {
    for (const std::vector<std::size_t>& part : Parts()) {
      if (part.empty() || part.front() == 0 || (stop_ && stop_())) continue;
      if (refined(part.front()).tie == TrackTie::kLoose) continue;
      std::vector<std::size_t> before(part.front());
      std::iota(before.begin(), before.end(), std::size_t{0});
      const int moved = CountMovedDoors(ContradictionsOfPlace(
          ViewsOf(before), ViewsOf(part), Pose2::Zero(), options_));
      if (moved == 0) continue;
      TellOfDoubt(part.front(),
                  std::to_string(moved) +
                      (moved == 1 ? " door stands" : " doors stand") +
                      " elsewhere in the same wall, as on another floor");
    }
  }

 private:
  const KeyScanRecord& record(std::size_t k) const {
    return result_.records[k];
  }
  // The one that its motion counts from; k > 0.
  std::size_t RecordBefore(std::size_t k) const {
    return record(k).from >= 0 ? static_cast<std::size_t>(record(k).from)
                               : k - 1;
  }
  RefinedScan& refined(std::size_t k) {
    return result_.refined[static_cast<std::size_t>(record(k).scan)];
  }

  // Records that hang together by more than a guess or a few scans.
  void NumberParts() {
    for (std::size_t k = 0; k < result_.records.size(); ++k) {
      const int before = k > 0 ? part_[RecordBefore(k)] : 0;
      const RefinedScan& scan = refined(k);
      const bool is_cut = k == 0 || IsUnsure(scans_, result_, k, ties_.sure);
      if (!is_cut) {
        part_.push_back(before);
        continue;
      }
      const auto part = static_cast<int>(hangs_on_.size());
      const bool is_guess = k > 0 && scan.tie == TrackTie::kLoose;
      part_.push_back(part);
      hangs_on_.push_back(is_guess ? part_[k - 1] : before);
      is_guess_.push_back(is_guess);
      claim_.push_back(
          k == 0 || is_guess ? part : claim_[static_cast<std::size_t>(before)]);
    }
    first_part_ = part_;
    shifts_.assign(hangs_on_.size(), Pose2::Zero());
  }

  // The record that the later one of both begins with.
  static std::size_t FirstOfLater(const std::vector<std::size_t>& rest,
                                  const std::vector<std::size_t>& part) {
    return std::max(rest.front(), part.front());
  }

  std::vector<std::vector<std::size_t>> Parts() const {
    std::vector<std::vector<std::size_t>> parts(shifts_.size());
    for (std::size_t k = 0; k < part_.size(); ++k) {
      parts[static_cast<std::size_t>(part_[k])].push_back(k);
    }
    return parts;
  }

  std::vector<KeyView> ViewsOf(const std::vector<std::size_t>& where) const {
    std::vector<KeyView> views;
    for (const std::size_t k : where) views.push_back(views_[k]);
    return views;
  }

  // Joins two parts, the largest one and another if that can be: two that were
  // found in each other may show together where they lie. `parts`: the largest
  // one first.
  bool JoinAny(const std::vector<std::vector<std::size_t>>& parts) {
    const std::size_t least = kLeastWindows * Keys(options_.window_keys);
    for (std::size_t r = 0; r < parts.size(); ++r) {
      const std::vector<std::size_t>& rest = parts[r];
      for (std::size_t p = r + 1; p < parts.size(); ++p) {
        const std::vector<std::size_t>& part = parts[p];
        if (part.size() < least) break;
        if (stop_ && stop_()) return false;
        int& left = r == 0 ? placements_left_ : pairs_left_;
        if (left == 0) break;
        if (!HaveGrown(rest, part)) continue;
        --left;
        if (Join(rest, part, r == 0)) return true;
      }
      if (r == 0 && JoinAnyBetter(parts)) return true;
    }
    return false;
  }

  // Whether one of both is larger than when they were compared last, if they
  // were: they are now.
  bool HaveGrown(const std::vector<std::size_t>& rest,
                 const std::vector<std::size_t>& part) {
    Tried& tried = tried_[{part_[rest.front()], part_[part.front()]}];
    const auto has_grown = [](std::size_t now, std::size_t before) {
      return static_cast<double>(now) >=
             kMoreRest * static_cast<double>(before);
    };
    if (!has_grown(rest.size(), tried.rest) &&
        !has_grown(part.size(), tried.part)) {
      return false;
    }
    tried = {rest.size(), part.size()};
    return true;
  }

  // Poses were adjusted since both were compared: what still contradicts lies
  // elsewhere than the rest of either has it.
  void TellOfContradicting(const FoundPart& found) {
    const PlaceSupport support = JudgePlace(
        ViewsOf(found.rest), ViewsOf(found.part), Pose2::Zero(), options_);
    if (support.contradicting < kLeastRefuting) return;
    TellOfSupport(FirstOfLater(found.rest, found.part), support);
  }

  void TellOfSupport(std::size_t first, const PlaceSupport& support) {
    TellOfDoubt(first,
                std::to_string(support.agreeing) +
                    " short stretches of it agree with what was seen there, " +
                    std::to_string(support.contradicting) + " contradict it");
  }

  // Both hang on a guess, which is told of one of them alone.
  void TellOfGuess(const FoundPart& found) {
    TellOfDoubt(FirstOfLater(found.rest, found.part),
                "what it was found in lies there by a guess itself");
  }

  // Moves a part to where it lies in the rest, if it is found there. It is not
  // looked for where it was found before and nothing contradicts that.
  // `is_largest`: the rest, of all.
  bool Join(const std::vector<std::size_t>& rest,
            const std::vector<std::size_t>& part, bool is_largest) {
    const std::vector<KeyView> map = ViewsOf(rest);
    const std::vector<KeyView> track = ViewsOf(part);
    const bool has_claim = ClaimOf(rest) == ClaimOf(part);
    PlaceSupport here;
    if (has_claim) {
      here = JudgePlace(map, track, Pose2::Zero(), options_);
      if (here.agreeing >= kLeastAgreeing && here.contradicting == 0 &&
          IsTiedTo(rest, part)) {
        if (is_largest) LookForRivals(rest, part, map, track);
        return Merge(rest, part, Pose2::Zero());
      }
    }
    TrackPlacementOptions options = options_;
    options.max_searches = std::max(
        options.max_searches, static_cast<int>(part.size()) / kKeysPerSearch);
    const TrackPlacement placement =
        PlaceTrack(map, track, std::nullopt, options, stop_);
    if (is_largest) NoteDoubt(rest, part, placement);
    const bool may_be_elsewhere =
        !has_claim || IsRefuted(here) ||
        (IsContested(here) && placement.agreeing >= here.agreeing) ||
        (here.agreeing == 0 && placement.agreeing >= kLeastAgreeing);
    const bool is_better = IsOutweighed(here) && IsBetter(placement);
    if (is_largest && !placement.found &&
        ((may_be_elsewhere && IsRough(placement)) || is_better) &&
        !IsSamePlace(part, placement.pose)) {
      rough_[part_[part.front()]] = {placement.pose, placement.agreeing,
                                     is_better};
    }
    const bool is_found =
        placement.found ||
        (has_claim && IsLikely(placement) && IsSamePlace(part, placement.pose));
    if (!is_found) return false;
    if (has_claim) {
      if (!IsSamePlace(part, placement.pose)) {
        if (!IsRefuted(here) &&
            placement.agreeing < kMoreToMove * here.agreeing) {
          return false;
        }
      } else if (IsTiedTo(rest, part)) {
        return Merge(rest, part, Pose2::Zero());
      }
    }
    const std::size_t first = MoveTo(rest, part, placement);
    ties_.sure.insert(record(first).scan);
    ties_.found.push_back({rest, part});
    TellOfFound(first);
    return Merge(rest, part, placement.pose);
  }

  // Whether most of what a part saw speaks against the place that it was found
  // at by a few scans.
  static bool IsRefuted(const PlaceSupport& here) {
    return here.contradicting >= kLeastRefuting &&
           here.contradicting > here.agreeing;
  }

  // Whether it would not be found there with so much that speaks against it.
  static bool IsContested(const PlaceSupport& here) {
    return here.contradicting >= kLeastRefuting &&
           here.contradicting >
               kMostContradicting * (here.agreeing + here.contradicting);
  }

  // Whether more speaks against that place than for it.
  static bool IsOutweighed(const PlaceSupport& here) {
    return here.contradicting >= kLeastRefuting &&
           kContradictionWeight * here.contradicting > here.agreeing;
  }

  // Whether a part is rather here than where it is outweighed: it would fit
  // nowhere else.
  bool IsBetter(const TrackPlacement& placement) const {
    return placement.agreeing -
                   kContradictionWeight * placement.contradicting >=
               kLeastBetter &&
           placement.rival <= 0.0 && placement.misfit <= kMostBetterMisfit;
  }

  // Whether a place that is not certain is the likeliest by far: where a part
  // was found before, it stays there, and is told with the doubt.
  bool IsLikely(const TrackPlacement& placement) const {
    return placement.is_candidate && placement.agreeing >= kLeastAgreeing &&
           placement.rival <= options_.rival_share * placement.agreeing;
  }

  // Whether a few windows say where a guess may lie, and hardly anything speaks
  // against it.
  bool IsRough(const TrackPlacement& placement) const {
    const bool has_many = placement.agreeing >= kLeastAgreeing;
    return placement.agreeing >= kLeastRough &&
           placement.contradicted <=
               kMostRoughContradicted * placement.compared &&
           placement.clean_rival <= kMostRoughRival * placement.agreeing &&
           placement.misfit <=
               (has_many ? options_.max_misfit : kMostRoughMisfit);
  }

  // Puts one part that is a guess where it may lie, if that is known of any.
  // Those of which many windows agree may be found yet, when others have been
  // put there.
  bool JoinAnyRoughly(const std::vector<std::vector<std::size_t>>& parts) {
    for (const bool do_many : {false, true}) {
      for (std::size_t p = 1; p < parts.size(); ++p) {
        if (parts[p].empty() || (stop_ && stop_())) break;
        const auto rough = rough_.find(part_[parts[p].front()]);
        if (rough != rough_.end() &&
            (rough->second.agreeing >= kLeastAgreeing) == do_many &&
            JoinRoughly(parts[0], parts[p])) {
          return true;
        }
      }
    }
    for (std::size_t p = 1; p < parts.size(); ++p) {
      if (parts[p].empty() || (stop_ && stop_())) break;
      if (JoinShort(parts[0], parts[p])) return true;
    }
    return false;
  }

  // Puts one part, as a guess, where more speaks for it than where it was
  // found: before others are joined with it there.
  bool JoinAnyBetter(const std::vector<std::vector<std::size_t>>& parts) {
    for (std::size_t p = 1; p < parts.size(); ++p) {
      if (parts[p].empty() || (stop_ && stop_())) break;
      const auto rough = rough_.find(part_[parts[p].front()]);
      if (rough != rough_.end() && rough->second.is_better &&
          JoinRoughly(parts[0], parts[p])) {
        return true;
      }
    }
    return false;
  }

  // Moves a guess to where a few of its windows say, if they do; it stays told
  // as a guess.
  bool JoinRoughly(const std::vector<std::size_t>& rest,
                   const std::vector<std::size_t>& part) {
    const auto rough = rough_.find(part_[part.front()]);
    if (rough == rough_.end()) return false;
    const std::vector<KeyView> track = ViewsOf(part);
    const Pose2 start = Compose(rough->second.pose, track.front().pose);
    const bool is_better = rough->second.is_better;
    rough_.erase(rough);
    const TrackPlacement placement =
        PlaceTrack(ViewsOf(rest), track, start, options_, stop_);
    if (!IsRough(placement) && !(is_better && IsBetter(placement))) {
      return false;
    }
    TellOfRough(MoveTo(rest, part, placement), part, placement.agreeing);
    return Merge(rest, part, placement.pose);
  }

  // The same of a part of fewer windows than are looked for otherwise.
  bool JoinShort(const std::vector<std::size_t>& rest,
                 const std::vector<std::size_t>& part) {
    TrackPlacementOptions options = options_;
    if (part.size() >= kLeastWindows * Keys(options.window_keys) ||
        part.size() < kLeastRough * Keys(kShortWindow) ||
        ClaimOf(rest) == ClaimOf(part) || !HaveGrown(rest, part)) {
      return false;
    }
    options.window_keys = kShortWindow;
    options.min_agreeing = kLeastRough;
    options.min_information_share = kLeastShortInformation;
    const TrackPlacement placement =
        PlaceTrack(ViewsOf(rest), ViewsOf(part), std::nullopt, options, stop_);
    if (!placement.found || !IsRough(placement)) return false;
    TellOfRough(MoveTo(rest, part, placement), part, placement.agreeing);
    return Merge(rest, part, placement.pose);
  }

  // Moves a part to where it lies in the rest, and ties the later one of both
  // to the earlier one; returns the record that is tied.
  std::size_t MoveTo(const std::vector<std::size_t>& rest,
                     const std::vector<std::size_t>& part,
                     const TrackPlacement& placement) {
    any_moved_ = true;
    // Says how it was tied, which is known no more afterwards.
    TrackTold(FirstOfLater(rest, part));
    for (const std::size_t k : part) {
      views_[k].pose = Compose(placement.pose, views_[k].pose);
    }
    const bool is_later = part.front() > rest.front();
    const std::vector<std::size_t>& later = is_later ? part : rest;
    const std::vector<std::size_t>& earlier = is_later ? rest : part;
    const auto at_rest = static_cast<std::size_t>(placement.from);
    const auto at_part = static_cast<std::size_t>(placement.to);
    Tie(earlier, is_later ? at_rest : at_part, later,
        is_later ? at_part : at_rest);
    return later.front();
  }

  // Whether a part that was found again would fit in another place, too. `map`
  // and `track` are the views of either.
  void LookForRivals(const std::vector<std::size_t>& rest,
                     const std::vector<std::size_t>& part,
                     const std::vector<KeyView>& map,
                     const std::vector<KeyView>& track) {
    if (refined(FirstOfLater(rest, part)).tie != TrackTie::kMatched) return;
    TrackPlacementOptions options = options_;
    options.max_searches = std::min(options.max_searches, kRivalSearches);
    const TrackPlacement placement =
        PlaceTrack(map, track, std::nullopt, options, stop_);
    // What else may be said of its own place was said for it.
    if (placement.rival > 0.0 || !IsSamePlace(part, placement.pose)) {
      NoteDoubt(rest, part, placement);
    }
  }

  // Keeps in mind why much of a part looks like the rest, but it was not found.
  void NoteDoubt(const std::vector<std::size_t>& rest,
                 const std::vector<std::size_t>& part,
                 const TrackPlacement& placement) {
    const int scan = record(FirstOfLater(rest, part)).scan;
    ties_.doubts.erase(scan);
    if (!placement.found && placement.agreeing >= kLeastAgreeing) {
      ties_.doubts[scan] = placement.why_not;
    }
  }

  // The part becomes one of the rest's, moved by `shift`.
  bool Merge(const std::vector<std::size_t>& rest,
             const std::vector<std::size_t>& part, const Pose2& shift) {
    const int moved = part_[part.front()];
    const int into = part_[rest.front()];
    rough_.erase(moved);
    for (std::size_t p = 0; p < shifts_.size(); ++p) {
      if (OwnerOf(p) != moved) continue;
      shifts_[p] = Compose(shift, shifts_[p]);
    }
    for (int& number : part_) {
      if (number == moved) number = into;
    }
    return true;
  }

  // The first of those parts whose places were found in each other.
  int ClaimOf(const std::vector<std::size_t>& part) const {
    return claim_[static_cast<std::size_t>(first_part_[part.front()])];
  }

  // Whether a part stays where it is when it is moved by this.
  bool IsSamePlace(const std::vector<std::size_t>& part,
                   const Pose2& shift) const {
    const Pose2& middle = views_[part[part.size() / 2]].pose;
    const Pose2 moved = Between(middle, Compose(shift, middle));
    return moved.head<2>().norm() <= kSamePlace &&
           std::abs(moved[2]) <= kSamePlaceTurn;
  }

  // Whether the later one of both was found in the earlier one where they are
  // now, which is sure then.
  bool IsTiedTo(const std::vector<std::size_t>& rest,
                const std::vector<std::size_t>& part) {
    const bool is_later = part.front() > rest.front();
    const std::vector<std::size_t>& later = is_later ? part : rest;
    const std::vector<std::size_t>& earlier = is_later ? rest : part;
    const KeyScanRecord& tied = record(later.front());
    if (tied.is_loose) return false;
    const std::size_t from = RecordBefore(later.front());
    // Not where one of both was moved since.
    if (part_[from] != part_[earlier.front()] ||
        shifts_[static_cast<std::size_t>(first_part_[from])] !=
            shifts_[static_cast<std::size_t>(first_part_[later.front()])]) {
      return false;
    }
    ties_.sure.insert(tied.scan);
    return true;
  }

  // The part that a first part belongs to by now.
  int OwnerOf(std::size_t part) const {
    const auto first = static_cast<std::size_t>(
        std::find(first_part_.begin(), first_part_.end(),
                  static_cast<int>(part)) -
        first_part_.begin());
    return part_[first];
  }

  // The later part hangs on the earlier one; both were compared at these of
  // their records.
  void Tie(const std::vector<std::size_t>& earlier, std::size_t at_earlier,
           const std::vector<std::size_t>& later, std::size_t at_later) {
    const std::size_t first = later.front();
    const std::size_t from =
        *std::prev(std::lower_bound(earlier.begin(), earlier.end(), first));
    const double way = WayBetween(from, earlier[at_earlier], earlier) +
                       WayBetween(first, later[at_later], later);
    const UncertainPose2 tie =
        PlacementTie(Between(views_[from].pose, views_[first].pose), way);
    KeyScanRecord& tied = result_.records[first];
    tied.from = static_cast<int>(from);
    tied.is_loose = false;
    tied.motion = tie;
    RefinedScan& scan = refined(first);
    scan.tie = TrackTie::kMatched;
    scan.since = record(from).scan;
    scan.since_key = tie;
    scan.missed = Pose2::Zero();
    scan.missed_since = -1;
  }

  double WayBetween(std::size_t a, std::size_t b,
                    const std::vector<std::size_t>& part) const {
    double way = 0.0;
    std::optional<std::size_t> last;
    for (const std::size_t k : part) {
      if (k < std::min(a, b) || k > std::max(a, b)) continue;
      if (last) {
        way += (views_[k].pose - views_[*last].pose).head<2>().norm();
      }
      last = k;
    }
    return way;
  }

  // What is told of the track that begins with this record; where it seemed to
  // go on, or was found near by, nothing was told so far.
  LooseTrack& TrackTold(std::size_t first) {
    const int scan = record(first).scan;
    LooseTrack* told = nullptr;
    for (LooseTrack& loose : result_.loose) {
      if (loose.found ? loose.end == scan
                      : loose.begin < scan && scan <= loose.end) {
        told = &loose;
      }
    }
    if (told != nullptr) return *told;
    const auto at = std::find_if(
        result_.loose.begin(), result_.loose.end(),
        [&](const LooseTrack& loose) { return loose.begin >= scan; });
    told = &*result_.loose.insert(at, LooseTrack());
    told->begin = record(first - 1).scan;
    told->end = scan;
    told->found = true;
    told->why = IsAfterLongGap(scans_, result_.records, first)
                    ? "scans are missing; the next one seemed to follow"
                : refined(first).tie == TrackTie::kNone &&
                        IsAfterMissedMotion(result_, first)
                    ? "odometry alone says where the robot went; the next scan "
                      "seemed to follow"
                    : "the next scan does not fit; found again near by";
    return *told;
  }

  void TellOfFound(std::size_t first) {
    LooseTrack& told = TrackTold(first);
    told.found = true;
    told.end = record(first).scan;
    told.why = told.why.substr(0, told.why.find(';')) +
               "; found again by all that it saw afterwards";
  }

  void TellOfRough(std::size_t first, const std::vector<std::size_t>& part,
                   int agreeing) {
    LooseTrack& told = TrackTold(first);
    // All of it is a guess from now on.
    if (told.found && part.front() == first) {
      told.end = record(part.back()).scan;
    }
    told.found = false;
    told.why = told.why.substr(0, told.why.find(';')) +
               "; where it went on is a guess, on " + std::to_string(agreeing) +
               " short stretches of what it saw afterwards";
  }

  // What the track saw up to scan `end` speaks against where it was found.
  void TellOfRefuted(std::size_t first, int end) {
    LooseTrack& told = TrackTold(first);
    told.found = false;
    told.end = end;
    told.why += ", where most of what it saw afterwards contradicts that";
  }

  void TellOfDoubt(std::size_t first, const std::string& doubt) {
    LooseTrack& told = TrackTold(first);
    told.why +=
        (told.is_ambiguous
             ? "; "
             : ", which what it saw afterwards does not make certain: ") +
        doubt;
    told.is_ambiguous = true;
  }

  // What was found nowhere goes along with what it was found in before, or what
  // was found in it, or else with what it is a guess from, or what is a guess
  // from it, and takes along what was joined with it; the first record stays.
  void Finish() {
    const std::size_t count = shifts_.size();
    std::vector<bool> is_placed(count);
    const std::vector<std::vector<std::size_t>> parts = Parts();
    const auto rest =
        static_cast<int>(std::max_element(parts.begin(), parts.end(),
                                          [](const auto& a, const auto& b) {
                                            return a.size() < b.size();
                                          }) -
                         parts.begin());
    std::vector<int> owners;
    for (std::size_t p = 0; p < count; ++p) {
      owners.push_back(OwnerOf(p));
      is_placed[p] = owners[p] == rest;
    }
    const auto along = [&](std::size_t p, std::size_t with) {
      if (is_placed[p] || !is_placed[with]) return false;
      const Pose2 move = Compose(shifts_[with], Inverse(shifts_[p]));
      for (std::size_t other = 0; other < count; ++other) {
        if (owners[other] != owners[p]) continue;
        shifts_[other] = Compose(move, shifts_[other]);
        is_placed[other] = true;
      }
      return true;
    };
    for (bool any = true; any;) {
      any = false;
      for (std::size_t k = 0; k < part_.size(); ++k) {
        if (k == 0 || record(k).is_loose) continue;
        const auto p = static_cast<std::size_t>(first_part_[k]);
        const auto with =
            static_cast<std::size_t>(first_part_[RecordBefore(k)]);
        any = along(p, with) || along(with, p) || any;
      }
    }
    for (bool any = true; any;) {
      any = false;
      for (std::size_t p = 1; p < count; ++p) {
        const auto with = static_cast<std::size_t>(hangs_on_[p]);
        any = along(p, with) || along(with, p) || any;
      }
    }
    const Pose2 back = Inverse(shifts_.front());
    for (std::size_t k = 0; k < poses_.size(); ++k) {
      const Pose2& shift = shifts_[static_cast<std::size_t>(first_part_[k])];
      poses_[k] = Compose(back, Compose(shift, poses_[k]));
    }
  }

  const std::vector<Scan>& scans_;
  const TrackPlacementOptions& options_;
  const std::function<bool()>& stop_;
  LogSolverResult& result_;
  std::vector<Pose2>& poses_;
  PartTies& ties_;
  bool any_moved_ = false;
  // How large two parts were, by their numbers, when one was looked for in the
  // other.
  struct Tried {
    std::size_t rest = 0;
    std::size_t part = 0;
  };
  std::map<std::pair<int, int>, Tried> tried_;
  // Searches in the largest part, and in others.
  int placements_left_ = kMostPlacements;
  int pairs_left_ = kMostPairs;
  // By record; the parts' numbers now and in the beginning.
  std::vector<KeyView> views_;
  std::vector<int> part_;
  std::vector<int> first_part_;
  // By part as they were in the beginning: what it hangs on, whether by a
  // guess, the first of the parts that were found in each other, and by what
  // it was moved.
  std::vector<int> hangs_on_;
  std::vector<bool> is_guess_;
  std::vector<int> claim_;
  std::vector<Pose2> shifts_;
  // Where a few windows put parts that are guesses, by their numbers now.
  struct Rough {
    Pose2 pose = Pose2::Zero();
    int agreeing = 0;
    // More speaks against where the part was found than for it.
    bool is_better = false;
  };
  std::map<int, Rough> rough_;
};

}  // namespace

bool HasUnsureParts(const std::vector<Scan>& scans,
                    const LogSolverResult& result, const std::set<int>& sure) {
  for (std::size_t k = 0; k < result.records.size(); ++k) {
    if (IsUnsure(scans, result, k, sure)) return true;
  }
  return false;
}

TrackPlacementOptions WithinOneBuilding(TrackPlacementOptions options) {
  options.max_contradicting_stretch = kLongestContradicting;
  options.max_contradicting_per_window = kContradictingPerWindow;
  options.ask_all_voters = true;
  options.min_moved_doors = kNever;
  options.min_exchanged = kNever;
  options.min_agreeing = kLeastAgreeing;
  options.max_contradicting = kMostContradicting;
  options.min_agreeing_per_change = 1;
  options.min_certain_information_share = kLeastInformation;
  options.max_misfit *= kMoreMisfit;
  options.max_misfit_per_metre *= kMoreMisfit;
  options.max_mirrored_share = kNever;
  return options;
}

bool PlaceUnsureParts(const std::vector<Scan>& scans,
                      const TrackPlacementOptions& options,
                      const std::function<bool()>& stop,
                      LogSolverResult* result, std::vector<Pose2>* poses,
                      PartTies* ties) {
  return PartPlacing(scans, options, stop, result, poses, ties).Run();
}

void TellOfDoubtfulParts(const std::vector<Scan>& scans,
                         const TrackPlacementOptions& options,
                         const std::function<bool()>& stop,
                         LogSolverResult* result, std::vector<Pose2> poses,
                         PartTies ties) {
  PartPlacing(scans, options, stop, result, &poses, &ties).TellOfDoubts();
  // Also of those that are sure by now.
  PartTies none;
  PartPlacing(scans, options, stop, result, &poses, &none).TellOfMovedDoors();
}

}  // namespace plumbline
