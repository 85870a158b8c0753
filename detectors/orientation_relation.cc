#include <plumbline/core/error.h>
#include <plumbline/detectors/axial.h>
#include <plumbline/detectors/map_directions.h>
#include <plumbline/detectors/orientation_relation.h>
#include <plumbline/detectors/parameters.h>

#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <set>
#include <utility>

namespace plumbline {
namespace {

constexpr char kName[] = "orientation_relation";
constexpr char kAnglePrefix[] = "angle_";
constexpr char kAngleSigmaPrefix[] = "angle_sigma_deg_";

}  // namespace

OrientationRelation::OrientationRelation(OrientationRelationOptions options)
    : options_(std::move(options)) {
  // An angle between undirected lines has no sign: 45 degrees is 135 from the
  // other side.
  std::vector<double> both;
  std::vector<double> sigmas;
  for (std::size_t i = 0; i < options_.angles.size(); ++i) {
    const double own =
        i < options_.angle_sigmas.size() ? options_.angle_sigmas[i] : 0.0;
    for (const double sign : {1.0, -1.0}) {
      both.push_back(NormalizeAxial(sign * options_.angles[i]));
      sigmas.push_back(own > 0.0 ? own : options_.sigma);
    }
  }
  options_.angles = std::move(both);
  options_.angle_sigmas = std::move(sigmas);
}

const std::string& OrientationRelation::name() const {
  static const std::string name = kName;
  return name;
}

Transaction OrientationRelation::Detect(const Graph& graph,
                                        const Registry& registry,
                                        const DetectionScope& scope) const {
  std::vector<const Feature*> orientations;
  const auto consider = [&](const Feature& feature) {
    if (feature.level == scope.level && feature.type->name == "orientation") {
      orientations.push_back(&feature);
    }
  };
  std::set<FeatureId> ids(graph.VirtualFeatures(scope.level).begin(),
                          graph.VirtualFeatures(scope.level).end());
  if (scope.features != nullptr) {
    ids.insert(scope.features->begin(), scope.features->end());
    for (const FeatureId id : ids) {
      const Feature* feature = graph.FindFeature(id);
      if (feature != nullptr) consider(*feature);
    }
  } else if (scope.level > 0) {
    for (const FeatureId id : ids) consider(graph.GetFeature(id));
  } else {
    // Orientations that were read from a file may be raw.
    for (const Feature* feature : graph.Features()) consider(*feature);
  }

  std::int64_t pairs = 0;
  std::int64_t no_angle = 0;
  std::int64_t there = 0;
  std::int64_t contradicted = 0;
  // Where poses that saw the walls are in the graph, a relation is judged by
  // its innovation: a small difference that is known well is one all the same.
  MapDirections map;
  if (scope.features == nullptr) {
    map = CollectDirections(graph, nullptr, options_.links);
    if (map.has_sightings) {
      AddOrientations(graph, options_.own_direction_noise, &map);
      map.network.Solve();
    }
  }
  std::map<std::size_t, Eigen::VectorXd> columns;
  const auto contradicts = [&](const Feature& first, const Feature& second,
                               double angle, double sigma) {
    if (!map.has_sightings) return false;
    const auto a = map.nodes.find(first.id);
    const auto b = map.nodes.find(second.id);
    if (a == map.nodes.end() || b == map.nodes.end()) return false;
    const double difference = NormalizeAxial(
        map.network.Angle(b->second) - map.network.Angle(a->second) - angle);
    Eigen::VectorXd& column = columns[b->second];
    if (column.size() == 0) column = map.network.CovarianceColumn(b->second);
    const double variance =
        map.network.Variance(a->second) + map.network.Variance(b->second) -
        2.0 * column[static_cast<Eigen::Index>(a->second)] + sigma * sigma;
    return difference * difference > options_.innovation_gate * variance;
  };

  Transaction transaction;
  for (std::size_t j = 1; j < orientations.size(); ++j) {
    const Feature& second = *orientations[j];
    std::set<FeatureId> related;
    for (const ConstraintId id : graph.ConstraintsOf(second.id)) {
      const Constraint& constraint = graph.GetConstraint(id);
      if (constraint.state != ConstraintState::kLive ||
          constraint.type->name != "orientation_orientation") {
        continue;
      }
      related.insert(constraint.features.begin(), constraint.features.end());
    }
    int relations = 0;
    for (std::size_t i = 0; i < j && relations < options_.max_relations; ++i) {
      ++pairs;
      const Feature& first = *orientations[i];
      const double angle =
          NormalizeAxial(second.parameters[0] - first.parameters[0]);
      const int nearest = NearestAxial(options_.angles, angle, options_.gate);
      if (nearest < 0) {
        ++no_angle;
        continue;
      }
      // Counted whether it is there or not, so that what is proposed does not
      // depend on what was before.
      ++relations;
      if (related.count(first.id) > 0) {
        ++there;
        continue;
      }
      if (contradicts(first, second, options_.angles[nearest],
                      options_.angle_sigmas[nearest])) {
        ++contradicted;
        continue;
      }
      Constraint constraint;
      constraint.type = &registry.GetRelation("orientation_orientation");
      constraint.features = {first.id, second.id};
      constraint.expected =
          Eigen::VectorXd::Constant(1, options_.angles[nearest]);
      const double sigma =
          options_.angle_sigmas[static_cast<std::size_t>(nearest)];
      constraint.information =
          Eigen::MatrixXd::Constant(1, 1, 1.0 / (sigma * sigma));
      constraint.kind = ConstraintClass::kStructure;
      constraint.source = kName;
      transaction.AddConstraint(std::move(constraint));
    }
  }
  scope.Count("orientations", static_cast<std::int64_t>(orientations.size()));
  scope.Count("orientation pairs", pairs);
  scope.Count("orientation pairs refused: at no allowed angle", no_angle);
  scope.Count("orientation pairs refused: related already", there);
  scope.Count("orientation pairs refused: by their innovation", contradicted);
  return transaction;
}

DetectorType OrientationRelationType() {
  const OrientationRelationOptions defaults;
  DetectorType type;
  type.name = kName;
  type.description =
      "Relations between orientations at allowed angles: angle_0, angle_1, ... "
      "in degrees (0, 45, 90, 135), or the multiples of resolution_deg";
  type.reads = {"orientation"};
  type.defaults = {
      {"gate_deg", RadToDeg(defaults.gate)},
      {"sigma_deg", RadToDeg(defaults.sigma)},
      {"resolution_deg", 0.0},
      {"max_relations", static_cast<double>(defaults.max_relations)},
      {"innovation_gate", defaults.innovation_gate},
      {"link_sigma_scale", defaults.links.sigma_scale},
  };
  type.make = [known = type.defaults](const DetectorParameters& given) {
    const ParameterReader reader(kName, known, given,
                                 {kAnglePrefix, kAngleSigmaPrefix});
    OrientationRelationOptions options;
    options.gate = DegToRad(reader.Get("gate_deg", 0.0, 45.0));
    options.sigma = DegToRad(reader.Get("sigma_deg", 1e-6, 90.0));
    options.max_relations = reader.GetInt("max_relations", 1);
    options.innovation_gate = reader.Get("innovation_gate", 0.0);
    options.links.sigma_scale = reader.Get("link_sigma_scale", 1e-3);
    std::vector<double> angles;
    std::vector<double> sigmas;
    for (const auto& [name, value] : reader.values()) {
      if (name.rfind(kAngleSigmaPrefix, 0) == 0) {
        const std::string number =
            name.substr(std::string(kAngleSigmaPrefix).size());
        if (reader.values().count(kAnglePrefix + number) == 0) {
          throw PLUMBLINE_ERROR(
              std::string(kName) + ": " + name + " is of no angle",
              kAnglePrefix + number);
        }
      } else if (name.rfind(kAnglePrefix, 0) == 0) {
        angles.push_back(DegToRad(reader.Get(name, -360.0, 360.0)));
        const std::string own =
            kAngleSigmaPrefix + name.substr(std::string(kAnglePrefix).size());
        sigmas.push_back(reader.values().count(own) > 0
                             ? DegToRad(reader.Get(own, 1e-6, 90.0))
                             : 0.0);
      }
    }
    const double resolution = reader.Get("resolution_deg", 0.0, 180.0);
    if (resolution > 0.0) {
      if (resolution < 0.01) {
        throw PLUMBLINE_ERROR(std::string(kName) + ": resolution_deg is " +
                                  std::to_string(resolution),
                              "0, or at least 0.01");
      }
      for (int i = 0; i * resolution < 180.0 - 1e-9; ++i) {
        angles.push_back(DegToRad(i * resolution));
      }
    }
    if (!angles.empty()) options.angles = std::move(angles);
    options.angle_sigmas = std::move(sigmas);
    return std::make_unique<OrientationRelation>(std::move(options));
  };
  return type;
}

}  // namespace plumbline
