#include <plumbline/core/error.h>
#include <plumbline/core/parallel_for.h>
#include <plumbline/core/read_ahead.h>
#include <plumbline/core/sight_lines.h>
#include <plumbline/core/stopwatch.h>
#include <plumbline/detectors/default_hierarchy.h>
#include <plumbline/detectors/visibility.h>
#include <plumbline/frontend/looks.h>
#include <plumbline/frontend/missed_motion.h>
#include <plumbline/frontend/missed_steps.h>
#include <plumbline/frontend/relocalization.h>
#include <plumbline/frontend/returns_ahead.h>
#include <plumbline/pipeline/glimpsed_walls.h>
#include <plumbline/pipeline/log_run.h>
#include <plumbline/pipeline/log_solver.h>
#include <plumbline/pipeline/log_solver_state.h>
#include <plumbline/pipeline/map_review.h>
#include <plumbline/pipeline/second_map.h>
#include <plumbline/pipeline/usable_input.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>
#include <string>
#include <utility>

namespace plumbline {
namespace {

constexpr char kSameWallDetector[] = "same_wall";

// An EM step on the way takes in the whole of a small map when it has grown by
// more than this.
constexpr std::size_t kSmallMapGrowth = 10;

// Scans that the odometry refinement is ahead of the map at most.
constexpr std::size_t kScansAhead = 64;

// Rounds of binding walls to a plan, with EM after each.
constexpr int kPlanRounds = 6;

std::string NoteOf(const LateMetre& late, const LateMetreOptions& options) {
  char text[160];
  std::snprintf(text, sizeof(text),
                "odometry's metre was known late: stretches of %.0f m were up "
                "to %.2f m too long or too short, which is taken out",
                options.window, late.largest_change);
  return text;
}

// Before the detector that refutes closures.
void AddSameWall(HierarchySpec* hierarchy) {
  if (hierarchy->Contains(kSameWallDetector)) return;
  hierarchy->Add(0, kSameWallDetector);
  std::vector<std::string>& level = hierarchy->levels[0];
  std::stable_partition(
      level.begin(), level.end(),
      [](const std::string& name) { return name != kVisibilityDetector; });
}

// Detectors that read sight lines get those of these key scans.
template <typename MakePlaces>
void ShowScans(const std::vector<Scan>& scans, const ScanPointsOptions& points,
               const MakePlaces& make_places, const Hierarchy& detectors) {
  if (GiveLooks(nullptr, detectors) == 0) return;
  LookOptions options;
  options.points = points;
  GiveLooks(std::make_shared<const Looks>(
                CollectLooks(scans, make_places(), options)),
            detectors);
}

void AddNotesOn(const OdometryAgreement& odometry,
                std::vector<std::string>* notes) {
  if (odometry.turns_are_opposite) {
    notes->push_back(
        "the map turns left where odometry turns right: the beams come in the "
        "other order (a laser upside down: the map is a mirror image), or the "
        "sign of odometry's turns is wrong");
  }
  char text[200];
  if (odometry.is_course_disputed) {
    std::snprintf(text, sizeof text,
                  "the robot goes %.0f degrees to the %s of where odometry has "
                  "it: the laser is mounted turned by as much against what the "
                  "log says, or the map is wrong",
                  RadToDeg(std::abs(odometry.course)),
                  odometry.course > 0.0 ? "left" : "right");
    notes->push_back(text);
  }
  if (odometry.is_scale_disputed) {
    std::snprintf(text, sizeof text,
                  "a metre of odometry's is %.2f m in the map: its scale is "
                  "wrong, or lengths of the map are",
                  odometry.scale);
    notes->push_back(text);
  }
}

const LogSolverOptions& Usable(const LogSolverOptions& options) {
  RequireUsable(options);
  return options;
}

}  // namespace

double LengthOfWalls(const Graph& graph) {
  double length = 0.0;
  for (const Feature* feature : graph.Features()) {
    if (!feature->type->Is(FeatureRole::kWall) || feature->level != 0) continue;
    const double part = feature->extent_end - feature->extent_begin;
    if (std::isfinite(part)) length += part;
  }
  return length;
}

bool RecoversPoses(const LogSolverOptions& options) {
  return options.refine == Refinement::kMap &&
         options.features == RawFeatures::kSegments &&
         options.odometry.match_scans;
}

PoseRecoveryOptions RecoveryOptions(const LogSolverOptions& options) {
  PoseRecoveryOptions recovery;
  recovery.place_stride = options.adjustment.place_stride;
  recovery.noise = options.odometry.noise;
  recovery.drift = options.odometry.drift;
  return recovery;
}

KeyScan MakeKeyScan(int index, const Scan& scan, const RefinedScan& refined,
                    const std::vector<ScanPoint>& returns, double noise_scale) {
  KeyScan key;
  key.index = index;
  key.motion = refined.since_key;
  key.since = refined.since;
  // Found again by a match far down the track: where it begins, what is near in
  // the graph need not be in sight.
  key.is_loose = refined.tie == TrackTie::kLoose || refined.since >= 0;
  key.start = refined.pose;
  key.returns = returns;
  key.laser = scan.laser_offset.head<2>();
  key.angle_step = scan.angle_step;
  key.noise_scale = noise_scale;
  return key;
}

// What the stages share once all scans are in, and the second map, which some
// of them make.
struct LogSolver::Context : LogRun {
  SecondMap second;
  // False where the frame is that of another log.
  bool has_own_frame = true;

