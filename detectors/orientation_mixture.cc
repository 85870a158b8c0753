#include <plumbline/core/error.h>
#include <plumbline/detectors/orientation_mixture.h>
#include <plumbline/detectors/parameters.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <set>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

constexpr char kName[] = "orientation_mixture";

// A direction of a feature that may join an orientation.
struct Candidate {
  const Feature* feature;
  double angle;
  // Of the relation: pi/2 across a rectangle, else 0.
  double expected;
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

bool IsLiveStructure(const Constraint& constraint) {
  return constraint.state == ConstraintState::kLive &&
         constraint.kind == ConstraintClass::kStructure;
}

// Whether a wall is tied to an orientation, or to a rectangle that is read as
// well and speaks for it.
bool IsTied(const Graph& graph, const Feature& feature, int level) {
  for (const ConstraintId id : graph.ConstraintsOf(feature.id)) {
    const Constraint& constraint = graph.GetConstraint(id);
    if (!IsLiveStructure(constraint)) continue;
    for (const FeatureId other_id : constraint.features) {
      const Feature& other = graph.GetFeature(other_id);
      if (other.type->name == "orientation" ||
          (other.type->name == "rectangle" && other.level <= level)) {
        return true;
      }
    }
  }
  return false;
}

// Collects what has no orientation yet.
class CandidateList {
 public:
  CandidateList(const Graph& graph, int level,
                const OrientationMixtureOptions& options)
      : graph_(graph), level_(level), options_(options) {}

  void Consider(const Feature& feature) {
    if (feature.level > level_) return;
    if (feature.type->name == "rectangle") return AddRectangle(feature);
    const int parameter = DirectionParameter(feature);
    if (parameter < 0) return;
    if (LengthOf(feature) < options_.min_length) {
      ++short_;
      return;
    }
    if (IsTied(graph_, feature, level_)) {
      ++tied_;
      return;
    }
    candidates_.push_back({&feature, feature.parameters[parameter], 0.0});
    AddSample(feature.parameters[parameter], LengthOf(feature));
  }

  const std::vector<Candidate>& candidates() const { return candidates_; }
  const std::vector<AxialSample>& samples() const { return samples_; }
  void Count(const DetectionScope& scope) const {
    scope.Count("walls without a direction",
                static_cast<std::int64_t>(candidates_.size()));
    scope.Count("walls refused: too short", short_);
    scope.Count("walls refused: have a direction", tied_);
  }

 private:
  void AddSample(double angle, double length) {
    samples_.push_back({angle,
                        options_.direction_noise / (length * std::sqrt(length)),
                        length});
  }

  // Both directions; its walls are the evidence.
  void AddRectangle(const Feature& rectangle) {
    bool is_tied[2] = {false, false};
    const auto is_across = [](double angle) {
      return std::abs(NormalizeAxial(angle)) > 0.25 * kPi;
    };
    for (const ConstraintId id : graph_.ConstraintsOf(rectangle.id)) {
      const Constraint& constraint = graph_.GetConstraint(id);
      if (IsLiveStructure(constraint) &&
          constraint.type->name == "rectangle_orientation") {
        is_tied[is_across(constraint.expected[0])] = true;
      }
    }
    for (const bool across : {false, true}) {
      if (is_tied[across]) continue;
      const double expected = across ? 0.5 * kPi : 0.0;
      candidates_.push_back(
          {&rectangle, rectangle.parameters[2] + expected, expected});
    }
    for (const ConstraintId id : graph_.ConstraintsOf(rectangle.id)) {
      const Constraint& constraint = graph_.GetConstraint(id);
      if (!IsLiveStructure(constraint) ||
          (constraint.type->name != "segment_rectangle" &&
           constraint.type->name != "line_rectangle") ||
          is_tied[is_across(constraint.expected[1])]) {
        continue;
      }
      const Feature& wall = graph_.GetFeature(constraint.features[0]);
      // A wall may be on two rectangles.
      if (!spoken_for_.insert(wall.id).second) continue;
      AddSample(rectangle.parameters[2] + constraint.expected[1],
                LengthOf(wall));
    }
  }

  const Graph& graph_;
  int level_;
  const OrientationMixtureOptions& options_;
  std::vector<Candidate> candidates_;
  std::vector<AxialSample> samples_;
  std::set<FeatureId> spoken_for_;
  std::int64_t short_ = 0;
  std::int64_t tied_ = 0;
};

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
  CandidateList list(graph, scope.level, options_);
  if (scope.features != nullptr) {
    for (const auto* ids : {scope.features, scope.lower_features}) {
      if (ids == nullptr) continue;
      for (const FeatureId id : *ids) {
        const Feature* feature = graph.FindFeature(id);
        if (feature != nullptr) list.Consider(*feature);
      }
    }
  } else {
    for (const Feature* feature : graph.Features()) list.Consider(*feature);
  }
  list.Count(scope);
  const std::vector<Candidate>& candidates = list.candidates();
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

  const std::vector<AxialComponent> components =
      FindAxialComponents(list.samples(), directions, options_.mixture);
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

  std::int64_t far = 0;
  for (const Candidate& candidate : candidates) {
    const int nearest =
        NearestAxial(directions, candidate.angle, options_.mixture.gate);
    if (nearest < 0) {
      ++far;
      continue;
    }
    Constraint constraint;
    constraint.type =
        &registry.GetRelation(candidate.feature->type->name + "_orientation");
    constraint.features = {candidate.feature->id, orientations[nearest]};
    constraint.expected = Eigen::VectorXd::Constant(1, candidate.expected);
    constraint.information = Eigen::MatrixXd::Constant(
        1, 1, 1.0 / (options_.sigma * options_.sigma));
    constraint.kind = ConstraintClass::kStructure;
    constraint.source = kName;
    transaction.AddConstraint(std::move(constraint));
  }
  scope.Count("directions found", static_cast<std::int64_t>(components.size()));
  scope.Count("walls refused: no direction within the gate", far);
  return transaction;
}

DetectorType OrientationMixtureType() {
  const OrientationMixtureOptions defaults;
  DetectorType type;
  type.name = kName;
  type.description =
      "Orientations of segments, lines and rectangles: Gaussian mixture of "
      "unknown size over clutter, split by the K^2 test of normality";
  type.reads = {"segment", "line", "rectangle"};
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
