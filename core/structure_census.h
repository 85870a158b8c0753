#ifndef PLUMBLINE_CORE_STRUCTURE_CENSUS_H_
#define PLUMBLINE_CORE_STRUCTURE_CENSUS_H_

#include <plumbline/core/graph.h>

#include <map>
#include <set>
#include <string>

namespace plumbline {

/// Counts of the features and structure constraints of a graph, kept current by
/// what a GraphListener is told.
class StructureCensus {
 public:
  /// As in GraphListener.
  void OnFeatureAdded(const Feature& feature);
  /// As in GraphListener.
  void OnFeatureRemoved(const Feature& feature);
  /// As in GraphListener.
  void OnConstraintAdded(const Constraint& constraint);
  /// As in GraphListener; `stays` is false when the constraint leaves the
  /// graph. True when it was live until then, and not broken before.
  bool OnConstraintRetired(const Constraint& constraint, bool stays);

  /// Live features by type name.
  const std::map<std::string, int>& features() const { return features_; }
  /// Live structure constraints.
  int num_structure() const { return num_structure_; }
  /// Broken constraints on record.
  int num_broken() const { return static_cast<int>(broken_.size()); }
  /// Both by relation name; structure only.
  const std::map<std::string, int>& structure_by_relation() const {
    return structure_by_relation_;
  }
  const std::map<std::string, int>& broken_by_relation() const {
    return broken_by_relation_;
  }
  /// Live constraints that came or went so far, measurements included.
  int num_changes() const { return num_changes_; }

 private:
  std::map<std::string, int> features_;
  std::set<ConstraintId> broken_;
  int num_structure_ = 0;
  std::map<std::string, int> structure_by_relation_;
  std::map<std::string, int> broken_by_relation_;
  int num_changes_ = 0;
};

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_STRUCTURE_CENSUS_H_
