#include <plumbline/apps/evaluation/relations.h>
#include <plumbline/apps/experiments/building_trial.h>
#include <plumbline/apps/experiments/experiments.h>
#include <plumbline/core/atomic_file.h>
#include <plumbline/core/error.h>
#include <plumbline/core/session.h>
#include <plumbline/detectors/default_hierarchy.h>
#include <plumbline/factors/angle.h>
#include <plumbline/frontend/carmen_reader.h>
#include <plumbline/outputs/summary.h>
#include <plumbline/pipeline/log_solver.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <limits>
#include <memory>
#include <mutex>
#include <numeric>
#include <set>
#include <thread>

namespace plumbline {

const char kSyntheticHierarchy[] =
    "line_ransac,circle_ransac/center_cluster,orientation_mixture/"
    "orientation_relation";
const char kUnweightedLoss[] = "unweighted";

namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
// Curves of the error are drawn this far; what comes later moves little.
constexpr int kDrawnIterations = 6;
// S6: tolerance of two circles that are concentric, m. As wide as the noise of
// the centres, so that circles that truly share one are not broken apart as
// their weights fall; and a tight one, to which the noise is much.
constexpr double kConcentricSigma = 0.1;
constexpr double kTightSigma = 0.02;
// R2: the first part of the log, scans.
constexpr std::size_t kFirstPart = 4500;
// B1: of the walls seen on several visits so many shall be one in the map.
constexpr double kClosedShare = 0.95;

using Values = std::vector<std::pair<std::string, double>>;
using Phases = std::vector<SyntheticRun::Phase>;

// One run of a trial under one condition: writes into its own slot.
struct Job {
  std::string condition;
  std::uint64_t seed = 1;
  std::function<void(Job*)> run;
  Values values;
  Phases phases;
  std::vector<std::pair<std::string, MapDrawing>> maps;
  bool is_done = false;
};

bool IsStopped(const ExperimentOptions& options) {
  return options.stop && options.stop();
}

// Runs the jobs on options.num_threads threads. The first exception, in the
// order of jobs, is thrown again when all threads have ended.
void RunJobs(const ExperimentOptions& options, std::vector<Job>* jobs) {
  std::vector<std::exception_ptr> failures(jobs->size());
  std::atomic<std::size_t> next{0};
  std::mutex mutex;
  int done = 0;
  const auto work = [&] {
    for (std::size_t i = next++; i < jobs->size(); i = next++) {
      if (IsStopped(options)) return;
      Job& job = (*jobs)[i];
      try {
        job.run(&job);
        // What was cut short is not whole.
        job.is_done = !IsStopped(options);
      } catch (...) {
        failures[i] = std::current_exception();
        next = jobs->size();
      }
      const std::lock_guard<std::mutex> lock(mutex);
      ++done;
      if (options.progress) {
        options.progress(done, static_cast<int>(jobs->size()));
      }
    }
  };
  std::vector<std::thread> threads;
  for (int i = 1; i < options.num_threads; ++i) threads.emplace_back(work);
  work();
  for (std::thread& thread : threads) thread.join();
  for (const std::exception_ptr& failure : failures) {
    if (failure) std::rethrow_exception(failure);
  }
}

// Moves what the jobs measured into the result.
void Collect(std::vector<Job>* jobs, ExperimentResult* result) {
  for (Job& job : *jobs) {
    if (!job.is_done) {
      result->interrupted = true;
      continue;
    }
    result->trials.push_back({job.condition, job.seed, std::move(job.values)});
    for (auto& map : job.maps) result->maps.push_back(std::move(map));
  }
}

// Of the trials under a condition, in the order of seeds.
std::vector<double> Column(const ExperimentResult& result,
                           const std::string& condition,
                           const std::string& name) {
  std::vector<double> values;
  for (const TrialRow& row : result.trials) {
    if (row.condition == condition) values.push_back(row.Get(name));
  }
  return values;
}

double Mean(const std::vector<double>& values) {
  if (values.empty()) return kNan;
  return std::accumulate(values.begin(), values.end(), 0.0) /
         static_cast<double>(values.size());
}

std::string Format(const char* format, double value) {
  char text[64];
  std::snprintf(text, sizeof(text), format, value);
  return text;
}

std::string FormatEstimate(const Estimate& estimate) {
  if (!std::isfinite(estimate.value)) return "-";
  if (estimate.low == estimate.value && estimate.high == estimate.value) {
    return Format("%.4g", estimate.value);
  }
  return Format("%.4g", estimate.value) + " [" + Format("%.4g", estimate.low) +
         ", " + Format("%.4g", estimate.high) + "]";
}

std::string ErrorName(const std::string& name) { return "error_" + name; }

void AddCounts(const std::string& name, const MatchCount& count,
               Values* values) {
  values->emplace_back(name + "_found", count.found);
  values->emplace_back(name + "_missed", count.missed);
  values->emplace_back(name + "_false", count.wrong);
}

Values ValuesOf(const SyntheticRun& run, const OracleErrors& oracle) {
  Values values = {{ErrorName("start"), run.start_error},
                   {ErrorName("distances"), run.distances_error},
                   {ErrorName("structure"), run.final_error},
                   {ErrorName("oracle"), oracle.full},
                   {ErrorName("oracle_weighted"), oracle.weighted}};
  AddCounts("virtual", run.match.all(), &values);
  AddCounts("lines", run.match.lines, &values);
  AddCounts("circles", run.match.circles, &values);
  AddCounts("centers", run.match.centers, &values);
  AddCounts("orientations", run.match.orientations, &values);
  AddCounts("supports", run.match.supports, &values);
  values.emplace_back("exact", run.match.is_exact() ? 1.0 : 0.0);
  values.emplace_back("outliers_in_models", run.match.tied_outliers);
  values.emplace_back("iterations", run.em.iterations);
  values.emplace_back("converged", run.em.converged ? 1.0 : 0.0);
  return values;
}

SyntheticRunOptions RunOptions(const ExperimentOptions& options,
                               std::uint64_t seed) {
  SyntheticRunOptions run;
  run.delta_mode = options.delta_mode;
  run.delta_threshold = options.delta_threshold;
  run.full_weight_test = options.full_weight_test;
  run.hierarchy = options.hierarchy;
  run.detector_parameters = options.detector_parameters;
  run.seed = seed;
  run.stop = options.stop;
  return run;
}

std::unique_ptr<SolverSession> MakeSession(const SyntheticRunOptions& options,
                                           const Registry& registry,
                                           Graph* graph) {
  SessionOptions session;
  session.delta_mode = options.delta_mode;
  // The error of the distances alone is that of their optimum, which a start
  // far from it takes more than the usual number of steps to reach.
  session.max_iterations = 200;
  return std::make_unique<SolverSession>(graph, registry, session);
}

double Tolerance(const Registry& registry, const SyntheticRunOptions& options,
                 const std::string& detector, const std::string& name,
                 double fallback) {
  const auto given = options.detector_parameters.find(detector);
  if (given != options.detector_parameters.end() &&
      given->second.count(name) > 0) {
    return given->second.at(name);
  }
  const DetectorType* type = registry.FindDetector(detector);
  if (type == nullptr || type->defaults.count(name) == 0) return fallback;
  return type->defaults.at(name);
}

// -- Curves -------------------------------------------------------------------

// What a person calls the phases of the EM loop.
std::string PhaseLabel(const SyntheticRun::Phase& phase) {
  static const std::map<std::string, std::string> labels = {
      {"start", "start"},
      {"measurements", "distances"},
      {"optimize", "solve"},
      {"break", "break"},
      {"detect_0", "detect level 0"},
      {"detect_1", "detect level 1"},
      {"detect_2", "detect level 2"},
      {"final", "solve"}};
  const auto found = labels.find(phase.name);
  const std::string name = found == labels.end() ? phase.name : found->second;
  return phase.iteration > 0 ? std::to_string(phase.iteration) + ": " + name
                             : name;
}

// Errors over the phases of the EM loop, a line a condition: the mean over the
// trials, each holding its last value when it has ended, with its confidence
// interval.
LinePlot EvolutionPlot(const std::vector<Job>& jobs,
                       const std::vector<std::string>& conditions,
                       const std::string& title, const std::string& y_label) {
  LinePlot plot;
  plot.title = title;
  plot.x_label = "phase of the EM loop";
  plot.y_label = y_label;
  plot.height = 540;
  std::map<std::pair<int, int>, std::string> axis;
  for (const Job& job : jobs) {
    for (const SyntheticRun::Phase& phase : job.phases) {
      if (phase.iteration > kDrawnIterations) continue;
      axis.emplace(std::make_pair(phase.iteration, phase.order),
                   PhaseLabel(phase));
    }
  }
  double x = 0.0;
  for (const auto& [key, label] : axis) plot.x_ticks.emplace_back(x++, label);
  for (const std::string& condition : conditions) {
    PlotSeries series;
    series.name = condition;
    x = 0.0;
    for (const auto& entry : axis) {
      std::vector<double> errors;
      for (const Job& job : jobs) {
        if (!job.is_done || job.condition != condition) continue;
        double error = kNan;
        for (const SyntheticRun::Phase& phase : job.phases) {
          if (std::make_pair(phase.iteration, phase.order) <= entry.first) {
            error = phase.error;
          }
        }
        errors.push_back(error);
      }
      const Estimate mean = MeanEstimate(errors);
      series.x.push_back(x++);
      series.y.push_back(mean.value);
      series.low.push_back(mean.low);
      series.high.push_back(mean.high);
    }
    plot.series.push_back(std::move(series));
  }
  return plot;
}

void AddLevel(const std::string& name, double y, int color, LinePlot* plot) {
  PlotSeries series;
  series.name = name;
  series.dashed = true;
  series.color = color;
  series.x = {0.0, static_cast<double>(plot->x_ticks.size()) - 1.0};
  series.y = {y, y};
  plot->series.push_back(std::move(series));
}

// -- Claims -------------------------------------------------------------------

void AddBound(const std::string& text, const Estimate& measured, double bound,
              ExperimentResult* result) {
  result->claims.push_back({text, "at most " + Format("%g", bound), measured,
                            measured.value <= bound});
}

// `successes` of the trials must be at least `required` of 20.
void AddShare(const std::string& text, const std::vector<double>& successes,
              int required, ExperimentResult* result) {
  const int count =
      static_cast<int>(std::count(successes.begin(), successes.end(), 1.0));
  const int trials = static_cast<int>(successes.size());
  Claim claim;
  claim.text = text + " (" + std::to_string(count) + " of " +
               std::to_string(trials) + ")";
  claim.required = "in at least " + std::to_string(required) + " of 20 trials";
  claim.measured = ShareEstimate(count, trials);
  claim.holds = trials > 0 && count * 20 >= required * trials;
  result->claims.push_back(std::move(claim));
}

// -- S1 to S5 -----------------------------------------------------------------

// A world under one condition.
struct Case {
  std::string condition;
  std::string world;
  SyntheticOptions world_options;
  // Empty: that of the options.
  std::string delta_mode;
  bool break_constraints = true;
  bool with_outliers = true;
  StructureMatchOptions match;
  // Draws maps of the first trial, with this before their names; null: none.
  const char* maps = nullptr;
};

void RunCase(const Case& the_case, const ExperimentOptions& options,
             const Registry& registry, Job* job) {
  SyntheticRunOptions run_options = RunOptions(options, job->seed);
  if (!the_case.delta_mode.empty()) {
    run_options.delta_mode = the_case.delta_mode;
  }
  run_options.break_constraints = the_case.break_constraints;
  run_options.with_outliers = the_case.with_outliers;
  run_options.match = the_case.match;
  const auto make = [&] {
    return MakeSyntheticWorld(the_case.world, the_case.world_options, job->seed,
                              registry);
  };
  SyntheticWorld world = make();
  const bool draws = the_case.maps != nullptr && job->seed == options.seed;
  const auto draw = [&](const char* name, const std::string& title) {
    MapDrawing drawing = DrawingFromGraph(*world.graph, {});
    drawing.title = title;
    job->maps.emplace_back(the_case.maps + std::string(name), drawing);
  };
  if (draws) draw("start", the_case.world + ": start");
  const SyntheticRun run = RunOnWorld(registry, run_options, &world);
  if (draws) draw("structure", the_case.world + ": with structure");
  world = make();
  const OracleErrors oracle = RunOracle(registry, run_options, &world);
  if (draws) {
    world = make();
    MakeSession(run_options, registry, world.graph.get())->SolveGlobal();
    draw("distances", the_case.world + ": distances only");
  }
  job->values = ValuesOf(run, oracle);
  job->phases = run.phases;
}

std::vector<Job> RunCases(const std::vector<Case>& cases,
                          const ExperimentOptions& options,
                          const Registry& registry, ExperimentResult* result) {
  std::vector<Job> jobs;
  for (const Case& the_case : cases) {
    for (int trial = 0; trial < options.trials; ++trial) {
      Job job;
      job.condition = the_case.condition;
      job.seed = options.seed + static_cast<std::uint64_t>(trial);
      job.run = [&the_case, &options, &registry](Job* self) {
        RunCase(the_case, options, registry, self);
      };
      jobs.push_back(std::move(job));
    }
  }
  RunJobs(options, &jobs);
  Collect(&jobs, result);
  return jobs;
}

const char kPointError[] = "mean position error of a point, m";

void RunS1(const ExperimentOptions& options, const Registry& registry,
           ExperimentResult* result) {
  result->title = "Structure in a map of 572 points and 1193 distances";
  result->paper =
      "28 virtual features are found; the error falls far below that of the "
      "distances alone, with a drop at each detection (Figs. 4 to 6).";
  const std::string name = "S1";
  Case the_case;
  the_case.condition = name;
  the_case.world = name;
  the_case.world_options = DefaultSyntheticOptions(name);
  the_case.maps = "";
  const std::vector<Job> jobs = RunCases({the_case}, options, registry, result);

  const auto structure = Column(*result, name, ErrorName("structure"));
  const auto distances = Column(*result, name, ErrorName("distances"));
  const auto oracle = Column(*result, name, ErrorName("oracle"));
  AddShare("all 28 virtual features found and no false one",
           Column(*result, name, "exact"), 18, result);
  AddBound("error with structure / error with the true structure given",
           RatioEstimate(structure, oracle), 1.1, result);
  AddBound("error with structure / error with distances only",
           RatioEstimate(structure, distances), 0.6, result);
  const auto weighted = Column(*result, name, ErrorName("oracle_weighted"));
  result->notes.push_back(
      "The oracle's structure has its full weight. What was found is weighed "
      "by delta, which is below 1 for right structure, too. Against an oracle "
      "whose structure is weighed the same way the error is, as a ratio, " +
      FormatEstimate(RatioEstimate(structure, weighted)) + ".");
  LinePlot plot =
      EvolutionPlot(jobs, {name},
                    "S1: error with structure, " +
                        std::to_string(structure.size()) + " trials",
                    kPointError);
  plot.series[0].name = "with structure";
  AddLevel("distances only", Mean(distances), 1, &plot);
  AddLevel("true structure given", Mean(oracle), 2, &plot);
  AddLevel("the same, weighed by delta", Mean(weighted), 3, &plot);
  result->plots.push_back(std::move(plot));
}

void RunS2(const ExperimentOptions& options, const Registry& registry,
           ExperimentResult* result) {
  result->title = "Initial noise";
  result->paper =
      "0.05 to 0.3 m of initial noise scarcely affect the final error or the "
      "number of iterations.";
  std::vector<Case> cases;
  std::vector<double> noises;
  for (int step = 1; step <= 6; ++step) {
    noises.push_back(0.05 * step);
    Case the_case;
    the_case.condition = "noise " + Format("%.2f m", noises.back());
    the_case.world = "S2";
    the_case.world_options = DefaultSyntheticOptions("S2");
    the_case.world_options.position_noise = noises.back();
    cases.push_back(std::move(the_case));
  }
  RunCases(cases, options, registry, result);

  // Trials of the same seed have the same distances at all noises: they are
  // drawn together.
  std::vector<std::vector<double>> errors;
  std::size_t trials = std::numeric_limits<std::size_t>::max();
  for (const Case& the_case : cases) {
    errors.push_back(
        Column(*result, the_case.condition, ErrorName("structure")));
    trials = std::min(trials, errors.back().size());
  }
  const Estimate change =
      Bootstrap(trials, [&](const std::vector<std::size_t>& indices) {
        double low = std::numeric_limits<double>::infinity();
        double high = 0.0;
        for (const std::vector<double>& column : errors) {
          double sum = 0.0;
          for (const std::size_t i : indices) sum += column[i];
          low = std::min(low, sum);
          high = std::max(high, sum);
        }
        return high / low - 1.0;
      });
  AddBound("largest mean error / smallest mean error - 1", change, 0.25,
           result);

  LinePlot plot;
  plot.title = "S2: error and initial noise";
  plot.x_label = "initial noise, m";
  plot.y_label = kPointError;
  LinePlot iterations = plot;
  iterations.title = "S2: EM iterations and initial noise";
  iterations.y_label = "EM iterations";
  const auto add = [&](const std::string& name, const std::string& value,
                       LinePlot* target) {
    PlotSeries series;
    series.name = name;
    series.markers = true;
    series.x = noises;
    for (const Case& the_case : cases) {
      const Estimate mean =
          MeanEstimate(Column(*result, the_case.condition, value));
      series.y.push_back(mean.value);
      series.low.push_back(mean.low);
      series.high.push_back(mean.high);
    }
    target->series.push_back(std::move(series));
  };
  add("with structure", ErrorName("structure"), &plot);
  add("distances only", ErrorName("distances"), &plot);
  add("true structure given", ErrorName("oracle"), &plot);
  add("", "iterations", &iterations);
  result->plots = {plot, iterations};
}

void RunS3(const ExperimentOptions& options, const Registry& registry,
           ExperimentResult* result) {
  result->title = "Noise of the distances";
  result->paper =
      "With 0.1 m of noise the distances alone lead to a worse map in which "
      "structure is found in part, and still helps (Figs. 7 and 8).";
  std::vector<Case> cases;
  for (const double noise : {0.01, 0.1}) {
    Case the_case;
    the_case.condition = "distance noise " + Format("%.2f m", noise);
    the_case.world = "S3";
    the_case.world_options = DefaultSyntheticOptions("S3");
    the_case.world_options.distance_noise = noise;
    cases.push_back(std::move(the_case));
  }
  const std::vector<Job> jobs = RunCases(cases, options, registry, result);

  const std::string& noisy = cases.back().condition;
  const auto structure = Column(*result, noisy, ErrorName("structure"));
  const auto distances = Column(*result, noisy, ErrorName("distances"));
  std::vector<double> better;
  for (std::size_t i = 0; i < structure.size(); ++i) {
    better.push_back(structure[i] < distances[i] ? 1.0 : 0.0);
  }
  AddShare("0.1 m: error with structure below that of distances only", better,
           19, result);
  for (const Case& the_case : cases) {
    LinePlot plot = EvolutionPlot(jobs, {the_case.condition},
                                  "S3: " + the_case.condition, kPointError);
    plot.series[0].name = "with structure";
    AddLevel("distances only",
             Mean(Column(*result, the_case.condition, ErrorName("distances"))),
             1, &plot);
    AddLevel("true structure given",
             Mean(Column(*result, the_case.condition, ErrorName("oracle"))), 2,
             &plot);
    result->plots.push_back(std::move(plot));
  }
}

void RunS4(const ExperimentOptions& options, const Registry& registry,
           ExperimentResult* result) {
  result->title = "20 random points";
  result->paper =
      "Structure detection is robust against outliers, and delta removes wrong "
      "constraints (Fig. 9).";
  std::vector<Case> cases(2);
  cases[0].condition = "without outliers";
  cases[0].world = "S1";
  cases[1].condition = "20 outliers";
  cases[1].world = "S4";
  // Errors are those of the points on structure: the same ones in both.
  cases[1].with_outliers = false;
  cases[1].maps = "";
  for (Case& the_case : cases) {
    the_case.world_options = DefaultSyntheticOptions(the_case.world);
  }
  const std::vector<Job> jobs = RunCases(cases, options, registry, result);

  const auto with = Column(*result, "20 outliers", ErrorName("structure"));
  auto without = Column(*result, "without outliers", ErrorName("structure"));
  without.resize(std::min(with.size(), without.size()), kNan);
  AddBound(
      "error with outliers / error without",
      RatioEstimate({with.begin(), with.begin() + without.size()}, without),
      1.25, result);
  std::vector<double> outside;
  for (const double tied :
       Column(*result, "20 outliers", "outliers_in_models")) {
    outside.push_back(tied == 0.0 ? 1.0 : 0.0);
  }
  AddShare("all outliers left outside every model", outside, 20, result);
  LinePlot plot = EvolutionPlot(jobs, {"20 outliers", "without outliers"},
                                "S4: error with 20 outliers", kPointError);
  AddLevel("distances only, 20 outliers",
           Mean(Column(*result, "20 outliers", ErrorName("distances"))), 0,
           &plot);
  result->plots.push_back(std::move(plot));
}

void RunS5(const ExperimentOptions& options, const Registry& registry,
           ExperimentResult* result) {
  result->title = "Rows of trees that only nearly stand in a line";
  result->paper =
      "Keeping the wrong structure leaves an error of 0.10 m, removing it by "
      "delta 0.035 m, less than without structure (Figs. 13 to 15).";
  std::vector<Case> cases(3);
  cases[0].condition = "wrong structure kept";
  cases[0].delta_mode = kUnweightedLoss;
  cases[0].break_constraints = false;
  cases[0].maps = "kept_";
  cases[1].condition = "kept, weighted by delta";
  cases[1].break_constraints = false;
  cases[2].condition = "removed by delta";
  cases[2].maps = "removed_";
  for (Case& the_case : cases) {
    the_case.world = "S5";
    the_case.world_options = DefaultSyntheticOptions("S5");
  }
  const std::vector<Job> jobs = RunCases(cases, options, registry, result);

  const auto kept = Column(*result, cases[0].condition, ErrorName("structure"));
  auto removed = Column(*result, cases[2].condition, ErrorName("structure"));
  removed.resize(std::min(kept.size(), removed.size()), kNan);
  AddBound(
      "error when removed / error when kept",
      RatioEstimate(removed, {kept.begin(), kept.begin() + removed.size()}),
      0.5, result);
  result->notes.push_back(
      "'kept' lets every constraint pull with its full weight to the end; "
      "'weighted' keeps all of them but lets delta weigh them.");
  LinePlot plot = EvolutionPlot(
      jobs, {cases[0].condition, cases[1].condition, cases[2].condition},
      "S5: error with wrong structure kept and removed", kPointError);
  AddLevel("distances only",
           Mean(Column(*result, cases[2].condition, ErrorName("distances"))), 6,
           &plot);
  result->plots.push_back(std::move(plot));
}

// -- S6 -----------------------------------------------------------------------

Phases::value_type MakePhase(const EmPhase& phase, double error) {
  SyntheticRun::Phase entry;
  entry.iteration = phase.iteration;
  entry.name = phase.phase;
  entry.error = error;
  if (phase.phase.rfind("detect_", 0) == 0) {
    entry.order = 2 + std::stoi(phase.phase.substr(7));
  } else if (phase.phase == "break") {
    entry.order = 1;
  }
  return entry;
}

void RunConcentricity(Concentricity method, double sigma,
                      const ExperimentOptions& options,
                      const Registry& registry, Job* job) {
  SyntheticWorld world = MakeSyntheticWorld("S6", DefaultSyntheticOptions("S6"),
                                            job->seed, registry);
  const SyntheticRunOptions run_options = RunOptions(options, job->seed);
  const auto session = MakeSession(run_options, registry, world.graph.get());
  session->SolveGlobal();
  const double start = MeanPositionError(*world.graph, world.truth);
  job->phases.push_back({0, -1, "start", start});
  AddConcentricity(method, sigma, registry, world.graph.get());
  EmOptions em_options;
  em_options.delta_threshold = options.delta_threshold;
  em_options.full_weight_test = options.full_weight_test;
  em_options.loop_tolerance = kPointsLoopTolerance;
  em_options.seed = job->seed;
  EmOrchestrator em(world.graph.get(), session.get(), registry, Hierarchy(),
                    em_options);
  em.SetTrace([&](const EmPhase& phase) {
    job->phases.push_back(
        MakePhase(phase, MeanPositionError(*world.graph, world.truth)));
  });
  const EmReport report = em.Run(options.stop);
  const ConcentricityResult check =
      CheckConcentricity(*world.graph, world.truth);
  int live = 0;
  int broken = 0;
  for (const Constraint* constraint :
       std::as_const(*world.graph).Constraints()) {
    if (constraint->kind != ConstraintClass::kStructure) continue;
    ++(constraint->state == ConstraintState::kLive ? live : broken);
  }
  job->values = {
      {ErrorName("start"), start},
      {ErrorName("structure"), MeanPositionError(*world.graph, world.truth)},
      {"outlier_isolated", check.is_isolated ? 1.0 : 0.0},
      {"others_connected", check.is_intact ? 1.0 : 0.0},
      {"right", check.is_isolated && check.is_intact ? 1.0 : 0.0},
      {"live", static_cast<double>(live)},
      {"broken", static_cast<double>(broken)},
      {"iterations", static_cast<double>(report.iterations)},
      {"converged", report.converged ? 1.0 : 0.0}};
}

void RunS6(const ExperimentOptions& options, const Registry& registry,
           ExperimentResult* result) {
  result->title = "Four ways to say that circles are concentric";
  result->paper =
      "A common virtual centre alone tells the circle that is not concentric "
      "from the others and keeps these together, in all of 20 runs, with the "
      "smallest error (Figs. 10 to 12).";
  const std::vector<std::string> methods = {"1: each and the next",
                                            "2: all to one", "3: all pairs",
                                            "4: common centre"};
  std::vector<Job> jobs;
  std::vector<std::vector<std::string>> conditions;
  for (const double sigma : {kConcentricSigma, kTightSigma}) {
    conditions.emplace_back();
    for (std::size_t i = 0; i < methods.size(); ++i) {
      conditions.back().push_back(methods[i] + Format(", %g m", sigma));
      for (int trial = 0; trial < options.trials; ++trial) {
        Job job;
        job.condition = conditions.back().back();
        job.seed = options.seed + static_cast<std::uint64_t>(trial);
        const auto method = static_cast<Concentricity>(i + 1);
        job.run = [method, sigma, &options, &registry](Job* self) {
          RunConcentricity(method, sigma, options, registry, self);
        };
        jobs.push_back(std::move(job));
      }
    }
  }
  RunJobs(options, &jobs);
  Collect(&jobs, result);
  AddShare("method 4 isolates the outlier and keeps the others together",
           Column(*result, conditions[0][3], "right"), 20, result);
  result->notes.push_back(
      "Isolates the outlier and keeps the others together:");
  for (const std::vector<std::string>& group : conditions) {
    for (const std::string& condition : group) {
      const auto right = Column(*result, condition, "right");
      result->notes.push_back(
          "  method " + condition + " of tolerance: " +
          std::to_string(std::count(right.begin(), right.end(), 1.0)) + " of " +
          std::to_string(right.size()));
    }
  }
  for (std::size_t i = 0; i < conditions.size(); ++i) {
    result->plots.push_back(EvolutionPlot(
        jobs, conditions[i],
        "S6: error by way of concentricity, tolerance" +
            Format(" %g m", i == 0 ? kConcentricSigma : kTightSigma),
        "mean position error of a circle, m"));
    for (std::size_t k = 0; k < methods.size(); ++k) {
      result->plots.back().series[k].name = methods[k];
    }
  }
}

// -- R1 and R2 ----------------------------------------------------------------

double Seconds() {
  return std::chrono::duration<double>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

void RunLog(const std::string& log_file, const std::string& relations_file,
            std::size_t max_scans, const ExperimentOptions& options,
            const Registry& registry, ExperimentResult* result) {
  if (options.datasets.empty()) {
    result->skipped =
        "PLUMBLINE_DATASETS is not set: it names the folder with " + log_file;
    return;
  }
  const std::string log_path = options.datasets + "/" + log_file;
  if (!std::filesystem::exists(log_path)) {
    result->skipped = log_path + " is not there";
    return;
  }
  Log log = ReadCarmenLog(log_path, LaserOptions());
  if (max_scans > 0 && log.scans.size() > max_scans) {
    log.scans.resize(max_scans);
  }
  const std::vector<Relation> relations =
      ReadRelations(options.datasets + "/" + relations_file);
  const std::vector<std::string> conditions = {"without structure",
                                               "with structure"};
  std::vector<Job> jobs;
  for (const bool structure : {false, true}) {
    Job job;
    job.condition = conditions[structure ? 1 : 0];
    job.seed = options.seed;
    job.run = [structure, &log, &relations, &options, &registry,
               result](Job* self) {
      LogSolverOptions solver_options;
      solver_options.structure = structure;
      solver_options.session.delta_mode = options.delta_mode;
      solver_options.em.delta_threshold = options.delta_threshold;
      solver_options.em.seed = options.seed;
      LogSolver solver(registry, solver_options);
      const double begin = Seconds();
      const LogSolverResult solved =
          solver.Run(log, {nullptr, options.stop, nullptr});
      const double seconds = Seconds() - begin;
      if (solved.interrupted) return;
      std::vector<TimedPose> trajectory(solved.trajectory.size());
      for (std::size_t i = 0; i < trajectory.size(); ++i) {
        trajectory[i].timestamp = log.scans[i].timestamp;
        trajectory[i].pose = solved.trajectory[i];
      }
      const RelationEvaluation evaluation =
          EvaluateRelations(trajectory, relations);
      self->values = {
          {"orthogonality_deg",
           OrthogonalityDeg(solver.graph()).value_or(kNan)},
          {"translation_mean", evaluation.translation.mean},
          {"translation_std", evaluation.translation.standard_deviation},
          {"translation_max", evaluation.translation.maximum},
          {"rotation_mean_deg", evaluation.rotation_deg.mean},
          {"relations", static_cast<double>(evaluation.errors.size())},
          {"scans", static_cast<double>(log.scans.size())},
          {"seconds", seconds}};
      MapDrawing drawing = DrawingFromGraph(solver.graph(), solved.trajectory);
      drawing.title = result->id + ": " + self->condition;
      self->maps.emplace_back(structure ? "with" : "without", drawing);
    };
    jobs.push_back(std::move(job));
  }
  RunJobs(options, &jobs);
  Collect(&jobs, result);
  if (result->interrupted) return;
  for (const char* value : {"orthogonality_deg", "translation_mean"}) {
    AddBound(std::string(value) + " with structure / without",
             RatioEstimate(Column(*result, conditions[1], value),
                           Column(*result, conditions[0], value)),
             1.0, result);
  }
  result->notes.push_back(
      "One run each way: a ratio below 1 means better with structure. Errors "
      "are those of Kuemmerle et al. 2009, m and degrees.");
}

void RunR1(const ExperimentOptions& options, const Registry& registry,
           ExperimentResult* result) {
  result->title = "MIT Killian Court";
  result->paper =
      "Without structure the map is inconsistent and not orthogonal, in 38 s; "
      "with structure it is orthogonal, in 72 s (Pentium D, 3.2 GHz; Figs. 17 "
      "and 18).";
  RunLog("mit-killian.clf.bz2", "mit-killian.relations", 0, options, registry,
         result);
}

void RunR2(const ExperimentOptions& options, const Registry& registry,
           ExperimentResult* result) {
  result->title = "Intel Research Lab, first part";
  result->paper =
      "Better with structure than without, even with slightly curved walls "
      "(Figs. 19 and 20).";
  RunLog("intel.clf.bz2", "intel.relations", kFirstPart, options, registry,
         result);
}

// -- B1 -----------------------------------------------------------------------

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

using Runner = void (*)(const ExperimentOptions&, const Registry&,
                        ExperimentResult*);

const std::vector<std::pair<std::string, Runner>>& Runners() {
  static const std::vector<std::pair<std::string, Runner>> runners = {
      {"S1", RunS1}, {"S2", RunS2}, {"S3", RunS3}, {"S4", RunS4}, {"S5", RunS5},
      {"S6", RunS6}, {"R1", RunR1}, {"R2", RunR2}, {"B1", RunB1}};
  return runners;
}

// Empty for what is not a number.
std::string CsvNumber(double value) {
  return std::isfinite(value) ? Format("%.9g", value) : std::string();
}

}  // namespace

double TrialRow::Get(const std::string& name) const {
  for (const auto& [key, value] : values) {
    if (key == name) return value;
  }
  throw PLUMBLINE_ERROR("no value '" + name + "' in a trial of " + condition,
                        "one that the experiment measures");
}

const std::vector<std::string>& ExperimentNames() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> list;
    for (const auto& runner : Runners()) list.push_back(runner.first);
    return list;
  }();
  return names;
}

