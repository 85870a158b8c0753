#include <plumbline/detectors/default_hierarchy.h>

namespace plumbline {

HierarchySpec DefaultHierarchy(const std::set<std::string>& raw_feature_types) {
  const bool has_points = raw_feature_types.count("point") > 0;
  const bool has_circles = raw_feature_types.count("circle") > 0;
  const bool has_walls = raw_feature_types.count("segment") > 0 ||
                         raw_feature_types.count("line") > 0;
  HierarchySpec spec;
  if (has_points) {
    spec.levels = {{"line_ransac", "circle_ransac"},
                   {"center_cluster", "orientation_mixture"},
                   {"orientation_relation"}};
  }
  if (has_circles) spec.Add(0, "center_cluster");
  if (has_walls) {
    spec.Add(0, "orientation_mixture");
    spec.Add(1, "orientation_relation");
  }
  return spec;
}

}  // namespace plumbline
