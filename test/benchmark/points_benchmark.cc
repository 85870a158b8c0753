// Structure of points against their number: buildings like that of experiment
// S1, side by side. Prints one line per world and writes a figure.
//
//     points_benchmark [--figure=FILE.svg] [--phases] [POINTS ...]
//
// With --phases also a line for each phase of EM.

#include <plumbline/apps/figures/line_plot.h>
#include <plumbline/apps/simulation/synthetic_worlds.h>
#include <plumbline/core/em.h>
#include <plumbline/core/session.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/detectors/default_hierarchy.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <fstream>
#include <map>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "benchmark/benchmark_util.h"

namespace plumbline {
namespace {

// Between the places of buildings, m; they stand off by up to kShift, so that
// walls of neighbours are not in line.
constexpr double kPitch = 38.0;
constexpr double kShift = 3.0;
// Distances that tie a building to the next, and how long they may be, m.
constexpr int kTies = 8;
constexpr double kLongestTie = 14.0;

// Places of a few numbers that look random, the same every time.
double Fraction(int i, double irrational) {
  const double x = (i + 1) * irrational;
  return x - std::floor(x);
}

// A square of buildings, each with its own noise, tied to its neighbours to the
// right and above.
class City {
 public:
  City(int buildings, const Registry& registry) : registry_(registry) {
    const int columns =
        static_cast<int>(std::ceil(std::sqrt(static_cast<double>(buildings))));
    std::vector<std::vector<std::pair<FeatureId, Eigen::Vector2d>>> built;
    for (int i = 0; i < buildings; ++i) {
      const Eigen::Vector2d place(
          kPitch * (i % columns) + kShift * Fraction(i, 0.7548776662466927),
          kPitch * (i / columns) + kShift * Fraction(i, 0.5698402909980532));
      built.push_back(AddBuilding(place, i));
      if (i % columns > 0) Tie(built[i - 1], built[i], i);
      if (i >= columns) Tie(built[i - columns], built[i], i);
    }
    graph_.Apply(std::move(transaction_));
  }

  Graph* graph() { return &graph_; }
  int num_points() const { return num_points_; }
  // Lines, circles and centres to be found.
  int num_features() const { return num_features_; }

 private:
  using Points = std::vector<std::pair<FeatureId, Eigen::Vector2d>>;

  // The points and where they are in truth.
  Points AddBuilding(const Eigen::Vector2d& place, int number) {
    const SyntheticWorld world =
        MakeSyntheticWorld("S1", DefaultSyntheticOptions("S1"),
                           1 + static_cast<std::uint64_t>(number), registry_);
    Points points;
    std::map<FeatureId, FeatureId> ids;
    const Graph& building = *world.graph;
    for (const Feature* feature : building.Features()) {
      Feature moved = *feature;
      moved.id = kNoId;
      moved.parameters[0] += place.x();
      moved.parameters[1] += place.y();
      ids[feature->id] = transaction_.AddFeature(std::move(moved));
      points.emplace_back(
          ids[feature->id],
          place + world.truth.positions[static_cast<std::size_t>(feature->id)]);
    }
    for (const Constraint* constraint : building.Constraints()) {
      Constraint moved = *constraint;
      moved.id = kNoId;
      for (FeatureId& id : moved.features) id = ids.at(id);
      transaction_.AddConstraint(std::move(moved));
    }
    num_points_ += static_cast<int>(points.size());
    num_features_ +=
        static_cast<int>(world.truth.lines.size() + world.truth.circles.size() +
                         world.truth.centers.size());
    return points;
  }

  // The shortest distances between two buildings, of different points.
  void Tie(const Points& first, const Points& second, int number) {
    std::vector<std::tuple<double, std::size_t, std::size_t>> pairs;
    for (std::size_t i = 0; i < first.size(); ++i) {
      for (std::size_t j = 0; j < second.size(); ++j) {
        const double length = (first[i].second - second[j].second).norm();
        if (length < kLongestTie) pairs.emplace_back(length, i, j);
      }
    }
    std::sort(pairs.begin(), pairs.end());
    const double noise = DefaultSyntheticOptions("S1").distance_noise;
    std::map<std::pair<int, std::size_t>, int> uses;
    int count = 0;
    for (const auto& [length, i, j] : pairs) {
      if (count == kTies) break;
      if (uses[{0, i}] > 0 || uses[{1, j}] > 0) continue;
      ++uses[{0, i}];
      ++uses[{1, j}];
      Constraint tie;
      tie.type = &registry_.GetRelation("point_point_distance");
      tie.features = {first[i].first, second[j].first};
      tie.expected = Eigen::VectorXd::Constant(
          1, length + noise * (2.0 * Fraction(kTies * number + count,
                                              0.6180339887498949) -
                               1.0));
      tie.information = Eigen::MatrixXd::Constant(1, 1, 3.0 / (noise * noise));
      transaction_.AddConstraint(std::move(tie));
      ++count;
    }
  }

