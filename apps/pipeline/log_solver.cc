#include <plumbline/detectors/default_hierarchy.h>
#include <plumbline/pipeline/log_solver.h>

#include <algorithm>
#include <chrono>
#include <string>
#include <utility>

namespace plumbline {
namespace {

double Now() {
  return std::chrono::duration<double>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

std::string RawType(const LogSolverOptions& options) {
  return options.features == RawFeatures::kPoints ? "point" : "segment";
}

std::string HierarchyOf(const LogSolverOptions& options) {
  return options.hierarchy.empty() ? DefaultHierarchy({RawType(options)})
                                   : options.hierarchy;
}

// The constraints from the robot that an EM step while replaying reaches at
// most: points are bound to farther ones than segments, and there are more.
constexpr int kPointEmDepth = 1;

// The detectors of lines and circles have the synthetic worlds' noise of
// decimetres as defaults. A point of a log is placed across its wall by many
// returns, to a centimetre. Walls go on behind open doors, and a row of points
// is a wall of its own when it is a hand's breadth from another.
DetectorParameters CurvesOfALog() {
  return {{"tolerance", 0.1}, {"gate", 0.06}, {"max_gap", 2.5}, {"reach", 2.0}};
}

// What points cannot do is off.
LogSolverOptions Settle(LogSolverOptions options) {
  if (options.features == RawFeatures::kPoints) {
    options.global_association = false;
    options.complete_walls = false;
    if (options.refine == Refinement::kFull) options.refine = Refinement::kMap;
    for (const char* detector : {"line_ransac", "circle_ransac"}) {
      // What was given stays.
      for (const auto& parameter : CurvesOfALog()) {
        options.detector_parameters[detector].insert(parameter);
      }
    }
    options.em_depth = std::min(options.em_depth, kPointEmDepth);
  }
  return options;
}

// With same_wall as the last detector of level 0, unless it is there.
std::string WithSameWall(std::string hierarchy) {
  if (hierarchy.find("same_wall") != std::string::npos) return hierarchy;
  const std::size_t end = std::min(hierarchy.find('/'), hierarchy.size());
  hierarchy.insert(end, end > 0 ? ",same_wall" : "same_wall");
  return hierarchy;
}

}  // namespace

std::unique_ptr<GraphBuilder> MakeGraphBuilder(const LogSolverOptions& options,
                                               Graph* graph,
                                               const Registry& registry) {
  if (options.features == RawFeatures::kPoints) {
    return std::make_unique<PointMapBuilder>(graph, registry,
                                             options.point_builder);
  }
  return std::make_unique<MapBuilder>(graph, registry, options.builder);
}

KeyScan MakeKeyScan(int index, const Scan& scan, const RefinedScan& refined,
                    const std::vector<ScanPoint>& returns) {
  KeyScan key;
  key.index = index;
  key.motion = refined.since_key;
  key.start = refined.pose;
  key.returns = returns;
  key.laser = scan.laser_offset.head<2>();
  key.angle_step = scan.angle_step;
  return key;
}

LogSolver::LogSolver(const Registry& registry, const LogSolverOptions& options)
    : registry_(registry), options_(Settle(options)) {
  Hierarchy hierarchy;
  if (options_.structure) {
    hierarchy =
        MakeHierarchy(HierarchyOf(options_), registry_, {RawType(options_)},
                      options_.detector_parameters);
  }
  session_ =
      std::make_unique<SolverSession>(&graph_, registry_, options_.session);
  em_ = std::make_unique<EmOrchestrator>(&graph_, session_.get(), registry_,
                                         std::move(hierarchy), options_.em);
}

LogSolver::~LogSolver() = default;

void LogSolver::BeginClosing() {
  const Eigen::Vector3d scale(1.0 / options_.closing_position_scale,
                              1.0 / options_.closing_position_scale, 1.0);
  for (const Constraint* constraint : std::as_const(graph_).Constraints()) {
    if (constraint->kind != ConstraintClass::kMeasurement ||
        constraint->state != ConstraintState::kLive ||
        constraint->type->name != "pose_pose") {
      continue;
    }
    graph_.UpdateConstraint(
        constraint->id, constraint->expected,
        scale.asDiagonal() * constraint->information * scale.asDiagonal());
  }
  EmOptions options = options_.em;
  options.break_share = options_.closing_break_share;
  before_closing_ = em_->totals();
  em_ = std::make_unique<EmOrchestrator>(
      &graph_, session_.get(), registry_,
      MakeHierarchy(WithSameWall(HierarchyOf(options_)), registry_,
                    {RawType(options_)}, options_.detector_parameters),
      options);
  TraceEm();
}

void LogSolver::TraceEm() {
  em_->SetTrace([this](EmPhase phase) {
    phase.iteration += before_closing_.iterations;
    trace_.push_back(std::move(phase));
  });
}

LogSolverResult LogSolver::Run(
    const Log& log,
    const std::function<void(std::size_t, std::size_t)>& progress,
    const std::function<bool()>& stop,
    const std::function<void(const char*)>& step) {
  const auto begin_step = [&step](const char* name) {
    if (step) step(name);
  };
  LogSolverResult result;
  OdometryRefiner refiner(options_.odometry);
  const std::unique_ptr<GraphBuilder> builder =
      MakeGraphBuilder(options_, &graph_, registry_);
  std::vector<RefinedScan> refined;
  refined.reserve(log.scans.size());
  result.scan_seconds.reserve(log.scans.size());

  double em_seconds = 0.0;
  int since_em = 0;
  std::size_t features_at_last_global = 0;
  const double begin = Now();
  for (std::size_t i = 0; i < log.scans.size(); ++i) {
    if (stop && stop()) {
      result.interrupted = true;
      break;
    }
    const double scan_begin = Now();
    const Scan& scan = log.scans[i];
    refined.push_back(refiner.Process(scan));
    ++since_em;
    if (refined.back().is_key) {
      builder->AddScan(MakeKeyScan(static_cast<int>(i), scan, refined.back(),
                                   refiner.points()));
      if (options_.em_every > 0 && since_em >= options_.em_every) {
        since_em = 0;
        const double em_begin = Now();
        builder->WriteRobot();
        if (graph_.num_features() <
                static_cast<std::size_t>(options_.small_map) &&
            graph_.num_features() > features_at_last_global + 10) {
          features_at_last_global = graph_.num_features();
          em_->Iterate();
        } else {
          const std::vector<FeatureId> scope =
              builder->Neighborhood(options_.em_depth);
          em_->Iterate(&scope);
        }
        builder->ReadRobot();
        em_seconds += Now() - em_begin;
      }
    }
    result.scan_seconds.push_back(static_cast<float>(Now() - scan_begin));
    if (progress) progress(i + 1, log.scans.size());
  }
  result.frontend_seconds = Now() - begin - em_seconds;

  builder->WriteRobot();
  result.initial_cost = session_->Cost();
  TraceEm();
  begin_step("structure of the whole map");
  result.em = em_->Run(stop);
  if (options_.structure && options_.global_association &&
      !result.interrupted && !(stop && stop())) {
    begin_step("closing of loops");
    BeginClosing();
    const EmReport closing = em_->Run(stop);
    result.em.iterations += closing.iterations;
    result.em.converged = closing.converged;
  }
  builder->ReadRobot();
  result.final_cost = session_->Cost();
  if (stop && stop()) result.interrupted = true;

  std::vector<Pose2> keys;
  auto trajectory = [&] {
    const double relocalization_begin = Now();
    keys.clear();
    if (options_.refine != Refinement::kNone) {
      keys = RelocalizeKeyScans(graph_, builder->records(),
                                options_.relocalization);
    } else {
      for (const KeyScanRecord& record : builder->records()) {
        keys.push_back(record.pose);
      }
    }
    std::vector<Pose2> poses =
        InterpolateScans(refined, builder->records(), keys);
    result.relocalization_seconds += Now() - relocalization_begin;
    return poses;
  };
  result.trajectory = trajectory();

  if (options_.complete_walls && options_.refine != Refinement::kNone &&
      !result.interrupted) {
    begin_step("walls seen by glimpses");
    const double completion_begin = Now();
    Transaction walls = FindGlimpsedWalls(
        graph_, registry_, log.scans, result.trajectory, options_.completion);
    result.glimpsed_walls =
        static_cast<std::int64_t>(walls.added_features().size());
    result.completion_seconds = Now() - completion_begin;
    if (!walls.empty()) {
      graph_.Apply(std::move(walls));
      const EmReport again = em_->Run(stop);
      result.em.iterations += again.iterations;
      result.em.converged = again.converged;
      builder->ReadRobot();
      result.final_cost = session_->Cost();
      result.trajectory = trajectory();
      if (stop && stop()) result.interrupted = true;
    }
  }

  if (options_.refine == Refinement::kFull && !result.interrupted) {
    begin_step("joint adjustment of poses and walls");
    const double adjustment_begin = Now();
    JointAdjustment adjustment(&graph_, session_.get(), registry_, log.scans,
                               refined, builder->records(), keys,
                               builder->robot_id(), options_.adjustment);
    adjustment.Adjust(stop);
    const EmReport again = em_->Run(stop);
    result.em.iterations += again.iterations;
    result.em.converged = again.converged;
    if (stop && stop()) result.interrupted = true;
    result.final_cost = session_->Cost();
    result.trajectory =
        InterpolateScans(refined, builder->records(), adjustment.KeyPoses());
    result.scan_relations = adjustment.num_relations();
    result.wall_votes = adjustment.num_votes();
    result.adjustment_seconds = Now() - adjustment_begin;
  }
  result.detect_seconds =
      before_closing_.detect_seconds + em_->totals().detect_seconds;
  result.solve_seconds =
      before_closing_.solve_seconds + em_->totals().solve_seconds;

  result.key_scans = static_cast<std::int64_t>(builder->records().size());
  result.wide_searches = refiner.wide_searches();
  result.refused_matches = refiner.refusals();
  result.feature_matches = builder->num_matches();
  result.features_created = builder->num_created();
  result.records = builder->records();
  result.refined = std::move(refined);
  return result;
}

}  // namespace plumbline