ExperimentResult RunExperiment(const std::string& id,
                               const ExperimentOptions& options,
                               Registry* registry) {
  if (options.trials < 1 || options.num_threads < 1) {
    throw PLUMBLINE_ERROR("trials or threads are less than 1", "at least 1");
  }
  if (registry->FindLoss(kUnweightedLoss) == nullptr) {
    LossType type;
    type.name = kUnweightedLoss;
    type.description = "full weight whatever the residual (for comparison)";
    type.make_loss = [](const double*, int) {
      return std::unique_ptr<ceres::LossFunction>();
    };
    registry->Register(std::move(type));
  }
  for (const auto& [name, run] : Runners()) {
    if (name != id) continue;
    ExperimentResult result;
    result.id = id;
    run(options, *registry, &result);
    return result;
  }
  std::string known;
  for (const std::string& name : ExperimentNames()) {
    known += (known.empty() ? "" : ", ") + name;
  }
  throw PLUMBLINE_ERROR("no experiment is called '" + id + "'", known);
}

SyntheticRun RunOnWorld(const Registry& registry,
                        const SyntheticRunOptions& options,
                        SyntheticWorld* world) {
  SyntheticRun run;
  const auto error = [&] {
    return MeanPositionError(*world->graph, world->truth,
                             options.with_outliers);
  };
  const auto session = MakeSession(options, registry, world->graph.get());
  EmOptions em_options;
  em_options.delta_threshold = options.delta_threshold;
  em_options.break_constraints = options.break_constraints;
  em_options.full_weight_test = options.full_weight_test;
  em_options.loop_tolerance = kPointsLoopTolerance;
  em_options.seed = options.seed;
  EmOrchestrator em(world->graph.get(), session.get(), registry,
                    MakeHierarchy(ParseHierarchy(options.hierarchy), registry,
                                  {"point"}, options.detector_parameters),
                    em_options);
  run.start_error = error();
  run.phases.push_back({0, -1, "start", run.start_error});
  // EM does not solve for the distances alone to the end.
  std::vector<std::vector<double>> start;
  for (const Feature* feature : std::as_const(*world->graph).Features()) {
    start.emplace_back(feature->data(), feature->data() + feature->type->size);
  }
  session->SolveGlobal();
  run.distances_error = error();
  std::size_t next = 0;
  for (Feature* feature : world->graph->MutableFeatures()) {
    std::copy(start[next].begin(), start[next].end(), feature->data());
    ++next;
  }
  em.SetTrace([&](const EmPhase& phase) {
    run.phases.push_back(MakePhase(phase, error()));
  });
  run.em = em.Run(options.stop);
  run.final_error = error();
  run.match = MatchStructure(*world->graph, world->truth, options.match);
  return run;
}

