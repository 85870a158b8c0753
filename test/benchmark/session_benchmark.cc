// What the solver session costs, each figure beside its yardstick: global
// solves beside the factorizations that they cannot do without, local solves,
// changes and re-scoring beside the size of the graph.

#include <benchmark/benchmark.h>
#include <ceres/ceres.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/information.h>
#include <plumbline/core/serial_openmp.h>
#include <plumbline/core/session.h>

#include <Eigen/CholmodSupport>
#include <Eigen/SparseCore>
#include <algorithm>
#include <iterator>
#include <memory>
#include <utility>
#include <vector>

#include "benchmark/benchmark_util.h"
#include "benchmark/corridor_graph.h"

namespace plumbline {
namespace {

const Registry& Builtins() {
  static const Registry* const registry = [] {
    auto* made = new Registry;
    RegisterBuiltinRelations(made);
    return made;
  }();
  return *registry;
}

// The live constraints of a graph in a ceres::Problem of their own, and what
// linear algebra alone takes for them.
class Yardstick {
 public:
  explicit Yardstick(Graph* graph) {
    for (const Constraint* constraint : graph->Constraints()) {
      if (constraint->state != ConstraintState::kLive) continue;
      RelationArguments arguments;
      arguments.expected = constraint->expected;
      arguments.sqrt_information = SqrtInformation(constraint->information);
      std::vector<double*> blocks;
      for (const FeatureId id : constraint->features) {
        arguments.features.push_back(&graph->GetFeature(id));
        blocks.push_back(graph->GetFeature(id).data());
      }
      ceres::CostFunction* cost =
          constraint->type->make_cost(arguments).release();
      problem_.AddResidualBlock(cost, nullptr, blocks);
      if (constraint->kind == ConstraintClass::kStructure) {
        structure_.push_back({cost, std::move(blocks)});
      }
    }
    for (Feature* feature : graph->MutableFeatures()) {
      if (feature->fixed) continue;
      if (feature->type->make_manifold) {
        problem_.SetManifold(feature->data(),
                             feature->type->make_manifold().release());
      }
      evaluation_.parameter_blocks.push_back(feature->data());
    }
  }

  // Takes the normal matrix at the present state, damped as the session's first
  // step is, to be ordered by approximate minimum degree as Ceres has it.
  void TakeNormalMatrix() {
    ceres::CRSMatrix crs;
    problem_.Evaluate(evaluation_, nullptr, nullptr, nullptr, &crs);
    const Eigen::Map<const Eigen::SparseMatrix<double, Eigen::RowMajor>>
        jacobian(crs.num_rows, crs.num_cols,
                 static_cast<int>(crs.values.size()), crs.rows.data(),
                 crs.cols.data(), crs.values.data());
    normal_ = jacobian.transpose() * jacobian;
    const double damping =
        1.0 + 1.0 / SessionOptions().initial_trust_region_radius;
    for (int i = 0; i < normal_.cols(); ++i) normal_.coeffRef(i, i) *= damping;
    cholmod_.cholmod().nmethods = 1;
    cholmod_.cholmod().method[0].ordering = CHOLMOD_AMD;
    cholmod_.cholmod().postorder = 1;
  }

  // Ordering and symbolic factorization, once a solve.
  void Analyze() { cholmod_.analyzePattern(normal_); }
  // One numeric factorization.
  void Factorize() { cholmod_.factorize(normal_); }
  bool factorized() const { return cholmod_.info() == Eigen::Success; }

  // One evaluation of every structure constraint's residual and nothing else.
  void EvaluateStructure() const {
    double residual = 0.0;
    for (const auto& [cost, blocks] : structure_) {
      cost->Evaluate(blocks.data(), &residual, nullptr);
      benchmark::DoNotOptimize(residual);
    }
  }
  std::size_t num_structure() const { return structure_.size(); }

