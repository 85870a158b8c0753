#include <plumbline/core/error.h>
#include <plumbline/core/parallel_for.h>
#include <plumbline/core/read_ahead.h>
#include <plumbline/core/sight_lines.h>
#include <plumbline/core/stopwatch.h>
#include <plumbline/core/wall_pair.h>
#include <plumbline/detectors/default_hierarchy.h>
#include <plumbline/detectors/visibility.h>
#include <plumbline/frontend/looks.h>
#include <plumbline/frontend/open_ways.h>
#include <plumbline/frontend/place_chain.h>
#include <plumbline/frontend/wall_views.h>
#include <plumbline/pipeline/bent_map.h>
#include <plumbline/pipeline/log_solver.h>
#include <plumbline/pipeline/log_solver_state.h>

#include <algorithm>
#include <cstdio>
#include <limits>
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

// A second map with less than this share of the first one's length of walls has
// lost what the scans show, and is no better.
constexpr double kLeastSecondShare = 1.0 / 3.0;

// Rounds of binding walls to a plan, with EM after each.
constexpr int kPlanRounds = 6;

// How well a wall of glimpses is known relative to the place that saw it, m
// and rad.
constexpr double kGlimpsedPosition = 0.03;
constexpr double kGlimpsedDirection = DegToRad(0.3);

// Of crossings whose times and those of what speaks against them enclose
// others' only these: the fault lies between.
std::vector<BlockedWay> Innermost(const std::vector<BlockedWay>& ways) {
  std::vector<BlockedWay> left;
  const auto span = [](const BlockedWay& way) {
    return std::minmax(way.crossing, way.seen);
  };
  for (const BlockedWay& way : ways) {
    const auto [begin, end] = span(way);
    const bool encloses =
        std::any_of(ways.begin(), ways.end(), [&](const BlockedWay& other) {
          const auto [first, last] = span(other);
          return first >= begin && last <= end &&
                 (first > begin || last < end || &other < &way);
        });
    if (!encloses) left.push_back(way);
  }
  return left;
}

void AddLoose(int begin, int end, std::string why, LogSolverResult* result) {
  LooseTrack loose;
  loose.begin = begin;
  loose.end = end;
  loose.found = true;
  loose.why = std::move(why);
  result->loose.push_back(std::move(loose));
}

// The returns and the matches of the check of the map.
OpenWayOptions OptionsOfOpenWays(const MapCheckOptions& check) {
  OpenWayOptions options;
  options.points = check.points;
  options.matcher = check.matcher;
  options.num_threads = check.num_threads;
  return options;
}

