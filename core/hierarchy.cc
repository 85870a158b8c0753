#include <plumbline/core/error.h>
#include <plumbline/core/hierarchy.h>

#include <algorithm>
#include <set>
#include <utility>

namespace plumbline {
namespace {

bool Intersects(const std::vector<std::string>& names,
                const std::set<std::string>& set) {
  return std::any_of(
      names.begin(), names.end(),
      [&set](const std::string& name) { return set.count(name) > 0; });
}

// "level 0 (segment): a, b; level 1 (orientation): c"
std::string WhatFitsWhere(const Registry& registry,
                          const std::vector<std::set<std::string>>& levels) {
  std::string list;
  for (std::size_t level = 0; level < levels.size(); ++level) {
    std::string types;
    for (const std::string& type : levels[level]) {
      types += (types.empty() ? "" : ", ") + type;
    }
    std::string detectors;
    for (const DetectorType* detector : registry.detectors()) {
      if (!Intersects(detector->reads, levels[level])) continue;
      detectors += (detectors.empty() ? "" : ", ") + detector->name;
    }
    list += (list.empty() ? "level " : "; level ") + std::to_string(level) +
            " (" + (types.empty() ? "nothing" : types) +
            "): " + (detectors.empty() ? "none" : detectors);
  }
  return list;
}

}  // namespace

Hierarchy MakeHierarchy(
    const HierarchySpec& spec, const Registry& registry,
    const std::vector<std::string>& raw_feature_types,
    const std::map<std::string, DetectorParameters>& parameters) {
  for (const auto& entry : parameters) registry.GetDetector(entry.first);
  Hierarchy hierarchy;
  // Types that each level can hold, as far as it is known.
  std::vector<std::set<std::string>> types = {
      {raw_feature_types.begin(), raw_feature_types.end()}};
  for (const std::vector<std::string>& names : spec.levels) {
    const std::size_t level = hierarchy.size();
    hierarchy.emplace_back();
    std::set<std::string> made;
    for (const std::string& name : names) {
      const DetectorType& type = registry.GetDetector(name);
      if (!Intersects(type.reads, types[level])) {
        throw PLUMBLINE_ERROR("detector '" + name +
                                  "' has nothing to read at level " +
                                  std::to_string(level),
                              WhatFitsWhere(registry, types));
      }
      DetectorParameters values = type.defaults();
      const auto given = parameters.find(name);
      if (given != parameters.end()) {
        for (const auto& value : given->second) {
          values[value.first] = value.second;
        }
      }
      hierarchy.back().push_back(type.make(values));
      made.insert(type.makes.begin(), type.makes.end());
    }
    types.push_back(std::move(made));
  }
  return hierarchy;
}

}  // namespace plumbline