 private:
  ceres::Problem problem_;
  ceres::Problem::EvaluateOptions evaluation_;
  std::vector<std::pair<const ceres::CostFunction*, std::vector<double*>>>
      structure_;
  Eigen::SparseMatrix<double> normal_;
  Eigen::CholmodDecomposition<Eigen::SparseMatrix<double>, Eigen::Lower>
      cholmod_;
};

std::vector<FeatureId> AllSegments(const CorridorGraph& world) {
  std::vector<FeatureId> ids;
  for (int i = 0; i < world.num_segments(); ++i) ids.push_back(i);
  return ids;
}

// From drifted starts (cold), or from the solution with every segment moved by
// a centimetre (warm, as EM steps find it).
void SolveGlobal(benchmark::State& state, bool warm) {
  const SerialOpenMp serial;
  CorridorGraph world(Builtins(), static_cast<int>(state.range(0)));
  SolverSession session(&world.graph(), Builtins(), SessionOptions());
  Yardstick yardstick(&world.graph());
  const std::vector<FeatureId> segments = AllSegments(world);
  session.SolveGlobal();
  const auto solution = world.State();
  yardstick.TakeNormalMatrix();

  std::vector<double> ratios;
  std::vector<double> analyses;
  std::vector<double> factorizations;
  SolveReport sum;
  for (auto _ : state) {
    world.SetState(warm ? solution : world.start());
    if (warm) world.Disturb(segments);
    SolveReport report;
    const double seconds =
        CpuSecondsOf([&] { report = session.SolveGlobal(); });
    state.SetIterationTime(seconds);
    if (!report.usable || !report.converged) {
      state.SkipWithError("the solve did not converge");
      break;
    }
    analyses.push_back(CpuSecondsOf([&] { yardstick.Analyze(); }));
    const double factorization = CpuSecondsOf([&] { yardstick.Factorize(); });
    factorizations.push_back(factorization);
    ratios.push_back(seconds / (factorization * report.iterations));
    sum.iterations += report.iterations;
    sum.evaluation_seconds += report.evaluation_seconds;
    sum.linear_solver_seconds += report.linear_solver_seconds;
    sum.setup_seconds += report.setup_seconds;
    sum.total_seconds += report.total_seconds;
  }
  if (!yardstick.factorized()) {
    state.SkipWithError("the normal matrix is not positive definite");
  }
  if (sum.total_seconds <= 0.0) return;
  state.counters["over_linear_algebra"] = Median(ratios);
  state.counters["iterations"] =
      static_cast<double>(sum.iterations) / ratios.size();
  state.counters["factorization_ms"] = 1e3 * Median(factorizations);
  state.counters["analysis_over_factorization"] =
      Median(analyses) / Median(factorizations);
  state.counters["evaluation_share"] =
      sum.evaluation_seconds / sum.total_seconds;
  state.counters["linear_share"] =
      sum.linear_solver_seconds / sum.total_seconds;
  state.counters["setup_share"] = sum.setup_seconds / sum.total_seconds;
}

void GlobalSolveCold(benchmark::State& state) { SolveGlobal(state, false); }
void GlobalSolveWarm(benchmark::State& state) { SolveGlobal(state, true); }
BENCHMARK(GlobalSolveCold)
    ->Arg(1000)
    ->Arg(3000)
    ->Arg(10000)
    ->Iterations(5)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK(GlobalSolveWarm)
    ->Arg(1000)
    ->Arg(3000)
    ->Arg(10000)
    ->Iterations(5)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);

// One corridor, alternately in a graph of the size asked for and in one of
// 1000 segments.
void LocalSolve(benchmark::State& state) {
  const SerialOpenMp serial;
  CorridorGraph small(Builtins(), 1000);
  CorridorGraph large(Builtins(), static_cast<int>(state.range(0)));
  SolverSession small_session(&small.graph(), Builtins(), SessionOptions());
  SolverSession large_session(&large.graph(), Builtins(), SessionOptions());
  const std::vector<FeatureId> small_scope = small.MiddleCorridor();
  const std::vector<FeatureId> large_scope = large.MiddleCorridor();
  small_session.SolveGlobal();
  large_session.SolveGlobal();
  std::vector<double> small_seconds;
  std::vector<double> large_seconds;
  SolveReport report;
  for (auto _ : state) {
    small.Disturb(small_scope);
    small_seconds.push_back(
        CpuSecondsOf([&] { report = small_session.SolveLocal(small_scope); }) /
        report.iterations);
    large.Disturb(large_scope);
    const double seconds =
        CpuSecondsOf([&] { report = large_session.SolveLocal(large_scope); });
    large_seconds.push_back(seconds / report.iterations);
    state.SetIterationTime(seconds);
  }
  state.counters["variable_blocks"] = report.variable_blocks;
  state.counters["per_iteration_over_1000"] =
      Median(large_seconds) / Median(small_seconds);
}
BENCHMARK(LocalSolve)
    ->Arg(1000)
    ->Arg(3000)
    ->Arg(10000)
    ->Iterations(50)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);

