#include <plumbline/detectors/default_hierarchy.h>

#include <algorithm>

namespace plumbline {

HierarchySpec DefaultHierarchy(
    const std::vector<const FeatureType*>& raw_feature_types,
    const Registry& registry) {
  // Whether there is a type of this role that the detector reads.
  const auto has = [&](FeatureRole role, const char* reader) {
    const DetectorType& detector = registry.GetDetector(reader);
    return std::any_of(raw_feature_types.begin(), raw_feature_types.end(),
                       [&](const FeatureType* type) {
                         return type->Is(role) && detector.Reads(*type);
                       });
  };
  HierarchySpec spec;
  if (has(FeatureRole::kPoint, "line_ransac")) {
    spec.levels = {{"line_ransac", "circle_ransac"},
                   {"center_cluster", "orientation_mixture"},
                   {"orientation_relation"}};
  }
  if (has(FeatureRole::kCircle, "center_cluster")) {
    spec.Add(0, "center_cluster");
  }
  if (has(FeatureRole::kWall, "orientation_mixture")) {
    spec.Add(0, "orientation_mixture");
    spec.Add(1, "orientation_relation");
  }
  return spec;
}

}  // namespace plumbline