  Context(const std::vector<Scan>& all_scans, const RunControl& run_control,
          LogSolver* solver)
      : LogRun(all_scans, run_control),
        second(solver->registry_, solver->options_, this, &solver->map_) {}
};

// What the refiner made of a scan.
struct LogSolver::Processed {
  RefinedScan refined;
  // Scans whose place is settled now.
  std::vector<SettledScan> settled;
  // None whose place is not.
  bool all_settled = false;
  // As it is known now: the refiner may be scans ahead of who takes this.
  double noise_scale = 1.0;
  double seconds = 0.0;
};

LogSolver::LogSolver(const Registry& registry, const LogSolverOptions& options)
    : registry_(registry),
      profile_(ProfileOf(options.features)),
      options_(WithProfile(profile_, Usable(options))),
      map_(registry_, options_.session, options_.em),
      refiner_(options_.odometry) {
  map_.Renew(StructureDetectors());
  if (RecoversPoses(options_)) {
    options_.builder.association.max_gap = options_.max_gap_of_final_map;
  }
  builder_ = profile_.make_builder(options_, &map_.graph(), registry_);
}

LogSolver::~LogSolver() = default;

HierarchySpec LogSolver::HierarchyOfOptions() const {
  if (!options_.hierarchy.empty()) return options_.hierarchy;
  return DefaultHierarchy({&registry_.GetFeature(profile_.feature_type)},
                          registry_);
}

Hierarchy LogSolver::StructureDetectors() const {
  return options_.structure ? MakeDetectors(HierarchyOfOptions()) : Hierarchy();
}

Hierarchy LogSolver::MakeDetectors(const HierarchySpec& spec) const {
  return MakeHierarchy(spec, registry_, {profile_.feature_type},
                       options_.detector_parameters);
}

void LogSolver::RequireUnfinished() const {
  if (is_finished_) {
    throw PLUMBLINE_ERROR("the log of this solver is solved",
                          "a new solver for each log");
  }
}

void LogSolver::RequireFresh() const {
  RequireUnfinished();
  if (!refined_.empty()) {
    throw PLUMBLINE_ERROR("scans were added before Run",
                          "Finish, or a new solver");
  }
}

Pose2 LogSolver::AddScan(Scan scan) {
  RequireUnfinished();
  // Before anything of it is taken: who catches the Error goes on.
  RequireUsable(scan, scans_.size());
  scans_.push_back(std::move(scan));
  TakeScan(scans_, Process(scans_.back(), nullptr));
  if (builder_->records().empty()) return refined_.back().pose;
  return refined_.back().is_key
             ? builder_->robot()
             : Compose(builder_->robot(), refined_.back().since_key.mean);
}

LogSolver::Processed LogSolver::Process(const Scan& scan,
                                        ReturnsAhead* returns) {
  const Stopwatch watch;
  Processed processed;
  processed.refined =
      returns == nullptr
          ? refiner_.Process(scan)
          : refiner_.Process(
                scan, [&](double noise_scale, std::vector<ScanPoint>* points) {
                  returns->Take(noise_scale, points);
                });
  processed.settled = Settled();
  processed.all_settled = refiner_.IsSettled();
  processed.noise_scale = refiner_.noise_scale();
  processed.seconds = watch.Seconds();
  return processed;
}

std::vector<SettledScan> LogSolver::Settled() {
  std::vector<SettledScan> all;
  SettledScan settled;
  while (refiner_.TakeSettled(&settled)) all.push_back(std::move(settled));
  return all;
}

void LogSolver::TakeSettled(const std::vector<Scan>& scans,
                            const std::vector<SettledScan>& all,
                            double noise_scale, double* em_seconds) {
  for (const SettledScan& settled : all) {
    const auto index = static_cast<std::size_t>(settled.index);
    refined_[index] = settled.refined;
    num_settled_ = index + 1;
    TakeKeyScan(scans, settled, noise_scale, em_seconds);
  }
}

void LogSolver::TakeKeyScan(const std::vector<Scan>& scans,
                            const SettledScan& settled, double noise_scale,
                            double* em_seconds) {
  if (!settled.refined.is_key) return;
  const auto index = static_cast<std::size_t>(settled.index);
  builder_->AddScan(MakeKeyScan(settled.index, scans[index], settled.refined,
                                settled.points, noise_scale));
  if (options_.em_every > 0 && scans_since_em_ >= options_.em_every) {
    scans_since_em_ = 0;
    const ScopedTimer timer(em_seconds);
    RunEmNearRobot();
  }
}

void LogSolver::TakeAnew(const std::vector<Scan>& scans, double* em_seconds) {
  for (const LateTie& late : refiner_.late_ties()) {
    RefinedScan& refined = refined_[static_cast<std::size_t>(late.scan)];
    refined.tie = TrackTie::kMatched;
    refined.since = late.since;
    refined.since_key = late.since_key;
  }
  builder_.reset();
  map_.StartOver();
  builder_ = profile_.make_builder(options_, &map_.graph(), registry_);
  map_.Renew(StructureDetectors());
  scans_since_em_ = 0;
  features_at_last_global_ = 0;
  const double noise_scale = refiner_.noise_scale();
  ScanPointsOptions points = options_.odometry.points;
  points.ScaleToNoise(noise_scale);
  SettledScan settled;
  for (std::size_t i = 0; i < refined_.size(); ++i) {
    ++scans_since_em_;
    settled.index = static_cast<int>(i);
    settled.refined = refined_[i];
    if (settled.refined.is_key) {
      ExtractScanPoints(scans[i], points, &settled.points);
    }
    TakeKeyScan(scans, settled, noise_scale, em_seconds);
  }
}

void LogSolver::TakeScan(const std::vector<Scan>& scans,
                         const Processed& processed) {
  const Stopwatch watch;
  double em_seconds = 0.0;
  refined_.push_back(processed.refined);
  ++scans_since_em_;
  TakeSettled(scans, processed.settled, processed.noise_scale, &em_seconds);
  if (num_settled_ < refined_.size()) {
    // The robot is lost: until it is found a guess from the last key scan.
    RefinedScan& guess = refined_.back();
    guess.is_key = false;
    guess.since_key.mean =
        Between(refined_[builder_->records().back().scan].pose, guess.pose);
  }
  if (EndsStage(stage_begin_, refined_.size(), processed) &&
      num_settled_ == refined_.size()) {
    stage_begin_ = refined_.size();
    map_.Renew(StructureDetectors());
  }
  const double seconds = watch.Seconds() + processed.seconds;
  scan_seconds_.push_back(static_cast<float>(seconds));
  frontend_seconds_ += seconds - em_seconds;
}

bool LogSolver::EndsStage(std::size_t begin, std::size_t end,
                          const Processed& last) const {
  return options_.scans_per_stage > 0 &&
         end >= begin + static_cast<std::size_t>(options_.scans_per_stage) &&
         last.all_settled;
}

bool LogSolver::TakeStage(const std::vector<Scan>& scans,
                          const RunControl& control) {
  // The refiner does not look at the map. It goes as far as the stage: there
  // its state is written.
  std::size_t next = refined_.size();
  bool is_end = false;
  ReturnsAhead returns(scans, next, options_.odometry.points, kScansAhead);
  ReadAhead<Processed> ahead(
      kScansAhead, [&, stage_begin = stage_begin_](Processed* processed) {
        if (is_end || next == scans.size()) return false;
        *processed = Process(scans[next++], &returns);
        is_end = EndsStage(stage_begin, next, *processed);
        return true;
      });
  bool is_stopped = false;
  const auto ask_stop = [&] {
    if (is_stopped || !control.stop || !control.stop()) return;
    is_stopped = true;
    ahead.Stop();
  };
  ask_stop();
  while (true) {
    while (!ahead.HasNext() && returns.MakeNext()) {
    }
    Processed processed;
    if (!ahead.Next(&processed)) break;
    TakeScan(scans, processed);
    if (control.progress) control.progress(refined_.size(), scans.size());
    if (control.look) {
      control.look(
          {map_.graph(), map_.trace(), [this] { return Trajectory(); }});
    }
    // Also what was begun when it was stopped: the refiner has gone that far.
    ask_stop();
  }
  return !is_stopped;
}

void LogSolver::TakeScans(const std::vector<Scan>& scans,
                          const RunControl& control) {
  refined_.reserve(scans.size());
  scan_seconds_.reserve(scans.size());
  while (refined_.size() < scans.size()) {
    const std::size_t before = refined_.size();
    const bool goes_on = TakeStage(scans, control);
    if (refined_.size() > before && stage_begin_ == refined_.size() &&
        control.checkpoint) {
      control.checkpoint([&] {
        StateWriter writer;
        Stage stage = Stage::kTakeScans;
        Context context(scans, control, this);
        ExchangeState(writer, &stage, &context);
        ExchangeScansState(writer);
        builder_->WriteState(&writer);
        refiner_.WriteState(&writer);
        return writer.bytes();
      });
    }
    if (!goes_on) break;
  }
}

void LogSolver::RunEmNearRobot() {
  builder_->WriteRobot();
  const std::size_t features = map_.graph().num_features();
  if (features < static_cast<std::size_t>(options_.small_map) &&
      features > features_at_last_global_ + kSmallMapGrowth) {
    features_at_last_global_ = features;
    map_.em().Iterate();
  } else {
    const std::vector<FeatureId> scope =
        builder_->Neighborhood(options_.em_depth);
    map_.em().Iterate(&scope);
  }
  builder_->ReadRobot();
}

std::vector<Pose2> LogSolver::KeyPoses(
    const std::vector<KeyScanRecord>& records) const {
  if (options_.refine != Refinement::kNone) {
    return RelocalizeKeyScans(map_.graph(), records, options_.relocalization);
  }
  std::vector<Pose2> poses;
  for (const KeyScanRecord& record : records) poses.push_back(record.pose);
  return poses;
}

std::vector<Pose2> LogSolver::Trajectory() const {
  RequireUnfinished();
  return InterpolateScans(refined_, builder_->records(),
                          KeyPoses(builder_->records()));
}

LogSolverResult LogSolver::Run(const Log& log, const RunControl& control) {
  RequireFresh();
  RequireUsable(log.scans);
  TakeScans(log.scans, control);
  return FinishWith(log.scans, Stage::kEnd, control);
}

LogSolverResult LogSolver::RunFirst(const Log& log, const RunControl& control) {
  RequireFresh();
  RequireUsable(log.scans);
  TakeScans(log.scans, control);
  LogSolverResult result = FinishWith(log.scans, Stage::kAdjustPoses, control);
  result.closures =
      FindLoopClosures(map_.graph(), result.records, result.trajectory);
  return result;
}

LogSolverResult LogSolver::GoOn(const std::vector<Scan>& scans,
                                LogSolverResult first, double wall_length,
                                const RunControl& control) {
  if (first.refined.size() != scans.size() ||
      first.trajectory.size() != scans.size()) {
    throw PLUMBLINE_ERROR(
        "a first map of " + std::to_string(first.refined.size()) + " scans",
        std::to_string(scans.size()));
  }
  RequireUsable(scans);
  // A solver that made the first map allows for the noise already.
  if (!is_finished_) ScaleToNoise(first.noise_scale);
  is_finished_ = true;
  builder_.reset();
  Context context(scans, control, this);
  context.has_own_frame = false;
  context.result = std::move(first);
  context.second.SetFirstLength(wall_length);
  for (const KeyScanRecord& record : context.result.records) {
    context.keys.push_back(
        context.result.trajectory[static_cast<std::size_t>(record.scan)]);
  }
  return FinishFrom(Stage::kAdjustPoses, Stage::kEnd, &context);
}

LogSolverResult LogSolver::Finish(const RunControl& control) {
  RequireUnfinished();
  return FinishWith(scans_, Stage::kEnd, control);
}

LogSolverResult LogSolver::Resume(const Log& log, const std::string& state,
                                  const RunControl& control) {
  RequireUnfinished();
  if (!refined_.empty()) {
    throw PLUMBLINE_ERROR("scans were added before Resume", "a new solver");
  }
  RequireUsable(log.scans);
  Context context(log.scans, control, this);
  Stage stage = Stage::kTakeScans;
  StateReader reader(state);
  ExchangeState(reader, &stage, &context);
  if (stage == Stage::kTakeScans) {
    ExchangeScansState(reader);
    if (refined_.size() > log.scans.size()) {
      throw PLUMBLINE_ERROR(
          "the state is of " + std::to_string(refined_.size()) + " scans",
          std::to_string(log.scans.size()) + " at most");
    }
    builder_->ReadState(&reader);
    refiner_.ReadState(&reader);
    map_.Renew(StructureDetectors());
    if (control.progress) control.progress(refined_.size(), log.scans.size());
    TakeScans(log.scans, control);
    return FinishWith(log.scans, Stage::kEnd, control);
  }
  is_finished_ = true;
  builder_.reset();
  ScaleToNoise(context.result.noise_scale);
  if (context.result.refined.size() != log.scans.size()) {
    throw PLUMBLINE_ERROR("the state is of a log with " +
                              std::to_string(context.result.refined.size()) +
                              " scans",
                          std::to_string(log.scans.size()));
  }
  map_.Renew();
  if (stage == Stage::kMakeWalls || stage == Stage::kAdjustWalls) {
    context.second.ReadAdjustment(&reader);
  }
  if (control.progress) control.progress(log.scans.size(), log.scans.size());
  return FinishFrom(stage, Stage::kEnd, &context);
}

void LogSolver::ScaleToNoise(double scale) {
  options_.completion.ScaleToNoise(scale);
  options_.adjustment.ScaleToNoise(scale);
  options_.check.ScaleToNoise(scale);
  options_.way_check.ScaleToNoise(scale);
  options_.mirrors.ScaleToNoise(scale);
}

std::vector<LooseTrack> LogSolver::CorrectMissedSteps(Context* context) {
  if (!options_.odometry.match_scans) return {};
  MissedStepOptions options;
  options.points = options_.odometry.points;
  options.points.ScaleToNoise(refiner_.noise_scale());
  options.num_threads = options_.check.num_threads;
  std::vector<MotionCorrection> corrections;
  std::vector<LooseTrack> told;
  for (const MissedStep& step :
       FindMissedSteps(context->scans, refined_, options,
                       [context] { return context->IsStopped(); })) {
    if (step.is_sure) corrections.push_back(step.correction);
    LooseTrack track;
    track.begin = step.begin;
    track.end = step.end;
    track.found = true;
    char why[160];
    std::snprintf(why, sizeof why,
                  step.is_sure
                      ? "odometry missed %.1f m of the way here, and nothing "
                        "near showed it: what was seen from afar did"
                      : "odometry missed %.1f m of the way here, or the one "
                        "thing in sight was moved by as much",
                  std::abs(step.length));
    track.why = why;
    told.push_back(std::move(track));
  }
  if (!corrections.empty()) CorrectMotions(corrections, &refined_);
  return told;
}

LogSolverResult LogSolver::FinishWith(const std::vector<Scan>& scans, Stage end,
                                      const RunControl& control) {
  is_finished_ = true;
  Context context(scans, control, this);
  LogSolverResult& result = context.result;
  result.interrupted = refined_.size() < scans.size();
  std::vector<LooseTrack> missed;
  std::vector<GuessedTurn> guessed_turns;
  {
    const Stopwatch watch;
    double em_seconds = 0.0;
    refiner_.Finish([&context] { return context.IsStopped(); });
    TakeSettled(scans, Settled(), refiner_.noise_scale(), &em_seconds);
    if (!result.interrupted) {
      const LateMetre late =
          FindLateMetre(refiner_.metre_uses(), options_.late_metre);
      if (!late.corrections.empty()) {
        result.notes.push_back(NoteOf(late, options_.late_metre));
        CorrectMotions(late.corrections, &refined_);
      }
      missed = CorrectMissedSteps(&context);
      if (options_.structure) guessed_turns = refiner_.guessed_turns();
      for (const GuessedTurn& guessed : guessed_turns) {
        Pose2& motion =
            refined_[static_cast<std::size_t>(guessed.scan)].since_key.mean;
        motion = WithTurn(motion, guessed.turn);
      }
      if (!refiner_.late_ties().empty() || !guessed_turns.empty() ||
          !late.corrections.empty() || !missed.empty()) {
        TakeAnew(scans, &em_seconds);
      }
    }
    SpreadMissedMotion(&refined_);
    frontend_seconds_ += watch.Seconds() - em_seconds;
  }
  builder_->WriteRobot();
  result.frontend_seconds = frontend_seconds_;
  result.scan_seconds = std::move(scan_seconds_);
  result.key_scans = static_cast<std::int64_t>(builder_->records().size());
  result.wide_searches = refiner_.wide_searches();
  result.refused_matches = refiner_.refusals();
  result.lost_tracks = refiner_.losses();
  result.range_sigma = refiner_.range_sigma();
  result.odometry_scale = refiner_.odometry_scale();
  result.odometry_course = refiner_.odometry_course();
  result.noise_scale = refiner_.noise_scale();
  ScaleToNoise(result.noise_scale);
  result.loose = refiner_.loose();
  for (const GuessedTurn& guessed : guessed_turns) {
    result.loose[static_cast<std::size_t>(guessed.loose)].why +=
        ", turned into the directions of the walls before it";
  }
  result.loose.insert(result.loose.end(), missed.begin(), missed.end());
  result.feature_matches = builder_->num_matches();
  result.features_created = builder_->num_created();
  result.records = builder_->records();
  result.refined = std::move(refined_);
  builder_.reset();
  if (end == Stage::kEnd && options_.refine == Refinement::kFull) {
    context.second.GatherAhead();
  }
  return FinishFrom(Stage::kFindStructure, end, &context);
}

LogSolverResult LogSolver::FinishFrom(Stage stage, Stage end,
                                      Context* context) {
  if (stage == Stage::kFindStructure) {
    FindStructure(context);
    BeginStage(stage = Stage::kCloseLoops, context);
  }
  if (stage == Stage::kCloseLoops) {
    CloseLoops(context);
    if (RecoversPoses(options_)) BringPosesBack(context);
    FindScansAgain(context);
    CompleteWalls(context);
    BeginAtOdometry(context);
    BeginStage(stage = Stage::kAdjustPoses, context);
  }
  if (stage == Stage::kAdjustPoses && stage != end) {
    AdjustPoses(context);
    BeginStage(stage = context->second.is_begun() ? Stage::kMakeWalls
                                                  : Stage::kFindStructureAgain,
               context);
  }
  if (stage == Stage::kMakeWalls) {
    MakeWalls(context);
    BeginStage(stage = Stage::kAdjustWalls, context);
  }
  if (stage == Stage::kAdjustWalls) {
    AdjustWalls(context);
    BeginStage(stage = Stage::kFindStructureAgain, context);
  }
  if (stage == Stage::kFindStructureAgain) {
    FindStructureAgain(context);
    CheckMap(context);
    BeginStage(stage = Stage::kEnd, context);
  }
  const EmReport totals = map_.totals();
  context->result.detect_seconds = totals.detect_seconds;
  context->result.solve_seconds = totals.solve_seconds;
  context->result.breaks = map_.breaks();
  context->second.DropGathered();
  scans_ = {};
  return std::move(context->result);
}

void LogSolver::BeginStage(Stage stage, Context* context) {
  if (context->control.look) {
    context->control.look({map_.graph(), map_.trace(), [&] {
                             const LogSolverResult& result = context->result;
                             return result.trajectory.empty()
                                        ? InterpolateScans(
                                              result.refined, result.records,
                                              KeyPoses(result.records))
                                        : result.trajectory;
                           }});
  }
  // What was cut short is for no other run to go on with.
  if (context->IsStopped()) return;
  map_.Renew();
  context->second.TakeSession();
  if (!context->control.checkpoint) return;
  context->control.checkpoint([&] {
    StateWriter writer;
    ExchangeState(writer, &stage, context);
    context->second.WriteAdjustment(&writer);
    return writer.bytes();
  });
}

template <typename Archive>
void LogSolver::ExchangeState(Archive& archive, Stage* stage,
                              Context* context) {
  ExchangeAll(archive, *stage, context->result, context->keys, context->places);
  context->second.ExchangeFirst(archive);
  Exchange(archive, context->may_have_open_ways);
  map_.ExchangeState(archive);
}

template <typename Archive>
void LogSolver::ExchangeScansState(Archive& archive) {
  ExchangeAll(archive, refined_, num_settled_, stage_begin_, scan_seconds_,
              frontend_seconds_, scans_since_em_, features_at_last_global_);
}

void LogSolver::RunEm(Context* context) {
  const EmReport report = map_.em().Run(context->control.stop);
  context->result.em.iterations += report.iterations;
  context->result.em.termination = report.termination;
}

void LogSolver::FindStructure(Context* context) {
  context->Begin("structure of the whole map");
  context->result.initial_cost = map_.session().Cost();
  map_.Trace();
  RunEm(context);
}

void LogSolver::CloseLoops(Context* context) {
  if (!options_.structure || !options_.global_association ||
      context->IsStopped()) {
    return;
  }
  context->Begin("closing of loops");
  BeginClosing(context);
  RunEm(context);
}

// The relations that stood for the poses have served to find structure. What
// they claim of their errors is not sound: structure is weighed anew by what
// was measured.
void LogSolver::BringPosesBack(Context* context) {
  if (context->IsStopped()) return;
  context->Begin("recovery of poses");
  {
    const ScopedTimer timer(&context->result.relocalization_seconds);
    FeatureId robot = kNoId;
    for (const Feature* feature : std::as_const(map_.graph()).Features()) {
      if (feature->type->Is(FeatureRole::kPose)) robot = feature->id;
    }
    context->places =
        RecoverPoses(context->result.records, KeyPoses(context->result.records),
                     robot, RecoveryOptions(options_), registry_, &map_.graph())
            .places;
  }
  map_.Renew();
  context->result.initial_cost = map_.session().Cost();
  map_.Trace();
  RunEm(context);
}

void LogSolver::FindScansAgain(Context* context) {
  LogSolverResult& result = context->result;
  result.final_cost = map_.session().Cost();
  context->IsStopped();
  const ScopedTimer timer(&result.relocalization_seconds);
  if (!context->places.empty()) {
    context->TakeTrajectory(map_.graph(), options_.adjustment.place_stride);
    return;
  }
  context->keys = KeyPoses(result.records);
  result.trajectory =
      InterpolateScans(result.refined, result.records, context->keys);
}

void LogSolver::CompleteWalls(Context* context) {
  if (!options_.complete_walls || options_.refine != Refinement::kMap ||
      context->IsStopped()) {
    return;
  }
  context->Begin("walls seen by glimpses");
  LogSolverResult& result = context->result;
  Transaction walls;
  {
    const ScopedTimer timer(&result.completion_seconds);
    walls = FindGlimpsedWalls(map_.graph(), registry_, context->scans,
                              result.trajectory, options_.completion,
                              context->control.stop);
  }
  if (!context->places.empty()) {
    walls = BindGlimpsedWalls(walls, map_.graph(), registry_, context->places,
                              context->scans, result.records, result.trajectory,
                              options_.adjustment.place_stride,
                              options_.completion);
  }
  result.glimpsed_walls =
      static_cast<std::int64_t>(walls.added_features().size());
  if (walls.empty()) return;
  map_.graph().Apply(std::move(walls));
  RunEm(context);
  FindScansAgain(context);
}

// The frame is that of the first pose, where odometry has it. While the map
// grew a wall that the first scan saw held it, whose direction that scan alone
// tells to a few tenths of a degree: the whole map would be turned by as much.
void LogSolver::BeginAtOdometry(Context* context) {
  LogSolverResult& result = context->result;
  if (!context->has_own_frame || options_.refine == Refinement::kNone ||
      result.records.empty() || result.trajectory.empty()) {
    return;
  }
  const auto first = static_cast<std::size_t>(result.records.front().scan);
  const Pose2 by =
      Compose(result.refined[first].pose, Inverse(result.trajectory[first]));
  if (!map_.Move(by)) return;
  for (Pose2& pose : result.trajectory) pose = Compose(by, pose);
  for (Pose2& pose : context->keys) pose = Compose(by, pose);
}

void LogSolver::AdjustPoses(Context* context) {
  if (options_.refine != Refinement::kFull || context->IsStopped()) return;
  const ScopedTimer timer(&context->result.adjustment_seconds);
  context->Begin("adjustment of poses");
  context->second.AdjustPoses(context->has_own_frame);
}

void LogSolver::MakeWalls(Context* context) {
  const ScopedTimer timer(&context->result.adjustment_seconds);
  if (!context->IsStopped()) context->Begin("walls from adjusted poses");
  context->second.MakeWalls();
}

void LogSolver::AdjustWalls(Context* context) {
  if (!context->second.is_begun()) return;
  LogSolverResult& result = context->result;
  const ScopedTimer timer(&result.adjustment_seconds);
  if (!context->IsStopped()) {
    context->Begin("joint adjustment of poses and walls");
  }
  context->second.AdjustWalls();
  if (!result.second_map_refused ||
      options_.features != RawFeatures::kSegments) {
    return;
  }
  BringPosesBack(context);
  FindScansAgain(context);
  BeginAtOdometry(context);
}

void LogSolver::FindStructureAgain(Context* context) {
  LogSolverResult& result = context->result;
  if (options_.refine != Refinement::kFull || context->places.empty() ||
      result.second_map_refused) {
    return;
  }
  context->Begin("structure of the map from adjusted poses");
  const ScopedTimer timer(&result.adjustment_seconds);
  HierarchySpec hierarchy = HierarchyOfOptions();
  if (options_.global_association) AddSameWall(&hierarchy);
  EmOptions options = options_.em;
  options.break_share = options_.closing_break_share;
  Hierarchy detectors =
      options_.structure ? MakeDetectors(hierarchy) : Hierarchy();
  ShowScans(
      context->scans, options_.adjustment.points,
      [&] {
        return LooksFromPlaces(result.records, context->places,
                               options_.adjustment.place_stride);
      },
      detectors);
  map_.ReplaceEm(std::move(detectors), options);
  KnownStructureBinder known(options_.known, registry_, context->places.front(),
                             &map_.graph());
  if (options_.structure) known.AddStatements();
  RunEm(context);
  if (options_.structure && !context->IsStopped() &&
      known.AddStatementsAgain() > 0) {
    RunEm(context);
  }
  if (options_.structure) TieToPlan(&known, context);
  context->IsStopped();
  result.final_cost = map_.session().Cost();
  context->TakeTrajectory(map_.graph(), options_.adjustment.place_stride);
  ReportVoteVariances(context->second.vote_excess(), registry_, &map_.graph());
}

// Walls that lie near the plan pull others near.
void LogSolver::TieToPlan(KnownStructureBinder* known, Context* context) {
  for (int round = 0; round < kPlanRounds && !context->IsStopped(); ++round) {
    if (known->TieToPlan(context->control.stop) == 0) break;
    RunEm(context);
  }
  for (std::string& note : known->Notes(!context->IsStopped())) {
    context->result.notes.push_back(std::move(note));
  }
}

void LogSolver::CheckMap(Context* context) const {
  LogSolverResult& result = context->result;
  if (!options_.check_map || options_.refine == Refinement::kNone ||
      context->IsStopped()) {
    return;
  }
  context->Begin("check of the map");
  const ScopedTimer timer(&result.relocalization_seconds);
  // The second map moves poses by centimetres: what is in sight stays the same.
  const bool tell_open_ways =
      context->may_have_open_ways || result.second_map_refused;
  const MapReview review(context->scans, result.records, result.trajectory,
                         options_.check, options_.way_check,
                         [context] { return context->IsStopped(); });
  review.Revise(map_.graph(), result.refined, tell_open_ways, &result.loose,
                &result.notes);
  AddNotesOn(review.Odometry(), &result.notes);
}

void LogSolver::BeginClosing(Context* context) {
  const Eigen::Vector3d scale(1.0 / options_.closing_position_scale,
                              1.0 / options_.closing_position_scale, 1.0);
  for (const Constraint* constraint :
       std::as_const(map_.graph()).Constraints()) {
    if (constraint->kind != ConstraintClass::kMeasurement ||
        constraint->state != ConstraintState::kLive ||
        !constraint->type->Is(RelationRole::kPose) ||
        constraint->features.size() != 2) {
      continue;
    }
    map_.graph().UpdateConstraint(
        constraint->id, constraint->expected,
        scale.asDiagonal() * constraint->information * scale.asDiagonal());
  }
  EmOptions options = options_.em;
  options.break_share = options_.closing_break_share;
  HierarchySpec hierarchy = HierarchyOfOptions();
  AddSameWall(&hierarchy);
  Hierarchy detectors = MakeDetectors(hierarchy);
  ShowScans(
      context->scans, options_.adjustment.points,
      [&] {
        const std::vector<KeyScanRecord>& records = context->result.records;
        return LooksFromWalls(records, KeyPoses(records), map_.graph(),
                              options_.adjustment.place_stride);
      },
      detectors);
  map_.ReplaceEm(std::move(detectors), options);
}

}  // namespace plumbline
