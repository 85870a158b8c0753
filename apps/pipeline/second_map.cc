#include <plumbline/core/parallel_for.h>
#include <plumbline/core/wall.h>
#include <plumbline/factors/angle.h>
#include <plumbline/frontend/agreeing_visits.h>
#include <plumbline/frontend/key_views.h>
#include <plumbline/frontend/mirrors.h>
#include <plumbline/frontend/wall_completion.h>
#include <plumbline/pipeline/bent_map.h>
#include <plumbline/pipeline/guessed_parts.h>
#include <plumbline/pipeline/log_solver.h>
#include <plumbline/pipeline/loop_closures.h>
#include <plumbline/pipeline/second_map.h>

#include <algorithm>
#include <cstdint>
#include <future>
#include <optional>
#include <system_error>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

// A second map with less than this share of the first one's length of walls has
// lost what the scans show, and is no better; unless they lie on its walls: a
// noisy laser had the first one put walls beside its walls, or visits apart.
constexpr double kLeastSecondShare = 1.0 / 3.0;
constexpr double kEnoughExplained = 0.5;

// Parts of a log are looked for so often at most.
constexpr int kMostRounds = 3;

// Of walls that must not straighten a building: what their votes weigh, and the
// least turn at which one is two, rad. Structure would straighten it, too, were
// matches of scans given more room than they need: the least factor of their
// variances.
constexpr double kLooseVotes = 0.03;
constexpr double kSmallKink = DegToRad(0.2);
constexpr double kSmallVarianceFactor = 0.02;

std::vector<Wall> WallsOf(const Transaction& transaction) {
  std::vector<Wall> walls;
  for (const Feature& feature : transaction.added_features()) {
    const std::optional<Wall> wall = WallOf(feature);
    if (wall) walls.push_back(*wall);
  }
  return walls;
}

}  // namespace

SecondMap::SecondMap(const Registry& registry, const LogSolverOptions& options,
                     LogRun* run, SolvedMap* map)
    : registry_(registry), options_(options), run_(*run), map_(*map) {}

SecondMap::~SecondMap() { DropGathered(); }

void SecondMap::GatherAhead() {
  if (ThreadsHere() < 2) return;
  try {
    gathered_ = std::async(std::launch::async, [this] {
      JointAdjustmentOptions alone = options_.adjustment;
      alone.num_threads = 1;
      return GatherPlaces(run_.scans, run_.result.refined, run_.result.records,
                          alone,
                          [this] { return is_gathering_dropped_.load(); });
    });
  } catch (const std::system_error&) {
    // No thread is granted.
  }
}

void SecondMap::DropGathered() {
  if (!gathered_.valid()) return;
  is_gathering_dropped_ = true;
  gathered_.wait();
  gathered_ = {};
}

void SecondMap::AdjustPoses(bool find_parts) {
  KeepFirst();
  AdjustPosesOfRun();
  // What was found makes the poses straighter, and more is found in them.
  PartTies ties;
  for (int round = 0; find_parts && round < kMostRounds; ++round) {
    if (!FindParts(&ties)) break;
    AdjustPosesOfRun();
  }
  for (int round = 0; find_parts && round < kMostRounds; ++round) {
    if (!HasContradictions() || !TryFrom(WhereVisitsAgree(), false)) break;
  }
  if (find_parts && !run_.IsStopped() &&
      HasUnsureParts(run_.scans, run_.result, {})) {
    TellOfDoubtfulParts(
        run_.scans, PartPlacement(), [this] { return run_.IsStopped(); },
        &run_.result, adjustment_->KeyPoses(), std::move(ties));
  }
  if (run_.IsStopped()) ReturnToFirst();
}

TrackPlacementOptions SecondMap::PartPlacement() const {
  TrackPlacementOptions placement;
  placement.points = options_.odometry.points;
  placement.matcher = options_.odometry.matcher;
  placement.ScaleToNoise(run_.result.noise_scale);
  return WithinOneBuilding(placement);
}

std::vector<Pose2> SecondMap::WhereVisitsAgree() const {
  std::vector<int> keys;
  std::vector<bool> follows;
  for (const KeyScanRecord& record : run_.result.records) {
    keys.push_back(record.scan);
    const TrackTie tie =
        run_.result.refined[static_cast<std::size_t>(record.scan)].tie;
    follows.push_back(tie == TrackTie::kNone && FollowsTheOneBefore(record));
  }
  const TrackPlacementOptions options = PartPlacement();
  return PosesOfAgreeingVisits(
      MakeKeyViews(run_.scans, keys, adjustment_->KeyPoses(), options.points),
      follows, options, options_.adjustment.num_threads,
      [this] { return run_.IsStopped(); });
}

