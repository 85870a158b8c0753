#include <plumbline/core/error.h>
#include <plumbline/core/hierarchy_spec.h>

#include <algorithm>
#include <iterator>

namespace plumbline {

bool HierarchySpec::Contains(const std::string& detector) const {
  return std::any_of(levels.begin(), levels.end(),
                     [&detector](const std::vector<std::string>& level) {
                       return std::count(level.begin(), level.end(), detector) >
                              0;
                     });
}

void HierarchySpec::Add(std::size_t level, const std::string& detector) {
  if (level > levels.size()) {
    throw PLUMBLINE_ERROR("level " + std::to_string(level) +
                              " of a hierarchy of " +
                              std::to_string(levels.size()),
                          "no level left out");
  }
  if (level == levels.size()) levels.emplace_back();
  levels[level].push_back(detector);
}

bool operator==(const HierarchySpec& a, const HierarchySpec& b) {
  return a.levels == b.levels;
}

bool operator!=(const HierarchySpec& a, const HierarchySpec& b) {
  return !(a == b);
}

HierarchySpec ParseHierarchy(const std::string& text) {
  std::string dense;
  std::copy_if(text.begin(), text.end(), std::back_inserter(dense), [](char c) {
    return c != ' ' && c != '\t' && c != '\n' && c != '\r';
  });
  HierarchySpec spec;
  if (dense.empty()) return spec;
  spec.levels.emplace_back(1);
  for (const char c : dense) {
    if (c == '/') {
      spec.levels.emplace_back(1);
    } else if (c == ',') {
      spec.levels.back().emplace_back();
    } else {
      spec.levels.back().back() += c;
    }
  }
  return spec;
}

std::string FormatHierarchy(const HierarchySpec& spec) {
  std::string text;
  for (const std::vector<std::string>& level : spec.levels) {
    if (&level != &spec.levels.front()) text += '/';
    for (const std::string& name : level) {
      if (&name != &level.front()) text += ',';
      text += name;
    }
  }
  return text;
}

}  // namespace plumbline
