#include <plumbline/apps/experiments/concentricity.h>

#include <algorithm>
#include <set>
#include <utility>
#include <vector>

namespace plumbline {

void AddConcentricity(Concentricity method, double sigma,
                      const Registry& registry, Graph* graph) {
  std::vector<FeatureId> circles;
  Eigen::Vector2d center = Eigen::Vector2d::Zero();
  for (const Feature* feature : std::as_const(*graph).Features()) {
    if (feature->level == 0 && feature->type->Is(FeatureRole::kCircle)) {
      circles.push_back(feature->id);
      center += Eigen::Vector2d(feature->parameters[0], feature->parameters[1]);
    }
  }
  if (circles.empty()) return;
  Transaction transaction;
  const auto add = [&](FeatureId a, FeatureId b) {
    Constraint constraint;
    constraint.type = &registry.GetRelation("point_point_coincidence");
    constraint.features = {a, b};
    constraint.expected = Eigen::Vector2d::Zero();
    constraint.information = Eigen::Matrix2d::Identity() / (sigma * sigma);
    constraint.kind = ConstraintClass::kStructure;
    constraint.source = "concentricity";
    transaction.AddConstraint(std::move(constraint));
  };
  const std::size_t n = circles.size();
  switch (method) {
    case Concentricity::kChain:
      for (std::size_t i = 1; i < n; ++i) add(circles[i - 1], circles[i]);
      break;
    case Concentricity::kStar:
      for (std::size_t i = 1; i < n; ++i) add(circles[0], circles[i]);
      break;
    case Concentricity::kAllPairs:
      for (std::size_t i = 0; i < n; ++i) {
        for (std::size_t j = i + 1; j < n; ++j) add(circles[i], circles[j]);
      }
      break;
    case Concentricity::kCommonCenter: {
      center /= static_cast<double>(n);
      Feature feature;
      feature.type = &registry.GetFeature("point");
      feature.level = 1;
      feature.is_virtual = true;
      feature.source = "concentricity";
      feature.parameters = {center.x(), center.y()};
      const FeatureId id = transaction.AddFeature(feature);
      for (const FeatureId circle : circles) add(id, circle);
      break;
    }
  }
  graph->Apply(std::move(transaction));
}

ConcentricityResult CheckConcentricity(const Graph& graph,
                                       const SyntheticTruth& truth) {
  ConcentricityResult result;
  const std::set<FeatureId> outliers(truth.outliers.begin(),
                                     truth.outliers.end());
  std::map<FeatureId, std::vector<FeatureId>> neighbours;
  result.is_isolated = true;
  for (const Constraint* constraint : graph.Constraints()) {
    if (constraint->kind != ConstraintClass::kStructure ||
        constraint->state != ConstraintState::kLive) {
      continue;
    }
    for (const FeatureId id : constraint->features) {
      if (outliers.count(id) > 0) result.is_isolated = false;
      for (const FeatureId other : constraint->features) {
        if (other != id) neighbours[id].push_back(other);
      }
    }
  }
  // Circles that the first one which is no outlier reaches past none.
  std::vector<FeatureId> circles;
  for (const Feature* feature : graph.Features()) {
    if (feature->level == 0 && feature->type->Is(FeatureRole::kCircle) &&
        outliers.count(feature->id) == 0) {
      circles.push_back(feature->id);
    }
  }
  if (circles.empty()) return result;
  std::set<FeatureId> seen = {circles.front()};
  std::vector<FeatureId> queue = {circles.front()};
  for (std::size_t i = 0; i < queue.size(); ++i) {
    for (const FeatureId other : neighbours[queue[i]]) {
      if (outliers.count(other) == 0 && seen.insert(other).second) {
        queue.push_back(other);
      }
    }
  }
  result.is_intact =
      std::all_of(circles.begin(), circles.end(),
                  [&seen](FeatureId id) { return seen.count(id) > 0; });
  return result;
}

}  // namespace plumbline