bool SecondMap::FindParts(PartTies* ties) {
  if (run_.IsStopped() ||
      !HasUnsureParts(run_.scans, run_.result, ties->sure)) {
    return false;
  }
  std::vector<Pose2> keys = adjustment_->KeyPoses();
  LogSolverResult& result = run_.result;
  const bool is_first = first_records_.empty();
  if (is_first) {
    first_refined_ = result.refined;
    first_records_ = result.records;
    first_loose_ = result.loose;
  }
  if (!PlaceUnsureParts(
          run_.scans, PartPlacement(), [this] { return run_.IsStopped(); },
          &run_.result, &keys, ties)) {
    if (is_first) ForgetParts();
    return false;
  }
  run_.keys = std::move(keys);
  return true;
}

void SecondMap::AdjustPosesOfRun() {
  // What was taken for walls must not make odometry worse.
  const std::vector<Pose2> by_odometry =
      PosesByMotions(run_.result.records, run_.keys);
  const bool is_bent = IsBent(run_.keys, by_odometry);
  AdjustFrom(is_bent ? by_odometry : run_.keys, options_.adjustment);
  TryFrom(is_bent ? run_.keys : by_odometry,
          options_.check_map && HasKink(adjustment_->KeyPoses(), by_odometry));
}

void SecondMap::KeepFirst() {
  StateWriter first_map;
  map_.WriteGraph(&first_map);
  first_map_ = first_map.bytes();
  first_trajectory_ = run_.result.trajectory;
  if (first_length_ == 0.0) first_length_ = LengthOfWalls(map_.graph());
  // RunFirst has kept them, perhaps those of several maps.
  if (run_.result.closures.empty()) {
    run_.result.closures = FindLoopClosures(map_.graph(), run_.result.records,
                                            run_.result.trajectory);
  }
}

void SecondMap::AdjustFrom(const std::vector<Pose2>& start,
                           const JointAdjustmentOptions& options) {
  adjustment_.reset();
  contradicts_.reset();
  map_.Clear();
  std::vector<Place> places;
  if (gathered_.valid()) places = gathered_.get();
  adjustment_ = std::make_unique<JointAdjustment>(
      &map_.graph(), &map_.session(), registry_, run_.scans,
      run_.result.refined, run_.result.records, start, kNoId, options,
      run_.control.stop, std::move(places));
  run_.places = adjustment_->places();
  adjustment_->Adjust();
  if (!run_.IsStopped()) {
    adjustment_->MatchAnew();
    adjustment_->Adjust();
  }
  if (run_.IsStopped()) return;
  adjustment_->EstimateVariances();
  run_.TakeTrajectory(map_.graph(), options_.adjustment.place_stride);
}

bool SecondMap::TryFrom(const std::vector<Pose2>& start, bool has_kink) {
  if (start.empty()) return false;
  const bool has_contradictions = HasContradictions();
  const double open_sigma = has_contradictions ? 0.0 : LargestOpenSigma();
  if (!has_contradictions && open_sigma == 0.0 && !has_kink) return false;
  const MapAgreement agreement = Review().Agreement();
  const double misfit = adjustment_->Misfit();
  const std::int64_t relations = adjustment_->num_relations();
  StateWriter kept;
  map_.WriteGraph(&kept);
  adjustment_->WriteState(&kept);
  std::vector<Pose2> trajectory = run_.result.trajectory;
  AdjustFrom(start, options_.adjustment);
  const MapAgreement now = Review().Agreement();
  const bool fits_better = adjustment_->FitsBetterThan(misfit, relations);
  // Where scans agree everywhere, as in a round corridor, what was measured
  // between them decides, and how far odometry has the same.
  const bool is_better =
      has_contradictions
          ? now.IsBetterThan(agreement) ||
                (fits_better && now.ContradictsFarLessThan(agreement))
          : fits_better && now.contradicting <= agreement.contradicting &&
                Review().LargestOpenSigma() <= open_sigma;
  if (run_.IsStopped() || is_better) return true;
  const std::string bytes = kept.bytes();
  StateReader reader(bytes);
  adjustment_.reset();
  map_.RestoreGraph(&reader);
  ReadAdjustment(&reader);
  run_.places = adjustment_->places();
  run_.result.trajectory = std::move(trajectory);
  contradicts_ = has_contradictions;
  return false;
}

MapReview SecondMap::Review() const {
  return MapReview(run_.scans, run_.result.records, run_.result.trajectory,
                   options_.check, options_.way_check,
                   [this] { return run_.IsStopped(); });
}

bool SecondMap::HasContradictions() {
  if (!options_.check_map || run_.IsStopped()) return false;
  if (!contradicts_) contradicts_ = Review().HasContradictions();
  return *contradicts_;
}

