#include <plumbline/apps/experiments/synthetic_run.h>
#include <plumbline/core/session.h>
#include <plumbline/detectors/default_hierarchy.h>
#include <plumbline/factors/angle.h>

#include <algorithm>
#include <string>
#include <utility>

namespace plumbline {

const char kSyntheticHierarchy[] =
    "line_ransac,circle_ransac/center_cluster,orientation_mixture/"
    "orientation_relation";
const char kUnweightedLoss[] = "unweighted";

namespace {

double Tolerance(const Registry& registry, const SyntheticRunOptions& options,
                 const std::string& detector, const std::string& name,
                 double fallback) {
  const auto given = options.detector_parameters.find(detector);
  if (given != options.detector_parameters.end() &&
      given->second.count(name) > 0) {
    return given->second.at(name);
  }
  const DetectorType* type = registry.FindDetector(detector);
  if (type == nullptr || type->defaults().count(name) == 0) return fallback;
  return type->defaults().at(name);
}

}  // namespace

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

SyntheticRun::Phase MakePhase(const EmPhase& phase, double error) {
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

}  // namespace plumbline
