#include <plumbline/core/registry.h>
#include <plumbline/core/solve_schedule.h>
#include <plumbline/core/stopwatch.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace plumbline {
namespace {

// Radius of the trust region of a coarse run's first solve.
constexpr double kFirstRadius = 1e4;

}  // namespace

SolveSchedule::SolveSchedule(Graph* graph, SolverSession* session,
                             const EmOptions& options)
    : graph_(graph),
      session_(session),
      loop_tolerance_(options.loop_tolerance),
      loop_radius_(options.loop_trust_region_radius),
      em_cost_tolerance_(options.cost_tolerance) {}

void SolveSchedule::BeginRun(bool may_be_coarse) {
  is_dirty_ = true;
  is_coarse_ =
      may_be_coarse && loop_tolerance_ > session_->options().function_tolerance;
  tolerance_ = kFirstTolerances * loop_tolerance_;
  radius_ = kFirstRadius;
}

void SolveSchedule::BeginLoop() {
  tolerance_ = loop_tolerance_;
  radius_ = loop_radius_;
}

bool SolveSchedule::BeginFinal() {
  if (!is_coarse_) return false;
  is_dirty_ = true;
  tolerance_ = std::max(session_->options().function_tolerance,
                        kFinalTolerances * loop_tolerance_);
  return true;
}

void SolveSchedule::EndRun() { is_coarse_ = false; }

void SolveSchedule::OnConstraintChanged(const Constraint& constraint) {
  is_dirty_ = true;
  for (const FeatureId id : constraint.features) {
    const Feature* feature = graph_->FindFeature(id);
    if (feature != nullptr && feature->is_virtual) unsettled_.insert(id);
  }
}

void SolveSchedule::Optimize(const EmScope& scope) {
  const ScopedTimer timer(&seconds_);
  if (scope.is_whole()) {
    if (is_dirty_) SolveWhole();
    return;
  }
  is_usable_ = session_->SolveLocal(scope.variables).usable;
  for (const FeatureId id : scope.variables) UpdateExtent(id);
}

void SolveSchedule::OptimizeAfterFinds(const EmScope& scope, int changes,
                                       int num_structure) {
  if (is_coarse_ && changes <= kFew * num_structure) {
    SettleInPlace();
  } else {
    Optimize(scope);
  }
}

void SolveSchedule::NoteCost() {
  if (is_coarse_) noted_cost_ = session_->Cost().total();
}

double SolveSchedule::Cost() const {
  return is_coarse_ ? noted_cost_ : session_->Cost().total();
}

double SolveSchedule::cost_tolerance() const {
  return is_coarse_ ? 2.0 * loop_tolerance_ : 0.0;
}

void SolveSchedule::SolveWhole() {
  const SolveReport report = is_coarse_
                                 ? session_->SolveGlobal(tolerance_, radius_)
                                 : session_->SolveGlobal();
  is_usable_ = report.usable;
  has_converged_ = report.usable &&
                   (report.converged ||
                    std::abs(report.initial_cost - report.final_cost) <=
                        em_cost_tolerance_ *
                            std::max(report.initial_cost, report.final_cost));
  is_dirty_ = false;
  unsettled_.clear();
  for (const int level : graph_->VirtualLevels()) {
    for (const FeatureId id : graph_->VirtualFeatures(level)) UpdateExtent(id);
  }
}

// Solves for the virtual features that gained or lost constraints since the
// last solve, with all others held.
void SolveSchedule::SettleInPlace() {
  const ScopedTimer timer(&seconds_);
  const std::vector<FeatureId> ids(unsettled_.begin(), unsettled_.end());
  session_->SolveLocal(ids);
  for (const FeatureId id : ids) UpdateExtent(id);
  unsettled_.clear();
}

void SolveSchedule::UpdateExtent(FeatureId id) {
  Feature* feature = graph_->FindFeature(id);
  if (feature == nullptr || !feature->is_virtual ||
      !feature->type->update_extent) {
    return;
  }
  std::vector<const Feature*> support;
  for (const ConstraintId constraint_id : graph_->ConstraintsOf(id)) {
    const Constraint& constraint = *graph_->FindConstraint(constraint_id);
    if (!IsLiveStructure(constraint)) continue;
    for (const FeatureId other_id : constraint.features) {
      const Feature& other = *graph_->FindFeature(other_id);
      if (other.level < feature->level) support.push_back(&other);
    }
  }
  feature->type->update_extent(support, feature);
}

}  // namespace plumbline