double SecondMap::LargestOpenSigma() {
  if (!options_.check_map || run_.IsStopped()) return 0.0;
  const UncertainLengths lengths = Review().Lengths();
  run_.may_have_open_ways =
      !lengths.ways.empty() || lengths.distance_sigma > 0.0;
  return lengths.LargestSigma();
}

void SecondMap::MakeWalls() {
  // Half of a second map is worth less than the whole of the first.
  if (run_.IsStopped()) return ReturnToFirst();
  AddWalls(options_.completion);
}

void SecondMap::AddWalls(const WallCompletionOptions& completion) {
  LogSolverResult& result = run_.result;
  const auto find = [&](const std::vector<Scan>& scans) {
    return FindGlimpsedWalls(map_.graph(), registry_, scans, result.trajectory,
                             completion, run_.control.stop);
  };
  Transaction walls = find(run_.scans);
  if (options_.find_mirrors && !run_.IsStopped()) {
    result.mirrors =
        FindMirrors(WallsOf(walls), run_.scans, result.trajectory,
                    options_.mirrors, [this] { return run_.IsStopped(); });
  }
  if (!result.mirrors.empty()) {
    walls = find(CutAtMirrors(run_.scans, result.trajectory, result.mirrors,
                              options_.mirrors));
  }
  adjustment_->AddWalls(std::move(walls));
}

void SecondMap::AdjustBoth() {
  adjustment_->Adjust();
  if (!run_.IsStopped()) adjustment_->EstimateVariances();
}

void SecondMap::AdjustWalls() {
  if (run_.IsStopped()) return ReturnToFirst();
  LogSolverResult& result = run_.result;
  const std::vector<Pose2> by_scans = adjustment_->KeyPoses();
  AdjustBoth();
  if (!run_.IsStopped() && AreBentByWalls(adjustment_->KeyPoses(), by_scans)) {
    JointAdjustmentOptions adjustment = options_.adjustment;
    adjustment.votes.independence *= kLooseVotes;
    adjustment.min_variance_factor =
        std::min(adjustment.min_variance_factor, kSmallVarianceFactor);
    WallCompletionOptions completion = options_.completion;
    completion.min_kink = std::min(completion.min_kink, kSmallKink);
    AdjustFrom(by_scans, adjustment);
    if (!run_.IsStopped()) AddWalls(completion);
    if (!run_.IsStopped()) AdjustBoth();
    result.loose_walls = true;
  }
  if (run_.IsStopped()) return ReturnToFirst();
  run_.TakeTrajectory(map_.graph(), options_.adjustment.place_stride);
  result.scan_relations = adjustment_->num_relations();
  result.wall_votes = adjustment_->num_votes();
  vote_excess_ = adjustment_->vote_variance_excess();
  result.second_map_refused =
      LengthOfWalls(map_.graph()) < kLeastSecondShare * first_length_ &&
      !IsBent(first_trajectory_, result.trajectory) &&
      ExplainedShare(map_.graph(), run_.scans, result.trajectory,
                     options_.completion) < kEnoughExplained;
  if (result.second_map_refused) return ReturnToFirst();
  adjustment_.reset();
  first_map_.clear();
  first_trajectory_.clear();
  ForgetParts();
}

void SecondMap::ForgetParts() {
  first_refined_.clear();
  first_records_.clear();
  first_loose_.clear();
}

void SecondMap::ReturnToFirst() {
  LogSolverResult& result = run_.result;
  adjustment_.reset();
  StateReader reader(first_map_);
  map_.RestoreGraph(&reader);
  run_.places.clear();
  result.trajectory = std::move(first_trajectory_);
  first_trajectory_.clear();
  first_map_.clear();
  if (!first_records_.empty()) {
    result.refined = std::move(first_refined_);
    result.records = std::move(first_records_);
    result.loose = std::move(first_loose_);
  }
  ForgetParts();
  // They stand in the map.
  result.closures.clear();
  result.scan_relations = result.wall_votes = 0;
  result.loose_walls = false;
  result.mirrors.clear();
}

void SecondMap::TakeSession() {
  if (adjustment_ != nullptr) adjustment_->SetSession(&map_.session());
}

void SecondMap::WriteAdjustment(StateWriter* state) {
  if (adjustment_ != nullptr) adjustment_->WriteState(state);
}

void SecondMap::ReadAdjustment(StateReader* state) {
  adjustment_ = std::make_unique<JointAdjustment>(
      &map_.graph(), &map_.session(), registry_, run_.scans,
      run_.result.refined, run_.result.records, state, options_.adjustment,
      run_.control.stop);
}

}  // namespace plumbline
