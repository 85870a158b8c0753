#include <plumbline/core/error.h>
#include <plumbline/factors/angle.h>
#include <plumbline/frontend/scan_matcher.h>
#include <plumbline/frontend/track_placement.h>
#include <plumbline/frontend/track_windows.h>
#include <plumbline/frontend/wall_contradictions.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <utility>

namespace plumbline {
namespace {

// Least score of a place that a search finds, and its share of the best.
constexpr double kLeastScore = 0.4;
constexpr double kPeakShare = 0.7;
// Windows that are searched for before the places found are judged, and how
// many times the windows that have to agree must do so to search no further.
constexpr std::size_t kBatch = 6;
constexpr int kClear = 2;
// Two places of the track are one when they put both windows so near to each
// other, m and rad.
constexpr double kSameDistance = 1.5;
constexpr double kSameTurn = DegToRad(8.0);
// A rival lies farther off than this, m or rad.
constexpr double kRivalDistance = 2.0;
constexpr double kRivalTurn = DegToRad(15.0);
// A window is where the track has it when it lies no farther from there, m. It
// is asked so often again, and agrees as well elsewhere with this share of its
// quality.
constexpr double kInPlace = 0.1;
constexpr int kPasses = 2;
constexpr double kAsClearly = 0.95;
// Of two places the one of whose returns the share that is contradicted is so
// many times that of the other's is hardly a rival of that one.
constexpr double kClearlyMore = 1.5;
// The share of the best place's support from which on another one may be the
// place where the best contradicts the map.
constexpr double kNearlyAsMuch = 0.9;
// Doors of a mirror image that were seen in passing speak one way only: of all
// places that changed so many are openings, and so many walls.
constexpr int kLeastEachWay = 2;

std::string Parts(int number) {
  return std::to_string(number) + (number == 1 ? " part" : " parts");
}

std::string ShortText(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.2f", value);
  return text;
}

// A place of the track, with what all windows say of it.
struct Candidate {
  // Of the track's frame; the window that speaks for it.
  Pose2 pose = Pose2::Zero();
  std::size_t window = 0;
  double score = 0.0;
  // Windows that were searched for and may lie there.
  int votes = 0;
  std::vector<WindowJudgement> judgements;
  int agreeing = 0;
  int contradicting = 0;
  int doubtful = 0;
  // Returns of all windows.
  int compared = 0;
  int contradicted = 0;
  // Once they were asked for.
  std::shared_ptr<const WallContradictions> contradictions;
  double support() const {
    return agreeing - kContradictionWeight * contradicting;
  }
  double contradicted_share() const {
    return static_cast<double>(contradicted) / std::max(1, compared);
  }
};

bool AreOne(const Candidate& a, const Candidate& b,
            const std::vector<TrackWindow>& windows, double distance,
            double turn) {
  if (std::abs(NormalizeAngle(a.pose[2] - b.pose[2])) > turn) return false;
  for (const std::size_t w : {a.window, b.window}) {
    const Eigen::Vector2d middle = windows[w].middle.head<2>();
    if ((PoseTransform(a.pose).Point(middle) -
         PoseTransform(b.pose).Point(middle))
            .norm() > distance) {
      return false;
    }
  }
  return true;
}

void Count(Candidate* candidate) {
  candidate->agreeing = candidate->contradicting = candidate->doubtful = 0;
  candidate->compared = candidate->contradicted = 0;
  for (const WindowJudgement& judgement : candidate->judgements) {
    const WindowVerdict verdict = judgement.verdict;
    candidate->agreeing += verdict == WindowVerdict::kAgrees ? 1 : 0;
    candidate->contradicting += verdict == WindowVerdict::kContradicts ? 1 : 0;
    candidate->doubtful += verdict == WindowVerdict::kDoubtful ? 1 : 0;
    candidate->compared += judgement.compared;
    candidate->contradicted += judgement.contradicted;
  }
}

// Asks all windows, the ones near the one that speaks for it first: a track
// bends, and those that agree carry on to the next.
void JudgeCandidate(const std::vector<KeyView>& map,
                    const std::vector<KeyView>& track,
                    const std::vector<TrackWindow>& windows,
                    const TrackPlacementOptions& options,
                    Candidate* candidate) {
  candidate->judgements.assign(windows.size(), WindowJudgement());
  std::vector<std::pair<double, std::size_t>> order;
  for (std::size_t w = 0; w < windows.size(); ++w) {
    order.emplace_back((windows[w].middle - windows[candidate->window].middle)
                           .head<2>()
                           .norm(),
                       w);
  }
  std::sort(order.begin(), order.end());
  for (const auto& [distance, w] : order) {
    // From the nearest window that agrees.
    Pose2 guess = Compose(candidate->pose, windows[w].middle);
    double nearest = -1.0;
    for (std::size_t other = 0; other < windows.size(); ++other) {
      const WindowJudgement& judgement = candidate->judgements[other];
      if (judgement.verdict != WindowVerdict::kAgrees) continue;
      const double apart =
          (windows[other].middle - windows[w].middle).head<2>().norm();
      if (nearest >= 0.0 && apart >= nearest) continue;
      nearest = apart;
      guess = Compose(judgement.pose,
                      Between(windows[other].middle, windows[w].middle));
    }
    candidate->judgements[w] =
        JudgeWindow(map, track, windows[w], guess, options);
    Count(candidate);
    const WindowVerdict verdict = candidate->judgements[w].verdict;
    if (w == candidate->window && verdict != WindowVerdict::kAgrees) return;
    if (candidate->contradicting >= 3 &&
        candidate->contradicting > candidate->agreeing) {
      return;
    }
  }
}

// Along a bare corridor a window lies wherever the one before it had led. Asks
// those again which lie elsewhere than the track as a whole has them, and takes
// them to be there where they agree there as well.
void AskAgain(const std::vector<KeyView>& map,
              const std::vector<KeyView>& track,
              const std::vector<TrackWindow>& windows,
              const TrackPlacementOptions& options, Candidate* candidate) {
  for (int pass = 0; pass < kPasses; ++pass) {
    bool any = false;
    for (std::size_t w = 0; w < windows.size(); ++w) {
      WindowJudgement& judgement = candidate->judgements[w];
      const Pose2 there = Compose(candidate->pose, windows[w].middle);
      const auto off = [&there](const Pose2& pose) {
        return (pose - there).head<2>().norm();
      };
      if (judgement.verdict == WindowVerdict::kUnknown ||
          off(judgement.pose) <= kInPlace) {
        continue;
      }
      const WindowJudgement again =
          JudgeWindow(map, track, windows[w], there, options);
      if (again.verdict != WindowVerdict::kAgrees ||
          (judgement.verdict == WindowVerdict::kAgrees &&
           (again.quality < kAsClearly * judgement.quality ||
            off(again.pose) >= off(judgement.pose)))) {
        continue;
      }
      judgement = again;
      any = true;
    }
    if (!any) return;
    candidate->pose = FitTrack(windows, candidate->judgements);
  }
}

// Places of a track in a map, found window by window.
class Search {
 public:
  // All must outlive it.
  Search(const std::vector<KeyView>& map, const std::vector<KeyView>& track,
         const std::optional<Pose2>& start,
         const TrackPlacementOptions& options)
      : map_(map),
        track_(track),
        start_(start),
        options_(options),
        windows_(MakeTrackWindows(
            track, static_cast<std::size_t>(options.window_keys))),
        whole_(options.matcher) {
    Eigen::Vector2d low = map.front().pose.head<2>();
    Eigen::Vector2d high = low;
    for (const KeyView& view : map) {
      low = low.cwiseMin(view.pose.head<2>());
      high = high.cwiseMax(view.pose.head<2>());
    }
    SetReference(map, &whole_);
    center_ << 0.5 * (low + high), 0.0;
    reach_ = 0.5 * (high - low).maxCoeff() + 1.0;
  }

