#include <plumbline/core/error.h>
#include <plumbline/core/marginals.h>
#include <plumbline/detectors/axial.h>
#include <plumbline/detectors/map_directions.h>
#include <plumbline/detectors/orientation_relation.h>
#include <plumbline/detectors/parameters.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

constexpr char kName[] = "orientation_relation";
constexpr char kAnglePrefix[] = "angle_";
constexpr char kAngleSigmaPrefix[] = "angle_sigma_deg_";

void Bind(ParameterBinder* parameters, OrientationRelationOptions* options) {
  ParameterBinder& p = *parameters;
  p.Angle("gate_deg", &options->gate, 0.0, 45.0,
          "how near to an expected angle two orientations are related");
  p.Angle("uncertain_gate_deg", &options->uncertain_gate, 0.0, 45.0,
          "the same where the map is not known better, in a graph whose "
          "measurements give no directions");
  p.Angle("sigma_deg", &options->sigma, 1e-6, 90.0,
          "tolerance of the relation");
  p.Count("max_relations", &options->max_relations, 1,
          "orientations before it that one is related to, at most");
  p.Number("innovation_gate", &options->innovation_gate, 0.0,
           ParameterBinder::kNoLimit, "",
           "largest chi-square of the innovation of a relation");
  p.Number("link_sigma_scale", &options->links.sigma_scale, 1e-3,
           ParameterBinder::kNoLimit, "",
           "factor of the standard deviations of the map's links");
  std::map<std::string, double> angles;
  p.AngleList(kAnglePrefix, &angles, -360.0, 360.0, "angles that are expected");
  std::map<std::string, double> sigmas;
  p.AngleList(kAngleSigmaPrefix, &sigmas, 1e-6, 90.0,
              "tolerances of the angles that have one of their own");
  double resolution = 0.0;
  p.Number("resolution_deg", &resolution, 0.0, 180.0, "deg",
           "its multiples are expected as well; 0: they are not");
  for (const auto& [number, unused] : sigmas) {
    if (angles.count(number) > 0) continue;
    throw PLUMBLINE_ERROR(std::string(kName) + ": " + kAngleSigmaPrefix +
                              number + " is of no angle",
                          kAnglePrefix + number);
  }
  if (resolution > 0.0 && resolution < 0.01) {
    throw PLUMBLINE_ERROR(std::string(kName) + ": resolution_deg is " +
                              std::to_string(resolution),
                          "0, or at least 0.01");
  }
  std::vector<double> expected;
  for (const auto& [number, angle] : angles) {
    expected.push_back(angle);
    const auto own = sigmas.find(number);
    options->angle_sigmas.push_back(own == sigmas.end() ? 0.0 : own->second);
  }
  if (resolution > 0.0) {
    for (int i = 0; i * resolution < 180.0 - 1e-9; ++i) {
      expected.push_back(DegToRad(i * resolution));
    }
  }
  if (!expected.empty()) options->angles = std::move(expected);
}

// Orientations of the scope's level: all virtual ones, and raw ones of the
// scope, as files may have them.
std::vector<const Feature*> OrientationsOf(const Graph& graph,
                                           const DetectionScope& scope) {
  std::set<FeatureId> ids(graph.VirtualFeatures(scope.level).begin(),
                          graph.VirtualFeatures(scope.level).end());
  for (const Feature* feature : FeaturesInScope(graph, scope)) {
    ids.insert(feature->id);
  }
  std::vector<const Feature*> orientations;
  for (const FeatureId id : ids) {
    const Feature& feature = graph.GetFeature(id);
    if (feature.type->Is(FeatureRole::kDirection)) {
      orientations.push_back(&feature);
    }
  }
  return orientations;
}

// Features that live constraints relate to an orientation at an angle, itself
// included.
std::set<FeatureId> RelatedTo(const Graph& graph, FeatureId orientation) {
  std::set<FeatureId> related;
  for (const ConstraintId id : graph.ConstraintsOf(orientation)) {
    const Constraint& constraint = graph.GetConstraint(id);
    if (constraint.state == ConstraintState::kLive &&
        constraint.type->Is(RelationRole::kAngle)) {
      related.insert(constraint.features.begin(), constraint.features.end());
    }
  }
  return related;
}

bool IsTied(const Graph& graph, FeatureId id) {
  const std::vector<ConstraintId>& on = graph.ConstraintsOf(id);
  return std::any_of(on.begin(), on.end(), [&](ConstraintId constraint) {
    return graph.GetConstraint(constraint).state == ConstraintState::kLive;
  });
}

// Whether a measurement of the graph may tell the direction of something.
bool MeasuresDirections(const Graph& graph) {
  for (const Feature* feature : graph.Features()) {
    if (!feature->is_virtual && HasDirection(*feature)) return true;
  }
  return false;
}

// Judges relations by their innovation. Mostly all orientations are related
// already, and none is judged.
class RelationJudge {
 public:
  RelationJudge(const Graph& graph, const DetectionScope& scope,
                const OrientationRelationOptions& options)
      : graph_(graph), options_(options), knows_(scope.features != nullptr) {}

