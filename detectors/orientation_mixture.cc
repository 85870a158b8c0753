#include <plumbline/core/error.h>
#include <plumbline/detectors/direction_assignment.h>
#include <plumbline/detectors/map_directions.h>
#include <plumbline/detectors/orientation_mixture.h>
#include <plumbline/detectors/parameters.h>

#include <algorithm>
#include <cmath>
#include <map>
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
      if (other.type->Is(FeatureRole::kDirection) ||
          (other.type->Is(FeatureRole::kRectangle) && other.level <= level)) {
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
    if (feature.type->Is(FeatureRole::kRectangle)) return AddRectangle(feature);
    if (!feature.type->Is(FeatureRole::kWall)) return;
    if (LengthOf(feature) < options_.min_length) {
      ++short_;
      return;
    }
    if (IsTied(graph_, feature, level_)) {
      ++tied_;
      return;
    }
    const double direction = feature.type->frame(feature)[2];
    candidates_.push_back({&feature, direction, 0.0});
    AddSample(direction, LengthOf(feature));
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
    samples_.push_back(
        {angle, OwnDirectionSigma(length, options_.direction_noise), length});
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
          constraint.type->Is(RelationRole::kDirection)) {
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
          !constraint.type->Is(RelationRole::kSide) ||
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

void Bind(ParameterBinder* parameters, OrientationMixtureOptions* options) {
  ParameterBinder& p = *parameters;
  constexpr double kNoLimit = ParameterBinder::kNoLimit;
  p.Angle("sigma_deg", &options->sigma, 1e-6, 90.0,
          "tolerance of a wall against its orientation");
  p.Length("min_length", &options->min_length, 0.0, kNoLimit,
           "shortest wall that is looked at");
  p.Angle("direction_noise_deg", &options->direction_noise, 0.0, 90.0,
          "noise of the direction of a wall of 1 m");
  AxialMixtureOptions& mixture = options->mixture;
  p.Angle("gate_deg", &mixture.gate, 0.1, 45.0,
          "how near to an orientation a wall joins it");
  p.Angle("max_stddev_deg", &mixture.max_stddev, 0.1, 45.0,
          "widest spread of the walls of one orientation");
  p.Angle("min_separation_deg", &mixture.min_separation, 0.1, 45.0,
          "orientations nearer to each other are one");
  p.Count("min_support", &mixture.min_support, 2,
          "fewest walls that make an orientation");
  p.Length("min_support_length", &mixture.min_support_length, 0.0, kNoLimit,
           "least length of wall that makes one");
  p.Number("significance", &mixture.significance, 1e-300, 1.0, "",
           "chance at which clutter may look like an orientation");
  p.Number("min_contrast", &mixture.min_contrast, 1.0, kNoLimit, "",
           "density of walls at an orientation over that beside it");
  p.Number("normality_significance", &mixture.normality_significance, 0.0, 1.0,
           "", "chance at which one orientation may be split");
  p.Angle("own_direction_noise_deg", &options->own_direction_noise, 0.0, 90.0,
          "how far the visible part of a wall of 1 m may be off its direction");
  p.Number("innovation_gate", &options->assignment.gate, 0.0, kNoLimit, "",
           "largest chi-square of the innovation of a new tie");
  p.Number("breaking_gate", &options->assignment.breaking_gate, 0.0, kNoLimit,
           "", "chi-square of its innovation beyond which a tie is broken");
  p.Number("split_gate", &options->assignment.split_gate, 0.0, kNoLimit, "",
           "chi-square at which two orientations are two, not one");
  p.Number("link_sigma_scale", &options->links.sigma_scale, 1e-3, kNoLimit, "",
           "factor of the standard deviations of the map's links");
  p.Angle("link_sigma_floor_deg", &options->links.sigma_floor, 0.0, 90.0,
          "no link is known better than this");
}

}  // namespace

OrientationMixture::OrientationMixture(const OrientationMixtureOptions& options)
    : options_(options) {}

const std::string& OrientationMixture::name() const {
  static const std::string name = kName;
  return name;
}

