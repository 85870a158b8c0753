#include <plumbline/core/error.h>
#include <plumbline/detectors/orientation_mixture.h>
#include <plumbline/detectors/parameters.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

constexpr char kName[] = "orientation_mixture";

// A feature that may join an orientation.
struct Candidate {
  const Feature* feature;
  double angle;
};

// Index of the direction among the parameters; -1 for types without one.
int DirectionParameter(const Feature& feature) {
  if (feature.type->name == "segment") return 2;
  if (feature.type->name == "line") return 1;
  return -1;
}

double LengthOf(const Feature& feature) {
  const double length = feature.extent_end - feature.extent_begin;
  return length == 0.0 ? 1.0 : std::abs(length);
}

bool IsTied(const Graph& graph, const Feature& feature) {
  for (const ConstraintId id : graph.ConstraintsOf(feature.id)) {
    const Constraint& constraint = graph.GetConstraint(id);
    if (constraint.state != ConstraintState::kLive ||
        constraint.kind != ConstraintClass::kStructure) {
      continue;
    }
    for (const FeatureId other : constraint.features) {
      if (other != feature.id &&
          graph.GetFeature(other).type->name == "orientation") {
        return true;
      }
    }
  }
  return false;
}

}  // namespace

OrientationMixture::OrientationMixture(const OrientationMixtureOptions& options)
    : options_(options) {}

const std::string& OrientationMixture::name() const {
  static const std::string name = kName;
  return name;
}

Transaction OrientationMixture::Detect(const Graph& graph,
                                       const Registry& registry,
                                       const DetectionScope& scope) const {
  std::vector<Candidate> candidates;
  const auto consider = [&](const Feature& feature) {
    if (feature.level > scope.level) return;
    const int parameter = DirectionParameter(feature);
    if (parameter < 0 || LengthOf(feature) < options_.min_length) return;
    if (IsTied(graph, feature)) return;
    candidates.push_back({&feature, feature.parameters[parameter]});
  };
  if (scope.features != nullptr) {
    for (const FeatureId id : *scope.features) {
      const Feature* feature = graph.FindFeature(id);
      if (feature != nullptr) consider(*feature);
    }
  } else {
    for (const Feature* feature : graph.Features()) consider(*feature);
  }
  Transaction transaction;
  if (candidates.empty()) return transaction;

  std::vector<FeatureId> orientations;
  std::vector<double> directions;
  for (const FeatureId id : graph.VirtualFeatures(scope.level + 1)) {
    const Feature& feature = graph.GetFeature(id);
    if (feature.type->name != "orientation") continue;
    orientations.push_back(id);
    directions.push_back(feature.parameters[0]);
  }

  std::vector<AxialSample> samples;
  samples.reserve(candidates.size());
  for (const Candidate& candidate : candidates) {
    const double length = LengthOf(*candidate.feature);
    samples.push_back({candidate.angle,
                       options_.direction_noise / (length * std::sqrt(length)),
                       length});
  }
  const std::vector<AxialComponent> components =
      FindAxialComponents(samples, directions, options_.mixture);
  for (const AxialComponent& component : components) {
    Feature orientation;
    orientation.type = &registry.GetFeature("orientation");
    orientation.level = scope.level + 1;
    orientation.is_virtual = true;
    orientation.parameters[0] = component.mean;
    orientation.source = kName;
    orientations.push_back(transaction.AddFeature(std::move(orientation)));
    directions.push_back(component.mean);
  }

  for (const Candidate& candidate : candidates) {
    const int nearest =
        NearestAxial(directions, candidate.angle, options_.mixture.gate);
    if (nearest < 0) continue;
    Constraint constraint;
    constraint.type =
        &registry.GetRelation(candidate.feature->type->name + "_orientation");
    constraint.features = {candidate.feature->id, orientations[nearest]};
    constraint.expected = Eigen::VectorXd::Zero(1);
    constraint.information = Eigen::MatrixXd::Constant(
        1, 1, 1.0 / (options_.sigma * options_.sigma));
    constraint.kind = ConstraintClass::kStructure;
    constraint.source = kName;
    transaction.AddConstraint(std::move(constraint));
  }
  return transaction;
}

DetectorType OrientationMixtureType() {
  const OrientationMixtureOptions defaults;
  DetectorType type;
  type.name = kName;
  type.description =
      "Orientations of segments and lines: Gaussian mixture of unknown size "
      "over clutter, split by the K^2 test of normality";
  type.reads = {"segment", "line"};
  type.makes = {"orientation"};
  type.defaults = {
      {"sigma_deg", RadToDeg(defaults.sigma)},
      {"min_length", defaults.min_length},
      {"direction_noise_deg", RadToDeg(defaults.direction_noise)},
      {"gate_deg", RadToDeg(defaults.mixture.gate)},
      {"max_stddev_deg", RadToDeg(defaults.mixture.max_stddev)},
      {"min_separation_deg", RadToDeg(defaults.mixture.min_separation)},
      {"min_support", static_cast<double>(defaults.mixture.min_support)},
      {"min_support_length", defaults.mixture.min_support_length},
      {"significance", defaults.mixture.significance},
      {"min_contrast", defaults.mixture.min_contrast},
      {"normality_significance", defaults.mixture.normality_significance},
  };
  type.make = [known = type.defaults](const DetectorParameters& given) {
    const ParameterReader reader(kName, known, given);
    OrientationMixtureOptions options;
    options.sigma = DegToRad(reader.Get("sigma_deg", 1e-6, 90.0));
    options.min_length = reader.Get("min_length", 0.0);
    options.direction_noise =
        DegToRad(reader.Get("direction_noise_deg", 0.0, 90.0));
    options.mixture.gate = DegToRad(reader.Get("gate_deg", 0.1, 45.0));
    options.mixture.max_stddev =
        DegToRad(reader.Get("max_stddev_deg", 0.1, 45.0));
    options.mixture.min_separation =
        DegToRad(reader.Get("min_separation_deg", 0.1, 45.0));
    options.mixture.min_support = reader.GetInt("min_support", 2);
    options.mixture.min_support_length = reader.Get("min_support_length", 0.0);
    options.mixture.significance = reader.Get("significance", 1e-300, 1.0);
    options.mixture.min_contrast = reader.Get("min_contrast", 1.0);
    options.mixture.normality_significance =
        reader.Get("normality_significance", 0.0, 1.0);
    return std::make_unique<OrientationMixture>(options);
  };
  return type;
}

}  // namespace plumbline
