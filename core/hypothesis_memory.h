#ifndef PLUMBLINE_CORE_HYPOTHESIS_MEMORY_H_
#define PLUMBLINE_CORE_HYPOTHESIS_MEMORY_H_

#include <plumbline/core/em_options.h>
#include <plumbline/core/graph.h>

#include <Eigen/Core>
#include <limits>
#include <map>
#include <set>
#include <utility>
#include <vector>

namespace plumbline {

/// Memory of broken hypotheses, which may not simply come again.
///
/// A hypothesis is remembered by what it said: relation, expected value and
/// features. Virtual features come again under other ids, so a hypothesis on
/// one is the same when the type is, and when the remembered feature's value
/// in the place of the new one changes the whitened error by no more than
/// EmOptions::reproposal_sigmas. Its own error is taken after the map has
/// relaxed without it (MeasureRelaxedErrors).
///
/// It is let in again only when its error has fallen by more than
/// reproposal_sigmas since, and only max_breaks times. A raw feature may have
/// max_breaks_per_feature hypotheses of one relation broken, whatever their
/// values. Hypotheses between virtual features alone count for the roots of
/// these: the raw feature with the smallest id that each has stood on, through
/// structure constraints down the levels. There are only so many raw features,
/// so what can be added is bounded, and the loop of EM ends.
class HypothesisMemory {
 public:
  /// The graph is not owned and must outlive the memory. Of the options, those
  /// on proposing again are read.
  HypothesisMemory(const Graph* graph, const EmOptions& options);

  /// To be called for every constraint that comes into the graph, in the order
  /// of ids: it tells what virtual features stand on.
  void OnConstraintAdded(const Constraint& constraint);

  /// Enters a structure constraint of the graph that was broken, or one that a
  /// detector is about to take back.
  void Remember(const Constraint& constraint);

  /// To be called while a feature that leaves the graph is still valid. A raw
  /// one takes its hypotheses along, a virtual one is kept by its value.
  void OnFeatureRemoved(const Feature& feature);

  /// Takes the errors of the hypotheses entered since the last call, at the
  /// present state: that of a solve without them.
  void MeasureRelaxedErrors();

  /// False when this was broken before and nothing speaks for trying it again.
  /// `features` are the constraint's, in its order; those of a proposal have no
  /// id yet. Sizes must fit the relation. `roots` are those of the features;
  /// empty: as the graph has them. Only those between virtual features count.
  bool MayBeProposed(const Constraint& constraint,
                     const std::vector<const Feature*>& features,
                     std::vector<FeatureId> roots = {}) const;

  /// The root of a feature of the graph: itself when it is raw; kNoId when it
  /// stands on nothing.
  FeatureId RootOf(FeatureId id) const;

 private:
  // A broken hypothesis, by what it said last.
  struct Hypothesis {
    Constraint said;
    // Norm of the whitened error, that is in standard deviations, once the map
    // had been solved without it.
    double error = std::numeric_limits<double>::infinity();
    int breaks = 0;
  };
  // By the first raw feature; what is between virtual ones alone is under
  // kNoId.
  using HypothesesByFeature = std::map<FeatureId, std::vector<Hypothesis>>;
  // A relation and the roots of the features that it is between.
  using RootedRelation = std::pair<const RelationType*, std::vector<FeatureId>>;

  std::vector<FeatureId> RootsOf(const std::vector<FeatureId>& ids) const;
  const Feature* Recall(FeatureId id) const;
  std::vector<const Feature*> RecallAll(
      const std::vector<FeatureId>& ids) const;
  bool SaysTheSame(const Hypothesis& hypothesis, const Constraint& constraint,
                   const std::vector<const Feature*>& features) const;

  const Graph* graph_;
  double reproposal_sigmas_;
  int max_breaks_;
  int max_breaks_per_feature_;
  HypothesesByFeature hypotheses_;
  // Keys of hypotheses that were broken and not measured since.
  std::set<FeatureId> unmeasured_;
  // Of virtual features.
  std::map<FeatureId, FeatureId> roots_;
  // How often hypotheses between virtual features alone were broken.
  std::map<RootedRelation, int> breaks_by_roots_;
  // Virtual features that are gone, as they were last.
  std::map<FeatureId, Feature> dropped_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_HYPOTHESIS_MEMORY_H_
