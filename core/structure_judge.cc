#include <plumbline/core/structure_judge.h>

#include <algorithm>
#include <cmath>

namespace plumbline {

Verdict BreakWorst(const std::vector<Refutation>& refutations,
                   double break_share) {
  double largest = 0.0;
  for (const Refutation& refutation : refutations) {
    largest = std::max(largest, refutation.squared);
  }
  Verdict verdict;
  for (const Refutation& refutation : refutations) {
    if (refutation.squared < break_share * largest) {
      verdict.is_final = false;
    } else {
      verdict.refuted.push_back(refutation.id);
    }
  }
  return verdict;
}

ResidualJudge::ResidualJudge(Graph* graph, SolverSession* session,
                             const EmOptions& options)
    : graph_(graph),
      session_(session),
      delta_threshold_(options.delta_threshold),
      break_share_(options.break_share),
      full_weight_test_(options.full_weight_test) {}

double ResidualJudge::Prepare(const EmScope& scope) {
  double change = 0.0;
  if (!full_weight_test_) return change;
  for (Constraint* constraint : LiveStructure(scope, graph_)) {
    change = std::max(change, std::abs(1.0 - constraint->delta));
    constraint->delta = 1.0;
  }
  return change;
}

double ResidualJudge::Weigh(const EmScope& scope) {
  return session_->UpdateDeltas(scope.session_scope());
}

Verdict ResidualJudge::Judge(const EmScope& scope) {
  std::vector<Refutation> refutations;
  for (const Constraint* constraint : LiveStructure(scope, graph_)) {
    // A weight at the floor does not tell how small the p-value is.
    const double p_value = constraint->delta > kDeltaFloor
                               ? constraint->delta
                               : session_->Delta(*constraint);
    if (p_value >= std::min(delta_threshold_, constraint->break_below)) {
      continue;
    }
    refutations.push_back(
        {constraint->id,
         break_share_ > 0.0 ? session_->SquaredResidual(*constraint) : 0.0});
  }
  return BreakWorst(refutations, break_share_);
}

}  // namespace plumbline
