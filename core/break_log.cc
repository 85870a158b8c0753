#include <plumbline/core/break_log.h>
#include <plumbline/core/constraint_evaluation.h>

namespace plumbline {

void BreakLog::Attach(Graph* graph) {
  Detach();
  graph_ = graph;
  graph_->AddListener(this);
}

void BreakLog::Detach() {
  if (graph_ != nullptr) graph_->RemoveListener(this);
  graph_ = nullptr;
}

void BreakLog::OnConstraintRetired(const Constraint& constraint) {
  if (constraint.kind != ConstraintClass::kStructure ||
      constraint.state != ConstraintState::kBroken) {
    return;
  }
  // One that was broken before and goes now tells nothing new.
  if (graph_->FindConstraint(constraint.id) == nullptr) return;
  BreakRecord& record = records_[constraint.id];
  record.iteration = iteration_;
  record.error = ErrorOf(*graph_, constraint);
}

}  // namespace plumbline