OracleErrors RunOracle(const Registry& registry,
                       const SyntheticRunOptions& options,
                       SyntheticWorld* world) {
  const auto session = MakeSession(options, registry, world->graph.get());
  session->SolveGlobal();
  TrueStructureTolerances tolerances;
  const auto tolerance = [&](const char* detector, const char* name,
                             double fallback) {
    return Tolerance(registry, options, detector, name, fallback);
  };
  tolerances.line = tolerance("line_ransac", "sigma", tolerances.line);
  tolerances.circle = tolerance("circle_ransac", "sigma", tolerances.circle);
  tolerances.center = tolerance("center_cluster", "sigma", tolerances.center);
  tolerances.orientation = DegToRad(tolerance(
      "orientation_mixture", "sigma_deg", RadToDeg(tolerances.orientation)));
  tolerances.relation = DegToRad(tolerance("orientation_relation", "sigma_deg",
                                           RadToDeg(tolerances.relation)));
  AddTrueStructure(world->truth, tolerances, registry, world->graph.get());
  session->SolveGlobal();
  OracleErrors errors;
  errors.full =
      MeanPositionError(*world->graph, world->truth, options.with_outliers);
  EmOptions em_options;
  em_options.break_constraints = false;
  em_options.full_weight_test = options.full_weight_test;
  em_options.loop_tolerance = kPointsLoopTolerance;
  EmOrchestrator em(world->graph.get(), session.get(), registry, Hierarchy(),
                    em_options);
  em.Run(options.stop);
  errors.weighted =
      MeanPositionError(*world->graph, world->truth, options.with_outliers);
  return errors;
}

