// Public graphs: what a session takes to converge, cold and again after one
// edge in a hundred has changed, beside a program that gives the same factors
// to Ceres and nothing else, a hand-written Gauss-Newton, and other programs.
//
//   graphs_benchmark [--rounds=5] [--peer=COMMAND] [--only=resident] [GRAPH
//   ...]

#include <ceres/ceres.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/em.h>
#include <plumbline/core/error.h>
#include <plumbline/core/graph_g2o.h>
#include <plumbline/core/information.h>
#include <plumbline/core/initial_guess.h>
#include <plumbline/core/serial_openmp.h>
#include <plumbline/core/session.h>
#include <plumbline/factors/line_manifold.h>
#include <plumbline/factors/point_line_distance.h>
#include <plumbline/factors/pose_line.h>
#include <plumbline/factors/pose_point.h>
#include <plumbline/factors/pose_pose.h>
#include <plumbline/frontend/input_stream.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "benchmark/benchmark_util.h"
#include "benchmark/flat_solver.h"

namespace plumbline {
namespace {

constexpr int kMaxIterations = 500;
// Relative change of the objective at which a solve ends.
constexpr double kTolerance = 1e-6;
// By how much measurements change, in standard deviations.
constexpr double kChange = 0.3;

const Registry& Builtins() {
  static const Registry* const registry = [] {
    auto* made = new Registry;
    RegisterBuiltinRelations(made);
    return made;
  }();
  return *registry;
}

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
    plain.sizes.push_back(feature->type->size);
    plain.is_fixed.push_back(feature->fixed);
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
  // These files are connected: as a session holds the gauge.
  if (std::find(plain.is_fixed.begin(), plain.is_fixed.end(), true) ==
      plain.is_fixed.end()) {
    plain.is_fixed[0] = true;
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

struct Outcome {
  double milliseconds = 0.0;
  int steps = 0;
  double objective = 0.0;
  // Of a session, ms: making it, and set-up, evaluation and linear algebra of
  // its solves.
  std::array<double, 4> parts = {};
};

// A bare program: one problem, one solve, the settings that the session has;
// what it takes until the solution is there, without taking down.
Outcome SolveBare(PlainGraph graph, double tolerance) {
  const double begin = CpuSeconds();
  ceres::Problem problem;
  for (const PlainGraph::Edge& edge : graph.edges) {
    ceres::CostFunction* cost = MakeCost(edge);
    problem.AddResidualBlock(
        cost, nullptr,
        graph.blocks[static_cast<std::size_t>(edge.first)].data(),
        graph.blocks[static_cast<std::size_t>(edge.second)].data());
  }
  for (const int line : graph.lines) {
    problem.SetManifold(graph.blocks[static_cast<std::size_t>(line)].data(),
                        new LineManifold);
  }
  for (std::size_t i = 0; i < graph.blocks.size(); ++i) {
    if (graph.is_fixed[i]) {
      problem.SetParameterBlockConstant(graph.blocks[i].data());
    }
  }
  const SessionOptions session;
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.sparse_linear_algebra_library_type = ceres::SUITE_SPARSE;
  options.max_num_iterations = kMaxIterations;
  options.function_tolerance = tolerance;
  options.parameter_tolerance = 1e-12;
  options.initial_trust_region_radius = session.initial_trust_region_radius;
  options.max_num_consecutive_invalid_steps = 20;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  return {1e3 * (CpuSeconds() - begin), summary.num_linear_solves,
          2.0 * summary.final_cost};
}

Outcome SolveFlat(const PlainGraph& graph, double tolerance) {
  const double begin = CpuSeconds();
  FlatSolver solver(graph);
  const FlatSolver::Result result = solver.Solve(tolerance, kMaxIterations);
  return {1e3 * (CpuSeconds() - begin), result.steps, result.objective};
}

SessionOptions SessionOf(const std::string& minimizer, double tolerance) {
  SessionOptions options;
  options.minimizer = minimizer;
  options.max_iterations = kMaxIterations;
  options.function_tolerance = tolerance;
  return options;
}

using State = std::vector<std::array<double, kMaxFeatureSize>>;

State StateOf(const Graph& graph) {
  State state;
  for (const Feature* feature : graph.Features()) {
    state.push_back(feature->parameters);
  }
  return state;
}

void Copy(const Graph& from, Graph* to) {
  std::vector<Feature> features;
  for (const Feature* feature : from.Features()) features.push_back(*feature);
  std::vector<Constraint> constraints;
  for (const Constraint* constraint : from.Constraints()) {
    constraints.push_back(*constraint);
  }
  to->Restore(std::move(features), std::move(constraints),
              from.feature_id_end(), from.constraint_id_end());
}

void SetState(const State& state, Graph* graph) {
  std::size_t next = 0;
  for (Feature* feature : graph->MutableFeatures()) {
    feature->parameters = state[next++];
  }
}

Outcome SolveSession(const std::string& minimizer, double tolerance,
                     Graph* graph) {
  SessionOptions options = SessionOf(minimizer, tolerance);
  options.fast_removal = false;  // as plumbline_solve --structure=false
  const double begin = CpuSeconds();
  SolverSession session(graph, Builtins(), options);
  const double made = CpuSeconds();
  EmOrchestrator em(graph, &session, Builtins(), {}, {});
  em.Run();
  const double end = CpuSeconds();
  const SolveReport& report = session.totals();
  return {
      1e3 * (end - begin),
      report.iterations,
      session.Cost().total(),
      {1e3 * (made - begin), 1e3 * report.setup_seconds,
       1e3 * report.evaluation_seconds, 1e3 * report.linear_solver_seconds}};
}

// One edge in a hundred, of those that may go: not between neighbours on the
// way, and only where something else is left on both.
std::vector<int> EdgesToRemove(const PlainGraph& graph) {
  std::vector<int> edges_on(graph.blocks.size(), 0);
  for (const PlainGraph::Edge& edge : graph.edges) {
    ++edges_on[edge.first];
    ++edges_on[edge.second];
  }
  std::vector<int> removed;
  const std::size_t wanted = graph.edges.size() / 100;
  const std::size_t stride = 37;  // all over the graph
  for (std::size_t k = 0; k < graph.edges.size() && removed.size() < wanted;
       ++k) {
    const std::size_t index = k * stride % graph.edges.size();
    const PlainGraph::Edge& edge = graph.edges[index];
    if (std::abs(edge.first - edge.second) < 2 || edges_on[edge.first] < 4 ||
        edges_on[edge.second] < 4) {
      continue;
    }
    --edges_on[edge.first];
    --edges_on[edge.second];
    removed.push_back(static_cast<int>(index));
  }
  return removed;
}

// From the optimum of all edges: some go, or their measurements change by a
// part of the standard deviation, and it is solved again.
Outcome Again(const Graph& from, const std::string& minimizer,
              const std::vector<int>& edges, bool are_removed) {
  Graph graph;
  Copy(from, &graph);
  SolverSession session(&graph, Builtins(), SessionOf(minimizer, kTolerance));
  session.SolveGlobal();
  const int steps = session.totals().iterations;
  const double begin = CpuSeconds();
  if (are_removed) {
    Transaction transaction;
    for (const int edge : edges) transaction.BreakConstraint(edge);
    graph.Apply(std::move(transaction));
  } else {
    for (const int edge : edges) {
      const Constraint& constraint = graph.GetConstraint(edge);
      Eigen::VectorXd expected = constraint.expected;
      expected[0] += kChange / std::sqrt(constraint.information(0, 0));
      graph.UpdateConstraint(edge, expected,
                             Eigen::MatrixXd(constraint.information));
    }
  }
  session.SolveGlobal();
  return {1e3 * (CpuSeconds() - begin), session.totals().iterations - steps,
          session.Cost().total()};
}

Outcome FlatAgain(const PlainGraph& graph, const std::vector<int>& edges,
                  bool are_removed) {
  FlatSolver solver(graph);
  solver.Solve(kTolerance, kMaxIterations);
  const double begin = CpuSeconds();
  for (const int edge : edges) {
    if (are_removed) {
      solver.SetActive(edge, false);
    } else {
      Eigen::Vector3d expected = graph.edges[edge].expected;
      expected[0] += kChange / std::sqrt(graph.edges[edge].information(0, 0));
      solver.SetExpected(edge, expected);
    }
  }
  const FlatSolver::Result result = solver.Solve(kTolerance, kMaxIterations);
  return {1e3 * (CpuSeconds() - begin), result.steps, result.objective};
}

// Runs `command file`, which prints lines "name milliseconds steps objective".
void RunPeer(const std::string& command, const std::string& file,
             std::map<std::string, std::vector<Outcome>>* outcomes) {
  FILE* const pipe = popen((command + " " + file).c_str(), "r");
  if (pipe == nullptr) return;
  char name[64];
  Outcome outcome;
  while (std::fscanf(pipe, "%63s %lf %d %lf", name, &outcome.milliseconds,
                     &outcome.steps, &outcome.objective) == 4) {
    (*outcomes)[name].push_back(outcome);
  }
  pclose(pipe);
}

double MedianMs(const std::vector<Outcome>& outcomes) {
  std::vector<double> values;
  for (const Outcome& outcome : outcomes) {
    values.push_back(outcome.milliseconds);
  }
  return Median(values);
}

void Print(const std::string& title,
           const std::map<std::string, std::vector<Outcome>>& outcomes) {
  const double resident = MedianMs(outcomes.at("resident"));
  std::printf("%s\n", title.c_str());
  for (const auto& [name, results] : outcomes) {
    std::printf("  %-20s %8.2f ms %6.2f of resident %4d steps  %.6f\n",
                name.c_str(), MedianMs(results), MedianMs(results) / resident,
                results.back().steps, results.back().objective);
    const std::array<double, 4>& parts = results.back().parts;
    if (parts[0] > 0.0) {
      std::printf(
          "%-22s made %.2f, set-up %.2f, evaluation %.2f, linear %.2f ms\n", "",
          parts[0], parts[1], parts[2], parts[3]);
    }
  }
  std::fflush(stdout);
}

struct Case {
  const char* name;
  InitialGuessMethod start;
};

void Compare(const Case& what, const std::string& path, int rounds,
             const std::string& peer, bool is_alone) {
  std::vector<const char*> minimizers = {"resident"};
  if (!is_alone) minimizers.push_back("ceres");
  Graph graph;
  InputStream input(path);
  std::istringstream text(input.ReadRest());
  G2oOptions options;
  options.information_at_second = true;  // as g2o has it
  const G2oFile file = ReadG2o(text, path, Builtins(), &graph, options);
  InitialGuessOptions guess;
  guess.method = what.start;
  MakeInitialGuess(guess, &graph);
  const PlainGraph plain = MakePlain(graph);
  const State start = StateOf(graph);
  const std::filesystem::path peer_file =
      std::filesystem::temp_directory_path() /
      ("graphs_benchmark." + std::to_string(getpid()) + ".g2o");
  if (!peer.empty()) {
    std::ofstream output(peer_file);
    WriteG2o(graph, &file, output);
  }
  const auto at_start = [&]() -> Graph* {
    SetState(start, &graph);
    return &graph;
  };

  std::map<std::string, std::vector<Outcome>> cold;
  for (int round = 0; round < rounds; ++round) {
    for (const char* minimizer : minimizers) {
      cold[minimizer].push_back(
          SolveSession(minimizer, kTolerance, at_start()));
    }
    if (is_alone) continue;
    cold["floor"].push_back(SolveFlat(plain, kTolerance));
    if (!peer.empty()) RunPeer(peer, peer_file.string(), &cold);
    // Whoever comes after another process finds the caches cold.
    cold["bare_ceres"].push_back(SolveBare(plain, kTolerance));
  }
  if (!peer.empty()) std::filesystem::remove(peer_file);
  const std::string title =
      what.name + std::string(what.start == InitialGuessMethod::kFile
                                  ? ", file"
                                  : ", chordal");
  Print(title, cold);

  std::map<std::string, std::vector<Outcome>> changed;
  std::map<std::string, std::vector<Outcome>> removed;
  const std::vector<int> edges = EdgesToRemove(plain);
  for (int round = 0; round < rounds; ++round) {
    for (const char* minimizer : minimizers) {
      changed[minimizer].push_back(
          Again(*at_start(), minimizer, edges, /*are_removed=*/false));
      removed[minimizer].push_back(
          Again(*at_start(), minimizer, edges, /*are_removed=*/true));
    }
    if (is_alone) continue;
    changed["floor"].push_back(FlatAgain(plain, edges, /*are_removed=*/false));
    removed["floor"].push_back(FlatAgain(plain, edges, /*are_removed=*/true));
  }
  Print(title + ", again without " + std::to_string(edges.size()) + " edges",
        removed);
  Print(title + ", again with " + std::to_string(edges.size()) +
            " other measurements",
        changed);
}

}  // namespace
}  // namespace plumbline

int main(int argc, char** argv) {
  using plumbline::InitialGuessMethod;
  int rounds = 5;
  std::string peer;
  bool is_alone = false;
  std::vector<std::string> names;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument.rfind("--rounds=", 0) == 0) {
      rounds = std::max(1, std::atoi(argument.c_str() + 9));
    } else if (argument.rfind("--peer=", 0) == 0) {
      peer = argument.substr(7);
    } else if (argument == "--only=resident") {
      is_alone = true;
    } else {
      names.push_back(argument);
    }
  }
  const char* const folder = std::getenv("PLUMBLINE_DATASETS");
  if (folder == nullptr) {
    std::fprintf(stderr,
                 "graphs_benchmark: set PLUMBLINE_DATASETS to a folder "
                 "that holds graphs/city10000.g2o.bz2 and others\n");
    return 1;
  }
  const plumbline::Case cases[] = {
      {"manhattanOlson3500", InitialGuessMethod::kFile},
      {"city10000", InitialGuessMethod::kFile},
      {"intel_posegraph", InitialGuessMethod::kChordal},
      {"victoriaPark", InitialGuessMethod::kChordal},
      {"dlr", InitialGuessMethod::kFile},
      {"segway_lines", InitialGuessMethod::kFile}};
  try {
    const plumbline::SerialOpenMp serial;
    for (const plumbline::Case& what : cases) {
      if (!names.empty() &&
          std::find(names.begin(), names.end(), what.name) == names.end()) {
        continue;
      }
      const std::filesystem::path path = std::filesystem::path(folder) /
                                         "graphs" /
                                         (std::string(what.name) + ".g2o.bz2");
      plumbline::Compare(what, path.string(), rounds, peer, is_alone);
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "graphs_benchmark: %s\n", error.what());
    return 1;
  }
  return 0;
}