  std::size_t num_windows() const { return windows_.size(); }

  // Looks for a window in the whole map.
  void Look(std::size_t w) {
    for (const ScoredPose& peak :
         // Where nothing was seen from nearby no window agrees, and looking
         // there would be too much in a large building.
         whole_.Peaks(windows_[w].sparse, center_, reach_, kPi, kLeastScore,
                      kPeakShare, options_.max_peaks, options_.radius)) {
      Candidate candidate;
      candidate.pose = Compose(peak.pose, Inverse(windows_[w].middle));
      candidate.window = w;
      candidate.score = peak.score;
      if (start_) {
        const Pose2 off = FromStart(candidate);
        if (off.head<2>().norm() > options_.start_distance ||
            std::abs(off[2]) > options_.start_turn) {
          continue;
        }
      }
      found_.push_back(std::move(candidate));
    }
  }

  // Where the track begins, seen from the start that somebody gave.
  Pose2 FromStart(const Candidate& candidate) const {
    return Between(*start_, Compose(candidate.pose, track_.front().pose));
  }

  // Whether somebody said that the track is here and not there.
  bool IsToldFrom(const Candidate& here, const Candidate& there) const {
    return start_ &&
           FromStart(there).head<2>().norm() >
               FromStart(here).head<2>().norm() + options_.start_precision;
  }