// Every hundredth constraint goes and comes back, in one transaction each,
// against making the session anew.
void ChangeOnePercent(benchmark::State& state) {
  CorridorGraph world(Builtins(), static_cast<int>(state.range(0)));
  std::unique_ptr<SolverSession> session;
  const double rebuild = CpuSecondsOf([&] {
    session = std::make_unique<SolverSession>(&world.graph(), Builtins(),
                                              SessionOptions());
  });
  std::vector<ConstraintId> ids;
  for (const Constraint* constraint : world.graph().Constraints()) {
    if (constraint->id % 100 == 0) ids.push_back(constraint->id);
  }
  std::vector<double> removals;
  std::vector<double> additions;
  for (auto _ : state) {
    Transaction removal;
    Transaction addition;
    for (const ConstraintId id : ids) {
      Constraint constraint = world.graph().GetConstraint(id);
      constraint.id = kNoId;
      addition.AddConstraint(std::move(constraint));
      removal.RemoveConstraint(id);
    }
    removals.push_back(
        CpuSecondsOf([&] { world.graph().Apply(std::move(removal)); }));
    additions.push_back(CpuSecondsOf(
        [&] { ids = world.graph().Apply(std::move(addition)).constraints; }));
    state.SetIterationTime(removals.back() + additions.back());
  }
  state.counters["changed"] = static_cast<double>(ids.size());
  state.counters["remove_us_each"] = 1e6 * Median(removals) / ids.size();
  state.counters["add_us_each"] = 1e6 * Median(additions) / ids.size();
  state.counters["both_over_rebuild"] =
      (Median(removals) + Median(additions)) / rebuild;
}
BENCHMARK(ChangeOnePercent)
    ->Arg(1000)
    ->Arg(3000)
    ->Arg(10000)
    ->Iterations(20)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);

// The E-step on the whole graph, against bare evaluation of the same residuals.
void UpdateDeltas(benchmark::State& state) {
  CorridorGraph world(Builtins(), static_cast<int>(state.range(0)));
  SolverSession session(&world.graph(), Builtins(), SessionOptions());
  const Yardstick yardstick(&world.graph());
  std::vector<double> updates;
  std::vector<double> evaluations;
  for (auto _ : state) {
    updates.push_back(CpuSecondsOf([&] { session.UpdateDeltas(); }));
    evaluations.push_back(CpuSecondsOf([&] { yardstick.EvaluateStructure(); }));
    state.SetIterationTime(updates.back());
  }
  state.counters["ns_each"] = 1e9 * Median(updates) / yardstick.num_structure();
  state.counters["over_evaluation"] = Median(updates) / Median(evaluations);
}
BENCHMARK(UpdateDeltas)
    ->Arg(1000)
    ->Arg(3000)
    ->Arg(10000)
    ->Iterations(50)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace plumbline

BENCHMARK_MAIN();
