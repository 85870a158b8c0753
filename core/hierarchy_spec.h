#ifndef PLUMBLINE_CORE_HIERARCHY_SPEC_H_
#define PLUMBLINE_CORE_HIERARCHY_SPEC_H_

#include <string>
#include <vector>

namespace plumbline {

/// Names of detectors by the level whose features they read: what is asked for,
/// before it is known whether it can be made (MakeHierarchy).
struct HierarchySpec {
  /// levels[0] reads level 0.
  std::vector<std::vector<std::string>> levels;

  /// True when no level is there: nothing is detected.
  bool empty() const { return levels.empty(); }
  /// Whether any level has this detector.
  bool Contains(const std::string& detector) const;
  /// Puts a detector behind those of a level (0 to the number of levels; the
  /// last makes a new one).
  void Add(std::size_t level, const std::string& detector);
};

bool operator==(const HierarchySpec& a, const HierarchySpec& b);
bool operator!=(const HierarchySpec& a, const HierarchySpec& b);

/// Reads "a,b/c/d" (levels by '/', detectors of a level by ','; blanks do not
/// count). Text of blanks is an empty hierarchy. Whether the names mean
/// anything, empty ones included, is for MakeHierarchy to say.
HierarchySpec ParseHierarchy(const std::string& text);

/// The text that ParseHierarchy reads back as the same.
std::string FormatHierarchy(const HierarchySpec& spec);

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_HIERARCHY_SPEC_H_
