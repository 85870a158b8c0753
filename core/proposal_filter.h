#ifndef PLUMBLINE_CORE_PROPOSAL_FILTER_H_
#define PLUMBLINE_CORE_PROPOSAL_FILTER_H_

#include <plumbline/core/em_options.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/hypothesis_memory.h>
#include <plumbline/core/support_policy.h>

#include <map>
#include <string>

namespace plumbline {

/// Decides what of a detector's proposal enters the graph.
///
/// Left out are constraints of relations that are not expected
/// (EmOptions::relation_priors), those that are live already with the same
/// expected value, those that were broken before (HypothesisMemory), and then
/// virtual features that are left with too little support (SupportPolicy), with
/// their constraints, up the levels. What is not well-formed passes:
/// Graph::Apply says what is wrong with it.
class ProposalFilter {
 public:
  /// Pointers are not owned and must outlive the filter.
  ProposalFilter(const Graph* graph,
                 const std::map<std::string, RelationPrior>& relation_priors,
                 const HypothesisMemory* memory, const SupportPolicy* support);

  /// The part of the proposal that is let in, under other provisional ids, with
  /// the tolerances of the priors; new features are marked as virtual, and the
  /// detector's name is filled in where no source is given. Throws Error when a
  /// prior does not fit its relation. Counts what is let in and what is not
  /// into `scope`.
  Transaction Filter(Transaction proposal, const StructureDetector& detector,
                     const DetectionScope& scope = DetectionScope()) const;

 private:
  bool ApplyPrior(Constraint* constraint) const;
  bool IsThere(const Constraint& constraint) const;

  const Graph* graph_;
  std::map<std::string, RelationPrior> relation_priors_;
  const HypothesisMemory* memory_;
  const SupportPolicy* support_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_PROPOSAL_FILTER_H_
