#ifndef PLUMBLINE_CORE_STRUCTURE_JUDGE_H_
#define PLUMBLINE_CORE_STRUCTURE_JUDGE_H_

#include <plumbline/core/em_options.h>
#include <plumbline/core/em_scope.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/session.h>

#include <vector>

namespace plumbline {

/// Verdict of a judge on live structure.
struct Verdict {
  /// To be broken, in the order of ids.
  std::vector<ConstraintId> refuted;
  /// False when there is more that may have to be broken, but only after a
  /// solve without what is refuted here.
  bool is_final = true;
};

/// The E-step of EM: gives every live structure constraint the p-value of its
/// hypothesis, and says which of them are to be broken.
///
/// In an iteration the orchestrator calls, each with the same scope,
///
///     Prepare     before the solve whose result is judged,
///     Weigh       after it (the E-step proper),
///     Judge       unless the solve failed or nothing is to be broken;
///
/// it breaks what is refuted, and while the verdict is not final it solves,
/// weighs and judges again.
class StructureJudge {
 public:
  virtual ~StructureJudge() = default;

  /// Gives structure the weights under which it is solved for before it is
  /// judged. Returns the largest change of a weight.
  virtual double Prepare(const EmScope& /*scope*/) { return 0.0; }

  /// Writes the weight of the M-step, the p-value of the hypothesis and at
  /// least kDeltaFloor, into the delta of every live structure constraint of
  /// the scope, at the present state. Returns the largest change of a weight.
  virtual double Weigh(const EmScope& scope) = 0;

  /// Says which live structure of the scope is to be broken, at the state and
  /// with the weights of the last Weigh.
  virtual Verdict Judge(const EmScope& scope) = 0;
};

/// A live structure constraint whose p-value is under the threshold.
struct Refutation {
  ConstraintId id = kNoId;
  /// The chi^2 that the p-value is of.
  double squared = 0.0;
};

/// The verdict that breaks the worst first (EmOptions::break_share): those
/// whose chi^2 is at least `break_share` of the largest. 0: all.
Verdict BreakWorst(const std::vector<Refutation>& refutations,
                   double break_share);

/// Judges by the unweighted residual that a constraint is left with in a solve
/// which contains it (the paper, Sect. 3): delta is its chi-square p-value, and
/// what is under EmOptions::delta_threshold and Constraint::break_below is
/// broken. With full_weight_test
/// the solve that is judged has all structure at its full weight.
class ResidualJudge final : public StructureJudge {
 public:
  /// Pointers are not owned and must outlive the judge.
  ResidualJudge(Graph* graph, SolverSession* session, const EmOptions& options);

  double Prepare(const EmScope& scope) override;
  double Weigh(const EmScope& scope) override;
  Verdict Judge(const EmScope& scope) override;

 private:
  Graph* graph_;
  SolverSession* session_;
  double delta_threshold_;
  double break_share_;
  bool full_weight_test_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_STRUCTURE_JUDGE_H_