  const Registry& registry_;
  Transaction transaction_;
  Graph graph_;
  int num_points_ = 0;
  int num_features_ = 0;
};

struct Row {
  double points = 0.0;
  double seconds = 0.0;
  double detect_seconds = 0.0;
  double solve_seconds = 0.0;
};

// Prints what each phase of EM took.
class PhasePrinter {
 public:
  explicit PhasePrinter(const SolverSession& session) : session_(session) {}

  void operator()(const EmPhase& phase) {
    const int steps = session_.totals().iterations;
    std::printf(
        "  %3d %-12s %8.2f s %4d steps, structure %7d live %5d broken,"
        " cost %.1f\n",
        phase.iteration, phase.phase.c_str(), phase.seconds, steps - steps_,
        phase.structure_constraints, phase.broken_constraints,
        phase.cost.total());
    std::fflush(stdout);
    steps_ = steps;
  }

 private:
  const SolverSession& session_;
  int steps_ = 0;
};

Row Measure(int points, bool has_phases, const Registry& registry) {
  City city(std::max(1, static_cast<int>(std::lround(points / 572.0))),
            registry);
  Row row;
  EmReport report;
  int steps = 0;
  row.seconds = CpuSecondsOf([&] {
    SessionOptions session_options;
    // As plumbline_solve does.
    session_options.minimizer = "resident";
    SolverSession session(city.graph(), registry, session_options);
    // As plumbline_solve has it for points.
    EmOptions options;
    options.full_weight_test = true;
    options.loop_tolerance = kPointsLoopTolerance;
    EmOrchestrator em(
        city.graph(), &session, registry,
        MakeHierarchy(
            DefaultHierarchy({&registry.GetFeature("point")}, registry),
            registry, {"point"}, {}),
        options);
    if (has_phases) em.SetTrace(PhasePrinter(session));
    report = em.Run();
    steps = session.totals().iterations;
  });
  row.points = city.num_points();
  row.detect_seconds = report.detect_seconds;
  row.solve_seconds = report.solve_seconds;
  int found = 0;
  const Graph& graph = *city.graph();
  for (const Feature* feature : graph.Features()) {
    if (feature->is_virtual && feature->type->name != "orientation") ++found;
  }
  std::printf("%7d %8d %9d %9d %6s %6d %9.2f %9.2f %9.2f %9.2f\n",
              city.num_points(), city.num_features(), found, report.iterations,
              report.converged() ? "yes" : "no", steps, row.seconds,
              row.detect_seconds, row.solve_seconds,
              1e6 * row.seconds / (row.points * std::log(row.points)));
  std::fflush(stdout);
  return row;
}

int Run(int argc, char** argv) {
  std::string figure;
  bool has_phases = false;
  std::vector<int> sizes;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    const std::string flag = "--figure=";
    if (argument.rfind(flag, 0) == 0) {
      figure = argument.substr(flag.size());
    } else if (argument == "--phases") {
      has_phases = true;
    } else {
      sizes.push_back(std::stoi(argument));
    }
  }
  if (sizes.empty()) {
    sizes = {500, 1000, 2000, 5000, 10000, 20000, 50000, 100000};
  }
  Registry registry;
  RegisterBuiltins(&registry);
  std::printf("%7s %8s %9s %9s %6s %6s %9s %9s %9s %9s\n", "points", "features",
              "found", "rounds", "ended", "steps", "cpu s", "detect s",
              "solve s", "us/nlogn");
  std::vector<Row> rows;
  for (const int size : sizes) {
    rows.push_back(Measure(size, has_phases, registry));
  }
  if (figure.empty()) return 0;

  LinePlot plot;
  plot.title = "Detection and EM against the number of points";
  plot.x_label = "points";
  plot.y_label = "seconds";
  plot.log_x = true;
  plot.log_y = true;
  PlotSeries all, detect, solve, reference;
  all.name = "all (processor)";
  detect.name = "detection";
  solve.name = "solving";
  reference.name = "n log n";
  reference.dashed = true;
  all.markers = detect.markers = solve.markers = true;
  // Through the first world of at least 1,000 points.
  double scale = 0.0;
  for (const Row& row : rows) {
    if (row.points >= 1000 && scale == 0.0) {
      scale = row.seconds / (row.points * std::log(row.points));
    }
  }
  for (const Row& row : rows) {
    for (PlotSeries* series : {&all, &detect, &solve, &reference}) {
      series->x.push_back(row.points);
    }
    all.y.push_back(row.seconds);
    detect.y.push_back(row.detect_seconds);
    solve.y.push_back(row.solve_seconds);
    reference.y.push_back(scale * row.points * std::log(row.points));
  }
  plot.series = {all, detect, solve, reference};
  std::ofstream(figure) << PlotSvg({plot});
  return 0;
}

}  // namespace
}  // namespace plumbline

int main(int argc, char** argv) {
  try {
    return plumbline::Run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "points_benchmark: %s\n", error.what());
    return 1;
  }
}