  // Judges the places that most windows speak for, `most` in all. False when it
  // was stopped.
  bool JudgeFound(std::size_t most, const std::function<bool()>& stop) {
    for (Candidate& candidate : found_) {
      std::set<std::size_t> voters;
      for (const Candidate& other : found_) {
        if (AreOne(candidate, other, windows_, kSameDistance, kSameTurn)) {
          voters.insert(other.window);
        }
      }
      candidate.votes = static_cast<int>(voters.size());
    }
    std::stable_sort(found_.begin(), found_.end(),
                     [](const Candidate& a, const Candidate& b) {
                       return std::make_pair(a.votes, a.score) >
                              std::make_pair(b.votes, b.score);
                     });
    for (const Candidate& found : found_) {
      if (stop && stop()) return false;
      if (num_places_ >= most) break;
      bool is_new = true;
      bool is_known = false;
      for (const Candidate& other : judged_) {
        if (!AreOne(found, other, windows_, kSameDistance, kSameTurn)) continue;
        is_new = false;
        // A window that speaks for a place may not agree when it is looked at
        // closely, as where people stood, and another one may.
        is_known = is_known || other.agreeing > 0 ||
                   other.window == found.window || !options_.ask_all_voters;
      }
      if (is_known) continue;
      if (is_new) ++num_places_;
      judged_.push_back(found);
      Candidate& candidate = judged_.back();
      JudgeCandidate(map_, track_, windows_, options_, &candidate);
      if (candidate.agreeing == 0) continue;
      candidate.pose = FitTrack(windows_, candidate.judgements);
      if (candidate.agreeing >= options_.min_agreeing) {
        AskAgain(map_, track_, windows_, options_, &candidate);
        Count(&candidate);
      }
    }
    return true;
  }

  // What there is to say by now.
  TrackPlacement Decide() {
    TrackPlacement placement;
    placement.windows = static_cast<int>(windows_.size());
    Candidate* best = FindBest();
    untold_rival_ = 0.0;
    if (best == nullptr) {
      placement.why_not = WhyNothing();
      return placement;
    }
    placement.pose = best->pose;
    placement.agreeing = best->agreeing;
    placement.contradicting = best->contradicting;
    placement.doubtful = best->doubtful;
    placement.compared = best->compared;
    placement.contradicted = best->contradicted;
    placement.clean_rival = CleanRival(*best);
    for (Candidate& rival : judged_) {
      const bool is_told = IsToldFrom(*best, rival);
      if (&rival == best ||
          rival.support() <= (is_told ? placement.rival : untold_rival_) ||
          AreOne(*best, rival, windows_, kRivalDistance, kRivalTurn) ||
          (rival.support() > options_.max_certain_rival * best->support() &&
           IsRather(best, &rival))) {
        continue;
      }
      placement.rival = std::max(placement.rival, rival.support());
      if (!is_told) untold_rival_ = rival.support();
    }
    placement.has_twin = HasTwin(*best);
    placement.misfit = Misfit(*best);
    const bool is_plain = IsPlain(best);
    placement.why_not = WhyNot(best, is_plain, &placement);
    if (placement.why_not.empty() && !is_plain) {
      const std::string uncertain = WhyUncertain(*best, placement);
      (start_ ? placement.doubt : placement.why_not) = uncertain;
      placement.is_candidate = !start_ && !uncertain.empty();
    }
    placement.found = placement.why_not.empty();
    if (placement.found) {
      AddDoubts(*best, placement, &placement.doubt);
    }
    TakeTie(*best, &placement);
    return placement;
  }

