#include <plumbline/apps/experiments/concentricity.h>
#include <plumbline/apps/experiments/experiment_jobs.h>
#include <plumbline/apps/experiments/synthetic_experiments.h>
#include <plumbline/apps/experiments/synthetic_run.h>
#include <plumbline/detectors/default_hierarchy.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <string>
#include <utility>

namespace plumbline {
namespace {

// S6: tolerance of two circles that are concentric, m. As wide as the noise of
// the centres, so that circles that truly share one are not broken apart as
// their weights fall; and a tight one, to which the noise is much.
constexpr double kConcentricSigma = 0.1;
constexpr double kTightSigma = 0.02;
// That of a common centre of six circles which pulls as all their pairs do with
// the first one: sum_ij |c_i - c_j|^2 = n sum_i |c_i - mean|^2.
constexpr double kAsTightAsPairs = kConcentricSigma * 0.4082482904638630;

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
  values.emplace_back("converged", run.em.converged() ? 1.0 : 0.0);
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
    AddTrials(
        options, the_case.condition,
        [&the_case, &options, &registry](Job* self) {
          RunCase(the_case, options, registry, self);
        },
        &jobs);
  }
  RunJobs(options, &jobs);
  Collect(&jobs, result);
  return jobs;
}

const char kPointError[] = "mean position error of a point, m";

// Says what breaking wrong structure brings over keeping it at its weight.
void NoteBreakingOverWeighing(const std::string& broken,
                              const std::string& weighed,
                              ExperimentResult* result) {
  const auto count = [&](const std::string& condition, const char* name) {
    return Format("%.1f", Mean(Column(*result, condition, name)));
  };
  result->notes.push_back(
      "What delta breaks, over what it only weighs (the paper's Eq. 8): ratio "
      "of the errors " +
      FormatEstimate(
          RatioOfMeans(*result, ErrorName("structure"), broken, weighed)) +
      "; 1 means that breaking brings nothing. Wrong virtual features for each "
      "trial " +
      count(broken, "virtual_false") + " and " +
      count(weighed, "virtual_false") + ", wrong supports " +
      count(broken, "supports_false") + " and " +
      count(weighed, "supports_false") + ".");
}

}  // namespace

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
  std::vector<Case> cases(3);
  cases[0].condition = "without outliers";
  cases[0].world = "S1";
  cases[1].condition = "20 outliers";
  cases[1].world = "S4";
  // Errors are those of the points on structure: the same ones in both.
  cases[1].with_outliers = false;
  cases[2] = cases[1];
  cases[2].condition = "20 outliers, kept, weighted by delta";
  cases[2].break_constraints = false;
  cases[1].maps = "";
  for (Case& the_case : cases) {
    the_case.world_options = DefaultSyntheticOptions(the_case.world);
  }
  const std::vector<Job> jobs = RunCases(cases, options, registry, result);

  AddBound("error with outliers / error without",
           RatioOfMeans(*result, ErrorName("structure"), cases[1].condition,
                        cases[0].condition),
           1.25, result);
  std::vector<double> outside;
  for (const double tied :
       Column(*result, "20 outliers", "outliers_in_models")) {
    outside.push_back(tied == 0.0 ? 1.0 : 0.0);
  }
  AddShare("all outliers left outside every model", outside, 20, result);
  NoteBreakingOverWeighing(cases[1].condition, cases[2].condition, result);
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

  AddBound("error when removed / error when kept",
           RatioOfMeans(*result, ErrorName("structure"), cases[2].condition,
                        cases[0].condition),
           0.5, result);
  NoteBreakingOverWeighing(cases[2].condition, cases[1].condition, result);
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

namespace {

// -- S6 -----------------------------------------------------------------------

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
      {"converged", report.converged() ? 1.0 : 0.0}};
}

}  // namespace

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
  const auto add = [&](std::size_t i, double sigma) {
    const auto method = static_cast<Concentricity>(i + 1);
    conditions.back().push_back(methods[i] + Format(", %.2g m", sigma));
    AddTrials(
        options, conditions.back().back(),
        [method, sigma, &options, &registry](Job* self) {
          RunConcentricity(method, sigma, options, registry, self);
        },
        &jobs);
  };
  for (const double sigma : {kConcentricSigma, kTightSigma}) {
    conditions.emplace_back();
    for (std::size_t i = 0; i < methods.size(); ++i) add(i, sigma);
  }
  conditions.emplace_back();
  add(3, kAsTightAsPairs);
  RunJobs(options, &jobs);
  Collect(&jobs, result);
  AddShare("method 4 isolates the outlier and keeps the others together",
           Column(*result, conditions[0][3], "right"), 20, result);
  result->notes.push_back(
      "Isolates the outlier and keeps the others together, and the mean error, "
      "m:");
  for (const std::vector<std::string>& group : conditions) {
    for (const std::string& condition : group) {
      const auto right = Column(*result, condition, "right");
      result->notes.push_back(
          "  method " + condition + " of tolerance: " +
          std::to_string(std::count(right.begin(), right.end(), 1.0)) + " of " +
          std::to_string(right.size()) + ", " +
          FormatEstimate(MeanEstimate(
              Column(*result, condition, ErrorName("structure")))));
    }
  }
  result->notes.push_back(
      "All pairs of n circles with a tolerance t pull as a common centre with "
      "t / sqrt(n) does: the last row is method 4 with the pull of method 3 at "
      "0.1 m.");
  // The last group is no comparison of methods.
  for (std::size_t i = 0; i + 1 < conditions.size(); ++i) {
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

}  // namespace plumbline
