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

const char kSameWallRelation[] = "segment_segment_collinearity";

namespace {

constexpr char kName[] = "same_wall";

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
  ComparePlaces(walls, options_, scope, &marginals, &candidates);
  if (scope.ShouldStop()) return transaction;
  scope.Count("walls", walls.size());
  const double narrow = options_.match.narrow + options_.match.tolerance;
  for (const ClosureCandidate& candidate : candidates.Choose(narrow, scope)) {
    Constraint constraint;
    constraint.type = &registry.GetRelation(kSameWallRelation);
    constraint.features = {walls.wall(candidate.pair.first).id,
                           walls.wall(candidate.pair.second).id};
    constraint.expected = Eigen::VectorXd::Zero(2);
    constraint.information = CollinearityInformation(
        options_.sigma_offset, options_.sigma_angle, candidate.along);
    constraint.kind = ConstraintClass::kStructure;
    constraint.source = kName;
    transaction.AddConstraint(std::move(constraint));
  }
  return transaction;
}

DetectorType SameWallType() {
  const SameWallOptions defaults;
  DetectorType type;
  type.name = kName;
  type.description =
      "Loop closures: segments of different visits that are one wall, matched "
      "place by place in agreement on one displacement";
  type.reads = {"segment"};
  type.defaults = {
      {"sigma_offset", defaults.sigma_offset},
      {"sigma_angle_deg", RadToDeg(defaults.sigma_angle)},
      {"min_length", defaults.min_length},
      {"place_links", static_cast<double>(defaults.place_links)},
      {"place_radius", defaults.place_radius},
      {"place_spacing", defaults.place_spacing},
      {"min_links", static_cast<double>(defaults.min_links)},
      {"covariance_scale", defaults.covariance_scale},
      {"drift_rate", defaults.drift_rate},
      {"known_sigma", defaults.known_sigma},
      {"known_offset", defaults.known_offset},
      {"contradiction", defaults.contradiction},
      {"gate_sigmas", defaults.match.gate},
      {"tolerance", defaults.match.tolerance},
      {"angle_tolerance_deg", RadToDeg(defaults.match.angle_tolerance)},
      {"direction_noise_deg", RadToDeg(defaults.match.direction_noise)},
      {"min_overlap", defaults.match.min_overlap},
      {"narrow", defaults.match.narrow},
      {"min_evidence", defaults.match.min_evidence},
      {"rival_margin", defaults.match.rival_margin},
      {"rival_offset", defaults.match.rival_offset},
  };
  type.make = [known = type.defaults](const DetectorParameters& given) {
    const ParameterReader reader(kName, known, given);
    SameWallOptions options;
    options.sigma_offset = reader.Get("sigma_offset", 1e-6, 10.0);
    options.sigma_angle = DegToRad(reader.Get("sigma_angle_deg", 1e-6, 90.0));
    options.min_length = reader.Get("min_length", 0.0);
    options.place_links = reader.GetInt("place_links", 1);
    options.place_radius = reader.Get("place_radius", 0.1);
    options.place_spacing = reader.Get("place_spacing", 0.0);
    options.min_links = reader.GetInt("min_links", 1);
    options.covariance_scale = reader.Get("covariance_scale", 1e-3, 1e3);
    options.drift_rate = reader.Get("drift_rate", 0.0, 1.0);
    options.known_sigma = reader.Get("known_sigma", 0.0);
    options.known_offset = reader.Get("known_offset", 0.0);
    options.contradiction = reader.Get("contradiction", 0.0);
    options.match.gate = reader.Get("gate_sigmas", 0.1, 100.0);
    options.match.tolerance = reader.Get("tolerance", 1e-3, 10.0);
    options.match.angle_tolerance =
        DegToRad(reader.Get("angle_tolerance_deg", 1e-3, 45.0));
    options.match.direction_noise =
        DegToRad(reader.Get("direction_noise_deg", 0.0, 45.0));
    options.match.min_overlap = reader.Get("min_overlap", 0.0);
    options.match.narrow = reader.Get("narrow", 0.0);
    options.match.min_evidence = reader.Get("min_evidence");
    options.match.rival_margin = reader.Get("rival_margin", 0.0);
    options.match.rival_offset = reader.Get("rival_offset", 0.0);
    return std::make_unique<SameWall>(options);
  };
  return type;
}

}  // namespace plumbline
