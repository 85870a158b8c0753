#include <plumbline/apps/experiments/building_experiments.h>
#include <plumbline/apps/experiments/building_trial.h>
#include <plumbline/apps/experiments/experiment_jobs.h>
#include <plumbline/apps/experiments/solve_mode.h>
#include <plumbline/apps/experiments/synthetic_run.h>
#include <plumbline/apps/simulation/bent_world.h>
#include <plumbline/apps/simulation/building.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <string>
#include <utility>

namespace plumbline {
namespace {

// Of the walls seen on several visits so many shall be one in the map.
constexpr double kClosedShare = 0.95;
// Length of walls that a map may have twice, m.
constexpr double kMostDrawnTwice = 0.5;

// A map with structure may be so much worse than the one without, as a share
// and m, and may bend the building by so many degrees.
constexpr double kWorseShare = 1.05;
constexpr double kWorseBy = 0.003;
constexpr double kBendDeg = 0.3;

// Between these the ratio of errors to covariances is sound.
constexpr double kSmallestRatio = 0.6;
constexpr double kLargestRatio = 1.5;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// A figure that is of something: an error of nothing is not 0.
double Known(double value, bool is_known) { return is_known ? value : kNan; }

double Median(std::vector<double> values) {
  if (values.empty()) return kNan;
  std::sort(values.begin(), values.end());
  const std::size_t half = values.size() / 2;
  return values.size() % 2 == 1 ? values[half]
                                : 0.5 * (values[half - 1] + values[half]);
}

Values ValuesOf(const Consistency& consistency) {
  return {{"ratio", consistency.ratio()},
          {"ratio_of_each_wall", consistency.mean_wall_ratio},
          {"degrees_of_freedom",
           static_cast<double>(consistency.degrees_of_freedom)},
          {"offset_error", consistency.offset_error},
          {"offset_sigma", consistency.offset_sigma},
          {"direction_error_deg", consistency.direction_error_deg},
          {"direction_sigma_deg", consistency.direction_sigma_deg}};
}

double Sum(const ExperimentResult& result, const std::string& shape,
           const char* name) {
  const std::vector<double> values = Column(result, shape, name);
  return std::accumulate(values.begin(), values.end(), 0.0);
}

// What a plan of a simulated building shall be.
void AddPlanClaims(const std::string& shape, ExperimentResult* result) {
  const auto add_share = [&](const std::string& what, const char* part,
                             const char* whole, double bound, bool is_least) {
    const double count = Sum(*result, shape, whole);
    if (count <= 0.0) return;
    Claim claim;
    claim.text = shape + ": " + what;
    claim.required =
        (is_least ? "at least " : "at most ") + Format("%g", bound);
    claim.measured =
        ShareEstimate(static_cast<int>(std::lround(Sum(*result, shape, part))),
                      static_cast<int>(std::lround(count)));
    claim.holds = is_least ? claim.measured.value >= bound
                           : claim.measured.value <= bound;
    result->claims.push_back(std::move(claim));
  };
  const auto add_mean = [&](const std::string& what, const char* name,
                            double bound, bool is_least) {
    std::vector<double> values = Column(*result, shape, name);
    const bool has_trials = !values.empty();
    values.erase(std::remove_if(values.begin(), values.end(),
                                [](double value) { return std::isnan(value); }),
                 values.end());
    // Of nothing, as the widths of doors where none was driven through.
    if (has_trials && values.empty()) return;
    Claim claim;
    claim.text = shape + ": " + what;
    claim.required =
        (is_least ? "at least " : "at most ") + Format("%g", bound);
    claim.measured = MeanEstimate(values);
    claim.holds = is_least ? claim.measured.value >= bound
                           : claim.measured.value <= bound;
    result->claims.push_back(std::move(claim));
  };
  add_share("rooms found of those entered", "rooms_found", "rooms", 0.97, true);
  add_share("rooms of the plan that are none", "rooms_false", "rooms_drawn",
            0.01, false);
  add_mean("mean IoU of rooms entered", "rooms_iou", 0.9, true);
  add_share("doors found of those driven through", "doors_found", "doors", 0.97,
            true);
  add_share("doors of the plan that are none", "doors_false", "doors_drawn",
            0.03, false);
  add_mean("mean error of a door's width, m", "door_width_error", 0.05, false);
  add_share("ends of walls that meet nothing", "wall_ends_free", "wall_ends",
            0.1, false);
  add_mean("walls of the plan that are drawn twice", "plan_walls_twice", 0.0,
           false);
}

// The figures of a trial of B1.
std::vector<std::pair<std::string, double>> FiguresOf(
    const BuildingTrial& run) {
  const ClosureEvaluation& closures = run.closures;
  return {{"scans", static_cast<double>(run.scans)},
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
          {"drawn_twice", run.map.doubled_length},
          {"offset_error",
           Known(run.map.offset_error.mean, run.map.offset_error.count > 0)},
          {"direction_error_deg", Known(run.map.direction_error_deg.mean,
                                        run.map.direction_error_deg.count > 0)},
          {"position_error", run.mean_position_error},
          {"rooms", run.plan.rooms.asked},
          {"rooms_found", run.plan.rooms.found},
          {"rooms_iou", run.plan.rooms.mean_iou},
          {"rooms_drawn", run.plan.rooms.drawn},
          {"rooms_false", run.plan.rooms.not_true},
          {"doors", run.plan.doors_asked},
          {"doors_found", run.plan.doors_found},
          {"doors_drawn", run.plan.doors_drawn},
          {"doors_false", run.plan.doors_false},
          {"door_width_error",
           Known(run.plan.door_width_error, run.plan.doors_found > 0)},
          {"wall_completeness", run.plan.wall_completeness},
          {"wall_correctness", run.plan.wall_correctness},
          {"wall_ends", run.plan.ends},
          {"wall_ends_free", run.plan.free_ends},
          {"plan_walls_twice", run.plan.double_walls}};
}

// What closures and walls of buildings of a shape shall be.
void AddClosureClaims(ExperimentResult* result) {
  for (const std::string& shape : BuildingShapes()) {
    std::vector<double> without;
    for (const double wrong : Column(*result, shape, "closures_wrong")) {
      without.push_back(wrong == 0.0 ? 1.0 : 0.0);
    }
    AddShare(shape + ": no wrong closure in the final map", without, 20,
             result);
  }
  for (const std::string& shape : BuildingShapes()) {
    const auto revisits =
        static_cast<int>(std::lround(Sum(*result, shape, "revisits")));
    const auto closed =
        static_cast<int>(std::lround(Sum(*result, shape, "revisits_closed")));
    // Walls that were grown from all visits at once need no closure.
    if (revisits == 0) continue;
    Claim claim;
    claim.text = shape + ": revisits closed (" + std::to_string(closed) +
                 " of " + std::to_string(revisits) + ")";
    claim.required = "at least " + Format("%g", kClosedShare);
    claim.measured = ShareEstimate(closed, revisits);
    claim.holds = closed >= kClosedShare * revisits;
    result->claims.push_back(std::move(claim));
  }
  for (const std::string& shape : BuildingShapes()) {
    Claim claim;
    claim.text = shape + ": walls drawn twice, m for each building";
    claim.required = "at most " + Format("%g", kMostDrawnTwice);
    claim.measured = MeanEstimate(Column(*result, shape, "drawn_twice"));
    claim.holds = claim.measured.value <= kMostDrawnTwice;
    result->claims.push_back(std::move(claim));
  }
}

}  // namespace

void RunB1(const ExperimentOptions& options, const Registry& registry,
           ExperimentResult* result) {
  result->title = "Loop closures in simulated buildings of several shapes";
  result->paper =
      "The paper closes no loops and names global data association as what "
      "would help most.";
  std::vector<Job> jobs;
  for (const std::string& shape : BuildingShapes()) {
    const auto run_trial = [shape, &options, &registry](Job* self) {
      const BuildingTrial run = RunBuildingTrial(
          MakeWorld(shape, self->seed, 1.0), SimulatorOptions(), self->seed,
          registry, SolverOptions(options), options.stop);
      if (run.is_stopped) return;
      self->values = FiguresOf(run);
      if (self->seed == options.seed) {
        MapDrawing drawing = run.drawing;
        drawing.title = "B1: " + shape;
        self->maps.emplace_back(shape, drawing);
      }
    };
    AddTrials(options, shape, run_trial, &jobs);
  }
  RunJobs(options, &jobs);
  Collect(&jobs, result);
  if (result->interrupted) return;
  AddClosureClaims(result);
  for (const std::string& shape : BuildingShapes()) {
    AddPlanClaims(shape, result);
  }
  result->notes.push_back(
      "Rooms that the robot was in are asked for, and doors that it drove "
      "through; a room of a plan is false when it is not the one with most in "
      "common with a true room, or less than half of it lies there.");
  result->notes.push_back(
      "A closure is wrong when it joins segments of different true walls; "
      "closures_near join a shut door and the wall that it is in. Errors are "
      "m.");
}

void RunB2(const ExperimentOptions& options, const Registry& registry,
           ExperimentResult* result) {
  result->title = "Two corridors that meet at a small angle";
  result->paper =
      "The paper's buildings have right angles only, and structure is broken "
      "where the measurements contradict it.";
  static const SolveMode kModes[] = {
      {"none", false, false, Refinement::kFull},
      {"structure", true, true, Refinement::kFull}};
  static const int kBends[] = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10};
  std::vector<Job> jobs;
  for (const bool has_niches : {false, true}) {
    for (const int bend : kBends) {
      for (const SolveMode& mode : kModes) {
        const auto run_trial = [=, &mode, &options, &registry](Job* self) {
          BentOptions bent = has_niches ? NichesOptions() : BentOptions();
          bent.bend_deg = bend;
          const BuildingTrial run = RunBuildingTrial(
              MakeBentWorld(bent, self->seed), SimulatorOptions(), self->seed,
              registry, SolverOptions(options, mode), options.stop);
          if (run.is_stopped) return;
          self->values = {{"position_error", run.mean_position_error},
                          {"bend_error_deg", Known(run.map.bend_error_deg,
                                                   run.map.is_bend_known)}};
        };
        AddTrials(options,
                  std::string(has_niches ? "niches " : "plain ") +
                      std::to_string(bend) + " deg, " + mode.name,
                  run_trial, &jobs);
      }
    }
  }
  RunJobs(options, &jobs);
  Collect(&jobs, result);
  if (result->interrupted) return;
  for (const char* kind : {"plain ", "niches "}) {
    std::vector<double> no_worse;
    std::vector<double> right;
    for (const int bend : kBends) {
      const std::string condition = kind + std::to_string(bend) + " deg, ";
      const std::vector<double> none =
          Column(*result, condition + "none", "position_error");
      const std::vector<double> with =
          Column(*result, condition + "structure", "position_error");
      for (std::size_t i = 0; i < std::min(none.size(), with.size()); ++i) {
        no_worse.push_back(with[i] <=
                           std::max(kWorseShare * none[i], none[i] + kWorseBy));
      }
      for (const char* mode : {"none", "structure"}) {
        for (const double error :
             Column(*result, condition + mode, "bend_error_deg")) {
          right.push_back(error <= kBendDeg);
        }
      }
    }
    AddShare(std::string(kind) + "corridors: structure is no worse than none",
             no_worse, 20, result);
    AddShare(std::string(kind) + "corridors: the bend is right to 0.3 degrees",
             right, 20, result);
  }
  result->notes.push_back(
      "position_error: m, the trajectory laid on the true one as a whole. "
      "bend_error_deg: how far the map turns one corridor against the other. "
      "Without structure nothing closes loops and poses are found again on a "
      "map that stays as it is.");
}

