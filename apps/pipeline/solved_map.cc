#include <plumbline/core/error.h>
#include <plumbline/core/rigid_motion.h>
#include <plumbline/core/transaction.h>
#include <plumbline/pipeline/map_state.h>
#include <plumbline/pipeline/solved_map.h>

#include <utility>

namespace plumbline {

SolvedMap::SolvedMap(const Registry& registry, const SessionOptions& session,
                     const EmOptions& em)
    : registry_(registry), session_options_(session), em_options_(em) {
  Discard();
  Renew();
}

SolvedMap::~SolvedMap() = default;

void SolvedMap::Renew(Hierarchy detectors) {
  DropEm();
  session_ = std::make_unique<SolverSession>(graph_.get(), registry_,
                                             session_options_);
  em_ =
      std::make_unique<EmOrchestrator>(graph_.get(), session_.get(), registry_,
                                       std::move(detectors), em_options_);
}

void SolvedMap::ReplaceEm(Hierarchy detectors, const EmOptions& options) {
  CountEm();
  em_ = std::make_unique<EmOrchestrator>(
      graph_.get(), session_.get(), registry_, std::move(detectors), options);
  Trace();
}

void SolvedMap::Trace() {
  em_->SetTrace([this](EmPhase phase) {
    phase.iteration += em_before_.iterations;
    break_log_.SetIteration(phase.iteration);
    trace_.push_back(std::move(phase));
  });
}

void SolvedMap::CountEm() {
  const EmReport& totals = em_->totals();
  em_before_.iterations += totals.iterations;
  em_before_.detect_seconds += totals.detect_seconds;
  em_before_.solve_seconds += totals.solve_seconds;
}

void SolvedMap::DropEm() {
  if (em_ != nullptr) CountEm();
  em_.reset();
  session_.reset();
}

void SolvedMap::Discard() {
  DropEm();
  break_log_.Detach();
  graph_ = std::make_unique<Graph>();
  break_log_.Attach(graph_.get());
}

void SolvedMap::StartOver() {
  Discard();
  break_log_.records().clear();
}

void SolvedMap::Clear() {
  Transaction clear;
  for (const Constraint* constraint : std::as_const(*graph_).Constraints()) {
    clear.RemoveConstraint(constraint->id);
  }
  for (const Feature* feature : std::as_const(*graph_).Features()) {
    clear.RemoveFeature(feature->id);
  }
  graph_->Apply(std::move(clear));
}

bool SolvedMap::Move(const Pose2& by) {
  std::unique_ptr<Graph> moved;
  try {
    moved = Moved(by, *graph_);
  } catch (const Error&) {
    return false;
  }
  for (Feature* feature : graph_->MutableFeatures()) {
    const Feature& there = moved->GetFeature(feature->id);
    feature->parameters = there.parameters;
    feature->anchor = there.anchor;
  }
  return true;
}

void SolvedMap::WriteGraph(StateWriter* state) const {
  Exchange(*state, registry_, std::as_const(*graph_));
}

void SolvedMap::RestoreGraph(StateReader* state) {
  Discard();
  Exchange(*state, registry_, *graph_);
  Renew();
}

EmReport SolvedMap::totals() const {
  EmReport totals = em_before_;
  if (em_ == nullptr) return totals;
  totals.iterations += em_->totals().iterations;
  totals.detect_seconds += em_->totals().detect_seconds;
  totals.solve_seconds += em_->totals().solve_seconds;
  return totals;
}

void SolvedMap::ExchangeState(StateWriter& state) {
  ExchangeAll(state, em_before_, trace_, break_log_.records());
  Exchange(state, registry_, std::as_const(*graph_));
}

void SolvedMap::ExchangeState(StateReader& state) {
  ExchangeAll(state, em_before_, trace_, break_log_.records());
  Exchange(state, registry_, *graph_);
}

}  // namespace plumbline
