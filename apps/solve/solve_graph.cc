#include <gflags/gflags.h>
#include <plumbline/apps/cli/app.h>
#include <plumbline/apps/cli/progress.h>
#include <plumbline/apps/solve/flag_remarks.h>
#include <plumbline/apps/solve/log_input.h>
#include <plumbline/apps/solve/reading_meter.h>
#include <plumbline/apps/solve/run_outputs.h>
#include <plumbline/apps/solve/run_summary.h>
#include <plumbline/apps/solve/solve_graph.h>
#include <plumbline/apps/solve_flags.h>
#include <plumbline/core/error.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/graph_g2o.h>
#include <plumbline/core/initial_guess.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/stopwatch.h>
#include <plumbline/core/utf8.h>
#include <plumbline/outputs/marginals_output.h>
#include <plumbline/pipeline/graph_solver.h>
#include <plumbline/pipeline/without_structure.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

// Reads a graph; nothing when that was interrupted.
std::optional<G2oFile> ReadGraph(InputStream* input, const Registry& registry,
                                 RunClock* clock, Graph* graph) {
  const ReadingProgress progress(input, clock);
  std::string text = input->ReadRest();
  if (InterruptRequested()) {
    clock->bar().Finish();
    std::fprintf(stderr, "interrupted: the graph is not read whole\n");
    return std::nullopt;
  }
  if (!input->damage().empty()) {
    throw Error(input->name(), 0, input->damage(), "a whole graph");
  }
  return ReadG2o(std::move(text), input->name(), registry, graph,
                 G2oOptionsFromFlags());
}

// Without --structure, what the file has of it is no part of the graph either:
// the map and graph.g2o have the measurements only.
void LeaveOutStructureOf(const InputStream& input, Graph* graph) {
  if (FLAGS_structure) return;
  const LeftOutStructure left_out = LeaveOutStructure(graph);
  if (left_out.constraints == 0 && left_out.features == 0) return;
  Remark(
      "%s: --structure=false leaves out its structure, %lld constraints and "
      "%lld virtual features: what is written has measurements only",
      input.name().c_str(), static_cast<long long>(left_out.constraints),
      static_cast<long long>(left_out.features));
}

// Places the features where --initial_guess says.
void PlaceStart(const InputStream& input, const G2oFile& g2o, Graph* graph,
                Summary::Solver* figures) {
  InitialGuessOptions start = InitialGuessOptionsFromFlags();
  if (!g2o.named_by_edges.empty() &&
      start.method == InitialGuessMethod::kFile) {
    if (!gflags::GetCommandLineFlagInfoOrDie("initial_guess").is_default) {
      throw Error("--initial_guess", 0,
                  "'file', but " + input.name() + " lists edges only",
                  "odometry, spanning_tree or chordal");
    }
    start.method = InitialGuessMethod::kChordal;
    Remark("%s: lists edges only: poses start by --initial_guess=chordal",
           input.name().c_str());
  }
  if (start.method == InitialGuessMethod::kFile) return;
  const Stopwatch watch;
  const InitialGuessReport made = MakeInitialGuess(start, graph);
  figures->start_poses = made.poses;
  figures->start_landmarks = made.landmarks;
  figures->start_kept = made.kept;
  figures->start_seconds = watch.Seconds();
  Detail("start: %lld poses in %d parts and %lld landmarks placed, %lld kept",
         static_cast<long long>(made.poses), made.parts,
         static_cast<long long>(made.landmarks),
         static_cast<long long>(made.kept));
}

// What may help where the solver did not converge. A chordal start needs
// relative poses.
std::string HintOf(const Graph& graph) {
  const std::vector<const Constraint*> constraints = graph.Constraints();
  const bool has_relative_poses = std::any_of(
      constraints.begin(), constraints.end(), [](const Constraint* constraint) {
        return constraint->type->Is(RelationRole::kPose) &&
               constraint->features.size() == 2;
      });
  const bool may_start_chordal =
      has_relative_poses &&
      InitialGuessOptionsFromFlags().method != InitialGuessMethod::kChordal;
  return std::string(may_start_chordal ? "--initial_guess=chordal or a" : "a") +
         " larger --max_solver_iterations may help";
}

// What the summary says of the solves of a graph.
void SummarizeSolves(const GraphSolverResult& result,
                     Summary::Solver* figures) {
  figures->solves = result.num_solves;
  figures->converged = result.solves.converged;
  figures->iterations = result.solves.iterations;
  figures->evaluation_seconds = result.solves.evaluation_seconds;
  figures->linear_solver_seconds = result.solves.linear_solver_seconds;
  figures->setup_seconds = result.solves.setup_seconds;
}

