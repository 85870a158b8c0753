#ifndef PLUMBLINE_CORE_SOLVE_SCHEDULE_H_
#define PLUMBLINE_CORE_SOLVE_SCHEDULE_H_

#include <plumbline/core/em_options.h>
#include <plumbline/core/em_scope.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/session.h>

#include <set>

namespace plumbline {

/// Schedule of the M-step: when it solves, for what, and how accurately.
///
/// A solve of the whole graph is left out while nothing has changed since the
/// last one. In a coarse run (EmOptions::loop_tolerance) solves end early: the
/// first, of the measurements alone, at kFirstTolerances of the tolerance,
/// those of the loop at the tolerance, and one at kFinalTolerances of it
/// follows the loop. Little finds are settled in place there, with the rest of
/// the graph held: the next iteration begins with a solve anyway.
class SolveSchedule {
 public:
  /// Tolerance of the first solve of a coarse run, as a share of that of the
  /// others: what is found first depends on it.
  static constexpr double kFirstTolerances = 0.03;
  /// Tolerance of the last solve, as a share of that of the others.
  static constexpr double kFinalTolerances = 1e-3;
  /// Finds of no more than this share of the structure are settled in place.
  static constexpr double kFew = 0.01;

  /// Neither pointer is owned; both must outlive the schedule.
  SolveSchedule(Graph* graph, SolverSession* session, const EmOptions& options);

  /// Begins a run with its first solve to come; solves are coarse when
  /// `may_be_coarse` and the options say so. Whatever was solved before counts
  /// for nothing.
  void BeginRun(bool may_be_coarse);
  /// The first solve is done, those of the loop come.
  void BeginLoop();
  /// The loop is over. True when a last solve has to follow it.
  bool BeginFinal();
  /// Ends a run: solves are to the session's own tolerance again.
  void EndRun();

  /// Says that something changed, so that the next solve is not left out.
  void MarkDirty() { is_dirty_ = true; }
  /// Says that a live constraint came or went.
  void OnConstraintChanged(const Constraint& constraint);

  /// The M-step: solves for the scope and updates the extents of the virtual
  /// features in it.
  void Optimize(const EmScope& scope);

  /// The M-step after `changes` live constraints were found in a graph that has
  /// `num_structure` of structure. Settles them in place where that does.
  void OptimizeAfterFinds(const EmScope& scope, int changes, int num_structure);

  /// Takes note of the cost by which a coarse run tells that it has converged:
  /// after a solve with what was broken left out. What is found later may not
  /// be solved for.
  void NoteCost();
  /// That cost, or in a run that is not coarse the present one.
  double Cost() const;

  /// Relative change of Cost() that is left undone by solves that end early.
  double cost_tolerance() const;
  bool is_coarse() const { return is_coarse_; }
  /// False when the last solve failed: its residuals prove nothing.
  bool is_usable() const { return is_usable_; }
  /// False when the last solve of the whole graph ended on its way: before it
  /// reached its tolerance, and with a cost that had changed by more than
  /// EmOptions::cost_tolerance.
  bool has_converged() const { return has_converged_; }
  /// Time of all solves so far.
  double seconds() const { return seconds_; }

 private:
  void SolveWhole();
  void SettleInPlace();
  void UpdateExtent(FeatureId id);

  Graph* graph_;
  SolverSession* session_;
  double loop_tolerance_;
  double loop_radius_;
  double em_cost_tolerance_;

  bool is_coarse_ = false;
  // Relative change of the cost at which coarse solves end, and the radius of
  // the trust region with which they begin.
  double tolerance_ = 0.0;
  double radius_ = 0.0;
  double noted_cost_ = 0.0;
  // The graph or a weight changed since the last solve of the whole.
  bool is_dirty_ = true;
  bool is_usable_ = true;
  bool has_converged_ = true;
  // Virtual features that gained or lost a constraint since then.
  std::set<FeatureId> unsettled_;
  double seconds_ = 0.0;
};

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_SOLVE_SCHEDULE_H_
