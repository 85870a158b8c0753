#include <plumbline/core/marginals.h>
#include <plumbline/detectors/closure_candidates.h>
#include <plumbline/detectors/parameters.h>
#include <plumbline/detectors/place_search.h>
#include <plumbline/detectors/same_wall.h>
#include <plumbline/detectors/wall_graph.h>
#include <plumbline/detectors/wall_overlaps.h>
#include <plumbline/factors/segment_segment_collinearity.h>

#include <memory>
#include <utility>

namespace plumbline {

const char* const kSameWallRelation = SegmentSegmentCollinearity::kName;

namespace {

constexpr char kName[] = "same_wall";

void Bind(ParameterBinder* parameters, SameWallOptions* options) {
  ParameterBinder& p = *parameters;
  constexpr double kNoLimit = ParameterBinder::kNoLimit;
  p.Length("sigma_offset", &options->sigma_offset, 1e-6, 10.0,
           "tolerance of a wall seen twice, across");
  p.Angle("sigma_angle_deg", &options->sigma_angle, 1e-6, 90.0,
          "tolerance of its direction");
  p.Length("min_length", &options->min_length, 0.0, kNoLimit,
           "shortest segment that is looked at");
  p.Count("place_links", &options->place_links, 1,
          "measurement links from the middle of a place to its walls");
  p.Length("place_radius", &options->place_radius, 0.1, kNoLimit,
           "how far they are from it");
  p.Length("place_spacing", &options->place_spacing, 0.0, kNoLimit,
           "how far from the last a new place begins");
  p.Count("min_links", &options->min_links, 1,
          "places fewer measurement links apart are of one visit");
  p.Number("covariance_scale", &options->covariance_scale, 1e-3, 1e3, "",
           "factor of the standard deviations that the graph gives");
  p.Number("drift_rate", &options->drift_rate, 0.0, 1.0, "m/m",
           "drift along the way between two places that is added");
  p.Length("known_sigma", &options->known_sigma, 0.0, kNoLimit,
           "walls side by side known to this are one ...");
  p.Length("known_offset", &options->known_offset, 0.0, kNoLimit,
           "... when they are within this offset");
  p.Length("contradiction", &options->contradiction, 0.0, kNoLimit,
           "two places that put a third this far apart are not both right");
  PlaceMatchOptions& match = options->match;
  p.Number("gate_sigmas", &match.gate, 0.1, 100.0, "",
           "displacements up to so many standard deviations are looked at");
  p.Length("tolerance", &match.tolerance, 1e-3, 10.0,
           "how close walls that are one lie");
  p.Angle("angle_tolerance_deg", &match.angle_tolerance, 1e-3, 45.0,
          "the same in direction, apart from noise");
  p.Angle("direction_noise_deg", &match.direction_noise, 0.0, 45.0,
          "noise of the direction of a wall of 1 m");
  p.Length("min_overlap", &match.min_overlap, 0.0, kNoLimit,
           "length over which they lie side by side");
  p.Length("narrow", &match.narrow, 0.0, kNoLimit,
           "half width of a search that reaches no other corridor");
  p.Number("min_evidence", &match.min_evidence, -kNoLimit, kNoLimit, "nats",
           "evidence beyond chance that a wider one needs");
  p.Number(
      "rival_margin", &match.rival_margin, 0.0, kNoLimit, "nats",
      "displacements that are not worse by this make a match ambiguous ...");
  p.Length("rival_offset", &match.rival_offset, 0.0, kNoLimit,
           "... where they put its wall elsewhere by more");
}

}  // namespace

SameWall::SameWall(const SameWallOptions& options) : options_(options) {}

const std::string& SameWall::name() const {
  static const std::string name = kName;
  return name;
}

Transaction SameWall::Detect(const Graph& graph, const Registry& registry,
                             const DetectionScope& scope) const {
  Transaction transaction;
  if (scope.features != nullptr || scope.level != 0) return transaction;
  const WallGraph walls(graph);
  Marginals marginals(graph, MarginalsOptions{/*hold_gauge=*/true});
  ClosureCandidates candidates(&walls);
  FindOverlaps(walls, options_, scope, &marginals, &candidates);
  if (scope.ShouldStop()) return transaction;
  const double narrow = options_.match.narrow + options_.match.tolerance;
  ComparePlaces(walls, options_, narrow, scope, &marginals, &candidates);
  if (scope.ShouldStop()) return transaction;
  scope.Count("walls", walls.size());
  for (const ClosureCandidate& candidate : candidates.Choose(narrow, scope)) {
    transaction.AddConstraint(MakeStructure(
        registry.GetRelation(kSameWallRelation),
        {walls.wall(candidate.pair.first).id,
         walls.wall(candidate.pair.second).id},
        Eigen::VectorXd::Zero(2),
        CollinearityInformation(options_.sigma_offset, options_.sigma_angle,
                                candidate.along),
        kName));
  }
  return transaction;
}

DetectorType SameWallType() {
  DetectorType type;
  type.name = kName;
  type.description =
      "Loop closures: segments of different visits that are one wall, matched "
      "place by place in agreement on one displacement";
  type.reads = {"segment"};
  SetParameters<SameWallOptions>(
      Bind,
      [](const SameWallOptions& options) {
        return std::make_unique<SameWall>(options);
      },
      &type);
  return type;
}

}  // namespace plumbline
