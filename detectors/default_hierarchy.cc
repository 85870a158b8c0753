#include <plumbline/detectors/default_hierarchy.h>

#include <vector>

namespace plumbline {

std::string DefaultHierarchy(const std::set<std::string>& raw_feature_types) {
  const bool has_points = raw_feature_types.count("point") > 0;
  const bool has_circles = raw_feature_types.count("circle") > 0;
  const bool has_walls = raw_feature_types.count("segment") > 0 ||
                         raw_feature_types.count("line") > 0;
  std::vector<std::vector<std::string>> levels(3);
  if (has_points) {
    levels[0] = {"line_ransac", "circle_ransac"};
    levels[1] = {"center_cluster", "orientation_mixture"};
    levels[2] = {"orientation_relation"};
  }
  if (has_circles) levels[0].push_back("center_cluster");
  if (has_walls) {
    levels[0].push_back("orientation_mixture");
    levels[1].push_back("orientation_relation");
  }
  std::string description;
  for (const std::vector<std::string>& level : levels) {
    if (level.empty()) break;
    if (!description.empty()) description += '/';
    for (const std::string& name : level) {
      if (&name != &level.front()) description += ',';
      description += name;
    }
  }
  return description;
}

}  // namespace plumbline
