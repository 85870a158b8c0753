#include <plumbline/core/detector.h>

namespace plumbline {

std::vector<const Feature*> FeaturesInScope(const Graph& graph,
                                            const DetectionScope& scope) {
  std::vector<const Feature*> features;
  const auto add = [&](const Feature* feature) {
    if (feature != nullptr && feature->level == scope.level) {
      features.push_back(feature);
    }
  };
  if (scope.features != nullptr) {
    for (const FeatureId id : *scope.features) add(graph.FindFeature(id));
  } else if (scope.level > 0) {
    for (const FeatureId id : graph.VirtualFeatures(scope.level)) {
      add(graph.FindFeature(id));
    }
  } else {
    for (const Feature* feature : graph.Features()) add(feature);
  }
  return features;
}

}  // namespace plumbline