  // Whether the measurements are against two orientations being at this angle
  // to this tolerance (rad), where the poses that saw the walls are in the
  // graph: a small difference that is known well is one all the same.
  bool Contradicts(const Feature& first, const Feature& second, double angle,
                   double sigma) {
    Learn();
    if (!map_.has_sightings) return false;
    const auto a = map_.nodes.find(first.id);
    const auto b = map_.nodes.find(second.id);
    if (a == map_.nodes.end() || b == map_.nodes.end()) return false;
    const double difference = NormalizeAxial(
        map_.network.Angle(b->second) - map_.network.Angle(a->second) - angle);
    Eigen::VectorXd& column = columns_[b->second];
    if (column.size() == 0) column = map_.network.CovarianceColumn(b->second);
    const double variance =
        map_.network.Variance(a->second) + map_.network.Variance(b->second) -
        2.0 * column[static_cast<Eigen::Index>(a->second)] + sigma * sigma;
    return difference * difference > options_.innovation_gate * variance;
  }

  // Whether a large difference (rad) is one that the map may have where it is
  // known no better, in a graph that measures no directions.
  bool MayBeOff(const Feature& first, const Feature& second,
                double difference) {
    if (!measures_directions_)
      measures_directions_ = MeasuresDirections(graph_);
    if (*measures_directions_ ||
        std::abs(difference) > options_.uncertain_gate ||
        !IsTied(graph_, first.id) || !IsTied(graph_, second.id)) {
      return false;
    }
    if (!marginals_) marginals_.emplace(graph_);
    const Eigen::MatrixXd one = Eigen::MatrixXd::Identity(1, 1);
    const double variance = marginals_->PropagatedCovariance(
        {first.id, second.id}, {-one, one})(0, 0);
    return variance <= options_.uncertain_gate * options_.uncertain_gate &&
           difference * difference <= options_.innovation_gate * variance;
  }

 private:
  void Learn() {
    if (knows_) return;
    knows_ = true;
    map_ = CollectDirections(graph_, nullptr, options_.links);
    if (!map_.has_sightings) return;
    AddOrientations(graph_, options_.own_direction_noise, &map_);
    map_.network.Solve();
  }

  const Graph& graph_;
  const OrientationRelationOptions& options_;
  // Whether the map is there; of parts of a map there is none.
  bool knows_;
  MapDirections map_;
  // Of the covariance, as far as they were asked for.
  std::map<std::size_t, Eigen::VectorXd> columns_;
  std::optional<bool> measures_directions_;
  std::optional<Marginals> marginals_;
};

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
  const std::vector<const Feature*> orientations = OrientationsOf(graph, scope);
  RelationJudge judge(graph, scope, options_);
  std::int64_t pairs = 0;
  std::int64_t no_angle = 0;
  std::int64_t there = 0;
  std::int64_t contradicted = 0;
  Transaction transaction;
  for (std::size_t j = 1; j < orientations.size(); ++j) {
    const Feature& second = *orientations[j];
    const std::set<FeatureId> related = RelatedTo(graph, second.id);
    int relations = 0;
    for (std::size_t i = 0; i < j && relations < options_.max_relations; ++i) {
      ++pairs;
      const Feature& first = *orientations[i];
      const double present =
          NormalizeAxial(second.parameters[0] - first.parameters[0]);
      const int nearest =
          NearestAxial(options_.angles, present,
                       std::max(options_.gate, options_.uncertain_gate));
      const double difference =
          nearest < 0 ? 0.0
                      : NormalizeAxial(
                            present -
                            options_.angles[static_cast<std::size_t>(nearest)]);
      if (nearest < 0 || (std::abs(difference) > options_.gate &&
                          related.count(first.id) == 0 &&
                          !judge.MayBeOff(first, second, difference))) {
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
      const double angle = options_.angles[static_cast<std::size_t>(nearest)];
      const double sigma =
          options_.angle_sigmas[static_cast<std::size_t>(nearest)];
      if (judge.Contradicts(first, second, angle, sigma)) {
        ++contradicted;
        continue;
      }
      transaction.AddConstraint(MakeStructure(
          registry.GetRelation(RelationRole::kAngle, *first.type, *second.type),
          {first.id, second.id}, Eigen::VectorXd::Constant(1, angle),
          InformationFromSigmas(Eigen::VectorXd::Constant(1, sigma)), kName));
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
  DetectorType type;
  type.name = kName;
  type.description =
      "Relations between orientations at allowed angles: angle_0, angle_1, ... "
      "in degrees (0, 45, 90, 135), or the multiples of resolution_deg";
  type.reads = {"orientation"};
  SetParameters<OrientationRelationOptions>(
      Bind,
      [](const OrientationRelationOptions& options) {
        return std::make_unique<OrientationRelation>(options);
      },
      &type);
  return type;
}

}  // namespace plumbline