void AddConcentricity(Concentricity method, double sigma,
                      const Registry& registry, Graph* graph) {
  std::vector<FeatureId> circles;
  Eigen::Vector2d center = Eigen::Vector2d::Zero();
  for (const Feature* feature : std::as_const(*graph).Features()) {
    if (feature->level == 0 && feature->type->name == "circle") {
      circles.push_back(feature->id);
      center += Eigen::Vector2d(feature->parameters[0], feature->parameters[1]);
    }
  }
  if (circles.empty()) return;
  Transaction transaction;
  const auto add = [&](FeatureId a, FeatureId b) {
    Constraint constraint;
    constraint.type = &registry.GetRelation("point_point_coincidence");
    constraint.features = {a, b};
    constraint.expected = Eigen::Vector2d::Zero();
    constraint.information = Eigen::Matrix2d::Identity() / (sigma * sigma);
    constraint.kind = ConstraintClass::kStructure;
    constraint.source = "concentricity";
    transaction.AddConstraint(std::move(constraint));
  };
  const std::size_t n = circles.size();
  switch (method) {
    case Concentricity::kChain:
      for (std::size_t i = 1; i < n; ++i) add(circles[i - 1], circles[i]);
      break;
    case Concentricity::kStar:
      for (std::size_t i = 1; i < n; ++i) add(circles[0], circles[i]);
      break;
    case Concentricity::kAllPairs:
      for (std::size_t i = 0; i < n; ++i) {
        for (std::size_t j = i + 1; j < n; ++j) add(circles[i], circles[j]);
      }
      break;
    case Concentricity::kCommonCenter: {
      center /= static_cast<double>(n);
      Feature feature;
      feature.type = &registry.GetFeature("point");
      feature.level = 1;
      feature.is_virtual = true;
      feature.source = "concentricity";
      feature.parameters = {center.x(), center.y()};
      const FeatureId id = transaction.AddFeature(feature);
      for (const FeatureId circle : circles) add(id, circle);
      break;
    }
  }
  graph->Apply(std::move(transaction));
}