// What a run builds.
struct SolvedGraph {
  Graph graph;
  std::optional<G2oFile> g2o;
  std::optional<GraphSolver> solver;
  GraphSolverResult result;
  SolveOutcome outcome;
};

}  // namespace

int SolveGraph(InputStream* input, const RunContext& run) {
  const Registry& registry = run.registry;
  RunClock* const clock = run.clock;
  // Goes with the process, which ends soon: to take it down would take as long
  // as to read a small graph.
  static auto* const solved = new SolvedGraph;
  SolveOutcome& outcome = solved->outcome;
  Summary& summary = outcome.summary;
  summary = BeginSummary();
  const GraphSolverOptions options = GraphSolverOptionsFromFlags(registry);
  RemarkOnFlags(input->name(), "graph", "logs", LogFlags());

  clock->bar().Plan({{"reading", 0.5},
                     {"first guess", 0.1},
                     {"solving", 1.0},
                     {"writing", 0.3}});
  clock->Begin("reading");
  const ReadingMeter reading;
  Graph& graph = solved->graph;
  std::optional<G2oFile>& g2o = solved->g2o;
  g2o = ReadGraph(input, registry, clock, &graph);
  if (!g2o) return kExitInterrupted;
  summary.reading = reading.Read();
  for (const auto& tag : g2o->unknown_tags) {
    Remark("%s: %d lines with the unknown tag %s kept as they are",
           input->name().c_str(), tag.second, PrintableUtf8(tag.first).c_str());
  }

  LeaveOutStructureOf(*input, &graph);
  if (!g2o->cut_tag.empty()) {
    Remark(
        "%s: may break off: its last line, '%s', does not end and is the "
        "beginning of a tag",
        input->name().c_str(), PrintableUtf8(g2o->cut_tag).c_str());
  }

  if (!FLAGS_marginals_hold_gauge) {
    CheckGauge(graph, ParseMarginalsSelection(FLAGS_marginals, registry));
  }
  Summary::Solver figures;
  clock->Begin("first guess");
  PlaceStart(*input, *g2o, &graph, &figures);

  ForFlag("hierarchy", [&] { MakeGraphHierarchy(options, graph, registry); });
  GraphSolver& solver = solved->solver.emplace(registry, options, &graph);
  if (!std::isfinite(solver.initial_cost().total())) {
    throw Error(input->name(), 0,
                "the sum of squared residuals at the start is no finite number",
                "smaller values, or less information");
  }
  GraphSolverResult& result = solved->result;
  {
    clock->Begin("solving");
    std::vector<EmPhase> trace;
    result = solver.Run(
        [clock] {
          clock->bar().Update();
          return InterruptRequested();
        },
        [&](const EmPhase& phase) {
          TellPhase(phase);
          if (!run.live->is_on()) return;
          trace.push_back(phase);
          run.live->Show(
              {graph, trace, [] { return std::vector<Pose2>(); }}, [&] {
                return "solving, iteration " + std::to_string(phase.iteration) +
                       ": " + phase.phase;
              });
        });
  }
  clock->Begin("figures");
  Summarize(result.initial_cost, result.final_cost, result.em, &summary);
  SummarizeSolves(result, &figures);
  if (!figures.converged) figures.hint = HintOf(graph);
  summary.solver = figures;
  if (!figures.converged && result.em.converged()) {
    Remark(
        "%s: a solve did not reach its tolerance, but nothing moves any more",
        input->name().c_str());
  } else if (!figures.converged) {
    const std::string& why = result.solves.message;
    Remark("%s: the solver did not converge%s; %s", input->name().c_str(),
           why.empty() ? "" : (" (" + why + ")").c_str(), figures.hint.c_str());
  }
  outcome.graph = &graph;
  outcome.registry = &registry;
  outcome.trace = std::move(result.trace);
  if (!InterruptRequested()) TakeMarginals(&solver.session(), &outcome);
  outcome.g2o = &*g2o;
  outcome.without_structure = [&] {
    MapWithoutStructure map;
    map.interrupted = InterruptRequested();
    if (!map.interrupted) map.features = SolveWithoutStructure(graph, registry);
    return map;
  };
  outcome.title = TitleOf(input->name());
  FinishRun(run, 1, &outcome);
  return kExitSuccess;
}

}  // namespace plumbline
