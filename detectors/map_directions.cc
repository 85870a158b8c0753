#include <plumbline/core/constraint_evaluation.h>
#include <plumbline/core/information.h>
#include <plumbline/core/parallel_for.h>
#include <plumbline/core/registry.h>
#include <plumbline/detectors/heading_drift.h>
#include <plumbline/detectors/map_directions.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

// Index of the direction among the parameters of a frame (x, y, theta).
constexpr int kDirection = 2;
// Eigenvalues of the information of the position below this share of the
// largest one are rounding.
constexpr double kRounding = 1e-9;

// Constraints that one thread looks at, at a time.
constexpr std::size_t kAtOnce = 256;

// Groups of links: relative poses, and what a pose sees of a wall.
constexpr int kRelative = 0;
constexpr int kSighted = 1;
constexpr int kPasses = 3;

// Information of the direction (third row) when the first two are open.
double WithoutPosition(const Eigen::Matrix3d& information) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> position(
      Eigen::Matrix2d(information.topLeftCorner<2, 2>()));
  const Eigen::Vector2d cross = information.block<2, 1>(0, kDirection);
  double schur = information(kDirection, kDirection);
  for (int i = 0; i < 2; ++i) {
    const double value = position.eigenvalues()[i];
    if (value <= kRounding * position.eigenvalues()[1]) continue;
    const double along = position.eigenvectors().col(i).dot(cross);
    schur -= along * along / value;
  }
  return schur <= kRounding * information(kDirection, kDirection) ? 0.0 : schur;
}

struct Difference {
  // rad: what the constraint wants of second minus first, and how much.
  double angle = 0.0;
  double information = 0.0;
};

Difference DirectionOf(const Graph& graph, const Constraint& constraint) {
  using RowMajor =
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Difference difference;
  if (constraint.type->Is(RelationRole::kPose)) {
    // The expected value is the relative pose.
    difference.angle = constraint.expected[kDirection];
    difference.information = WithoutPosition(constraint.information);
    return difference;
  }
  const std::vector<const Feature*> features = FeaturesOf(graph, constraint);
  const Feature& first = *features[0];
  const Feature& second = *features[1];
  const auto cost =
      MakeCost(constraint, SqrtInformation(constraint.information), features);
  Eigen::VectorXd residual(constraint.type->residual_size);
  RowMajor jacobian(constraint.type->residual_size, second.type->size);
  double* jacobians[] = {nullptr, jacobian.data()};
  if (!Evaluate(graph, constraint, *cost, residual.data(), jacobians) ||
      !residual.allFinite() || !jacobian.allFinite()) {
    return difference;
  }
  const Eigen::Matrix3d information = jacobian.transpose() * jacobian;
  const Eigen::Vector3d gradient = jacobian.transpose() * residual;
  // Out of the two rows of the position only what is known is eliminated.
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> position(
      Eigen::Matrix2d(information.topLeftCorner<2, 2>()));
  const Eigen::Vector2d cross = information.block<2, 1>(0, kDirection);
  double schur = information(kDirection, kDirection);
  double pull = gradient[kDirection];
  for (int i = 0; i < 2; ++i) {
    const double value = position.eigenvalues()[i];
    if (value <= kRounding * position.eigenvalues()[1]) continue;
    const Eigen::Vector2d axis = position.eigenvectors().col(i);
    const double share = axis.dot(cross) / value;
    schur -= share * axis.dot(cross);
    pull -= share * axis.dot(gradient.head<2>());
  }
  if (schur <= kRounding * information(kDirection, kDirection)) {
    return difference;
  }
  difference.angle = second.parameters[kDirection] -
                     first.parameters[kDirection] - pull / schur;
  difference.information = schur;
  return difference;
}

// A link of the network, and the features whose directions it ties.
struct DirectionLink {
  FeatureId from = kNoId;
  FeatureId to = kNoId;
  Difference difference;
  bool is_sighting = false;
};

// Adds to what was measured between poses what it lacks by systematic errors.
void CorrectDrift(const Graph& graph, std::vector<DirectionLink>* links) {
  std::map<FeatureId, std::size_t> order;
  for (const DirectionLink& link : *links) {
    for (const FeatureId id : {link.from, link.to}) {
      if (graph.GetFeature(id).type->Is(FeatureRole::kPose)) order[id] = 0;
    }
  }
  std::vector<double> headings;
  for (auto& [id, place] : order) {
    place = headings.size();
    headings.push_back(graph.GetFeature(id).parameters[kDirection]);
  }
  HeadingDrift drift(std::move(headings));
  const auto is_between_poses = [&](const DirectionLink& link) {
    return !link.is_sighting && order.count(link.from) > 0 &&
           order.count(link.to) > 0;
  };
  for (const DirectionLink& link : *links) {
    if (!is_between_poses(link)) continue;
    const std::size_t from = order[link.from];
    if (order[link.to] != from + 1) continue;
    drift.AddTurn(from, link.difference.angle, link.difference.information);
  }
  drift.Estimate();
  for (DirectionLink& link : *links) {
    if (!is_between_poses(link)) continue;
    link.difference.angle += drift.Between(order[link.from], order[link.to]);
  }
}

}  // namespace

