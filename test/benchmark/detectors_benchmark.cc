// What the detectors cost against the number of features that they read.

#include <benchmark/benchmark.h>
#include <plumbline/core/em.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/session.h>
#include <plumbline/core/sight_lines.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/detectors/orientation_mixture.h>
#include <plumbline/detectors/visibility.h>
#include <plumbline/factors/angle.h>

#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "benchmark/benchmark_util.h"
#include "benchmark/corridor_graph.h"
#include "detectors/wall_samples.h"

namespace plumbline {
namespace {

constexpr int kScopeSize = 50;

const Registry& Builtins() {
  static const Registry* const registry = [] {
    auto* made = new Registry;
    RegisterBuiltins(made);
    return made;
  }();
  return *registry;
}

void AddSegments(const std::vector<AxialSample>& samples, Graph* graph) {
  Transaction transaction;
  for (const AxialSample& sample : samples) {
    Feature feature;
    feature.type = &Builtins().GetFeature("segment");
    feature.parameters[2] = sample.angle;
    feature.extent_end = sample.length;
    transaction.AddFeature(feature);
  }
  graph->Apply(std::move(transaction));
}

// A building of two directions at right angles, a wing askew, and clutter.
std::vector<AxialSample> Walls(int count, std::uint64_t seed) {
  WallSampler sampler(seed);
  std::vector<AxialSample> samples;
  sampler.AddWalls(count * 35 / 100, 5.0, 0.2, 2.0, &samples);
  sampler.AddWalls(count * 35 / 100, 95.0, 0.2, 2.0, &samples);
  sampler.AddWalls(count * 20 / 100, 40.0, 0.2, 2.0, &samples);
  sampler.AddClutter(count - static_cast<int>(samples.size()), 1.0, &samples);
  return samples;
}

// A graph in which nothing has been found yet.
class NewGraph {
 public:
  explicit NewGraph(int num_segments) {
    AddSegments(Walls(num_segments, 1), &graph_);
  }
  Transaction Detect() const {
    return detector_.Detect(graph_, Builtins(), DetectionScope());
  }

 private:
  OrientationMixture detector_{OrientationMixtureOptions()};
  Graph graph_;
};

// A graph in which orientations have been found, with new segments in it.
class KnownGraph {
 public:
  explicit KnownGraph(int num_segments) {
    AddSegments(Walls(num_segments, 1), &graph_);
    graph_.Apply(detector_.Detect(graph_, Builtins(), DetectionScope()));
    const FeatureId first_new = graph_.feature_id_end();
    AddSegments(Walls(kScopeSize, 2), &graph_);
    for (FeatureId id = first_new; id < graph_.feature_id_end(); ++id) {
      scope_.push_back(id);
    }
  }
  Transaction Detect() const {
    DetectionScope scope;
    scope.features = &scope_;
    return detector_.Detect(graph_, Builtins(), scope);
  }

 private:
  OrientationMixture detector_{OrientationMixtureOptions()};
  Graph graph_;
  std::vector<FeatureId> scope_;
};

// Times the detector on a world of the size asked for and on the smallest one
// by turns.
template <typename World>
void Compare(benchmark::State& state, const char* counter, double scale) {
  const World small(100);
  const World large(static_cast<int>(state.range(0)));
  std::vector<double> small_seconds;
  std::vector<double> large_seconds;
  Transaction proposal;
  for (auto _ : state) {
    small_seconds.push_back(CpuSecondsOf([&] { proposal = small.Detect(); }));
    large_seconds.push_back(CpuSecondsOf([&] { proposal = large.Detect(); }));
    state.SetIterationTime(large_seconds.back());
  }
  state.counters["orientations"] =
      static_cast<double>(proposal.added_features().size());
  state.counters["constraints"] =
      static_cast<double>(proposal.added_constraints().size());
  state.counters[counter] =
      Median(large_seconds) / Median(small_seconds) / scale;
}

void OrientationMixtureWhole(benchmark::State& state) {
  Compare<NewGraph>(state, "per_segment_over_100", state.range(0) / 100.0);
}
BENCHMARK(OrientationMixtureWhole)
    ->Arg(100)
    ->Arg(1000)
    ->Arg(10000)
    ->Iterations(5)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);

void OrientationMixtureScope(benchmark::State& state) {
  Compare<KnownGraph>(state, "over_100", 1.0);
}
BENCHMARK(OrientationMixtureScope)
    ->Arg(100)
    ->Arg(1000)
    ->Arg(10000)
    ->Iterations(100)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);

// Looks along the walls of corridors, one each metre from 1.2 m in front of the
// wall that it moves with: 180 sight lines of at most 15 m that end on that
// wall's line or, on the other side, on that of the wall across.
Looks LooksAlongWalls(const Graph& graph) {
  constexpr double kWidth = 2.4;
  Looks looks;
  for (const Feature* wall : graph.Features()) {
    if (!wall->type->Is(FeatureRole::kWall)) continue;
    for (double x = wall->extent_begin + 0.5; x < wall->extent_end; x += 2.0) {
      Look look;
      look.frame = wall->id;
      look.sensor = {x, 0.5 * kWidth};
      for (int beam = 0; beam < 180; ++beam) {
        const double angle = DegToRad(2.0 * beam + 1.0);
        const Eigen::Vector2d ray(std::cos(angle), std::sin(angle));
        look.ends.push_back(look.sensor +
                            std::min(15.0, 0.5 * kWidth / std::abs(ray.y())) *
                                ray);
      }
      looks.push_back(std::move(look));
    }
  }
  return looks;
}

// What sight lines cost beside the round of EM that they are part of: that in
// which loops are closed.
void VisibilityRound(benchmark::State& state) {
  CorridorGraph world(Builtins(), static_cast<int>(state.range(0)));
  SolverSession session(&world.graph(), Builtins(), SessionOptions());
  session.SolveGlobal();
  const auto looks =
      std::make_shared<const Looks>(LooksAlongWalls(world.graph()));
  Visibility detector{VisibilityOptions()};
  detector.SetLooks(looks);
  EmOrchestrator em(
      &world.graph(), &session, Builtins(),
      MakeHierarchy(
          ParseHierarchy("orientation_mixture,same_wall/orientation_relation"),
          Builtins(), {"segment"}, {}),
      EmOptions());
  std::vector<double> detect_seconds;
  std::vector<double> round_seconds;
  for (auto _ : state) {
    Transaction proposal;
    detect_seconds.push_back(CpuSecondsOf([&] {
      proposal = detector.Detect(world.graph(), Builtins(), DetectionScope());
    }));
    round_seconds.push_back(CpuSecondsOf([&] { em.Iterate(); }));
    state.SetIterationTime(detect_seconds.back());
  }
  state.counters["looks"] = static_cast<double>(looks->size());
  state.counters["of_em_round"] =
      Median(detect_seconds) / Median(round_seconds);
}
BENCHMARK(VisibilityRound)
    ->Arg(1000)
    ->Arg(3000)
    ->Iterations(5)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace plumbline

BENCHMARK_MAIN();
