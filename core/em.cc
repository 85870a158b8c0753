#include <plumbline/core/em.h>
#include <plumbline/core/em_scope.h>
#include <plumbline/core/hypothesis_memory.h>
#include <plumbline/core/proposal_filter.h>
#include <plumbline/core/solve_schedule.h>
#include <plumbline/core/stopwatch.h>
#include <plumbline/core/structure_census.h>
#include <plumbline/core/support_policy.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

namespace plumbline {
namespace {

// Weights that moved less are not worth a solve.
constexpr double kDeltaChange = 1e-6;
// The loop ends when no more than this share of the structure came or went. The
// larger a graph, the surer one place in it is still undecided, and a round for
// its sake costs as much as any.
constexpr double kNegligible = 1e-4;

// When an iteration looks for structure.
enum class Detection {
  kAlways,
  // Once something was broken or dropped in it.
  kAfterBreaks,
  kNever,
};

// What a detector of a level may look at in a scope: features of the level, and
// those of lower ones.
struct FeaturesByLevel {
  std::vector<FeatureId> of_level;
  std::vector<FeatureId> lower;
};

FeaturesByLevel FeaturesUpTo(const Graph& graph, const EmScope& scope,
                             int level) {
  FeaturesByLevel ids;
  for (const FeatureId id : scope.attached) {
    const Feature* feature = graph.FindFeature(id);
    if (feature == nullptr || feature->level > level) continue;
    (feature->level == level ? ids.of_level : ids.lower).push_back(id);
  }
  return ids;
}

}  // namespace

const char* ToString(EmTermination termination) {
  switch (termination) {
    case EmTermination::kConvergence:
      return "convergence";
    case EmTermination::kFailure:
      return "failure";
    case EmTermination::kUserStop:
      return "user_stop";
    case EmTermination::kNoConvergence:
      break;
  }
  return "no_convergence";
}

struct EmOrchestrator::Impl final : public GraphListener {
  Impl(Graph* graph_in, SolverSession* session_in, const Registry& registry_in,
       Hierarchy hierarchy_in, const EmOptions& options_in,
       std::unique_ptr<StructureJudge> judge_in)
      : graph(graph_in),
        session(session_in),
        registry(registry_in),
        hierarchy(std::move(hierarchy_in)),
        options(options_in),
        schedule(graph, session, options),
        judge(std::move(judge_in)),
        support(graph, hierarchy, registry),
        memory(graph, options),
        filter(graph, options.relation_priors, &memory, &support) {
    if (judge == nullptr) {
      judge = std::make_unique<ResidualJudge>(graph, session, options);
    }
    for (const Feature* feature : std::as_const(*graph).Features()) {
      OnFeatureAdded(*feature);
    }
    for (const Constraint* constraint : std::as_const(*graph).Constraints()) {
      OnConstraintAdded(*constraint);
    }
    graph->AddListener(this);
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  ~Impl() override { graph->RemoveListener(this); }

  // -- The algorithm ----------------------------------------------------------

  EmReport Run() {
    const EmReport before = totals;
    // With no structure there and none looked for, nothing moves after the
    // first solve, and its cost need not be known.
    is_still = census.num_structure() == 0 && hierarchy.empty();
    cost_of_solve.reset();
    const auto cost_now = [&] { return is_still ? 0.0 : schedule.Cost(); };

    schedule.BeginRun(/*may_be_coarse=*/!is_still);
    OptimizeWhole(census.num_structure() == 0 ? "measurements" : "optimize");
    schedule.BeginLoop();
    double cost = cost_now();
    bool has_converged = false;
    bool may_be_quiet = false;
    for (int i = 0; i < options.max_iterations; ++i) {
      if (is_stopped || has_converged) break;
      const int changes_before = census.num_changes();
      bool has_changed = Iterate(
          nullptr, may_be_quiet ? Detection::kAfterBreaks : Detection::kAlways);
      const bool has_looked = has_changed || !may_be_quiet;
      double last_cost = std::exchange(cost, cost_now());
      // While weights settle that break nothing there is nothing new to find.
      // It does not end before somebody has looked.
      if (!has_looked && !is_stopped && IsSteady(last_cost, cost)) {
        EmScope whole = MakeEmScope(*graph, nullptr);
        has_changed = FindStructure(&whole);
        last_cost = std::exchange(cost, cost_now());
      }
      has_converged =
          !is_stopped && schedule.is_usable() &&
          IsSettled(has_changed, census.num_changes() - changes_before) &&
          IsSteady(last_cost, cost);
      // What came last has not been judged.
      if (has_converged && has_changed) Iterate(nullptr, Detection::kNever);
      may_be_quiet = !has_changed;
    }
    if (!is_stopped && schedule.BeginFinal()) OptimizeWhole("final");
    schedule.EndRun();
    is_still = false;

    totals.termination = Termination(has_converged);
    EmReport report = totals;
    report.iterations -= before.iterations;
    report.detect_seconds -= before.detect_seconds;
    report.solve_seconds -= before.solve_seconds;
    return report;
  }

  // One turn of the loop on these features, or the whole graph when null:
  //
  // 1. optimize, for the structure that is there;
  // 2. weigh it, break what is refuted, drop what has lost its support,
  //    optimize without that;
  // 3. for each level find structure, add it, optimize with it.
  //
  // True when something came or went.
  bool Iterate(const std::vector<FeatureId>* features, Detection detection) {
    ++totals.iterations;
    EmScope scope = MakeEmScope(*graph, features);
    OptimizeForJudgement(scope);
    if (is_stopped) return false;
    bool has_changed = BreakAndDrop(&scope);
    const bool detects = detection == Detection::kAlways ||
                         (detection == Detection::kAfterBreaks && has_changed);
    if (detects && FindStructure(&scope)) has_changed = true;
    return has_changed;
  }

  // Of all levels; true when there was something.
  bool FindStructure(EmScope* scope) {
    bool has_found = false;
    const int levels = static_cast<int>(hierarchy.size());
    for (int level = 0; level < levels && !is_stopped; ++level) {
      if (FindStructure(level, scope)) has_found = true;
    }
    return has_found;
  }

  // x <- optimize(graph), as a phase of its own.
  void OptimizeWhole(const std::string& phase) {
    const Stopwatch watch;
    const EmScope whole;
    schedule.Optimize(whole);
    EndPhase(phase, whole, watch);
  }

  // x <- optimize(graph), the solve that structure is judged by.
  void OptimizeForJudgement(const EmScope& scope) {
    const Stopwatch watch;
    NoteChange(judge->Prepare(scope));
    schedule.Optimize(scope);
    EndPhase("optimize", scope, watch);
  }

  // graph <- break what is refuted, drop what has lost its support;
  // x <- optimize(graph).
  bool BreakAndDrop(EmScope* scope) {
    const Stopwatch watch;
    bool has_changed = WeighAndBreak(*scope);
    if (scope->is_whole()) support.RecheckAll();
    if (support.DropUnsupported()) has_changed = true;
    *scope = MakeEmScope(*graph, scope->features);
    schedule.Optimize(*scope);
    schedule.NoteCost();
    memory.MeasureRelaxedErrors();
    EndPhase("break", *scope, watch);
    return has_changed;
  }

  // The E-step; true when something was broken.
  bool WeighAndBreak(const EmScope& scope) {
    bool has_broken = false;
    while (true) {
      NoteChange(judge->Weigh(scope));
      // Residuals of a state that could not be solved for prove nothing.
      if (!options.break_constraints || !schedule.is_usable()) break;
      const Verdict verdict = judge->Judge(scope);
      if (verdict.refuted.empty()) break;
      Transaction transaction;
      for (const ConstraintId id : verdict.refuted) {
        transaction.BreakConstraint(id);
      }
      graph->Apply(std::move(transaction));
      has_broken = true;
      if (verdict.is_final) break;
      schedule.Optimize(scope);
      // Nor do those of a solve that was cut short.
      if (is_stopped) break;
    }
    return has_broken;
  }

  // graph <- add(find_structure(graph, level)); x <- optimize(graph).
  bool FindStructure(int level, EmScope* scope) {
    const Stopwatch watch;
    const int changes_before = census.num_changes();
    const bool has_found = Detect(level, *scope);
    if (has_found) {
      *scope = MakeEmScope(*graph, scope->features);
      schedule.OptimizeAfterFinds(*scope, census.num_changes() - changes_before,
                                  census.num_structure());
    }
    EndPhase("detect_" + std::to_string(level), *scope, watch);
    return has_found;
  }

  // Has the detectors of a level look, and adds what the filter lets in; true
  // when there was something.
  bool Detect(int level, const EmScope& scope) {
    const Stopwatch watch;
    DetectionScope detection;
    detection.level = level;
    detection.stop = [this] { return AskStop(); };
    const FeaturesByLevel ids = FeaturesUpTo(*graph, scope, level);
    if (!scope.is_whole()) {
      detection.features = &ids.of_level;
      detection.lower_features = &ids.lower;
    }
    bool has_found = false;
    detections.clear();
    const auto& detectors = hierarchy[static_cast<std::size_t>(level)];
    for (std::size_t i = 0; i < detectors.size(); ++i) {
      // Different for every detector, the same in every iteration, so that what
      // is found at a fixed point is the same too.
      detection.seed =
          options.seed + 1000003u * static_cast<std::uint64_t>(level) + i;
      // Nobody asks for counts without a trace.
      detection.counts = trace ? &detections[detectors[i]->name()] : nullptr;
      Transaction proposal = detectors[i]->Detect(*graph, registry, detection);
      if (is_stopped) break;
      if (proposal.empty()) continue;
      Transaction accepted =
          filter.Filter(std::move(proposal), *detectors[i], detection);
      if (accepted.empty()) continue;
      RememberTakenBack(accepted);
      graph->Apply(std::move(accepted));
      has_found = true;
    }
    totals.detect_seconds += watch.Seconds();
    return has_found;
  }

  // What a detector takes back counts as broken, or it could find and take back
  // the same thing for ever: a curve that solves alternately draw to another
  // one and away from it.
  void RememberTakenBack(const Transaction& accepted) {
    for (const ConstraintId id : accepted.removed_constraints()) {
      const Constraint* constraint = graph->FindConstraint(id);
      if (constraint != nullptr && IsLiveStructure(*constraint)) {
        memory.Remember(*constraint);
      }
    }
  }

  // -- When it ends -----------------------------------------------------------

  // Nothing came or went in an iteration, or next to nothing.
  bool IsSettled(bool has_changed, int changes) const {
    return !has_changed ||
           (changes > 0 && changes <= kNegligible * census.num_structure());
  }

  // The cost stays what it is, as far as solves are carried.
  bool IsSteady(double last_cost, double cost) const {
    const double tolerance = options.cost_tolerance + schedule.cost_tolerance();
    return std::abs(cost - last_cost) <= tolerance * std::max(cost, last_cost);
  }

  EmTermination Termination(bool has_converged) const {
    // A graph that stands still because its solves end early is not there yet.
    if (has_converged && schedule.has_converged()) {
      return EmTermination::kConvergence;
    }
    if (is_stopped) return EmTermination::kUserStop;
    return schedule.is_usable() ? EmTermination::kNoConvergence
                                : EmTermination::kFailure;
  }

  bool AskStop() {
    if (!is_stopped && stop && stop()) is_stopped = true;
    return is_stopped;
  }

  // A weight changed by so much.
  void NoteChange(double change) {
    if (change > kDeltaChange) schedule.MarkDirty();
  }

  // Reports a phase that began with `watch` and asks whether to go on.
  void EndPhase(const std::string& name, const EmScope& scope,
                const Stopwatch& watch) {
    totals.solve_seconds = schedule.seconds();
    if (trace) {
      EmPhase phase;
      phase.iteration = totals.iterations;
      phase.phase = name;
      phase.seconds = watch.Seconds();
      if (!is_still || cost_of_solve != session->num_solves()) {
        last_cost = session->Cost(scope.session_scope());
        cost_of_solve = session->num_solves();
      }
      phase.cost = last_cost;
      phase.features = census.features();
      phase.structure_constraints = census.num_structure();
      phase.broken_constraints = census.num_broken();
      phase.structure_by_relation = census.structure_by_relation();
      phase.broken_by_relation = census.broken_by_relation();
      phase.detections = std::exchange(detections, {});
      trace(phase);
    }
    AskStop();
  }

  // -- What the graph tells ---------------------------------------------------

  void OnFeatureAdded(const Feature& feature) override {
    census.OnFeatureAdded(feature);
  }

  void OnFeatureRemoved(const Feature& feature) override {
    census.OnFeatureRemoved(feature);
    memory.OnFeatureRemoved(feature);
    support.OnFeatureRemoved(feature);
  }

  void OnConstraintAdded(const Constraint& constraint) override {
    census.OnConstraintAdded(constraint);
    schedule.OnConstraintChanged(constraint);
    memory.OnConstraintAdded(constraint);
    if (constraint.state == ConstraintState::kBroken &&
        constraint.kind == ConstraintClass::kStructure) {
      memory.Remember(constraint);
    }
  }

  void OnConstraintChanged(const Constraint&) override { schedule.MarkDirty(); }

  void OnConstraintRetired(const Constraint& constraint) override {
    const bool stays = graph->FindConstraint(constraint.id) != nullptr;
    if (!census.OnConstraintRetired(constraint, stays)) return;
    schedule.OnConstraintChanged(constraint);
    support.OnConstraintLost(constraint);
    if (stays && constraint.kind == ConstraintClass::kStructure) {
      memory.Remember(constraint);
    }
  }

  Graph* graph;
  SolverSession* session;
  const Registry& registry;
  Hierarchy hierarchy;
  EmOptions options;

  SolveSchedule schedule;
  std::unique_ptr<StructureJudge> judge;
  SupportPolicy support;
  HypothesisMemory memory;
  ProposalFilter filter;
  StructureCensus census;

  // By detector, since the last phase.
  std::map<std::string, DetectionCounts> detections;
  // Whether nothing but a solve moves anything; the cost after a solve, and
  // after which.
  bool is_still = false;
  CostReport last_cost;
  std::optional<int> cost_of_solve;
  bool is_stopped = false;
  std::function<bool()> stop;
  std::function<void(const EmPhase&)> trace;
  EmReport totals;
};

// Has phases, detectors and solves ask whether to stop while it lives.
class EmOrchestrator::StopScope {
 public:
  StopScope(Impl* em, const std::function<bool()>& stop)
      : em_(em), solve_stop_(em->session, [em] { return em->AskStop(); }) {
    em_->is_stopped = false;
    em_->stop = stop;
  }
  StopScope(const StopScope&) = delete;
  StopScope& operator=(const StopScope&) = delete;
  ~StopScope() { em_->stop = nullptr; }

 private:
  Impl* em_;
  SolveStop solve_stop_;
};

EmOrchestrator::EmOrchestrator(Graph* graph, SolverSession* session,
                               const Registry& registry, Hierarchy hierarchy,
                               const EmOptions& options,
                               std::unique_ptr<StructureJudge> judge)
    : impl_(std::make_unique<Impl>(graph, session, registry,
                                   std::move(hierarchy), options,
                                   std::move(judge))) {}

EmOrchestrator::~EmOrchestrator() = default;

bool EmOrchestrator::Iterate(const std::vector<FeatureId>* scope) {
  impl_->is_stopped = false;
  // Parameters may have been changed without the graph's knowledge.
  impl_->schedule.MarkDirty();
  return impl_->Iterate(scope, Detection::kAlways);
}

EmReport EmOrchestrator::Run(const std::function<bool()>& stop) {
  const StopScope stop_scope(impl_.get(), stop);
  return impl_->Run();
}

void EmOrchestrator::SetTrace(std::function<void(const EmPhase&)> trace) {
  impl_->trace = std::move(trace);
}

const EmReport& EmOrchestrator::totals() const { return impl_->totals; }

}  // namespace plumbline
