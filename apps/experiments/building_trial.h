#ifndef PLUMBLINE_APPS_EXPERIMENTS_BUILDING_TRIAL_H_
#define PLUMBLINE_APPS_EXPERIMENTS_BUILDING_TRIAL_H_

#include <plumbline/apps/evaluation/closure_truth.h>
#include <plumbline/apps/evaluation/consistency.h>
#include <plumbline/apps/evaluation/map_evaluation.h>
#include <plumbline/apps/evaluation/plan_evaluation.h>
#include <plumbline/apps/simulation/simulator.h>
#include <plumbline/apps/simulation/world.h>
#include <plumbline/core/registry.h>
#include <plumbline/outputs/map_drawing.h>
#include <plumbline/pipeline/log_solver.h>

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace plumbline {

/// The built-in worlds that trials are made of.
const std::vector<std::string>& BuildingShapes();

/// A map of a simulated building, compared with the truth.
struct BuildingTrial {
  std::int64_t scans = 0;
  MapTruthEvaluation map;
  ClosureEvaluation closures;
  PlanEvaluation plan;
  /// Mean distance of the poses of scans from the true ones once the trajectory
  /// is laid on them as a whole, m.
  double mean_position_error = 0.0;
  /// Errors of the map's walls against the covariances that it gives them.
  Consistency consistency;
  MapDrawing drawing;
  /// `stop` said so: the rest is empty.
  bool is_stopped = false;
};

/// Drives a robot through the world, solves the log that it would have written
/// (with the digits of a log), and compares. Throws Error as Simulate and
/// LogSolver do.
BuildingTrial RunBuildingTrial(const World& world,
                               const SimulatorOptions& simulator,
                               std::uint64_t seed, const Registry& registry,
                               const LogSolverOptions& options,
                               const std::function<bool()>& stop = nullptr);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_EXPERIMENTS_BUILDING_TRIAL_H_