ConcentricityResult CheckConcentricity(const Graph& graph,
                                       const SyntheticTruth& truth) {
  ConcentricityResult result;
  const std::set<FeatureId> outliers(truth.outliers.begin(),
                                     truth.outliers.end());
  std::map<FeatureId, std::vector<FeatureId>> neighbours;
  result.is_isolated = true;
  for (const Constraint* constraint : graph.Constraints()) {
    if (constraint->kind != ConstraintClass::kStructure ||
        constraint->state != ConstraintState::kLive) {
      continue;
    }
    for (const FeatureId id : constraint->features) {
      if (outliers.count(id) > 0) result.is_isolated = false;
      for (const FeatureId other : constraint->features) {
        if (other != id) neighbours[id].push_back(other);
      }
    }
  }
  // Circles that the first one which is no outlier reaches past none.
  std::vector<FeatureId> circles;
  for (const Feature* feature : graph.Features()) {
    if (feature->level == 0 && feature->type->name == "circle" &&
        outliers.count(feature->id) == 0) {
      circles.push_back(feature->id);
    }
  }
  if (circles.empty()) return result;
  std::set<FeatureId> seen = {circles.front()};
  std::vector<FeatureId> queue = {circles.front()};
  for (std::size_t i = 0; i < queue.size(); ++i) {
    for (const FeatureId other : neighbours[queue[i]]) {
      if (outliers.count(other) == 0 && seen.insert(other).second) {
        queue.push_back(other);
      }
    }
  }
  result.is_intact =
      std::all_of(circles.begin(), circles.end(),
                  [&seen](FeatureId id) { return seen.count(id) > 0; });
  return result;
}