  // Support of the place that most windows speak for.
  double MostSupport() const {
    double most = 0.0;
    for (const Candidate& candidate : judged_) {
      most = std::max(most, candidate.support());
    }
    return most;
  }

 private:
  // Why no place is worth a thought.
  std::string WhyNothing() const {
    if (!start_) return "no part of it looks like a part of the map";
    char text[200];
    std::snprintf(text, sizeof text,
                  "within %.3g m and %.3g degrees of where --start_pose says "
                  "that it starts, no part of it looks like a part of the map; "
                  "it was not looked for elsewhere",
                  options_.start_distance, RadToDeg(options_.start_turn));
    return text;
  }

  // The place that most speaks for. Of places that it speaks for nearly as
  // much one where the building is not another is rather its place.
  Candidate* FindBest() {
    Candidate* best = nullptr;
    for (Candidate& candidate : judged_) {
      if (candidate.agreeing > 0 &&
          (best == nullptr || candidate.support() > best->support())) {
        best = &candidate;
      }
    }
    if (best == nullptr) return best;
    Candidate* other = nullptr;
    for (Candidate& candidate : judged_) {
      if (candidate.agreeing > 0 &&
          candidate.support() >= kNearlyAsMuch * best->support() &&
          (other == nullptr || candidate.support() > other->support()) &&
          &candidate != best && IsRather(&candidate, best)) {
        other = &candidate;
      }
    }
    return other != nullptr ? other : best;
  }

  // Whether a place is one by what speaks against it, and another one is none
  // that clearly more speaks against.
  bool IsRather(Candidate* place, Candidate* other) {
    const WallContradictions& of_place = ContradictionsOf(place);
    const WallContradictions& of_other = ContradictionsOf(other);
    const double length_of_place = of_place.length() / place->agreeing;
    const double length_of_other = of_other.length() / other->agreeing;
    return (2 * of_place.number() <= of_other.number() &&
            WhyAnother(place->agreeing, of_place).empty() &&
            !WhyAnother(other->agreeing, of_other).empty()) ||
           (2.0 * length_of_place <= length_of_other &&
            length_of_other > options_.max_contradicting_per_window);
  }

  // Those of a place, which are found once.
  const WallContradictions& ContradictionsOf(Candidate* candidate) {
    if (!candidate->contradictions) {
      candidate->contradictions =
          std::make_shared<WallContradictions>(FindWallContradictions(
              map_, track_, windows_, candidate->judgements, options_));
    }
    return *candidate->contradictions;
  }

  // RMS distance of the windows that agree from where the track has them, m.
  double Misfit(const Candidate& candidate) const {
    double sum = 0.0;
    for (std::size_t w = 0; w < windows_.size(); ++w) {
      const WindowJudgement& judgement = candidate.judgements[w];
      if (judgement.verdict != WindowVerdict::kAgrees) continue;
      sum += (judgement.pose - Compose(candidate.pose, windows_[w].middle))
                 .head<2>()
                 .squaredNorm();
    }
    return std::sqrt(sum / std::max(1, candidate.agreeing));
  }

  // RMS distance of the windows that agree from their middle, m.
  double Spread(const Candidate& candidate) const {
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    double squares = 0.0;
    for (const WindowJudgement& judgement : candidate.judgements) {
      if (judgement.verdict != WindowVerdict::kAgrees) continue;
      sum += judgement.pose.head<2>();
      squares += judgement.pose.head<2>().squaredNorm();
    }
    const double count = std::max(1, candidate.agreeing);
    return std::sqrt(
        std::max(0.0, squares / count - (sum / count).squaredNorm()));
  }