void RunN1(const ExperimentOptions& options, const Registry& registry,
           ExperimentResult* result) {
  result->title = "Errors of walls against their covariances (NEES)";
  result->paper =
      "The paper reports no covariances; structure is judged by them all the "
      "same.";
  static const SolveMode kModes[] = {
      {"none", false, false, Refinement::kMap},
      {"structure alone", true, false, Refinement::kMap},
      {"default", true, true, Refinement::kFull}};
  static const char* const kShapes[] = {"office", "killian_like"};
  std::vector<std::string> conditions;
  std::vector<Job> jobs;
  for (const char* shape : kShapes) {
    for (const SolveMode& mode : kModes) {
      const auto run_trial = [=, &mode, &options, &registry](Job* self) {
        const BuildingTrial run = RunBuildingTrial(
            MakeWorld(shape, self->seed, 1.0), SimulatorOptions(), self->seed,
            registry, SolverOptions(options, mode), options.stop);
        if (run.is_stopped) return;
        self->values = ValuesOf(run.consistency);
      };
      conditions.push_back(std::string(shape) + ", " + mode.name);
      AddTrials(options, conditions.back(), run_trial, &jobs);
    }
  }
  for (const bool has_structure : {false, true}) {
    const auto run_trial = [=, &options, &registry](Job* self) {
      SyntheticWorld world = MakeSyntheticWorld(
          "S1", DefaultSyntheticOptions("S1"), self->seed, registry);
      SyntheticRunOptions run_options;
      run_options.seed = self->seed;
      run_options.stop = options.stop;
      if (has_structure) RunOnWorld(registry, run_options, &world);
      const auto session =
          MakeSession(run_options, registry, world.graph.get());
      if (!has_structure) session->SolveGlobal();
      if (options.stop && options.stop()) return;
      self->values = ValuesOf(
          EvaluatePointConsistency(*world.graph, *session, world.truth));
    };
    conditions.emplace_back(has_structure ? "S1, structure" : "S1, distances");
    AddTrials(options, conditions.back(), run_trial, &jobs);
  }
  RunJobs(options, &jobs);
  Collect(&jobs, result);
  if (result->interrupted) return;
  for (const std::string& condition : conditions) {
    const std::vector<double> ratios = Column(*result, condition, "ratio");
    Claim claim;
    claim.text = condition + ": median ratio of NEES to degrees of freedom";
    claim.required =
        Format("%g", kSmallestRatio) + " to " + Format("%g", kLargestRatio);
    claim.measured = Bootstrap(
        ratios.size(), [&ratios](const std::vector<std::size_t>& trials) {
          std::vector<double> drawn;
          for (const std::size_t i : trials) drawn.push_back(ratios[i]);
          return Median(std::move(drawn));
        });
    claim.holds = claim.measured.value >= kSmallestRatio &&
                  claim.measured.value <= kLargestRatio;
    result->claims.push_back(std::move(claim));
  }
  result->notes.push_back(
      "ratio: 1 is right, below 1 covariances are too wide, above 1 too small. "
      "Of walls that lie on one true wall as a whole, in the frame that fits "
      "best (generalized least squares); offsets in m. S1: of points, each of "
      "two coordinates.");
}

}  // namespace plumbline
