#ifndef PLUMBLINE_CORE_DETECTOR_H_
#define PLUMBLINE_CORE_DETECTOR_H_

#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/transaction.h>

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

namespace plumbline {

/// Counts of what a detector searched and refused, by name ("pairs searched",
/// "pairs refused: no overlap"): for traces and whoever wonders why something
/// was not found.
using DetectionCounts = std::map<std::string, std::int64_t>;

/// The part of a graph in which a detector looks for structure.
struct DetectionScope {
  /// Features that a detector reads are of this level (virtual ones that it
  /// extends are one level up).
  int level = 0;
  /// Ids, ascending, to look at; null for the whole graph. With a list, the
  /// detector's cost must depend on the list and on the virtual features that
  /// it could extend, not on the size of the graph.
  const std::vector<FeatureId>* features = nullptr;
  /// With a list: features of lower levels that belong to the same part of the
  /// graph, ascending, for a detector that reads those as well. May be null.
  const std::vector<FeatureId>* lower_features = nullptr;
  /// For detectors that draw random numbers; the same seed gives the same
  /// proposal.
  std::uint64_t seed = 1;
  /// Asked now and then by detectors that may take longer than a second; may be
  /// empty. Once it has returned true, what Detect returns is not used.
  std::function<bool()> stop;
  /// Counts of the detector's work; null when nobody asks.
  DetectionCounts* counts = nullptr;

  /// True when Detect shall return at once.
  bool ShouldStop() const { return stop && stop(); }
  /// Adds to a count, which is there from then on even when `number` is 0.
  void Count(const char* name, std::int64_t number) const {
    if (counts != nullptr) (*counts)[name] += number;
  }
};

/// What a detector looks at: the features of the scope's level, ascending. On a
/// level above 0 these are virtual ones.
std::vector<const Feature*> FeaturesInScope(const Graph& graph,
                                            const DetectionScope& scope);

/// Reads the features of one level and proposes what is seen in them: virtual
/// features one level up with constraints down to what supports them, or
/// constraints between features of the level. It never changes the graph, and
/// never proposes what is already there. Whether a hypothesis was broken
/// before is not its business: the orchestrator filters.
class StructureDetector {
 public:
  virtual ~StructureDetector() = default;

  /// Name under which the type is registered.
  virtual const std::string& name() const = 0;

  /// Fewest live constraints from below that keep a virtual feature of this
  /// detector alive.
  virtual int minimum_support() const { return 1; }

  /// Whether these live constraints from below, at least minimum_support of
  /// them, keep a virtual feature of this detector alive: not when a part of it
  /// would hang in the air.
  virtual bool IsSupported(
      const std::vector<const Constraint*>& /*support*/) const {
    return true;
  }

  /// Whether a virtual feature of this detector stays when it has a single live
  /// constraint. It only follows what it is on, but a detector of the next
  /// level may see something in several of them: the centres of circles that
  /// stand in a row.
  virtual bool keeps_followers() const { return false; }

  /// Returns what is seen in the scope and is not in the graph yet, as an empty
  /// transaction where there is nothing. Ids of new features are provisional.
  virtual Transaction Detect(const Graph& graph, const Registry& registry,
                             const DetectionScope& scope) const = 0;
};

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_DETECTOR_H_
