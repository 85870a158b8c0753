#ifndef PLUMBLINE_CORE_EM_OPTIONS_H_
#define PLUMBLINE_CORE_EM_OPTIONS_H_

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace plumbline {

/// Prior knowledge of a relation, before the building was seen.
struct RelationPrior {
  /// False: proposals of it are left out.
  bool is_expected = true;
  /// Standard deviations that take the place of the detector's, one per row, in
  /// the units of the rows; empty: as the detector has it.
  std::vector<double> sigmas;
};

/// Options of EM: when structure is broken and proposed again, and convergence.
struct EmOptions {
  /// Structure constraints with a smaller delta are broken, unless their
  /// Constraint::break_below is less.
  double delta_threshold = 0.3;
  /// False: wrong structure is kept (for comparison).
  bool break_constraints = true;
  /// Break the worst first: those whose chi^2 is at least this share of the
  /// largest, then solve and look again, so that what a wrong hypothesis bends
  /// is not broken with it. 0: break all at once (the paper).
  double break_share = 0.0;
  /// The solve that the E-step judges structure by. False: under the weights of
  /// the E-step before. A low weight lets the residual grow, and that lowers
  /// the weight again, until what lies some 1.5 standard deviations of its
  /// measurements off is broken, however tight the tolerance: right where a
  /// wrong constraint does more harm than a missing one. True: a solve in which
  /// all live structure has its full weight, so that delta is the p-value of
  /// the hypothesis itself; with a tolerance t and measurements that place the
  /// feature to within m, what is off by more than about t + m^2 / t is broken.
  /// The M-steps in between weigh by delta either way.
  bool full_weight_test = false;
  /// The loop ends after this many iterations at the latest.
  int max_iterations = 50;
  /// Relative change of the cost at which solves of the whole graph within the
  /// loop end; 0: the session's own tolerance. With a larger one the first
  /// solve, of the measurements alone, ends at 0.03 of it, and one to a
  /// thousandth (the session's own where that is more) follows when the loop
  /// has ended. Weights and hypotheses do not wait for the last digits,
  /// and the more parts a graph has the longer some part of it takes to settle.
  /// What a detector finds is settled in place where it is little; the next
  /// iteration solves for the rest of the graph.
  double loop_tolerance = 0.0;
  /// Initial radius of the trust region of those solves (SessionOptions; only
  /// with a loop_tolerance). The radius is one for the whole graph: with steps
  /// that are nearly Gauss-Newton's, one floppy place in which they go wrong
  /// has a step rejected everywhere, and the larger a graph the more often
  /// there is one.
  double loop_trust_region_radius = 1e7;
  /// Converged: at most one in 10,000 of structure came or went (so nothing, in
  /// smaller graphs), and the relative change of the total cost is smaller.
  double cost_tolerance = 1e-4;
  /// A broken hypothesis may be proposed again when its error has fallen by
  /// more than this many of its standard deviations since it was broken and the
  /// map relaxed without it ...
  double reproposal_sigmas = 1.0;
  /// ... but not after it was broken this many times, which bounds the loop.
  int max_breaks = 3;
  /// Nor when a raw feature had this many hypotheses of one relation broken,
  /// whatever their values: a virtual feature that comes back a little to the
  /// side each time would otherwise never be the same hypothesis. The same for
  /// hypotheses between virtual features that stand on the same raw ones.
  int max_breaks_per_feature = 10;
  std::uint64_t seed = 1;
  /// By relation; what is missing is as the detectors propose it. As many
  /// sigmas as the relation has rows, or none; others are an Error when the
  /// relation is proposed.
  std::map<std::string, RelationPrior> relation_priors;
};

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_EM_OPTIONS_H_