bool HasDirection(const Feature& feature) {
  return feature.type->traits.leading == Leading::kFrame &&
         (feature.type->Is(FeatureRole::kPose) ||
          feature.type->Is(FeatureRole::kWall));
}

MapDirections CollectDirections(const Graph& graph,
                                const std::vector<FeatureId>* scope,
                                const MapDirectionsOptions& options) {
  MapDirections result;
  std::vector<const Feature*> features;
  if (scope == nullptr) {
    features = graph.Features();
  } else {
    for (const FeatureId id : *scope) {
      const Feature* feature = graph.FindFeature(id);
      if (feature != nullptr) features.push_back(feature);
    }
  }
  for (const Feature* feature : features) {
    if (HasDirection(*feature)) {
      result.nodes.emplace(
          feature->id, result.network.AddNode(feature->parameters[kDirection]));
    }
  }
  std::vector<const Constraint*> measurements;
  for (const auto& [id, node] : result.nodes) {
    for (const ConstraintId constraint_id : graph.ConstraintsOf(id)) {
      const Constraint& constraint = graph.GetConstraint(constraint_id);
      if (constraint.state != ConstraintState::kLive ||
          constraint.kind != ConstraintClass::kMeasurement ||
          constraint.features.size() != 2 || constraint.features[0] != id) {
        continue;
      }
      const auto second = result.nodes.find(constraint.features[1]);
      if (second == result.nodes.end() || second->second == node) continue;
      measurements.push_back(&constraint);
    }
  }
  std::vector<Difference> differences(measurements.size());
  ParallelFor((measurements.size() + kAtOnce - 1) / kAtOnce, ThreadsHere(),
              [&](std::size_t part) {
                const std::size_t end =
                    std::min(measurements.size(), (part + 1) * kAtOnce);
                for (std::size_t k = part * kAtOnce; k < end; ++k) {
                  differences[k] = DirectionOf(graph, *measurements[k]);
                }
              });
  std::vector<DirectionLink> links;
  for (std::size_t k = 0; k < measurements.size(); ++k) {
    const Constraint& constraint = *measurements[k];
    const Difference& difference = differences[k];
    if (difference.information <= 0.0) continue;
    const double variance = 1.0 / difference.information;
    if (!(variance < DirectionNetwork::kUnknownVariance)) continue;
    const bool is_sighting = !constraint.type->Is(RelationRole::kPose);
    result.constraints.push_back(constraint.id);
    result.has_sightings = result.has_sightings || is_sighting;
    links.push_back({constraint.features[0], constraint.features[1], difference,
                     is_sighting});
  }
  CorrectDrift(graph, &links);
  for (const DirectionLink& link : links) {
    result.network.AddLink(result.nodes.at(link.from), result.nodes.at(link.to),
                           link.difference.angle,
                           1.0 / link.difference.information, false,
                           link.is_sighting ? kSighted : kRelative);
  }
  if (!result.has_sightings) return result;
  // Variances as the residuals show them to be. Relations between features were
  // made of common observations, so that they agree better than they are right.
  double factors[2] = {1.0, 1.0};
  for (int pass = 0; pass < kPasses; ++pass) {
    result.network.SolveAngles();
    for (const int group : {kRelative, kSighted}) {
      double factor = result.network.VarianceFactor(group);
      if (group == kRelative) factor = std::max(factor, 1.0 / factors[group]);
      factors[group] *= factor;
      result.network.ScaleVariances(group, factor, 0.0);
    }
  }
  for (const int group : {kRelative, kSighted}) {
    const double scale = options.sigma_scale * options.sigma_scale;
    result.network.ScaleVariances(
        group, scale, scale * options.sigma_floor * options.sigma_floor);
  }
  return result;
}

double OwnDirectionSigma(double length, double sigma_of_one_metre) {
  return sigma_of_one_metre / (length * std::sqrt(length));
}

void AddOrientations(const Graph& graph, double sigma_of_one_metre,
                     MapDirections* map) {
  const std::map<FeatureId, std::size_t> walls = map->nodes;
  for (const auto& [id, node] : walls) {
    const Feature& wall = graph.GetFeature(id);
    for (const ConstraintId constraint_id : graph.ConstraintsOf(id)) {
      const Constraint& constraint = graph.GetConstraint(constraint_id);
      if (constraint.state != ConstraintState::kLive ||
          !constraint.type->Is(RelationRole::kDirection)) {
        continue;
      }
      const FeatureId orientation = constraint.features[1];
      auto found = map->nodes.find(orientation);
      if (found == map->nodes.end()) {
        found = map->nodes
                    .emplace(orientation,
                             map->network.AddNode(
                                 graph.GetFeature(orientation).parameters[0]))
                    .first;
      }
      const double own =
          OwnDirectionSigma(std::max(wall.extent_end - wall.extent_begin, 0.1),
                            sigma_of_one_metre);
      // The tolerance may contain the wall's own error.
      map->network.AddLink(
          node, found->second, constraint.expected[0],
          std::max(1.0 / constraint.information(0, 0), own * own), true);
    }
  }
}

}  // namespace plumbline
