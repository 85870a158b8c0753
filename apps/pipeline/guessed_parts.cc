#include <plumbline/frontend/key_views.h>
#include <plumbline/frontend/track_placement.h>
#include <plumbline/pipeline/guessed_parts.h>
#include <plumbline/pipeline/placement_tie.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <map>
#include <optional>
#include <string>
#include <utility>

namespace plumbline {
namespace {

// A part of fewer windows says too little.
constexpr std::size_t kLeastWindows = 3;
// A part is looked for again when the rest has grown by this factor, and no
// more than so many are in all.
constexpr double kMoreRest = 1.25;
constexpr int kMostPlacements = 24;
// Windows that have to agree (twice as many where another place has any), and
// the share that may contradict: places that were found by parts of carried
// robots and were wrong had up to 7, and 0.4.
constexpr int kLeastAgreeing = 6;
constexpr double kMostContradicting = 0.25;
// Longest piece of wall, m, that contradicts.
constexpr double kLongestContradicting = 2.5;
// What the returns say of the place in the direction that they say least of, as
// a share of what they say across it: a corridor with few doors is enough, as
// other corridors of the building would be rivals.
constexpr double kLeastInformation = 0.05;
// Poses of parts that were never compared with each other are bent by so many
// times as much as those of whole logs.
constexpr double kMoreMisfit = 3.0;
// More than any number of windows.
constexpr int kNever = 1000000;

// Joins the parts of one log.
class PartPlacing {
 public:
  PartPlacing(const std::vector<Scan>& scans,
              const TrackPlacementOptions& options,
              const std::function<bool()>& stop, LogSolverResult* result,
              std::vector<Pose2>* poses)
      : options_(options), stop_(stop), result_(*result), poses_(*poses) {
    std::vector<int> keys;
    for (const KeyScanRecord& record : result_.records) {
      keys.push_back(record.scan);
    }
    views_ = MakeKeyViews(scans, keys, poses_, options_.points);
    NumberParts();
  }

  bool Run() {
    bool any = false;
    bool grows = true;
    int placements = 0;
    // Views of the rest when a part was looked for, by part.
    std::map<int, std::size_t> tried;
    while (grows) {
      grows = false;
      std::vector<std::vector<std::size_t>> parts = Parts();
      std::stable_sort(
          parts.begin(), parts.end(),
          [](const auto& a, const auto& b) { return a.size() > b.size(); });
      for (std::size_t p = 1; p < parts.size() && !grows; ++p) {
        const auto least =
            kLeastWindows * static_cast<std::size_t>(options_.window_keys);
        if (parts[p].size() < least) break;
        if (placements == kMostPlacements || (stop_ && stop_())) break;
        std::size_t& before = tried[part_[parts[p].front()]];
        if (static_cast<double>(parts[0].size()) <
            kMoreRest * static_cast<double>(before)) {
          continue;
        }
        before = parts[0].size();
        ++placements;
        grows = Join(parts[0], parts[p]);
        any = any || grows;
      }
    }
    if (any) Finish();
    return any;
  }

 private:
  const KeyScanRecord& record(std::size_t k) const {
    return result_.records[k];
  }
  RefinedScan& refined(std::size_t k) {
    return result_.refined[static_cast<std::size_t>(record(k).scan)];
  }

  // Records that hang together by more than guesses.
  void NumberParts() {
    int parts = 0;
    for (std::size_t k = 0; k < result_.records.size(); ++k) {
      const bool is_guess = refined(k).tie == TrackTie::kLoose;
      if (k == 0 || is_guess) {
        // What a guess hangs on.
        hangs_on_.push_back(k == 0 ? 0 : part_.back());
        part_.push_back(parts++);
      } else if (record(k).from >= 0) {
        part_.push_back(part_[static_cast<std::size_t>(record(k).from)]);
      } else {
        part_.push_back(part_.back());
      }
    }
    first_part_ = part_;
    shifts_.assign(static_cast<std::size_t>(parts), Pose2::Zero());
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

  // Moves a part to where it lies in the rest, if it is found there.
  bool Join(const std::vector<std::size_t>& rest,
            const std::vector<std::size_t>& part) {
    const TrackPlacement placement =
        PlaceTrack(ViewsOf(rest), ViewsOf(part), std::nullopt, options_, stop_);
    if (!placement.found) return false;
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
    const int moved = part_[part.front()];
    const int into = part_[rest.front()];
    for (std::size_t p = 0; p < shifts_.size(); ++p) {
      if (OwnerOf(p) != moved) continue;
      shifts_[p] = Compose(placement.pose, shifts_[p]);
    }
    for (int& number : part_) {
      if (number == moved) number = into;
    }
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
    TellOf(tied.scan);
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

  // Of the guess that a track began with at this scan.
  void TellOf(int scan) {
    LooseTrack* guess = nullptr;
    for (LooseTrack& loose : result_.loose) {
      if (!loose.found && loose.begin < scan &&
          (guess == nullptr || loose.begin > guess->begin)) {
        guess = &loose;
      }
    }
    if (guess == nullptr) return;
    guess->found = true;
    guess->end = scan;
    guess->why = guess->why.substr(0, guess->why.find(';')) +
                 "; found again by all that it saw afterwards";
  }

  // Guesses go along with what they hang on, and the first record stays.
  void Finish() {
    for (std::size_t p = 1; p < shifts_.size(); ++p) {
      const bool hangs = OwnerOf(p) == static_cast<int>(p) && !IsRest(p);
      if (hangs) shifts_[p] = shifts_[static_cast<std::size_t>(hangs_on_[p])];
    }
    const Pose2 back = Inverse(shifts_.front());
    for (std::size_t k = 0; k < poses_.size(); ++k) {
      const Pose2& shift = shifts_[static_cast<std::size_t>(first_part_[k])];
      poses_[k] = Compose(back, Compose(shift, poses_[k]));
    }
  }

  // Whether others were found in it.
  bool IsRest(std::size_t part) const {
    for (std::size_t p = 0; p < shifts_.size(); ++p) {
      if (p != part && OwnerOf(p) == static_cast<int>(part)) return true;
    }
    return false;
  }

  const TrackPlacementOptions& options_;
  const std::function<bool()>& stop_;
  LogSolverResult& result_;
  std::vector<Pose2>& poses_;
  // By record; the parts' numbers now and in the beginning.
  std::vector<KeyView> views_;
  std::vector<int> part_;
  std::vector<int> first_part_;
  // By part as they were in the beginning: what it hangs on by a guess, and by
  // what it was moved.
  std::vector<int> hangs_on_;
  std::vector<Pose2> shifts_;
};

}  // namespace

bool HasGuessedParts(const LogSolverResult& result) {
  return std::any_of(
      result.records.begin(), result.records.end(),
      [&](const KeyScanRecord& record) {
        return result.refined[static_cast<std::size_t>(record.scan)].tie ==
               TrackTie::kLoose;
      });
}

TrackPlacementOptions WithinOneBuilding(TrackPlacementOptions options) {
  options.max_contradicting_stretch = kLongestContradicting;
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

bool PlaceGuessedParts(const std::vector<Scan>& scans,
                       const TrackPlacementOptions& options,
                       const std::function<bool()>& stop,
                       LogSolverResult* result, std::vector<Pose2>* poses) {
  return PartPlacing(scans, options, stop, result, poses).Run();
}

}  // namespace plumbline