std::vector<SummaryRow> Summarize(const ExperimentResult& result) {
  std::vector<std::string> conditions;
  for (const TrialRow& row : result.trials) {
    if (std::find(conditions.begin(), conditions.end(), row.condition) ==
        conditions.end()) {
      conditions.push_back(row.condition);
    }
  }
  std::vector<SummaryRow> rows;
  for (const std::string& condition : conditions) {
    for (const auto& [name, value] : result.trials.front().values) {
      SummaryRow row;
      row.condition = condition;
      row.quantity = name;
      const std::vector<double> values = Column(result, condition, name);
      row.trials = static_cast<int>(values.size());
      row.mean = MeanEstimate(values);
      rows.push_back(std::move(row));
    }
  }
  return rows;
}

void WriteTrials(const ExperimentResult& result, std::ostream& output) {
  output << "experiment,condition,seed";
  if (!result.trials.empty()) {
    for (const auto& value : result.trials.front().values) {
      output << ',' << value.first;
    }
  }
  output << '\n';
  for (const TrialRow& row : result.trials) {
    output << result.id << ",\"" << row.condition << "\"," << row.seed;
    for (const auto& value : row.values) {
      output << ',' << CsvNumber(value.second);
    }
    output << '\n';
  }
}

void WriteExperimentSummary(const ExperimentResult& result,
                            std::ostream& output) {
  output << result.id << ": " << result.title << "\n\nPaper: " << result.paper
         << "\n\n";
  if (!result.skipped.empty()) {
    output << "Skipped: " << result.skipped << '\n';
    return;
  }
  if (result.interrupted) output << "Cut short: not all trials are whole.\n\n";
  for (const Claim& claim : result.claims) {
    output << (claim.holds ? "  holds   " : "  FAILS   ") << claim.text << ": "
           << FormatEstimate(claim.measured) << ", required " << claim.required
           << '\n';
  }
  if (!result.claims.empty()) output << '\n';
  for (const std::string& note : result.notes) output << note << '\n';
  if (!result.notes.empty()) output << '\n';
  output << "Means with 95 % confidence intervals\n";
  std::string condition;
  for (const SummaryRow& row : Summarize(result)) {
    if (row.condition != condition) {
      condition = row.condition;
      output << "\n  " << condition << " (" << row.trials << " trials)\n";
    }
    char line[160];
    std::snprintf(line, sizeof(line), "    %-22s %s\n", row.quantity.c_str(),
                  FormatEstimate(row.mean).c_str());
    output << line;
  }
}

void WriteExperiment(const ExperimentResult& result,
                     const std::string& folder) {
  const std::string base = folder + "/" + result.id;
  WriteFileAtomically(base + "_summary.txt", [&](std::ostream& output) {
    WriteExperimentSummary(result, output);
  });
  if (!result.skipped.empty()) return;
  WriteFileAtomically(base + ".csv", [&](std::ostream& output) {
    WriteTrials(result, output);
  });
  WriteFileAtomically(base + "_summary.csv", [&](std::ostream& output) {
    output << "experiment,condition,quantity,trials,mean,ci95_low,ci95_high\n";
    for (const SummaryRow& row : Summarize(result)) {
      output << result.id << ",\"" << row.condition << "\"," << row.quantity
             << ',' << row.trials << ',' << CsvNumber(row.mean.value) << ','
             << CsvNumber(row.mean.low) << ',' << CsvNumber(row.mean.high)
             << '\n';
    }
  });
  if (!result.plots.empty()) {
    WriteFileAtomically(base + ".svg", [&](std::ostream& output) {
      output << PlotSvg(result.plots);
    });
  }
  for (const auto& [name, drawing] : result.maps) {
    WriteMapSvg(drawing, base + "_" + name + ".svg");
  }
}

}  // namespace plumbline
