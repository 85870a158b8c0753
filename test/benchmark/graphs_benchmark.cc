// Public graphs: what the orchestrator takes to converge beside a program that
// gives the same factors to Ceres and nothing else.

#include <benchmark/benchmark.h>
#include <ceres/ceres.h>
#include <dlfcn.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/em.h>
#include <plumbline/core/error.h>
#include <plumbline/core/graph_g2o.h>
#include <plumbline/core/information.h>
#include <plumbline/core/initial_guess.h>
#include <plumbline/core/session.h>
#include <plumbline/factors/line_manifold.h>
#include <plumbline/factors/point_line_distance.h>
#include <plumbline/factors/pose_line.h>
#include <plumbline/factors/pose_point.h>
#include <plumbline/factors/pose_pose.h>
#include <plumbline/frontend/input_stream.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "benchmark/benchmark_util.h"

namespace plumbline {
namespace {

constexpr int kMaxIterations = 500;

const Registry& Builtins() {
  static const Registry* const registry = [] {
    auto* made = new Registry;
    RegisterBuiltinRelations(made);
    return made;
  }();
  return *registry;
}

// The same as the session does around its solves: some builds of CHOLMOD start
// a hard-coded number of threads.
void MakeOpenMpSerial() {
  const auto set = reinterpret_cast<void (*)(int)>(
      dlsym(RTLD_DEFAULT, "omp_set_max_active_levels"));
  if (set != nullptr) set(0);
}

// What a file says, without this project's graph.
struct PlainGraph {
  struct Edge {
    enum class Kind { kPose, kPoint, kLine, kPointOnLine };
    Kind kind;
    int first;
    int second;
    Eigen::Vector3d expected;
    Eigen::Matrix3d information;
  };
  std::vector<std::array<double, 3>> blocks;
  std::vector<int> lines;
  std::vector<Edge> edges;
};

PlainGraph MakePlain(const Graph& graph) {
  using Kind = PlainGraph::Edge::Kind;
  const std::map<std::string, Kind> kinds = {
      {"pose_pose", Kind::kPose},
      {"pose_point", Kind::kPoint},
      {"pose_line", Kind::kLine},
      {"point_line_distance", Kind::kPointOnLine}};
  PlainGraph plain;
  for (const Feature* feature : graph.Features()) {
    if (feature->type->name == "line") {
      plain.lines.push_back(static_cast<int>(feature->id));
    }
    plain.blocks.push_back({feature->parameters[0], feature->parameters[1],
                            feature->parameters[2]});
  }
  for (const Constraint* constraint : graph.Constraints()) {
    PlainGraph::Edge edge;
    const auto kind = kinds.find(constraint->type->name);
    if (kind == kinds.end()) {
      throw Error("graphs_benchmark", 0, "a " + constraint->type->name,
                  "graphs of poses, points and lines");
    }
    edge.kind = kind->second;
    edge.first = static_cast<int>(constraint->features[0]);
    edge.second = static_cast<int>(constraint->features[1]);
    const int size = constraint->type->residual_size;
    edge.expected.head(size) = constraint->expected;
    edge.information.topLeftCorner(size, size) = constraint->information;
    plain.edges.push_back(edge);
  }
  return plain;
}

ceres::CostFunction* MakeCost(const PlainGraph::Edge& edge) {
  using Kind = PlainGraph::Edge::Kind;
  const Eigen::Vector2d origin = Eigen::Vector2d::Zero();
  const Eigen::Vector2d expected = edge.expected.head<2>();
  const Eigen::Matrix2d information = edge.information.topLeftCorner<2, 2>();
  switch (edge.kind) {
    case Kind::kPose:
      return PosePose::Create(edge.expected, SqrtInformation(edge.information));
    case Kind::kPoint:
      return PosePoint::Create(expected, SqrtInformation(information));
    case Kind::kLine:
      return PoseLine::Create(expected, origin, SqrtInformation(information));
    case Kind::kPointOnLine:
      return PointLineDistance::Create<2>(expected[0], origin,
                                          std::sqrt(information(0, 0)));
  }
  return nullptr;
}

// A bare program: one problem, one solve, the settings that the session has.
// Appends what it takes until the solution is there, without taking down.
ceres::Solver::Summary SolveBare(PlainGraph* graph,
                                 std::vector<double>* seconds) {
  const double begin = CpuSeconds();
  ceres::Problem problem;
  for (const PlainGraph::Edge& edge : graph->edges) {
    ceres::CostFunction* cost = MakeCost(edge);
    problem.AddResidualBlock(
        cost, nullptr,
        graph->blocks[static_cast<std::size_t>(edge.first)].data(),
        graph->blocks[static_cast<std::size_t>(edge.second)].data());
  }
  for (const int line : graph->lines) {
    problem.SetManifold(graph->blocks[static_cast<std::size_t>(line)].data(),
                        new LineManifold);
  }
  problem.SetParameterBlockConstant(graph->blocks[0].data());
  const SessionOptions session;
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.sparse_linear_algebra_library_type = ceres::SUITE_SPARSE;
  options.max_num_iterations = kMaxIterations;
  options.function_tolerance = session.function_tolerance;
  options.parameter_tolerance = 1e-12;
  options.initial_trust_region_radius = session.initial_trust_region_radius;
  options.max_num_consecutive_invalid_steps = 20;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  seconds->push_back(CpuSeconds() - begin);
  return summary;
}

void Converge(benchmark::State& state, const std::string& path,
              InitialGuessMethod method) {
  MakeOpenMpSerial();
  Graph graph;
  InputStream input(path);
  std::istringstream text(input.ReadRest());
  ReadG2o(text, path, Builtins(), &graph);
  InitialGuessOptions guess;
  guess.method = method;
  const double start_seconds =
      CpuSecondsOf([&] { MakeInitialGuess(guess, &graph); });
  const PlainGraph plain = MakePlain(graph);
  std::vector<std::array<double, kMaxFeatureSize>> start;
  for (const Feature* feature : std::as_const(graph).Features()) {
    start.push_back(feature->parameters);
  }

  std::vector<double> own;
  std::vector<double> bare;
  std::vector<double> makes;
  SolveReport report;
  ceres::Solver::Summary summary;
  double objective = 0.0;
  const auto run_own = [&] {
    std::size_t next = 0;
    for (Feature* feature : graph.MutableFeatures()) {
      feature->parameters = start[next++];
    }
    SessionOptions options;
    options.max_iterations = kMaxIterations;
    options.fast_removal = false;  // as plumbline_solve --structure=false
    const double begin = CpuSeconds();
    SolverSession session(&graph, Builtins(), options);
    const double made = CpuSeconds();
    EmOrchestrator em(&graph, &session, Builtins(), {}, {});
    em.Run();
    own.push_back(CpuSeconds() - begin);
    makes.push_back(made - begin);
    report = session.totals();
    objective = session.Cost().total();
  };
  const auto run_bare = [&] {
    PlainGraph copy = plain;
    summary = SolveBare(&copy, &bare);
  };
  bool own_first = true;
  for (auto _ : state) {
    // Whoever comes second finds warm caches.
    if (own_first) run_own();
    run_bare();
    if (!own_first) run_own();
    own_first = !own_first;
    state.SetIterationTime(own.back());
  }
  if (!report.converged || summary.termination_type != ceres::CONVERGENCE) {
    state.SkipWithError("not converged");
  }
  const double bare_objective = 2.0 * summary.final_cost;
  state.counters["over_bare"] = Median(own) / Median(bare);
  state.counters["make_ms"] = 1e3 * Median(makes);
  state.counters["bare_ms"] = 1e3 * Median(bare);
  state.counters["iterations"] = report.iterations;
  state.counters["bare_iterations"] = summary.num_linear_solves;
  state.counters["objective"] = objective;
  state.counters["objective_off"] =
      std::abs(objective - bare_objective) / bare_objective;
  state.counters["start_ms"] = 1e3 * start_seconds;
  state.counters["evaluation_share"] =
      report.evaluation_seconds / report.total_seconds;
  state.counters["linear_share"] =
      report.linear_solver_seconds / report.total_seconds;
  state.counters["setup_share"] = report.setup_seconds / report.total_seconds;
}

void RegisterGraphs(const std::filesystem::path& folder) {
  const std::vector<std::pair<const char*, InitialGuessMethod>> cases = {
      {"manhattanOlson3500", InitialGuessMethod::kFile},
      {"manhattanOlson3500", InitialGuessMethod::kChordal},
      {"city10000", InitialGuessMethod::kFile},
      {"city10000", InitialGuessMethod::kChordal},
      {"victoriaPark", InitialGuessMethod::kChordal},
      {"dlr", InitialGuessMethod::kFile},
      {"dlr", InitialGuessMethod::kChordal},
      {"intel_posegraph", InitialGuessMethod::kChordal},
      {"segway_lines", InitialGuessMethod::kFile}};
  for (const auto& entry : cases) {
    const std::string name = entry.first;
    const InitialGuessMethod method = entry.second;
    const std::string path = (folder / (name + ".g2o.bz2")).string();
    benchmark::RegisterBenchmark(
        (name + (method == InitialGuessMethod::kFile ? "/file" : "/chordal"))
            .c_str(),
        [path, method](benchmark::State& state) {
          Converge(state, path, method);
        })
        ->Iterations(11)
        ->UseManualTime()
        ->Unit(benchmark::kMillisecond);
  }
}

}  // namespace
}  // namespace plumbline

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  const char* const folder = std::getenv("PLUMBLINE_DATASETS");
  if (folder == nullptr) {
    std::fprintf(stderr,
                 "graphs_benchmark: set PLUMBLINE_DATASETS to a folder "
                 "that holds graphs/city10000.g2o.bz2 and others\n");
    return 1;
  }
  try {
    plumbline::RegisterGraphs(std::filesystem::path(folder) / "graphs");
    benchmark::RunSpecifiedBenchmarks();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "graphs_benchmark: %s\n", error.what());
    return 1;
  }
  benchmark::Shutdown();
  return 0;
}
