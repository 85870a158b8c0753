#include <plumbline/core/em_scope.h>
#include <plumbline/detectors/direction_assignment.h>
#include <plumbline/detectors/direction_scatter.h>
#include <plumbline/detectors/map_directions.h>
#include <plumbline/detectors/orientation_mixture.h>
#include <plumbline/detectors/parameters.h>
#include <plumbline/factors/chi_square.h>

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

// Whether a live relation says that two orientations are one.
bool AreParallel(const Graph& graph, FeatureId a, FeatureId b) {
  for (const ConstraintId id : graph.ConstraintsOf(a)) {
    const Constraint& constraint = graph.GetConstraint(id);
    if (IsLiveStructure(constraint) &&
        constraint.type->Is(RelationRole::kAngle) &&
        constraint.features.size() == 2 &&
        (constraint.features[0] == b || constraint.features[1] == b) &&
        NormalizeAxial(constraint.expected[0]) == 0.0) {
      return true;
    }
  }
  return false;
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

// Makes one of directions whose orientations a live relation makes parallel:
// what the relation's own test has found to be one needs no second feature.
void JoinParallel(const Graph& graph, std::vector<FeatureId>* orientations,
                  DirectionAssignment* assignment) {
  for (std::size_t k = 1; k < orientations->size(); ++k) {
    if ((*orientations)[k] == kNoId) continue;
    for (std::size_t j = 0; j < k; ++j) {
      if ((*orientations)[j] == kNoId ||
          !AreParallel(graph, (*orientations)[j], (*orientations)[k])) {
        continue;
      }
      std::vector<std::size_t>& walls = assignment->directions[k].walls;
      for (const std::size_t wall : walls) {
        assignment->direction_of[wall] = static_cast<int>(j);
      }
      std::vector<std::size_t>& all = assignment->directions[j].walls;
      all.insert(all.end(), walls.begin(), walls.end());
      walls.clear();
      (*orientations)[k] = kNoId;
      break;
    }
  }
}

// The directions that walls may be tied to, and the ties that are proposed.
class Proposal {
 public:
  Proposal(const Graph& graph, const Registry& registry, int level,
           const OrientationMixtureOptions& options)
      : registry_(registry),
        orientation_type_(registry.GetFeature("orientation")),
        level_(level),
        variance_(options.sigma * options.sigma),
        break_below_(ChiSquarePValue(options.assignment.gate, 1)) {
    for (const FeatureId id : graph.VirtualFeatures(level)) {
      const Feature& feature = graph.GetFeature(id);
      if (!feature.type->Is(FeatureRole::kDirection)) continue;
      ids_.push_back(id);
      angles_.push_back(feature.parameters[0]);
    }
  }

  FeatureId AddOrientation(double angle) {
    Feature orientation;
    orientation.type = &orientation_type_;
    orientation.level = level_;
    orientation.is_virtual = true;
    orientation.parameters[0] = angle;
    orientation.source = kName;
    ids_.push_back(transaction_.AddFeature(std::move(orientation)));
    angles_.push_back(angle);
    return ids_.back();
  }

  // Proposes nothing where no relation ties such a feature. `own_sigma`: as
  // DirectionWall has it.
  void Tie(const Feature& feature, FeatureId orientation, double expected,
           double own_sigma) {
    const RelationType* relation = registry_.FindRelation(
        RelationRole::kDirection, *feature.type, orientation_type_);
    if (relation == nullptr) return;
    const double variance = variance_ + own_sigma * own_sigma;
    Constraint tie =
        MakeStructure(*relation, {feature.id, orientation},
                      Eigen::VectorXd::Constant(1, expected),
                      Eigen::MatrixXd::Constant(1, 1, 1.0 / variance), kName);
    // What was accepted by its innovation goes at the same gate.
    if (own_sigma > 0.0) tie.break_below = break_below_;
    transaction_.AddConstraint(std::move(tie));
  }

  void Break(ConstraintId tie) { transaction_.BreakConstraint(tie); }

  // The orientation nearest to an angle; kNoId beyond the gate (rad).
  FeatureId Nearest(double angle, double gate) const {
    const int nearest = NearestAxial(angles_, angle, gate);
    return nearest < 0 ? kNoId : ids_[static_cast<std::size_t>(nearest)];
  }

  const std::vector<double>& angles() const { return angles_; }
  std::int64_t num_found() const {
    return static_cast<std::int64_t>(transaction_.added_features().size());
  }
  Transaction Take() { return std::move(transaction_); }

 private:
  const Registry& registry_;
  const FeatureType& orientation_type_;
  // Of the orientations.
  const int level_;
  // Of a tie, without the wall's own error, rad^2.
  const double variance_;
  // Of a tie that was judged by its innovation.
  const double break_below_;
  std::vector<FeatureId> ids_;
  std::vector<double> angles_;
  Transaction transaction_;
};

// All features, or those that a scope lists.
CandidateList CollectCandidates(const Graph& graph, const DetectionScope& scope,
                                const OrientationMixtureOptions& options) {
  CandidateList list(graph, scope.level, options);
  if (scope.features == nullptr) {
    for (const Feature* feature : graph.Features()) list.Consider(*feature);
    return list;
  }
  for (const auto* ids : {scope.features, scope.lower_features}) {
    if (ids == nullptr) continue;
    for (const FeatureId id : *ids) {
      const Feature* feature = graph.FindFeature(id);
      if (feature != nullptr) list.Consider(*feature);
    }
  }
  return list;
}

// What became of the walls that were judged by their innovation.
struct AssignmentCounts {
  std::int64_t refused = 0;
  std::int64_t moved = 0;
};

// Ties judged walls as they were assigned, and breaks the ties that lost.
// Directions of the assignment that have become one are joined.
AssignmentCounts ProposeAssignment(const Graph& graph,
                                   const DetectionScope& scope,
                                   const OrientationMixtureOptions& options,
                                   const JudgedWalls& judged,
                                   DirectionAssignment* assignment,
                                   Proposal* proposal) {
  std::vector<WallTie> ties;
  for (const FeatureId id : judged.ids) ties.push_back(TieOf(graph, id));
  std::vector<FeatureId> shared =
      MatchOrientations(*assignment, judged.walls, ties);
  JoinParallel(graph, &shared, assignment);
  for (std::size_t k = 0; k < shared.size(); ++k) {
    const SharedDirection& direction = assignment->directions[k];
    if (shared[k] == kNoId && static_cast<int>(direction.walls.size()) >=
                                  std::max(2, options.minimum_support)) {
      shared[k] = proposal->AddOrientation(direction.angle);
    }
  }
  AssignmentCounts counts;
  for (std::size_t i = 0; i < judged.ids.size(); ++i) {
    const Feature& wall = graph.GetFeature(judged.ids[i]);
    const double own_sigma = judged.walls[i].own_sigma;
    const int k = assignment->direction_of[i];
    const FeatureId orientation = k < 0 ? kNoId : shared[k];
    counts.refused += orientation == kNoId;
    if (ties[i].orientation == kNoId) {
      if (orientation != kNoId && !IsTied(graph, wall, scope.level)) {
        proposal->Tie(wall, orientation, 0.0, own_sigma);
      }
      continue;
    }
    // A wall that waits keeps its direction unless that is refuted.
    const bool has_lost = orientation == kNoId
                              ? assignment->innovations[i].chi_square >
                                    options.assignment.breaking_gate
                              : orientation != ties[i].orientation;
    if (!has_lost) continue;
    proposal->Break(ties[i].constraint);
    ++counts.moved;
    if (orientation != kNoId) {
      proposal->Tie(wall, orientation, 0.0, own_sigma);
    }
  }
  return counts;
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
  const CandidateList list = CollectCandidates(graph, scope, options_);
  list.Count(scope);
  if (list.candidates().empty()) return {};
  Proposal proposal(graph, registry, scope.level + 1, options_);

  // What can be judged by its innovation is.
  JudgedWalls judged = CollectJudgedWalls(graph, scope, options_);
  AssignmentCounts counts;
  if (!judged.ids.empty()) {
    const bool is_new =
        judged.constraints != judged_constraints_ || judged.ids != judged_ids_;
    if (is_new) {
      judged.network.Solve();
      scatter_ = EstimateDirectionScatter(judged.network, judged.walls,
                                          options_.scatter);
    }
    for (DirectionWall& wall : judged.walls) {
      wall.own_sigma = std::hypot(wall.own_sigma, scatter_);
    }
    if (is_new) {
      DirectionAssignmentOptions assignment = options_.assignment;
      assignment.sigma = options_.sigma;
      assignment_ = AssignDirections(std::move(judged.network), judged.walls,
                                     {}, assignment, scope.stop);
      if (scope.ShouldStop()) return {};
      judged_constraints_ = std::move(judged.constraints);
      judged_ids_ = judged.ids;
    }
    counts = ProposeAssignment(graph, scope, options_, judged, &assignment_,
                               &proposal);
  } else {
    for (const AxialComponent& component : FindAxialComponents(
             list.samples(), proposal.angles(), options_.mixture)) {
      proposal.AddOrientation(component.mean);
    }
  }

  const std::set<FeatureId> is_judged(judged.ids.begin(), judged.ids.end());
  std::int64_t far = 0;
  for (const Candidate& candidate : list.candidates()) {
    if (is_judged.count(candidate.feature->id) > 0) continue;
    const FeatureId nearest =
        proposal.Nearest(candidate.angle, options_.mixture.gate);
    if (nearest == kNoId) {
      ++far;
      continue;
    }
    proposal.Tie(*candidate.feature, nearest, candidate.expected, 0.0);
  }
  scope.Count("directions found", proposal.num_found());
  scope.Count("walls refused: by their innovation", counts.refused);
  scope.Count("walls moved to another direction", counts.moved);
  scope.Count("walls refused: no direction within the gate", far);
  return proposal.Take();
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
