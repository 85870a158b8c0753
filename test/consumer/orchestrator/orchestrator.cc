// A graph of our own: walls along a corridor, each measured from the one
// before, with a heading error at every step. The orchestrator finds that they
// have two directions, at a right angle, and straightens the corridor.
#include <plumbline/core/em.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/session.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/factors/angle.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>
#include <vector>

using plumbline::DegToRad;
using plumbline::RadToDeg;

namespace {

constexpr double kPositionSigma = 0.02;          // m
constexpr double kHeadingSigma = DegToRad(0.5);  // rad

// Largest deviation of a segment from the multiples of 90 degrees, degrees.
double WorstDirection(const plumbline::Graph& graph) {
  double worst = 0.0;
  for (const plumbline::Feature* feature : graph.Features()) {
    if (!feature->type->Is(plumbline::FeatureRole::kWall)) continue;
    const double degrees = RadToDeg(feature->parameters[2]);
    worst = std::max(worst, std::abs(std::remainder(degrees, 90.0)));
  }
  return worst;
}

}  // namespace

int main() {
  // Where each wall is seen from the one before: m, m, rad. In truth they are
  // 2 m apart and turn by 90 degrees, left and right in turn.
  std::vector<Eigen::Vector3d> steps;
  const double heading_errors[] = {0.3, -0.1, 0.3, 0.2, -0.1, 0.2, 0.1};
  for (std::size_t i = 0; i < std::size(heading_errors); ++i) {
    const double turn = i % 2 == 0 ? 90.0 : -90.0;
    steps.emplace_back(2.0, 0.0, DegToRad(turn + heading_errors[i]));
  }

  //! [orchestrator]
  plumbline::Registry registry;
  plumbline::RegisterBuiltins(&registry);

  plumbline::Graph graph;
  plumbline::Transaction transaction;
  plumbline::Feature wall;
  wall.type = &registry.GetFeature("segment");
  wall.extent_begin = -1.0;
  wall.extent_end = 1.0;
  wall.fixed = true;  // The first one holds the map in place.
  plumbline::FeatureId previous = transaction.AddFeature(wall);
  for (const Eigen::Vector3d& step : steps) {
    const double heading = wall.parameters[2];
    wall.parameters[0] += std::cos(heading) * step[0];
    wall.parameters[1] += std::sin(heading) * step[0];
    wall.parameters[2] += step[2];
    wall.fixed = false;
    const plumbline::FeatureId id = transaction.AddFeature(wall);

    transaction.AddConstraint(plumbline::MakeMeasurement(
        registry.GetRelation("pose_pose"), {previous, id}, step,
        plumbline::InformationFromSigmas(
            Eigen::Vector3d(kPositionSigma, kPositionSigma, kHeadingSigma)),
        "example"));
    previous = id;
  }
  graph.Apply(std::move(transaction));

  plumbline::SolverSession session(&graph, registry, {});
  plumbline::EmOrchestrator em(
      &graph, &session, registry,
      plumbline::MakeHierarchy(
          plumbline::ParseHierarchy("orientation_mixture/orientation_relation"),
          registry, {"segment"}, {}),
      {});
  const double before = WorstDirection(graph);
  const plumbline::EmReport report = em.Run();
  //! [orchestrator]

  int orientations = 0;
  for (const plumbline::Feature* feature : graph.Features()) {
    if (feature->type->Is(plumbline::FeatureRole::kDirection)) ++orientations;
  }
  const double after = WorstDirection(graph);
  std::printf(
      "%d orientations after %d iterations; largest deviation from the axes "
      "%.2f degrees, %.2f before\n",
      orientations, report.iterations, after, before);
  return report.converged() && orientations == 2 && after < 0.1 && before > 0.5
             ? 0
             : 1;
}
