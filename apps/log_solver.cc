#include <plumbline/apps/log_solver.h>
#include <plumbline/detectors/default_hierarchy.h>

#include <chrono>
#include <utility>

namespace plumbline {
namespace {

double Now() {
  return std::chrono::duration<double>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

}  // namespace

LogSolver::LogSolver(const Registry& registry, const LogSolverOptions& options)
    : registry_(registry), options_(options) {
  Hierarchy hierarchy;
  if (options_.structure) {
    hierarchy =
        MakeHierarchy(options_.hierarchy.empty() ? DefaultHierarchy({"segment"})
                                                 : options_.hierarchy,
                      registry_, {"segment"}, options_.detector_parameters);
  }
  session_ =
      std::make_unique<SolverSession>(&graph_, registry_, options_.session);
  em_ = std::make_unique<EmOrchestrator>(&graph_, session_.get(), registry_,
                                         std::move(hierarchy), options_.em);
}

LogSolver::~LogSolver() = default;

LogSolverResult LogSolver::Run(
    const Log& log,
    const std::function<void(std::size_t, std::size_t)>& progress,
    const std::function<bool()>& stop) {
  LogSolverResult result;
  OdometryRefiner refiner(options_.odometry);
  MapBuilder builder(&graph_, registry_, options_.builder);
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
      builder.AddKeyScan(
          static_cast<int>(i), refined.back().since_key,
          ExtractSegments(refiner.points(), scan.laser_offset.head<2>(),
                          scan.angle_step, options_.segments),
          refined.back().pose);
      if (options_.em_every > 0 && since_em >= options_.em_every) {
        since_em = 0;
        const double em_begin = Now();
        builder.WriteRobot();
        if (graph_.num_features() <
                static_cast<std::size_t>(options_.small_map) &&
            graph_.num_features() > features_at_last_global + 10) {
          features_at_last_global = graph_.num_features();
          em_->Iterate();
        } else {
          const std::vector<FeatureId> scope =
              builder.Neighborhood(options_.em_depth);
          em_->Iterate(&scope);
        }
        builder.ReadRobot();
        em_seconds += Now() - em_begin;
      }
    }
    result.scan_seconds.push_back(static_cast<float>(Now() - scan_begin));
    if (progress) progress(i + 1, log.scans.size());
  }
  result.frontend_seconds = Now() - begin - em_seconds;

  builder.WriteRobot();
  result.initial_cost = session_->Cost();
  em_->SetTrace([this](const EmPhase& phase) { trace_.push_back(phase); });
  result.em = em_->Run(stop);
  builder.ReadRobot();
  result.final_cost = session_->Cost();

  std::vector<Pose2> keys;
  auto trajectory = [&] {
    const double relocalization_begin = Now();
    keys.clear();
    if (options_.refine != Refinement::kNone) {
      keys = RelocalizeKeyScans(graph_, builder.records(),
                                options_.relocalization);
    } else {
      for (const KeyScanRecord& record : builder.records()) {
        keys.push_back(record.pose);
      }
    }
    std::vector<Pose2> poses =
        InterpolateScans(refined, builder.records(), keys);
    result.relocalization_seconds += Now() - relocalization_begin;
    return poses;
  };
  result.trajectory = trajectory();

  if (options_.complete_walls && options_.refine != Refinement::kNone &&
      !result.interrupted) {
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
      builder.ReadRobot();
      result.final_cost = session_->Cost();
      result.trajectory = trajectory();
    }
  }

  if (options_.refine == Refinement::kFull && !result.interrupted) {
    const double adjustment_begin = Now();
    JointAdjustment adjustment(&graph_, session_.get(), registry_, log.scans,
                               refined, builder.records(), keys,
                               builder.robot_id(), options_.adjustment);
    adjustment.Adjust();
    const EmReport again = em_->Run(stop);
    result.em.iterations += again.iterations;
    result.em.converged = again.converged;
    result.final_cost = session_->Cost();
    result.trajectory =
        InterpolateScans(refined, builder.records(), adjustment.KeyPoses());
    result.scan_relations = adjustment.num_relations();
    result.wall_votes = adjustment.num_votes();
    result.adjustment_seconds = Now() - adjustment_begin;
  }
  result.detect_seconds = em_->totals().detect_seconds;
  result.solve_seconds = em_->totals().solve_seconds;

  result.key_scans = static_cast<std::int64_t>(builder.records().size());
  result.wide_searches = refiner.wide_searches();
  result.refused_matches = refiner.refusals();
  result.segment_matches = builder.num_matches();
  result.segments_created = builder.num_created();
  result.records = builder.records();
  result.refined = std::move(refined);
  return result;
}

}  // namespace plumbline
