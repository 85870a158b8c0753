#include <plumbline/apps/experiments/building_experiments.h>
#include <plumbline/apps/experiments/building_trial.h>
#include <plumbline/apps/experiments/experiment_jobs.h>
#include <plumbline/pipeline/log_solver.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <utility>

namespace plumbline {
namespace {

// Of the walls seen on several visits so many shall be one in the map.
constexpr double kClosedShare = 0.95;

}  // namespace

void RunB1(const ExperimentOptions& options, const Registry& registry,
           ExperimentResult* result) {
  result->title = "Loop closures in simulated buildings of several shapes";
  result->paper =
      "The paper closes no loops and names global data association as what "
      "would help most.";
  std::vector<Job> jobs;
  for (const std::string& shape : BuildingShapes()) {
    for (int trial = 0; trial < options.trials; ++trial) {
      Job job;
      job.condition = shape;
      job.seed = options.seed + static_cast<std::uint64_t>(trial);
      const bool is_drawn = trial == 0;
      job.run = [shape, is_drawn, &options, &registry](Job* self) {
        LogSolverOptions solver;
        solver.session.delta_mode = options.delta_mode;
        solver.em.delta_threshold = options.delta_threshold;
        solver.em.seed = options.seed;
        const BuildingTrial run = RunBuildingTrial(
            MakeWorld(shape, self->seed, 1.0), SimulatorOptions(), self->seed,
            registry, solver, options.stop);
        if (run.is_stopped) return;
        const ClosureEvaluation& closures = run.closures;
        self->values = {
            {"scans", static_cast<double>(run.scans)},
            {"closures_right", closures.right},
            {"closures_near", closures.near},
            {"closures_wrong", closures.wrong},
            {"broken_right", closures.broken_right},
            {"broken_wrong", closures.broken_wrong},
            {"revisits", closures.revisits},
            {"revisits_closed", closures.closed_revisits},
            {"walls", static_cast<double>(run.map.walls.size())},
            {"walls_missed", static_cast<double>(run.map.missed_walls.size())},
            {"walls_false", static_cast<double>(run.map.false_walls.size())},
            {"offset_error", run.map.offset_error.mean},
            {"direction_error_deg", run.map.direction_error_deg.mean},
            {"position_error", run.mean_position_error}};
        if (is_drawn) {
          MapDrawing drawing = run.drawing;
          drawing.title = "B1: " + shape;
          self->maps.emplace_back(shape, drawing);
        }
      };
      jobs.push_back(std::move(job));
    }
  }
  RunJobs(options, &jobs);
  Collect(&jobs, result);
  if (result->interrupted) return;
  for (const std::string& shape : BuildingShapes()) {
    std::vector<double> without;
    for (const double wrong : Column(*result, shape, "closures_wrong")) {
      without.push_back(wrong == 0.0 ? 1.0 : 0.0);
    }
    AddShare(shape + ": no wrong closure in the final map", without, 20,
             result);
  }
  for (const std::string& shape : BuildingShapes()) {
    const auto sum = [&](const char* name) {
      const std::vector<double> values = Column(*result, shape, name);
      return static_cast<int>(
          std::lround(std::accumulate(values.begin(), values.end(), 0.0)));
    };
    const int revisits = sum("revisits");
    const int closed = sum("revisits_closed");
    Claim claim;
    claim.text = shape + ": revisits closed (" + std::to_string(closed) +
                 " of " + std::to_string(revisits) + ")";
    claim.required = "at least " + Format("%g", kClosedShare);
    claim.measured = ShareEstimate(closed, revisits);
    claim.holds = closed >= kClosedShare * revisits;
    result->claims.push_back(std::move(claim));
  }
  result->notes.push_back(
      "A closure is wrong when it joins segments of different true walls; "
      "closures_near join a shut door and the wall that it is in. Errors are "
      "m.");
}

}  // namespace plumbline