  // Nothing when it is its place.
  std::string WhyNot(Candidate* best, bool is_plain,
                     TrackPlacement* placement) {
    const int least =
        start_ ? options_.min_agreeing_at_start : options_.min_agreeing;
    if (best->agreeing < least) {
      return "only " + Parts(best->agreeing) + " of " +
             std::to_string(windows_.size()) + " found a place in the map";
    }
    if (!is_plain &&
        best->contradicting > options_.max_contradicting *
                                  (best->agreeing + best->contradicting)) {
      return "where " + Parts(best->agreeing) + " of it would fit, " +
             Parts(best->contradicting) + " would contradict";
    }
    if (untold_rival_ > options_.rival_share * best->support()) {
      placement->is_candidate = true;
      return "it would fit in more than one place";
    }
    if (placement->misfit >
        options_.max_misfit + options_.max_misfit_per_metre * Spread(*best)) {
      return "its parts fit, but not together: they lie " +
             ShortText(placement->misfit) + " m (RMS) from where it has them";
    }
    // Whoever says where it begins knows how far along it is, too.
    if (!start_ && InformationShare(*best) < options_.min_information_share) {
      return "it could be moved along the walls that it shares with the map";
    }
    const WallContradictions& contradictions = ContradictionsOf(best);
    placement->walls_through_map =
        static_cast<int>(contradictions.of_track.size());
    placement->walls_through_track =
        static_cast<int>(contradictions.of_map.size());
    placement->contradicting_length = contradictions.length();
    if (contradictions.length() >
        options_.max_contradicting_per_window * best->agreeing) {
      return "where " + Parts(best->agreeing) + " of it would fit, " +
             ShortText(contradictions.length()) +
             " m of wall in all stand where the other has none";
    }
    if (is_plain) return "";
    const int moved = CountMovedDoors(contradictions);
    placement->is_candidate =
        contradictions.longest() <= options_.max_contradicting_stretch &&
        moved >= options_.min_moved_doors &&
        moved < options_.min_moved_doors_at_start;
    const std::string why = WhyAnother(best->agreeing, contradictions);
    placement->needs_start =
        !start_ && !why.empty() && !placement->is_candidate &&
        WhyAnother(best->agreeing, contradictions, true).empty();
    return why + (placement->needs_start
                      ? " (--start_pose says that it is this building)"
                      : "");
  }

  // Whether next to nothing contradicts of what both have seen at a place.
  bool IsClean(const Candidate& place) const {
    return place.contradicted <=
           options_.max_plain_contradicted_share * place.compared;
  }

  // Support of the best other place that hardly more contradicts.
  double CleanRival(const Candidate& best) const {
    const double most = kClearlyMore * best.contradicted_share();
    double support = 0.0;
    for (const Candidate& rival : judged_) {
      if (rival.contradicted_share() <= most &&
          !AreOne(best, rival, windows_, kRivalDistance, kRivalTurn)) {
        support = std::max(support, rival.support());
      }
    }
    return support;
  }

  // Whether there is another place that it may be as well: a rival that is more
  // than a straight corridor, and that nothing speaks against.
  bool HasTwin(const Candidate& best) const {
    return std::any_of(
        judged_.begin(), judged_.end(), [&](const Candidate& rival) {
          return &rival != &best &&
                 rival.support() >
                     options_.max_certain_rival * best.support() &&
                 !AreOne(best, rival, windows_, kRivalDistance, kRivalTurn) &&
                 IsClean(rival) &&
                 InformationShare(rival) >=
                     options_.min_certain_information_share;
        });
  }

  // Whether so much agrees, and so little contradicts, that doors which were
  // opened or shut do not make another building of it.
  bool IsPlain(Candidate* place) {
    if (IsSure(place)) return true;
    const int agreeing = place->agreeing;
    if (agreeing < options_.min_plain_agreeing ||
        place->contradicting > options_.max_plain_contradicting *
                                   (agreeing + place->contradicting) ||
        InformationShare(*place) < options_.min_certain_information_share) {
      return false;
    }
    if (!IsClean(*place) || HasTwin(*place)) return false;
    const WallContradictions& contradictions = ContradictionsOf(place);
    const auto changed = static_cast<double>(contradictions.number());
    return contradictions.longest() <= options_.max_contradicting_stretch &&
           changed * options_.min_plain_agreeing_per_change <= agreeing &&
           CountMovedDoors(contradictions) *
                   options_.min_plain_agreeing_per_moved_door <=
               agreeing &&
           CountMovedDoors(contradictions, options_.min_door_spacing) == 0 &&
           MirroredSupport() <=
               options_.max_plain_mirrored_share * place->support();
  }