void AddOpenWays(const std::vector<OpenWay>& ways, LogSolverResult* result) {
  for (const OpenWay& way : ways) {
    char why[128];
    std::snprintf(why, sizeof why,
                  "nothing in sight shows how far the robot went: the %.0f m "
                  "of this way are known to %.1f m",
                  way.length, way.sigma);
    AddLoose(way.begin, way.end, why, result);
  }
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

// The scans of the records, and where they are.
std::pair<std::vector<int>, std::vector<Pose2>> KeyScans(
    const LogSolverResult& result) {
  std::vector<int> keys;
  std::vector<Pose2> poses;
  for (const KeyScanRecord& record : result.records) {
    keys.push_back(record.scan);
    poses.push_back(result.trajectory[static_cast<std::size_t>(record.scan)]);
  }
  return {std::move(keys), std::move(poses)};
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

// What the stages share once all scans are in.
struct LogSolver::Context {
  const std::vector<Scan>& scans;
  const RunControl& control;
  LogSolverResult result;
  // As the scans were found again last.
  std::vector<Pose2> keys;
  // Features of the places of the second map, or of those that were recovered.
  std::vector<FeatureId> places;
  // While the second map is made: what makes it, and the first one.
  std::unique_ptr<JointAdjustment> adjustment;
  std::string first_map;
  std::vector<Pose2> first_trajectory;
  double first_length = 0.0;
  // Of the second map (JointAdjustment::vote_variance_excess).
  double vote_excess = 1.0;
  // Not once the adjusted poses were looked through for them in vain.
  bool may_have_open_ways = true;

  Context(const std::vector<Scan>& all_scans, const RunControl& run_control)
      : scans(all_scans), control(run_control) {}

  void Begin(const char* step) const {
    if (control.step) control.step(step);
  }
  // Once it was time to stop, it stays so.
  bool IsStopped() {
    if (!result.interrupted && control.stop && control.stop()) {
      result.interrupted = true;
    }
    return result.interrupted;
  }
};

// What the refiner made of a scan.
struct LogSolver::Processed {
  RefinedScan refined;
  // Scans whose place is settled now.
  std::vector<SettledScan> settled;
  // None whose place is not.
  bool all_settled = false;
  double seconds = 0.0;
};

LogSolver::LogSolver(const Registry& registry, const LogSolverOptions& options)
    : registry_(registry),
      profile_(ProfileOf(options.features)),
      options_(WithProfile(profile_, options)),
      graph_(std::make_unique<Graph>()),
      refiner_(options_.odometry) {
  break_log_.Attach(graph_.get());
  session_ = std::make_unique<SolverSession>(graph_.get(), registry_,
                                             options_.session);
  em_ =
      std::make_unique<EmOrchestrator>(graph_.get(), session_.get(), registry_,
                                       StructureDetectors(), options_.em);
  if (RecoversPoses(options_)) {
    options_.builder.association.max_gap = options_.max_gap_of_final_map;
  }
  builder_ = profile_.make_builder(options_, graph_.get(), registry_);
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
  scans_.push_back(std::move(scan));
  TakeScan(scans_, Process(scans_.back()));
  if (builder_->records().empty()) return refined_.back().pose;
  return refined_.back().is_key
             ? builder_->robot()
             : Compose(builder_->robot(), refined_.back().since_key.mean);
}

LogSolver::Processed LogSolver::Process(const Scan& scan) {
  const Stopwatch watch;
  Processed processed;
  processed.refined = refiner_.Process(scan);
  processed.settled = Settled();
  processed.all_settled = refiner_.IsSettled();
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
                            double* em_seconds) {
  for (const SettledScan& settled : all) {
    const auto index = static_cast<std::size_t>(settled.index);
    refined_[index] = settled.refined;
    num_settled_ = index + 1;
    TakeKeyScan(scans, settled, em_seconds);
  }
}

void LogSolver::TakeKeyScan(const std::vector<Scan>& scans,
                            const SettledScan& settled, double* em_seconds) {
  if (!settled.refined.is_key) return;
  const auto index = static_cast<std::size_t>(settled.index);
  builder_->AddScan(MakeKeyScan(settled.index, scans[index], settled.refined,
                                settled.points, refiner_.noise_scale()));
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
  DropEm();
  builder_.reset();
  MakeGraph();
  break_log_.records().clear();
  builder_ = profile_.make_builder(options_, graph_.get(), registry_);
  Renew(StructureDetectors());
  scans_since_em_ = 0;
  features_at_last_global_ = 0;
  ScanPointsOptions points = options_.odometry.points;
  points.ScaleToNoise(refiner_.noise_scale());
  SettledScan settled;
  for (std::size_t i = 0; i < refined_.size(); ++i) {
    ++scans_since_em_;
    settled.index = static_cast<int>(i);
    settled.refined = refined_[i];
    if (settled.refined.is_key) {
      ExtractScanPoints(scans[i], points, &settled.points);
    }
    TakeKeyScan(scans, settled, em_seconds);
  }
}

void LogSolver::TakeScan(const std::vector<Scan>& scans,
                         const Processed& processed) {
  const Stopwatch watch;
  double em_seconds = 0.0;
  refined_.push_back(processed.refined);
  ++scans_since_em_;
  TakeSettled(scans, processed.settled, &em_seconds);
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
    Renew(StructureDetectors());
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
  ReadAhead<Processed> ahead(
      [&, stage_begin = stage_begin_]() -> std::optional<Processed> {
        if (is_end || next == scans.size()) return std::nullopt;
        Processed processed = Process(scans[next++]);
        is_end = EndsStage(stage_begin, next, processed);
        return processed;
      },
      kScansAhead, ThreadsHere() > 1);
  bool is_stopped = false;
  const auto ask_stop = [&] {
    if (is_stopped || !control.stop || !control.stop()) return;
    is_stopped = true;
    ahead.Stop();
  };
  ask_stop();
  while (const std::optional<Processed> processed = ahead.Next()) {
    TakeScan(scans, *processed);
    if (control.progress) control.progress(refined_.size(), scans.size());
    if (control.look) {
      control.look({*graph_, trace_, [this] { return Trajectory(); }});
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
        Context context(scans, control);
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
  const std::size_t features = graph_->num_features();
  if (features < static_cast<std::size_t>(options_.small_map) &&
      features > features_at_last_global_ + kSmallMapGrowth) {
    features_at_last_global_ = features;
    em_->Iterate();
  } else {
    const std::vector<FeatureId> scope =
        builder_->Neighborhood(options_.em_depth);
    em_->Iterate(&scope);
  }
  builder_->ReadRobot();
}

std::vector<Pose2> LogSolver::KeyPoses(
    const std::vector<KeyScanRecord>& records) const {
  if (options_.refine != Refinement::kNone) {
    return RelocalizeKeyScans(*graph_, records, options_.relocalization);
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
  TakeScans(log.scans, control);
  return FinishWith(log.scans, Stage::kEnd, control);
}

LogSolverResult LogSolver::RunFirst(const Log& log, const RunControl& control) {
  RequireFresh();
  TakeScans(log.scans, control);
  LogSolverResult result = FinishWith(log.scans, Stage::kAdjustPoses, control);
  result.closures = ClosuresOf(result);
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
  // A solver that made the first map allows for the noise already.
  if (!is_finished_) ScaleToNoise(first.noise_scale);
  is_finished_ = true;
  builder_.reset();
  Context context(scans, control);
  context.result = std::move(first);
  context.first_length = wall_length;
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
  Context context(log.scans, control);
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
    Renew(StructureDetectors());
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
  Renew();
  if (stage == Stage::kMakeWalls || stage == Stage::kAdjustWalls) {
    context.adjustment = std::make_unique<JointAdjustment>(
        graph_.get(), session_.get(), registry_, log.scans,
        context.result.refined, context.result.records, &reader,
        options_.adjustment, control.stop);
  }
  if (control.progress) control.progress(log.scans.size(), log.scans.size());
  return FinishFrom(stage, Stage::kEnd, &context);
}

void LogSolver::ScaleToNoise(double scale) {
  options_.completion.ScaleToNoise(scale);
  options_.adjustment.ScaleToNoise(scale);
  options_.check.ScaleToNoise(scale);
  options_.way_check.ScaleToNoise(scale);
}

LogSolverResult LogSolver::FinishWith(const std::vector<Scan>& scans, Stage end,
                                      const RunControl& control) {
  is_finished_ = true;
  Context context(scans, control);
  LogSolverResult& result = context.result;
  result.interrupted = refined_.size() < scans.size();
  {
    const Stopwatch watch;
    double em_seconds = 0.0;
    refiner_.Finish([&context] { return context.IsStopped(); });
    TakeSettled(scans, Settled(), &em_seconds);
    if (!refiner_.late_ties().empty() && !result.interrupted) {
      TakeAnew(scans, &em_seconds);
    }
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
  result.noise_scale = refiner_.noise_scale();
  ScaleToNoise(result.noise_scale);
  result.loose = refiner_.loose();
  result.feature_matches = builder_->num_matches();
  result.features_created = builder_->num_created();
  result.records = builder_->records();
  result.refined = std::move(refined_);
  builder_.reset();
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
    BeginStage(stage = Stage::kAdjustPoses, context);
  }
  if (stage == Stage::kAdjustPoses && stage != end) {
    AdjustPoses(context);
    BeginStage(stage = context->adjustment == nullptr
                           ? Stage::kFindStructureAgain
                           : Stage::kMakeWalls,
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
  context->result.detect_seconds =
      em_before_.detect_seconds + em_->totals().detect_seconds;
  context->result.solve_seconds =
      em_before_.solve_seconds + em_->totals().solve_seconds;
  context->result.breaks = break_log_.records();
  scans_ = {};
  return std::move(context->result);
}

void LogSolver::BeginStage(Stage stage, Context* context) {
  if (context->control.look) {
    context->control.look({*graph_, trace_, [&] {
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
  Renew();
  if (context->adjustment != nullptr) {
    context->adjustment->SetSession(session_.get());
  }
  if (!context->control.checkpoint) return;
  context->control.checkpoint([&] {
    StateWriter writer;
    ExchangeState(writer, &stage, context);
    if (context->adjustment != nullptr) {
      context->adjustment->WriteState(&writer);
    }
    return writer.bytes();
  });
}

void LogSolver::DropEm() {
  if (em_ != nullptr) CountEm();
  em_.reset();
  session_.reset();
}

// The session and EM know nothing but what is in the graph.
void LogSolver::Renew(Hierarchy detectors) {
  DropEm();
  session_ = std::make_unique<SolverSession>(graph_.get(), registry_,
                                             options_.session);
  em_ =
      std::make_unique<EmOrchestrator>(graph_.get(), session_.get(), registry_,
                                       std::move(detectors), options_.em);
}

template <typename Archive>
void LogSolver::ExchangeState(Archive& archive, Stage* stage,
                              Context* context) {
  ExchangeAll(archive, *stage, context->result, context->keys, context->places,
              context->first_map, context->first_trajectory,
              context->first_length, context->vote_excess,
              context->may_have_open_ways, em_before_, trace_,
              break_log_.records());
  Exchange(archive, registry_, *graph_);
}

template <typename Archive>
void LogSolver::ExchangeScansState(Archive& archive) {
  ExchangeAll(archive, refined_, num_settled_, stage_begin_, scan_seconds_,
              frontend_seconds_, scans_since_em_, features_at_last_global_);
}

void LogSolver::RunEm(Context* context) {
  const EmReport report = em_->Run(context->control.stop);
  context->result.em.iterations += report.iterations;
  context->result.em.termination = report.termination;
}

void LogSolver::FindStructure(Context* context) {
  context->Begin("structure of the whole map");
  context->result.initial_cost = session_->Cost();
  TraceEm();
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
    for (const Feature* feature : std::as_const(*graph_).Features()) {
      if (feature->type->Is(FeatureRole::kPose)) robot = feature->id;
    }
    context->places =
        RecoverPoses(context->result.records, KeyPoses(context->result.records),
                     robot, RecoveryOptions(options_), registry_, graph_.get())
            .places;
  }
  Renew();
  context->result.initial_cost = session_->Cost();
  TraceEm();
  RunEm(context);
}

void LogSolver::FindScansAgain(Context* context) {
  LogSolverResult& result = context->result;
  result.final_cost = session_->Cost();
  context->IsStopped();
  const ScopedTimer timer(&result.relocalization_seconds);
  if (!context->places.empty()) {
    TakeTrajectory(context);
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
    walls =
        FindGlimpsedWalls(*graph_, registry_, context->scans, result.trajectory,
                          options_.completion, context->control.stop);
  }
  if (!context->places.empty()) walls = BindToPlaces(walls, *context);
  result.glimpsed_walls =
      static_cast<std::int64_t>(walls.added_features().size());
  if (walls.empty()) return;
  graph_->Apply(std::move(walls));
  RunEm(context);
  FindScansAgain(context);
}

Transaction LogSolver::BindToPlaces(const Transaction& walls,
                                    const Context& context) const {
  Transaction bound;
  const Eigen::Vector3d sigma(kGlimpsedPosition, kGlimpsedPosition,
                              kGlimpsedDirection);
  const Eigen::Matrix3d information =
      sigma.array().square().inverse().matrix().asDiagonal();
  const std::vector<std::size_t> begins =
      PlaceBegins(context.result.records, options_.adjustment.place_stride);
  std::vector<int> place_of_scan;
  for (std::size_t p = 0; p < begins.size(); ++p) {
    const auto first =
        static_cast<std::size_t>(context.result.records[begins[p]].scan);
    place_of_scan.resize(std::max(first, place_of_scan.size()),
                         std::max(0, static_cast<int>(p) - 1));
  }
  place_of_scan.resize(context.scans.size(),
                       static_cast<int>(begins.size()) - 1);
  const std::vector<int> seen_from = GroupsThatSaw(
      walls.added_features(), context.scans, context.result.trajectory,
      place_of_scan, options_.completion.points,
      options_.completion.explained_offset);
  for (std::size_t w = 0; w < seen_from.size(); ++w) {
    if (seen_from[w] < 0) continue;
    const Feature& wall = walls.added_features()[w];
    const Feature& place = graph_->GetFeature(context.places[seen_from[w]]);
    bound.AddConstraint(MakeMeasurement(
        registry_.GetRelation("pose_pose"), {place.id, bound.AddFeature(wall)},
        Between(place.type->frame(place), wall.type->frame(wall)), information,
        wall.source));
  }
  return bound;
}

void LogSolver::AdjustPoses(Context* context) {
  if (options_.refine != Refinement::kFull || context->IsStopped()) return;
  LogSolverResult& result = context->result;
  const ScopedTimer timer(&result.adjustment_seconds);
  context->Begin("adjustment of poses");
  StateWriter first_map;
  Exchange(first_map, registry_, *graph_);
  context->first_map = first_map.bytes();
  context->first_trajectory = result.trajectory;
  if (context->first_length == 0.0) {
    context->first_length = LengthOfWalls(*graph_);
  }
  // RunFirst has kept them, perhaps those of several maps.
  if (result.closures.empty()) result.closures = ClosuresOf(result);
  // What was taken for walls must not make odometry worse.
  const std::vector<Pose2> by_odometry =
      PosesByMotions(result.records, context->keys);
  const bool is_bent = IsBent(context->keys, by_odometry);
  AdjustPosesFrom(is_bent ? by_odometry : context->keys, context);
  const bool has_contradictions = HasContradictions(context);
  if (has_contradictions || HasOpenWays(context)) {
    // A start that is far off ends in a wrong place: the better of two stands.
    const MapAgreement agreement = AgreementOf(*context);
    const double misfit = context->adjustment->Misfit();
    const std::int64_t relations = context->adjustment->num_relations();
    StateWriter kept;
    Exchange(kept, registry_, *graph_);
    context->adjustment->WriteState(&kept);
    std::vector<Pose2> trajectory = result.trajectory;
    AdjustPosesFrom(is_bent ? context->keys : by_odometry, context);
    // Where scans agree everywhere, as in a round corridor, what was measured
    // between them decides.
    const MapAgreement now = AgreementOf(*context);
    const bool is_better =
        has_contradictions
            ? now.IsBetterThan(agreement)
            : now.contradicting <= agreement.contradicting &&
                  context->adjustment->FitsBetterThan(misfit, relations);
    if (!context->IsStopped() && !is_better) {
      const std::string bytes = kept.bytes();
      StateReader reader(bytes);
      context->adjustment.reset();
      DropEm();
      MakeGraph();
      Exchange(reader, registry_, *graph_);
      Renew();
      context->adjustment = std::make_unique<JointAdjustment>(
          graph_.get(), session_.get(), registry_, context->scans,
          result.refined, result.records, &reader, options_.adjustment,
          context->control.stop);
      context->places = context->adjustment->places();
      result.trajectory = std::move(trajectory);
    }
  }
  if (context->IsStopped()) ReturnToFirstMap(context);
}

void LogSolver::AdjustPosesFrom(const std::vector<Pose2>& start,
                                Context* context) {
  const LogSolverResult& result = context->result;
  context->adjustment.reset();
  ClearGraph();
  context->adjustment = std::make_unique<JointAdjustment>(
      graph_.get(), session_.get(), registry_, context->scans, result.refined,
      result.records, start, kNoId, options_.adjustment, context->control.stop);
  JointAdjustment& adjustment = *context->adjustment;
  context->places = adjustment.places();
  adjustment.Adjust();
  if (!context->IsStopped()) {
    adjustment.MatchAnew();
    adjustment.Adjust();
  }
  if (context->IsStopped()) return;
  adjustment.EstimateVariances();
  TakeTrajectory(context);
}

bool LogSolver::HasContradictions(Context* context) const {
  if (!options_.check_map || context->IsStopped()) return false;
  const auto [keys, poses] = KeyScans(context->result);
  return !FindContradictions(context->scans, keys, poses, options_.check,
                             [context] { return context->IsStopped(); })
              .empty();
}

bool LogSolver::HasOpenWays(Context* context) const {
  if (!options_.check_map || context->IsStopped()) return false;
  const auto [keys, poses] = KeyScans(context->result);
  context->may_have_open_ways =
      !FindOpenWays(context->scans, keys, poses,
                    OptionsOfOpenWays(options_.check),
                    [context] { return context->IsStopped(); })
           .empty();
  return context->may_have_open_ways;
}

MapAgreement LogSolver::AgreementOf(const Context& context) const {
  const auto [keys, poses] = KeyScans(context.result);
  return CountAgreement(context.scans, keys, poses, options_.check,
                        context.control.stop);
}

std::vector<LoopClosure> LogSolver::ClosuresOf(
    const LogSolverResult& result) const {
  std::vector<LoopClosure> closures;
  for (const Constraint* constraint : std::as_const(*graph_).Constraints()) {
    if (!constraint->type->Is(RelationRole::kSameWall)) continue;
    const std::optional<Wall> first =
        WallOf(graph_->GetFeature(constraint->features[0]));
    const std::optional<Wall> second =
        WallOf(graph_->GetFeature(constraint->features[1]));
    if (!first || !second) continue;
    const Pose2 middle = MiddleOfCommonPart(*first, *second);
    LoopClosure closure;
    double nearest = std::numeric_limits<double>::infinity();
    for (const KeyScanRecord& record : result.records) {
      const Pose2& pose =
          result.trajectory[static_cast<std::size_t>(record.scan)];
      const double distance = (pose - middle).head<2>().squaredNorm();
      if (distance >= nearest) continue;
      nearest = distance;
      closure.scan = record.scan;
      closure.place = Between(pose, middle);
    }
    closure.holds = constraint->state == ConstraintState::kLive;
    closure.delta = constraint->delta;
    closures.push_back(closure);
  }
  return closures;
}

void LogSolver::MakeWalls(Context* context) {
  // Half of a second map is worth less than the whole of the first.
  if (context->IsStopped()) return ReturnToFirstMap(context);
  const ScopedTimer timer(&context->result.adjustment_seconds);
  context->Begin("walls from adjusted poses");
  context->adjustment->AddWalls(FindGlimpsedWalls(
      *graph_, registry_, context->scans, context->result.trajectory,
      options_.completion, context->control.stop));
}

void LogSolver::AdjustWalls(Context* context) {
  if (context->adjustment == nullptr) return;
  if (context->IsStopped()) return ReturnToFirstMap(context);
  LogSolverResult& result = context->result;
  const ScopedTimer timer(&result.adjustment_seconds);
  context->Begin("joint adjustment of poses and walls");
  JointAdjustment& adjustment = *context->adjustment;
  adjustment.Adjust();
  if (!context->IsStopped()) adjustment.EstimateVariances();
  if (context->IsStopped()) return ReturnToFirstMap(context);
  TakeTrajectory(context);
  result.scan_relations = adjustment.num_relations();
  result.wall_votes = adjustment.num_votes();
  context->vote_excess = adjustment.vote_variance_excess();
  result.second_map_refused =
      LengthOfWalls(*graph_) < kLeastSecondShare * context->first_length &&
      !IsBent(context->first_trajectory, result.trajectory);
  if (result.second_map_refused) return ReturnToFirstMap(context);
  context->adjustment.reset();
  context->first_map.clear();
  context->first_trajectory.clear();
}

void LogSolver::ReturnToFirstMap(Context* context) {
  LogSolverResult& result = context->result;
  context->adjustment.reset();
  StateReader reader(context->first_map);
  DropEm();
  MakeGraph();
  Exchange(reader, registry_, *graph_);
  Renew();
  context->places.clear();
  result.trajectory = std::move(context->first_trajectory);
  context->first_trajectory.clear();
  context->first_map.clear();
  // They stand in the map.
  result.closures.clear();
  result.scan_relations = result.wall_votes = 0;
  if (!result.second_map_refused ||
      options_.features != RawFeatures::kSegments) {
    return;
  }
  BringPosesBack(context);
  FindScansAgain(context);
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
  ReplaceEm(std::move(detectors), options);
  KnownStructureBinder known(options_.known, registry_, context->places.front(),
                             graph_.get());
  if (options_.structure) known.AddStatements();
  RunEm(context);
  if (options_.structure) TieToPlan(&known, context);
  context->IsStopped();
  result.final_cost = session_->Cost();
  TakeTrajectory(context);
  ReportVoteVariances(context->vote_excess, registry_, graph_.get());
}

// Walls that lie near the plan pull others near.
void LogSolver::TieToPlan(KnownStructureBinder* known, Context* context) {
  for (int round = 0; round < kPlanRounds && !context->IsStopped(); ++round) {
    if (known->TieToPlan(context->control.stop) == 0) break;
    RunEm(context);
  }
  context->result.notes = known->Notes();
}

void LogSolver::TakeTrajectory(Context* context) const {
  LogSolverResult& result = context->result;
  result.trajectory = InterpolateScans(
      result.refined, result.records,
      KeyPosesOfPlaces(*graph_, context->places, result.records,
                       options_.adjustment.place_stride));
}

void LogSolver::CheckMap(Context* context) const {
  LogSolverResult& result = context->result;
  if (!options_.check_map || options_.refine == Refinement::kNone ||
      context->IsStopped()) {
    return;
  }
  context->Begin("check of the map");
  const ScopedTimer timer(&result.relocalization_seconds);
  const auto [keys, poses] = KeyScans(result);
  const auto stop = [context] { return context->IsStopped(); };
  const std::vector<MapContradiction> contradictions =
      FindContradictions(context->scans, keys, poses, options_.check, stop);
  std::vector<Wall> walls;
  for (const Feature* feature : std::as_const(*graph_).Features()) {
    if (feature->level != 0) continue;
    if (const std::optional<Wall> wall = WallOf(*feature)) {
      walls.push_back(*wall);
    }
  }
  const std::vector<BlockedWay> blocked = FindBlockedWays(
      context->scans, keys, poses, walls, options_.way_check, stop);
  // Where something is wrong no tie is taken for sure.
  if (contradictions.empty() && blocked.empty()) DropConfirmed(keys, context);
  for (const MapContradiction& part : contradictions) {
    AddLoose(part.begin, part.end,
             "what the robot saw here contradicts what it saw on other visits",
             &result);
  }
  for (const BlockedWay& way : Innermost(blocked)) {
    const auto [begin, end] = std::minmax(way.crossing, way.seen);
    // A tie between them that is reported already may be why.
    const bool is_explained =
        std::any_of(result.loose.begin(), result.loose.end(),
                    [begin = begin, end = end](const LooseTrack& loose) {
                      return (loose.begin >= begin && loose.begin < end) ||
                             (loose.end > begin && loose.end <= end);
                    });
    if (is_explained) continue;
    AddLoose(begin, end,
             "between these two the robot went through what it has seen as a "
             "wall: that was moved, or the map is wrong",
             &result);
  }
  // The second map moves poses by centimetres: what is in sight stays the same.
  if (context->may_have_open_ways || result.second_map_refused) {
    AddOpenWays(FindOpenWays(context->scans, keys, poses,
                             OptionsOfOpenWays(options_.check), stop),
                &result);
  }
  std::stable_sort(result.loose.begin(), result.loose.end(),
                   [](const LooseTrack& a, const LooseTrack& b) {
                     return a.begin < b.begin;
                   });
}

void LogSolver::DropConfirmed(const std::vector<int>& keys,
                              Context* context) const {
  LogSolverResult& result = context->result;
  std::vector<TrackCut> cuts;
  for (const LooseTrack& loose : result.loose) {
    // A guess is one from its first scan on.
    cuts.push_back({loose.begin, loose.found ? loose.end : loose.begin + 1});
  }
  const std::vector<bool> is_confirmed = FindConfirmedTies(
      context->scans, keys, result.trajectory, cuts, options_.check,
      [context] { return context->IsStopped(); });
  std::vector<LooseTrack> left;
  for (std::size_t i = 0; i < cuts.size(); ++i) {
    if (result.loose[i].found && is_confirmed[i]) continue;
    left.push_back(std::move(result.loose[i]));
  }
  result.loose = std::move(left);
}

void LogSolver::MakeGraph() {
  break_log_.Detach();
  graph_ = std::make_unique<Graph>();
  break_log_.Attach(graph_.get());
}

void LogSolver::ClearGraph() {
  Transaction clear;
  for (const Constraint* constraint : std::as_const(*graph_).Constraints()) {
    clear.RemoveConstraint(constraint->id);
  }
  for (const Feature* feature : std::as_const(*graph_).Features()) {
    clear.RemoveFeature(feature->id);
  }
  graph_->Apply(std::move(clear));
}

void LogSolver::BeginClosing(Context* context) {
  const Eigen::Vector3d scale(1.0 / options_.closing_position_scale,
                              1.0 / options_.closing_position_scale, 1.0);
  for (const Constraint* constraint : std::as_const(*graph_).Constraints()) {
    if (constraint->kind != ConstraintClass::kMeasurement ||
        constraint->state != ConstraintState::kLive ||
        !constraint->type->Is(RelationRole::kPose) ||
        constraint->features.size() != 2) {
      continue;
    }
    graph_->UpdateConstraint(
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
        return LooksFromWalls(records, KeyPoses(records), *graph_,
                              options_.adjustment.place_stride);
      },
      detectors);
  ReplaceEm(std::move(detectors), options);
}

void LogSolver::CountEm() {
  const EmReport& totals = em_->totals();
  em_before_.iterations += totals.iterations;
  em_before_.detect_seconds += totals.detect_seconds;
  em_before_.solve_seconds += totals.solve_seconds;
}

void LogSolver::ReplaceEm(Hierarchy detectors, const EmOptions& options) {
  CountEm();
  em_ = std::make_unique<EmOrchestrator>(
      graph_.get(), session_.get(), registry_, std::move(detectors), options);
  TraceEm();
}

void LogSolver::TraceEm() {
  em_->SetTrace([this](EmPhase phase) {
    phase.iteration += em_before_.iterations;
    break_log_.SetIteration(phase.iteration);
    trace_.push_back(std::move(phase));
  });
}

}  // namespace plumbline