namespace {

// A live tie of a wall to an orientation.
struct WallTie {
  ConstraintId constraint = kNoId;
  FeatureId orientation = kNoId;
};

WallTie TieOf(const Graph& graph, FeatureId wall) {
  for (const ConstraintId id : graph.ConstraintsOf(wall)) {
    const Constraint& constraint = graph.GetConstraint(id);
    if (!IsLiveStructure(constraint)) continue;
    for (const FeatureId other : constraint.features) {
      if (graph.GetFeature(other).type->Is(FeatureRole::kDirection)) {
        return {id, other};
      }
    }
  }
  return {};
}

// Walls whose directions the measurements tie to each other.
struct JudgedWalls {
  DirectionNetwork network;
  std::vector<FeatureId> ids;
  std::vector<DirectionWall> walls;
  // What the result depends on.
  std::vector<ConstraintId> constraints;
};

// Empty where there is nothing to judge by: parts of a map are not looked at
// so, and relations between walls that a front-end left neglect what their
// errors have in common, so that small innovations mean nothing.
JudgedWalls CollectJudgedWalls(const Graph& graph, const DetectionScope& scope,
                               const OrientationMixtureOptions& options) {
  JudgedWalls judged;
  if (scope.features != nullptr) return judged;
  MapDirections map = CollectDirections(graph, nullptr, options.links);
  if (!map.has_sightings) return judged;
  for (const auto& [id, node] : map.nodes) {
    const Feature& feature = graph.GetFeature(id);
    if (!feature.type->Is(FeatureRole::kWall) || feature.level > scope.level ||
        LengthOf(feature) < options.min_length || !map.network.HasLinks(node)) {
      continue;
    }
    const double length = LengthOf(feature);
    judged.ids.push_back(id);
    judged.walls.push_back(
        {node, length, OwnDirectionSigma(length, options.own_direction_noise)});
  }
  judged.network = std::move(map.network);
  judged.constraints = std::move(map.constraints);
  return judged;
}

// For each direction the orientation of the graph that shares the greatest
// length of walls with it, none of them twice; kNoId for a new one.
std::vector<FeatureId> MatchOrientations(
    const DirectionAssignment& assignment,
    const std::vector<DirectionWall>& walls, const std::vector<WallTie>& ties) {
  std::map<std::pair<std::size_t, FeatureId>, double> shared;
  for (std::size_t i = 0; i < walls.size(); ++i) {
    if (assignment.direction_of[i] < 0 || ties[i].orientation == kNoId) {
      continue;
    }
    shared[{static_cast<std::size_t>(assignment.direction_of[i]),
            ties[i].orientation}] += walls[i].length;
  }
  std::vector<std::pair<double, std::pair<std::size_t, FeatureId>>> by_length;
  for (const auto& [pair, length] : shared) by_length.push_back({length, pair});
  std::sort(
      by_length.begin(), by_length.end(), [](const auto& a, const auto& b) {
        return a.first != b.first ? a.first > b.first : a.second < b.second;
      });
  std::vector<FeatureId> orientations(assignment.directions.size(), kNoId);
  std::set<FeatureId> taken;
  for (const auto& [length, pair] : by_length) {
    if (orientations[pair.first] != kNoId || taken.count(pair.second) > 0) {
      continue;
    }
    orientations[pair.first] = pair.second;
    taken.insert(pair.second);
  }
  return orientations;
}

}  // namespace

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
    if (!feature.type->Is(FeatureRole::kDirection)) continue;
    orientations.push_back(id);
    directions.push_back(feature.parameters[0]);
  }

  const FeatureType& orientation_type = registry.GetFeature("orientation");
  const auto tie = [&](const Feature& wall, FeatureId orientation,
                       double expected, double own_sigma) {
    const RelationType* relation = registry.FindRelation(
        RelationRole::kDirection, *wall.type, orientation_type);
    if (relation == nullptr) return;
    const double variance =
        options_.sigma * options_.sigma + own_sigma * own_sigma;
    transaction.AddConstraint(
        MakeStructure(*relation, {wall.id, orientation},
                      Eigen::VectorXd::Constant(1, expected),
                      Eigen::MatrixXd::Constant(1, 1, 1.0 / variance), kName));
  };
  const auto add_orientation = [&](double angle) {
    Feature orientation;
    orientation.type = &orientation_type;
    orientation.level = scope.level + 1;
    orientation.is_virtual = true;
    orientation.parameters[0] = angle;
    orientation.source = kName;
    return transaction.AddFeature(std::move(orientation));
  };

  // What can be judged by its innovation is.
  JudgedWalls judged = CollectJudgedWalls(graph, scope, options_);
  std::int64_t refused = 0;
  std::int64_t moved = 0;
  if (!judged.ids.empty()) {
    if (judged.constraints != judged_constraints_ ||
        judged.ids != judged_ids_) {
      DirectionAssignmentOptions options = options_.assignment;
      options.sigma = options_.sigma;
      assignment_ = AssignDirections(std::move(judged.network), judged.walls,
                                     {}, options);
      judged_constraints_ = std::move(judged.constraints);
      judged_ids_ = judged.ids;
    }
    std::vector<WallTie> ties;
    for (const FeatureId id : judged.ids) ties.push_back(TieOf(graph, id));
    std::vector<FeatureId> shared =
        MatchOrientations(assignment_, judged.walls, ties);
    for (std::size_t k = 0; k < shared.size(); ++k) {
      const SharedDirection& direction = assignment_.directions[k];
      if (shared[k] != kNoId || static_cast<int>(direction.walls.size()) <
                                    std::max(2, options_.minimum_support)) {
        continue;
      }
      shared[k] = add_orientation(direction.angle);
      orientations.push_back(shared[k]);
      directions.push_back(direction.angle);
    }
    for (std::size_t i = 0; i < judged.ids.size(); ++i) {
      const Feature& wall = graph.GetFeature(judged.ids[i]);
      const int k = assignment_.direction_of[i];
      const FeatureId orientation = k < 0 ? kNoId : shared[k];
      refused += orientation == kNoId;
      if (ties[i].orientation == kNoId) {
        if (orientation != kNoId && !IsTied(graph, wall, scope.level)) {
          tie(wall, orientation, 0.0, judged.walls[i].own_sigma);
        }
      } else if (orientation == kNoId ? assignment_.innovations[i].chi_square >
                                            options_.assignment.breaking_gate
                                      : orientation != ties[i].orientation) {
        transaction.BreakConstraint(ties[i].constraint);
        ++moved;
        if (orientation != kNoId) {
          tie(wall, orientation, 0.0, judged.walls[i].own_sigma);
        }
      }
    }
  } else {
    for (const AxialComponent& component :
         FindAxialComponents(list.samples(), directions, options_.mixture)) {
      orientations.push_back(add_orientation(component.mean));
      directions.push_back(component.mean);
    }
  }

  const std::set<FeatureId> is_judged(judged.ids.begin(), judged.ids.end());
  std::int64_t far = 0;
  for (const Candidate& candidate : candidates) {
    if (is_judged.count(candidate.feature->id) > 0) continue;
    const int nearest =
        NearestAxial(directions, candidate.angle, options_.mixture.gate);
    if (nearest < 0) {
      ++far;
      continue;
    }
    tie(*candidate.feature, orientations[nearest], candidate.expected, 0.0);
  }
  scope.Count("directions found",
              static_cast<std::int64_t>(transaction.added_features().size()));
  scope.Count("walls refused: by their innovation", refused);
  scope.Count("walls moved to another direction", moved);
  scope.Count("walls refused: no direction within the gate", far);
  return transaction;
}

DetectorType OrientationMixtureType() {
  DetectorType type;
  type.name = kName;
  type.description =
      "Orientations of segments, lines and rectangles: Gaussian mixture of "
      "unknown size over clutter, split by the K^2 test of normality";
  type.reads = {"segment", "line", "rectangle"};
  type.makes = {"orientation"};
  SetParameters<OrientationMixtureOptions>(
      Bind,
      [](const OrientationMixtureOptions& options) {
        return std::make_unique<OrientationMixture>(options);
      },
      &type);
  return type;
}

}  // namespace plumbline