  // Whether so much agrees, next to nothing contradicts, and the track fits
  // nowhere else and its mirror image nowhere at all, that more doors may have
  // been opened or shut: those of another floor stand elsewhere.
  bool IsSure(Candidate* place) {
    const int agreeing = place->agreeing;
    const double rival = options_.max_sure_rival * place->support();
    if (agreeing < options_.min_sure_agreeing ||
        place->contradicting > options_.max_sure_contradicting *
                                   (agreeing + place->contradicting) ||
        untold_rival_ > rival ||
        InformationShare(*place) < options_.min_sure_information_share) {
      return false;
    }
    const WallContradictions& contradictions = ContradictionsOf(place);
    const auto changed = static_cast<double>(contradictions.number());
    return contradictions.longest() <=
               options_.max_sure_contradicting_stretch &&
           changed * options_.min_plain_agreeing_per_change <= agreeing &&
           CountMovedDoors(contradictions) == 0 && MirroredSupport() <= rival;
  }

  // What the returns say of the direction that they say least of, as a share of
  // what they say across it.
  static double InformationShare(const Candidate& place) {
    Eigen::Matrix2d information = Eigen::Matrix2d::Zero();
    for (const WindowJudgement& judgement : place.judgements) {
      information += judgement.information;
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(information);
    return solver.eigenvalues()[1] > 0.0
               ? solver.eigenvalues()[0] / solver.eigenvalues()[1]
               : 0.0;
  }

  // Longest piece of wall, m, that one of both may have and the other not.
  // Nobody drives through a wall; but who knows that it is the building knows
  // of a wall that was put up or taken down.
  double MaxStretch(int agreeing, bool has_start) const {
    return has_start && agreeing >= options_.min_plain_agreeing
               ? options_.max_contradicting_stretch_at_start
               : options_.max_contradicting_stretch;
  }

  // Why the contradictions of a place say that it is another building, though
  // so many windows agree; empty when they do not.
  std::string WhyAnother(int agreeing,
                         const WallContradictions& contradictions) const {
    return WhyAnother(agreeing, contradictions, start_.has_value());
  }
  std::string WhyAnother(int agreeing, const WallContradictions& contradictions,
                         bool has_start) const {
    const std::string would = "where " + Parts(agreeing) + " of it would fit, ";
    const double longest = contradictions.longest();
    if (longest > MaxStretch(agreeing, has_start)) {
      return would + "one of both has " + ShortText(longest) +
             " m of wall where the other has none";
    }
    const int moved = CountMovedDoors(contradictions);
    if (moved >= (has_start ? options_.min_moved_doors_at_start
                            : options_.min_moved_doors)) {
      return would + std::to_string(moved) +
             (moved == 1 ? " door stands" : " doors stand") +
             " elsewhere in the same wall, as in another building or in its "
             "mirror image (--start_pose says that it is this building)";
    }
    if (has_start && agreeing >= options_.min_plain_agreeing) return "";
    const auto of_track = static_cast<int>(contradictions.of_track.size());
    const auto of_map = static_cast<int>(contradictions.of_map.size());
    const int exchanged = of_track + of_map;
    const int each_way = std::min(of_track, of_map);
    if (each_way >= 1 && exchanged >= options_.min_exchanged &&
        exchanged >= agreeing) {
      return would + std::to_string(exchanged) +
             " places have a wall in one and an opening in the other";
    }
    if (each_way >= kLeastEachWay && exchanged >= 2 * options_.min_exchanged &&
        exchanged > 2.0 * options_.max_exchanged_share * agreeing) {
      return would + "it has wall at " + std::to_string(of_track) +
             " places where the map has openings, and openings at " +
             std::to_string(of_map) +
             " places where the map has wall, as a mirror image of the "
             "building has";
    }
    return "";
  }

  // Why the place may well be another, or of another building, though nothing
  // says that it is; empty when it is clear.
  std::string WhyUncertain(const Candidate& best,
                           const TrackPlacement& placement) {
    if (InformationShare(best) < options_.min_certain_information_share) {
      return "what it shares with the map is little more than a straight "
             "corridor, and corridors look alike";
    }
    if (best.doubtful + best.contradicting >= best.agreeing) {
      return "as many parts of it lie where the map is known and do not fit";
    }
    if (placement.rival > options_.max_certain_rival * best.support()) {
      return "much of it would fit in another place, too";
    }
    if (placement.rival > 0.0 &&
        best.agreeing < kClear * options_.min_agreeing) {
      return "only " + std::to_string(best.agreeing) + " of " +
             std::to_string(windows_.size()) +
             " parts of it agree with the map, and some would fit in another "
             "place, too";
    }
    const int changed =
        placement.walls_through_map + placement.walls_through_track;
    if (changed * options_.min_agreeing_per_change > best.agreeing) {
      return Changed(placement) + ", and only " + Parts(best.agreeing) +
             " of it agree with the map";
    }
    if (changed > 0 &&
        MirroredSupport() > options_.max_mirrored_share * best.support()) {
      return Changed(placement) +
             ", and its mirror image fits in the map nearly as well";
    }
    return "";
  }

  // Where it has wall and the map has not, and the other way round.
  static std::string Changed(const TrackPlacement& placement) {
    return "it has wall at " + std::to_string(placement.walls_through_map) +
           " and openings at " + std::to_string(placement.walls_through_track) +
           " places where the map has it the other way";
  }

  // What else is to be said of the place that was found.
  void AddDoubts(const Candidate& best, const TrackPlacement& placement,
                 std::string* doubt) {
    const auto add = [doubt](const std::string& reason) {
      *doubt += (doubt->empty() ? "" : "; ") + reason;
    };
    if (!start_ && best.agreeing < kClear * options_.min_agreeing) {
      add("only " + std::to_string(best.agreeing) + " of " +
          std::to_string(windows_.size()) + " parts of it agree with the map");
    }
    // Two corridors and a corner, say, of which there are many.
    if (!start_ && best.agreeing < options_.min_plain_agreeing &&
        MirroredSupport() >
            options_.max_plain_mirrored_share * best.support()) {
      add("its mirror image fits in the map nearly as well, as it does where "
          "buildings look alike");
    }
    if (placement.walls_through_map > 0 || placement.walls_through_track > 0) {
      add(Changed(placement) +
          ": doors that were opened or shut, or another building");
    }
  }

  // How much of the track's mirror image finds a place in the map; looked for
  // once.
  double MirroredSupport();

  // Where the tie is best.
  void TakeTie(const Candidate& best, TrackPlacement* placement) const {
    std::size_t firmest = 0;
    double quality = -1.0;
    for (std::size_t w = 0; w < windows_.size(); ++w) {
      const WindowJudgement& judgement = best.judgements[w];
      if (judgement.verdict != WindowVerdict::kAgrees ||
          judgement.quality <= quality) {
        continue;
      }
      quality = judgement.quality;
      firmest = w;
    }
    const TrackWindow& window = windows_[firmest];
    placement->to = static_cast<int>((window.begin + window.end) / 2);
    double nearest = -1.0;
    for (std::size_t k = 0; k < map_.size(); ++k) {
      const double distance =
          (map_[k].pose - best.judgements[firmest].pose).head<2>().norm();
      if (nearest >= 0.0 && distance >= nearest) continue;
      nearest = distance;
      placement->from = static_cast<int>(k);
    }
  }

  const std::vector<KeyView>& map_;
  const std::vector<KeyView>& track_;
  const std::optional<Pose2>& start_;
  const TrackPlacementOptions& options_;
  std::vector<TrackWindow> windows_;
  ScanMatcher whole_;
  // Of the search: the middle of the map, and how far it goes.
  Pose2 center_ = Pose2::Zero();
  double reach_ = 0.0;
  std::vector<Candidate> found_;
  std::vector<Candidate> judged_;
  // Of these, those that are no other window's.
  std::size_t num_places_ = 0;
  // Support of the rival of the best place that nobody told from it.
  double untold_rival_ = 0.0;
  std::optional<double> mirrored_support_;
};

// A track through the mirror image of the building.
std::vector<KeyView> Mirrored(std::vector<KeyView> track) {
  for (KeyView& view : track) {
    view.pose.tail<2>() *= -1.0;
    view.laser.y() *= -1.0;
    for (ScanPoint& point : view.points) {
      point.position.y() *= -1.0;
      point.normal.y() *= -1.0;
    }
  }
  return track;
}

double Search::MirroredSupport() {
  if (mirrored_support_) return *mirrored_support_;
  const std::vector<KeyView> mirrored = Mirrored(track_);
  const std::optional<Pose2> anywhere;
  Search search(map_, mirrored, anywhere, options_);
  const std::size_t windows = search.num_windows();
  const std::size_t searches = std::min(windows, kBatch);
  for (std::size_t i = 0; i < searches; ++i) {
    search.Look((2 * i + 1) * windows / (2 * searches));
  }
  search.JudgeFound(static_cast<std::size_t>(options_.max_candidates), nullptr);
  mirrored_support_ = search.MostSupport();
  return *mirrored_support_;
}

}  // namespace

TrackPlacement PlaceTrack(const std::vector<KeyView>& map,
                          const std::vector<KeyView>& track,
                          const std::optional<Pose2>& start,
                          const TrackPlacementOptions& options,
                          const std::function<bool()>& stop) {
  TrackPlacement placement;
  if (options.window_keys < 1) {
    throw PLUMBLINE_ERROR(
        "window_keys is " + std::to_string(options.window_keys), "1 or more");
  }
  if (map.empty() || track.empty()) {
    placement.why_not = "there are no scans to compare";
    return placement;
  }
  Search search(map, track, start, options);
  const std::size_t windows = search.num_windows();
  const std::size_t searches =
      std::min(windows, static_cast<std::size_t>(options.max_searches));
  const std::size_t batches = (searches + kBatch - 1) / kBatch;
  // Each batch is spread over the whole track.
  for (std::size_t batch = 0; batch < batches; ++batch) {
    for (std::size_t i = batch; i < searches; i += batches) {
      if (stop && stop()) return TrackPlacement();
      search.Look((2 * i + 1) * windows / (2 * searches));
    }
    const std::size_t most = (batch + 1) * options.max_candidates;
    if (!search.JudgeFound(most, stop)) return TrackPlacement();
    placement = search.Decide();
    if (placement.found &&
        placement.agreeing >= kClear * options.min_agreeing) {
      break;
    }
  }
  return placement;
}

PlaceSupport JudgePlace(const std::vector<KeyView>& map,
                        const std::vector<KeyView>& track, const Pose2& pose,
                        const TrackPlacementOptions& options) {
  PlaceSupport support;
  for (const TrackWindow& window :
       MakeTrackWindows(track, static_cast<std::size_t>(options.window_keys))) {
    const WindowVerdict verdict =
        JudgeWindow(map, track, window, Compose(pose, window.middle), options)
            .verdict;
    support.agreeing += verdict == WindowVerdict::kAgrees ? 1 : 0;
    support.contradicting += verdict == WindowVerdict::kContradicts ? 1 : 0;
  }
  return support;
}

WallContradictions ContradictionsOfPlace(const std::vector<KeyView>& map,
                                         const std::vector<KeyView>& track,
                                         const Pose2& pose,
                                         const TrackPlacementOptions& options) {
  const std::vector<TrackWindow> windows =
      MakeTrackWindows(track, static_cast<std::size_t>(options.window_keys));
  std::vector<WindowJudgement> judgements;
  for (const TrackWindow& window : windows) {
    judgements.push_back(
        JudgeWindow(map, track, window, Compose(pose, window.middle), options));
  }
  return FindWallContradictions(map, track, windows, judgements, options);
}

}  // namespace plumbline
