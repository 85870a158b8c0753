#include <plumbline/core/em.h>
#include <plumbline/core/error.h>
#include <plumbline/factors/information.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <set>
#include <utility>

namespace plumbline {
namespace {

// Weights that moved less are not worth a solve.
constexpr double kDeltaChange = 1e-6;
// The loop ends when no more than this share of the structure came or went. The
// larger a graph, the surer one place in it is still undecided, and a round for
// its sake costs as much as any.
constexpr double kNegligible = 1e-4;
// The first solve of a coarse loop is far from its end, and leaves so much of
// what the others do: what is found first depends on it.
constexpr double kFirstRadius = 1e4;
constexpr double kFirstTolerances = 0.03;
// The last one leaves so much of what the others do.
constexpr double kFinalTolerances = 1e-3;
// Where a coarse loop finds no more than this share of the structure anew, it
// settles what was found in place and leaves the rest of the graph to the next
// iteration, which begins with a solve anyway.
constexpr double kFew = 0.01;
// In an iteration with a scope, virtual features with more constraints are
// held: they speak for a large part of the map, and solving for them costs as
// much.
constexpr std::size_t kMaxLocalConstraints = 50;

double SecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start)
      .count();
}

std::vector<std::string> Split(const std::string& text, char separator) {
  std::vector<std::string> parts(1);
  for (const char c : text) {
    if (c == separator) {
      parts.emplace_back();
    } else if (c != ' ' && c != '\t' && c != '\n' && c != '\r') {
      parts.back() += c;
    }
  }
  return parts;
}

bool Intersects(const std::vector<std::string>& names,
                const std::set<std::string>& set) {
  return std::any_of(
      names.begin(), names.end(),
      [&set](const std::string& name) { return set.count(name) > 0; });
}

// "level 0 (segment): a, b; level 1 (orientation): c"
std::string WhatFitsWhere(const Registry& registry,
                          const std::vector<std::set<std::string>>& levels) {
  std::string list;
  for (std::size_t level = 0; level < levels.size(); ++level) {
    std::string types;
    for (const std::string& type : levels[level]) {
      types += (types.empty() ? "" : ", ") + type;
    }
    std::string detectors;
    for (const DetectorType* detector : registry.detectors()) {
      if (!Intersects(detector->reads, levels[level])) continue;
      detectors += (detectors.empty() ? "" : ", ") + detector->name;
    }
    list += (list.empty() ? "level " : "; level ") + std::to_string(level) +
            " (" + (types.empty() ? "nothing" : types) +
            "): " + (detectors.empty() ? "none" : detectors);
  }
  return list;
}

// A broken hypothesis, by what it said.
struct BrokenHypothesis {
  const RelationType* relation = nullptr;
  std::vector<FeatureId> features;
  Eigen::VectorXd expected;
  Eigen::MatrixXd information;
  // Norm of the whitened error, that is in standard deviations, once the map
  // had been solved without it.
  double error = std::numeric_limits<double>::infinity();
  int breaks = 0;
};

// Id of a feature and name of a relation.
using HypothesisKey = std::pair<FeatureId, std::string>;

// Forgets what has the feature in its key.
template <typename Container>
void EraseFeature(FeatureId id, Container* container) {
  container->erase(container->lower_bound({id, ""}),
                   container->lower_bound({id + 1, ""}));
}

}  // namespace

Hierarchy MakeHierarchy(
    const std::string& description, const Registry& registry,
    const std::vector<std::string>& raw_feature_types,
    const std::map<std::string, DetectorParameters>& parameters) {
  for (const auto& entry : parameters) registry.GetDetector(entry.first);
  Hierarchy hierarchy;
  const std::vector<std::string> levels = Split(description, '/');
  if (levels.size() == 1 && levels[0].empty()) return hierarchy;

  // Types that each level can hold, as far as it is known.
  std::vector<std::set<std::string>> types = {
      {raw_feature_types.begin(), raw_feature_types.end()}};
  for (const std::string& level_description : levels) {
    const std::size_t level = hierarchy.size();
    hierarchy.emplace_back();
    std::set<std::string> made;
    for (const std::string& name : Split(level_description, ',')) {
      const DetectorType& type = registry.GetDetector(name);
      if (!Intersects(type.reads, types[level])) {
        throw PLUMBLINE_ERROR("detector '" + name +
                                  "' has nothing to read at level " +
                                  std::to_string(level),
                              WhatFitsWhere(registry, types));
      }
      DetectorParameters values = type.defaults;
      const auto given = parameters.find(name);
      if (given != parameters.end()) {
        for (const auto& value : given->second) {
          values[value.first] = value.second;
        }
      }
      hierarchy.back().push_back(type.make(values));
      made.insert(type.makes.begin(), type.makes.end());
    }
    types.push_back(std::move(made));
  }
  return hierarchy;
}

struct EmOrchestrator::Impl final : public GraphListener {
  Impl(Graph* graph_in, SolverSession* session_in, const Registry& registry_in,
       Hierarchy hierarchy_in, const EmOptions& options_in)
      : graph(graph_in),
        session(session_in),
        registry(registry_in),
        hierarchy(std::move(hierarchy_in)),
        options(options_in) {
    for (const auto& level : hierarchy) {
      for (const auto& detector : level) {
        detectors_by_name[detector->name()] = detector.get();
      }
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

  // -- What the graph tells ---------------------------------------------------

  void OnFeatureAdded(const Feature& feature) override {
    ++feature_counts[feature.type->name];
    highest_level = std::max(highest_level, feature.level);
  }

  void OnFeatureRemoved(const Feature& feature) override {
    const auto count = feature_counts.find(feature.type->name);
    if (--count->second == 0) feature_counts.erase(count);
    if (feature.is_virtual) {
      // Comes again under another id: remembered by its value.
      dropped.emplace(feature.id, feature);
    } else {
      EraseFeature(feature.id, &memory);
    }
    EraseFeature(feature.id, &silent_alone);
  }

  void OnConstraintAdded(const Constraint& constraint) override {
    is_dirty = true;
    ++changes;
    AddUnsettled(constraint);
    if (constraint.state == ConstraintState::kBroken) {
      broken_on_record.insert(constraint.id);
      if (constraint.kind == ConstraintClass::kStructure) {
        ++broken_by_relation[constraint.type->name];
        RememberBroken(constraint);
      }
    } else if (constraint.kind == ConstraintClass::kStructure) {
      ++structure_count;
      ++structure_by_relation[constraint.type->name];
    }
  }

  void OnConstraintChanged(const Constraint&) override { is_dirty = true; }

  void OnConstraintRetired(const Constraint& constraint) override {
    const bool is_structure = constraint.kind == ConstraintClass::kStructure;
    if (broken_on_record.erase(constraint.id) > 0) {  // broken before
      if (is_structure) --broken_by_relation[constraint.type->name];
      return;
    }
    is_dirty = true;
    ++changes;
    AddUnsettled(constraint);
    if (is_structure) {
      --structure_count;
      --structure_by_relation[constraint.type->name];
    }
    if (graph->FindConstraint(constraint.id) != nullptr) {
      broken_on_record.insert(constraint.id);
      if (is_structure) {
        ++broken_by_relation[constraint.type->name];
        RememberBroken(constraint);
      }
    }
    for (const FeatureId id : constraint.features) {
      const Feature* feature = graph->FindFeature(id);
      if (feature != nullptr && feature->is_virtual) lost_support.insert(id);
    }
  }

  void AddUnsettled(const Constraint& constraint) {
    for (const FeatureId id : constraint.features) {
      const Feature* feature = graph->FindFeature(id);
      if (feature != nullptr && feature->is_virtual) unsettled.insert(id);
    }
  }

  // -- Broken hypotheses ------------------------------------------------------

  // A feature that is there or was there once; null when it is forgotten.
  const Feature* Recall(FeatureId id) const {
    const Feature* feature = graph->FindFeature(id);
    if (feature != nullptr) return feature;
    const auto found = dropped.find(id);
    return found == dropped.end() ? nullptr : &found->second;
  }

  static Eigen::VectorXd WhitenedError(
      const RelationType& relation, const Eigen::VectorXd& expected,
      const Eigen::MatrixXd& information,
      const std::vector<const Feature*>& features) {
    RelationArguments arguments;
    arguments.expected = expected;
    arguments.sqrt_information = SqrtInformation(information);
    arguments.features = features;
    std::vector<const double*> parameters;
    parameters.reserve(features.size());
    for (const Feature* feature : features) {
      parameters.push_back(feature->data());
    }
    const auto cost = relation.make_cost(arguments);
    Eigen::VectorXd error(relation.residual_size);
    if (!cost->Evaluate(parameters.data(), error.data(), nullptr) ||
        !error.allFinite()) {
      error.setConstant(std::numeric_limits<double>::infinity());
    }
    return error;
  }

  // The first raw feature identifies a hypothesis; one between virtual features
  // is found among all such of the relation.
  static HypothesisKey KeyOf(const Constraint& constraint,
                             const std::vector<const Feature*>& features) {
    FeatureId raw = kNoId;
    for (const Feature* feature : features) {
      if (!feature->is_virtual) {
        raw = feature->id;
        break;
      }
    }
    return {raw, constraint.type->name};
  }

  // True when `hypothesis` says what `constraint` between `features` says:
  // every feature is the same, or is virtual and of the same type, and putting
  // the hypothesis' own virtual features in the place of these changes the
  // error by no more than the tolerance for re-proposal.
  bool SaysTheSame(const BrokenHypothesis& hypothesis,
                   const Constraint& constraint,
                   const std::vector<const Feature*>& features) const {
    if (hypothesis.relation != constraint.type ||
        hypothesis.expected != constraint.expected) {
      return false;
    }
    std::vector<const Feature*> replaced = features;
    bool is_same = true;
    for (std::size_t i = 0; i < features.size(); ++i) {
      // A new feature has no id and equals none.
      if (features[i]->id == hypothesis.features[i]) continue;
      is_same = false;
      const Feature* own = Recall(hypothesis.features[i]);
      if (own == nullptr || !own->is_virtual || !features[i]->is_virtual ||
          own->type != features[i]->type) {
        return false;
      }
      replaced[i] = own;
    }
    if (is_same) return true;
    const Eigen::VectorXd change =
        WhitenedError(*constraint.type, constraint.expected,
                      constraint.information, replaced) -
        WhitenedError(*constraint.type, constraint.expected,
                      constraint.information, features);
    return change.norm() <= options.reproposal_sigmas;
  }

  BrokenHypothesis* FindBroken(const Constraint& constraint,
                               const std::vector<const Feature*>& features) {
    const auto found = memory.find(KeyOf(constraint, features));
    if (found == memory.end()) return nullptr;
    for (BrokenHypothesis& hypothesis : found->second) {
      if (SaysTheSame(hypothesis, constraint, features)) return &hypothesis;
    }
    return nullptr;
  }

  std::vector<const Feature*> FeaturesOf(const Constraint& constraint) const {
    std::vector<const Feature*> features;
    for (const FeatureId id : constraint.features) {
      features.push_back(&std::as_const(*graph).GetFeature(id));
    }
    return features;
  }

  // Enters a constraint of the graph into the memory.
  void RememberBroken(const Constraint& constraint) {
    const std::vector<const Feature*> features = FeaturesOf(constraint);
    const HypothesisKey key = KeyOf(constraint, features);
    BrokenHypothesis* hypothesis = FindBroken(constraint, features);
    if (hypothesis == nullptr) {
      std::vector<BrokenHypothesis>& entries = memory[key];
      entries.emplace_back();
      hypothesis = &entries.back();
      hypothesis->relation = constraint.type;
      hypothesis->expected = constraint.expected;
    }
    // The latest values are those to compare with.
    hypothesis->features = constraint.features;
    hypothesis->information = constraint.information;
    hypothesis->error = std::numeric_limits<double>::infinity();
    ++hypothesis->breaks;
    unmeasured.insert(key);
  }

  // What a detector takes back counts as broken, or it could find and take back
  // the same thing for ever: a curve that solves alternately draw to another
  // one and away from it.
  void RememberTakenBack(const Transaction& accepted) {
    for (const ConstraintId id : accepted.removed_constraints()) {
      const Constraint* constraint = graph->FindConstraint(id);
      if (constraint != nullptr && IsLiveStructure(*constraint)) {
        RememberBroken(*constraint);
      }
    }
  }

  // What the hypotheses just broken would say, now that the map is solved
  // without them.
  void MeasureRelaxedErrors() {
    for (const HypothesisKey& key : unmeasured) {
      const auto found = memory.find(key);
      if (found == memory.end()) continue;
      for (BrokenHypothesis& hypothesis : found->second) {
        if (!std::isinf(hypothesis.error)) continue;
        std::vector<const Feature*> features;
        for (const FeatureId id : hypothesis.features) {
          const Feature* feature = Recall(id);
          if (feature != nullptr) features.push_back(feature);
        }
        if (features.size() != hypothesis.features.size()) continue;
        hypothesis.error =
            WhitenedError(*hypothesis.relation, hypothesis.expected,
                          hypothesis.information, features)
                .norm();
      }
    }
    unmeasured.clear();
  }

  bool MayBeProposed(const Constraint& constraint,
                     const std::vector<const Feature*>& features) {
    const HypothesisKey key = KeyOf(constraint, features);
    if (key.first != kNoId) {
      const auto entries = memory.find(key);
      int breaks = 0;
      if (entries != memory.end()) {
        for (const BrokenHypothesis& broken : entries->second) {
          breaks += broken.breaks;
        }
      }
      if (breaks >= options.max_breaks_per_feature) return false;
    }
    const BrokenHypothesis* hypothesis = FindBroken(constraint, features);
    if (hypothesis == nullptr) return true;
    if (hypothesis->breaks >= options.max_breaks) return false;
    const double error = WhitenedError(*constraint.type, constraint.expected,
                                       constraint.information, features)
                             .norm();
    return error < hypothesis->error - options.reproposal_sigmas;
  }

  // What identifies a virtual feature `id` with this constraint alone: it
  // follows the other feature, so its value does not matter.
  static HypothesisKey AloneKey(const Constraint& constraint, FeatureId id) {
    for (const FeatureId other : constraint.features) {
      if (other != id) return {other, constraint.type->name};
    }
    return {kNoId, constraint.type->name};
  }

  // -- The steps of an iteration ----------------------------------------------

  // Features, live structure constraints and all live constraints that an
  // iteration works on.
  struct Scope {
    // Null for the whole graph.
    const std::vector<FeatureId>* features = nullptr;
    // With a list: the list and the virtual features on it that have few
    // constraints; these vary.
    std::vector<FeatureId> variables;
    // The same with all virtual features on it.
    std::vector<FeatureId> attached;
  };

  bool IsLiveStructure(const Constraint& constraint) const {
    return constraint.state == ConstraintState::kLive &&
           constraint.kind == ConstraintClass::kStructure;
  }

  Scope MakeScope(const std::vector<FeatureId>* features) const {
    Scope scope;
    scope.features = features;
    if (features == nullptr) return scope;
    std::set<FeatureId> seen;
    std::set<FeatureId> variables;
    std::vector<FeatureId> queue;
    for (const FeatureId id : *features) {
      if (graph->FindFeature(id) == nullptr || !seen.insert(id).second) {
        continue;
      }
      variables.insert(id);
      queue.push_back(id);
    }
    for (std::size_t i = 0; i < queue.size(); ++i) {
      const int level = graph->FindFeature(queue[i])->level;
      for (const ConstraintId constraint_id : graph->ConstraintsOf(queue[i])) {
        const Constraint& constraint = *graph->FindConstraint(constraint_id);
        if (!IsLiveStructure(constraint)) continue;
        for (const FeatureId id : constraint.features) {
          const Feature& other = *graph->FindFeature(id);
          if (!other.is_virtual || other.level <= level ||
              !seen.insert(id).second) {
            continue;
          }
          if (graph->ConstraintsOf(id).size() <= kMaxLocalConstraints) {
            variables.insert(id);
            queue.push_back(id);
          }
        }
      }
    }
    scope.variables.assign(variables.begin(), variables.end());
    scope.attached.assign(seen.begin(), seen.end());
    return scope;
  }

  void UpdateExtent(FeatureId id) {
    Feature* feature = graph->FindFeature(id);
    if (feature == nullptr || !feature->is_virtual ||
        !feature->type->update_extent) {
      return;
    }
    std::vector<const Feature*> support;
    for (const ConstraintId constraint_id : graph->ConstraintsOf(id)) {
      const Constraint& constraint = *graph->FindConstraint(constraint_id);
      if (!IsLiveStructure(constraint)) continue;
      for (const FeatureId other_id : constraint.features) {
        const Feature& other = *graph->FindFeature(other_id);
        if (other.level < feature->level) support.push_back(&other);
      }
    }
    feature->type->update_extent(support, feature);
  }

  void Optimize(const Scope& scope) {
    const auto start = std::chrono::steady_clock::now();
    if (scope.features == nullptr) {
      if (is_dirty) {
        is_usable =
            (is_coarse ? session->SolveGlobal(coarse_tolerance, coarse_radius)
                       : session->SolveGlobal())
                .usable;
        is_dirty = false;
        unsettled.clear();
        for (int level = 0; level <= highest_level; ++level) {
          for (const FeatureId id : graph->VirtualFeatures(level)) {
            UpdateExtent(id);
          }
        }
      }
    } else {
      is_usable = session->SolveLocal(scope.variables).usable;
      for (const FeatureId id : scope.variables) UpdateExtent(id);
    }
    totals.solve_seconds += SecondsSince(start);
  }

  // Solves for the virtual features that gained or lost constraints since the
  // last solve, with all others held.
  void SettleInPlace() {
    const auto start = std::chrono::steady_clock::now();
    const std::vector<FeatureId> ids(unsettled.begin(), unsettled.end());
    session->SolveLocal(ids);
    for (const FeatureId id : ids) UpdateExtent(id);
    unsettled.clear();
    totals.solve_seconds += SecondsSince(start);
  }

  // Live structure constraints that the iteration works on, ascending.
  std::vector<Constraint*> StructureOf(const Scope& scope) {
    std::vector<Constraint*> structure;
    if (scope.features == nullptr) {
      for (Constraint* constraint : graph->MutableConstraints()) {
        if (IsLiveStructure(*constraint)) structure.push_back(constraint);
      }
      return structure;
    }
    std::set<ConstraintId> ids;
    for (const FeatureId id : scope.variables) {
      const auto& constraints = graph->ConstraintsOf(id);
      ids.insert(constraints.begin(), constraints.end());
    }
    for (const ConstraintId id : ids) {
      Constraint* constraint = graph->FindConstraint(id);
      if (IsLiveStructure(*constraint)) structure.push_back(constraint);
    }
    return structure;
  }

  // Live structure pulls with its full weight again.
  void RestoreWeights(const Scope& scope) {
    for (Constraint* constraint : StructureOf(scope)) {
      if (1.0 - constraint->delta > kDeltaChange) is_dirty = true;
      constraint->delta = 1.0;
    }
  }

  // E-step and breaking; true when something was broken or dropped.
  bool Break(const Scope& scope) {
    bool has_broken = false;
    for (bool is_done = false; !is_done;) {
      const double change = session->UpdateDeltas(
          scope.features == nullptr ? nullptr : &scope.variables);
      if (change > kDeltaChange) is_dirty = true;
      is_done = true;
      // Residuals of a state that could not be solved for prove nothing.
      if (!options.break_constraints || !is_usable) break;
      Transaction transaction = WorstOf(scope, &is_done);
      if (transaction.empty()) break;
      has_broken = true;
      graph->Apply(std::move(transaction));
      if (!is_done) Optimize(scope);
    }
    if (scope.features == nullptr) {
      for (int level = 0; level <= highest_level; ++level) {
        const auto& ids = graph->VirtualFeatures(level);
        lost_support.insert(ids.begin(), ids.end());
      }
    }
    const bool has_dropped = DropUnsupported();
    return has_broken || has_dropped;
  }

  // Breaks live structure below the threshold: all of it, or the worst of it
  // (break_share); then `is_all` becomes false when some is left.
  Transaction WorstOf(const Scope& scope, bool* is_all) {
    std::vector<std::pair<ConstraintId, double>> bad;
    double largest = 0.0;
    for (const Constraint* constraint : StructureOf(scope)) {
      const double delta = constraint->delta > kDeltaFloor
                               ? constraint->delta
                               : session->Delta(*constraint);
      if (delta >= options.delta_threshold) continue;
      const double squared = options.break_share > 0.0
                                 ? session->SquaredResidual(*constraint)
                                 : 0.0;
      largest = std::max(largest, squared);
      bad.emplace_back(constraint->id, squared);
    }
    Transaction transaction;
    for (const auto& [id, squared] : bad) {
      if (squared < options.break_share * largest) {
        *is_all = false;
      } else {
        transaction.BreakConstraint(id);
      }
    }
    return transaction;
  }

  // The detector that made a feature; null when it is none of the hierarchy's.
  const StructureDetector* MakerOf(const Feature& feature) const {
    const auto found = detectors_by_name.find(feature.source);
    return found == detectors_by_name.end() ? nullptr : found->second;
  }

  static bool IsEnough(const StructureDetector& detector,
                       const std::vector<const Constraint*>& support) {
    return static_cast<int>(support.size()) >= detector.minimum_support() &&
           detector.IsSupported(support);
  }

  bool IsSupport(const Constraint& constraint, const Feature& feature) const {
    return std::any_of(constraint.features.begin(), constraint.features.end(),
                       [&](FeatureId id) {
                         return graph->FindFeature(id)->level < feature.level;
                       });
  }

  // Drops virtual features without support, also those that lose theirs by it.
  bool DropUnsupported() {
    bool has_dropped = false;
    while (!lost_support.empty()) {
      const FeatureId id = *lost_support.begin();
      lost_support.erase(lost_support.begin());
      const Feature* feature = graph->FindFeature(id);
      if (feature == nullptr || !feature->is_virtual || feature->fixed) {
        continue;
      }
      Transaction transaction;
      const Constraint* last = nullptr;
      int live = 0;
      std::vector<const Constraint*> support;
      bool is_measured = false;
      for (const ConstraintId constraint_id : graph->ConstraintsOf(id)) {
        const Constraint& constraint = *graph->FindConstraint(constraint_id);
        if (constraint.state != ConstraintState::kLive) continue;
        if (constraint.kind == ConstraintClass::kMeasurement) {
          is_measured = true;
          break;
        }
        ++live;
        if (IsSupport(constraint, *feature)) support.push_back(&constraint);
        last = &constraint;
        transaction.RemoveConstraint(constraint_id);
      }
      if (is_measured) continue;
      const StructureDetector* const maker = MakerOf(*feature);
      const bool is_supported =
          maker == nullptr ? !support.empty() : IsEnough(*maker, support);
      if (is_supported &&
          (live > 1 || (maker != nullptr && maker->keeps_followers()))) {
        continue;
      }
      if (is_supported && last != nullptr) {
        // Nothing is wrong with it, but it would be found and dropped again.
        silent_alone.insert(AloneKey(*last, id));
      }
      transaction.RemoveFeature(id);
      graph->Apply(std::move(transaction));
      has_dropped = true;
    }
    return has_dropped;
  }

  // What a detector of a level may look at in a scope: features of the level,
  // and those of lower ones.
  std::pair<std::vector<FeatureId>, std::vector<FeatureId>> FeaturesUpTo(
      const Scope& scope, int level) const {
    std::pair<std::vector<FeatureId>, std::vector<FeatureId>> ids;
    for (const FeatureId id : scope.attached) {
      const Feature* feature = graph->FindFeature(id);
      if (feature == nullptr || feature->level > level) continue;
      (feature->level == level ? ids.first : ids.second).push_back(id);
    }
    return ids;
  }

  // Detects, filters and adds; true when something was added.
  bool Detect(int level, const std::vector<FeatureId>* scope_features) {
    const auto start = std::chrono::steady_clock::now();
    const Scope scope = MakeScope(scope_features);
    DetectionScope detection;
    detection.level = level;
    const auto ids = FeaturesUpTo(scope, level);
    if (scope_features != nullptr) {
      detection.features = &ids.first;
      detection.lower_features = &ids.second;
    }
    bool has_changed = false;
    const auto& detectors = hierarchy[static_cast<std::size_t>(level)];
    for (std::size_t i = 0; i < detectors.size(); ++i) {
      // Different for every detector, the same in every iteration, so that what
      // is found at a fixed point is the same too.
      detection.seed =
          options.seed + 1000003u * static_cast<std::uint64_t>(level) + i;
      Transaction proposal = detectors[i]->Detect(*graph, registry, detection);
      if (proposal.empty()) continue;
      Transaction accepted = Filter(std::move(proposal), *detectors[i]);
      if (accepted.empty()) continue;
      RememberTakenBack(accepted);
      graph->Apply(std::move(accepted));
      has_changed = true;
    }
    totals.detect_seconds += SecondsSince(start);
    return has_changed;
  }

  // True when the numbers fit the relation and each other, so that the error
  // can be computed.
  static bool IsWellFormed(const Constraint& constraint,
                           const std::vector<const Feature*>& between) {
    if (constraint.type == nullptr) return false;
    const RelationType& type = *constraint.type;
    const Eigen::Index size = type.residual_size;
    return between.size() == constraint.features.size() &&
           between.size() == type.feature_types.size() &&
           constraint.expected.size() == size &&
           constraint.information.rows() == size &&
           IsValidInformation(constraint.information);
  }

  bool IsThere(const Constraint& constraint) const {
    const std::vector<ConstraintId>* fewest = nullptr;
    for (const FeatureId id : constraint.features) {
      if (graph->FindFeature(id) == nullptr) return false;
      const auto& constraints = graph->ConstraintsOf(id);
      if (fewest == nullptr || constraints.size() < fewest->size()) {
        fewest = &constraints;
      }
    }
    return fewest != nullptr &&
           std::any_of(fewest->begin(), fewest->end(), [&](ConstraintId id) {
             const Constraint& other = *graph->FindConstraint(id);
             return other.state == ConstraintState::kLive &&
                    other.type == constraint.type &&
                    other.features == constraint.features &&
                    other.expected == constraint.expected;
           });
  }

  // Gives a proposal the tolerances that are known beforehand; false when it is
  // not expected at all.
  bool ApplyPrior(Constraint* constraint) const {
    if (constraint->type == nullptr) return true;
    const auto found = options.relation_priors.find(constraint->type->name);
    if (found == options.relation_priors.end()) return true;
    const std::vector<double>& sigmas = found->second.sigmas;
    if (!found->second.is_expected) return false;
    if (sigmas.empty()) return true;
    const auto rows = static_cast<Eigen::Index>(sigmas.size());
    if (rows != constraint->type->residual_size) {
      throw PLUMBLINE_ERROR("prior of " + found->first + " has " +
                                std::to_string(rows) + " sigmas",
                            std::to_string(constraint->type->residual_size));
    }
    constraint->information =
        Eigen::Map<const Eigen::VectorXd>(sigmas.data(), rows)
            .cwiseAbs2()
            .cwiseInverse()
            .asDiagonal();
    return true;
  }

  // Takes out of a proposal what is there already, what was broken before, and
  // virtual features that are left with too little support.
  Transaction Filter(Transaction proposal, const StructureDetector& detector) {
    std::vector<Feature>& features = proposal.added_features();
    for (Feature& feature : features) {
      feature.is_virtual = true;
      if (feature.source.empty()) feature.source = detector.name();
    }
    const auto find = [&](FeatureId id) -> const Feature* {
      if (!Transaction::IsProvisional(id)) return graph->FindFeature(id);
      const std::size_t index = Transaction::ProvisionalIndex(id);
      return index < features.size() ? &features[index] : nullptr;
    };
    std::vector<Constraint> constraints;
    for (Constraint& constraint : proposal.added_constraints()) {
      if (!ApplyPrior(&constraint)) continue;
      std::vector<const Feature*> between;
      for (const FeatureId id : constraint.features) {
        const Feature* feature = find(id);
        if (feature != nullptr && feature->type != nullptr) {
          between.push_back(feature);
        }
      }
      // What is not well-formed is left to Graph::Apply, which says why.
      if (IsWellFormed(constraint, between) &&
          (IsThere(constraint) || !MayBeProposed(constraint, between))) {
        continue;
      }
      constraints.push_back(std::move(constraint));
    }

    // Features without enough support go with their constraints, and so do
    // those that lose theirs by it.
    std::vector<bool> is_kept(features.size(), true);
    std::vector<bool> is_out(constraints.size(), false);
    std::vector<std::vector<std::size_t>> constraints_on(features.size());
    for (std::size_t c = 0; c < constraints.size(); ++c) {
      for (const FeatureId id : constraints[c].features) {
        if (!Transaction::IsProvisional(id)) continue;
        const std::size_t index = Transaction::ProvisionalIndex(id);
        if (index < features.size()) constraints_on[index].push_back(c);
      }
    }
    std::set<std::size_t> unchecked;
    for (std::size_t i = 0; i < features.size(); ++i) unchecked.insert(i);
    while (!unchecked.empty()) {
      const std::size_t i = *unchecked.begin();
      unchecked.erase(unchecked.begin());
      if (!is_kept[i] || features[i].fixed) continue;
      const FeatureId id = Transaction::ProvisionalId(i);
      const Constraint* last = nullptr;
      int live = 0;
      std::vector<const Constraint*> support;
      for (const std::size_t c : constraints_on[i]) {
        if (is_out[c]) continue;
        const Constraint& constraint = constraints[c];
        ++live;
        last = &constraint;
        if (std::any_of(constraint.features.begin(), constraint.features.end(),
                        [&](FeatureId other) {
                          const Feature* feature = find(other);
                          return feature != nullptr &&
                                 feature->level < features[i].level;
                        })) {
          support.push_back(&constraint);
        }
      }
      if (IsEnough(detector, support) &&
          !(live == 1 && silent_alone.count(AloneKey(*last, id)) > 0)) {
        continue;
      }
      is_kept[i] = false;
      for (const std::size_t c : constraints_on[i]) {
        is_out[c] = true;
        for (const FeatureId other : constraints[c].features) {
          if (!Transaction::IsProvisional(other)) continue;
          const std::size_t index = Transaction::ProvisionalIndex(other);
          if (index < features.size()) unchecked.insert(index);
        }
      }
    }

    Transaction accepted;
    std::map<FeatureId, FeatureId> new_ids;
    for (std::size_t i = 0; i < features.size(); ++i) {
      if (!is_kept[i]) continue;
      new_ids[Transaction::ProvisionalId(i)] =
          accepted.AddFeature(std::move(features[i]));
    }
    for (std::size_t c = 0; c < constraints.size(); ++c) {
      if (is_out[c]) continue;
      Constraint& constraint = constraints[c];
      for (FeatureId& id : constraint.features) {
        const auto found = new_ids.find(id);
        if (found != new_ids.end()) id = found->second;
      }
      if (constraint.source.empty()) constraint.source = detector.name();
      accepted.AddConstraint(std::move(constraint));
    }
    for (const FeatureId id : proposal.removed_features()) {
      accepted.RemoveFeature(id);
    }
    for (const ConstraintId id : proposal.removed_constraints()) {
      accepted.RemoveConstraint(id);
    }
    for (const ConstraintId id : proposal.broken_constraints()) {
      accepted.BreakConstraint(id);
    }
    return accepted;
  }

  // Reports a phase that began at `start`; false when the loop shall stop.
  bool EndPhase(const std::string& name, const Scope& scope,
                std::chrono::steady_clock::time_point start) {
    if (trace) {
      EmPhase phase;
      phase.iteration = totals.iterations;
      phase.phase = name;
      phase.seconds = SecondsSince(start);
      phase.cost =
          session->Cost(scope.features == nullptr ? nullptr : &scope.variables);
      phase.features = feature_counts;
      phase.structure_constraints = structure_count;
      phase.broken_constraints = static_cast<int>(broken_on_record.size());
      phase.structure_by_relation = structure_by_relation;
      phase.broken_by_relation = broken_by_relation;
      trace(phase);
    }
    if (stop && stop()) is_stopped = true;
    return !is_stopped;
  }

  bool Iterate(const std::vector<FeatureId>* features) {
    ++totals.iterations;
    auto start = std::chrono::steady_clock::now();
    Scope scope = MakeScope(features);
    if (options.full_weight_test) RestoreWeights(scope);
    Optimize(scope);
    if (!EndPhase("optimize", scope, start)) return false;

    start = std::chrono::steady_clock::now();
    bool has_changed = Break(scope);
    if (features != nullptr) scope = MakeScope(features);
    Optimize(scope);
    if (is_coarse) solved_cost = session->Cost().total();
    MeasureRelaxedErrors();
    if (!EndPhase("break", scope, start)) return has_changed;

    for (std::size_t level = 0; detects && level < hierarchy.size(); ++level) {
      start = std::chrono::steady_clock::now();
      const int changes_before = changes;
      if (Detect(static_cast<int>(level), features)) {
        has_changed = true;
        if (features != nullptr) scope = MakeScope(features);
        if (is_coarse && changes - changes_before <= kFew * structure_count) {
          SettleInPlace();
        } else {
          Optimize(scope);
        }
      }
      if (!EndPhase("detect_" + std::to_string(level), scope, start)) break;
    }
    return has_changed;
  }

  Graph* graph;
  SolverSession* session;
  const Registry& registry;
  Hierarchy hierarchy;
  EmOptions options;
  std::map<std::string, const StructureDetector*> detectors_by_name;

  std::map<HypothesisKey, std::vector<BrokenHypothesis>> memory;
  // Keys of hypotheses that were broken and not measured since.
  std::set<HypothesisKey> unmeasured;
  // Virtual features that are gone, as they were last.
  std::map<FeatureId, Feature> dropped;
  // Features and relations that alone made a virtual feature that said nothing.
  std::set<HypothesisKey> silent_alone;
  // Virtual features that lost a constraint.
  std::set<FeatureId> lost_support;
  // Virtual features that gained or lost one since the last solve.
  std::set<FeatureId> unsettled;

  std::map<std::string, int> feature_counts;
  std::set<ConstraintId> broken_on_record;
  int structure_count = 0;
  std::map<std::string, int> structure_by_relation;
  std::map<std::string, int> broken_by_relation;
  int highest_level = 0;
  // Global solves are to this relative change of the cost, and begin with this
  // radius of the trust region.
  bool is_coarse = false;
  double coarse_tolerance = 0.0;
  double coarse_radius = 0.0;
  // In a coarse loop: after the last solve with what was broken left out.
  double solved_cost = 0.0;
  // Constraints that came or went in this iteration of Run.
  int changes = 0;
  // False: an iteration only judges what is there.
  bool detects = true;
  // The graph or a weight changed since the last global solve.
  bool is_dirty = true;
  bool is_usable = true;
  bool is_stopped = false;
  std::function<bool()> stop;
  std::function<void(const EmPhase&)> trace;
  EmReport totals;
};

EmOrchestrator::EmOrchestrator(Graph* graph, SolverSession* session,
                               const Registry& registry, Hierarchy hierarchy,
                               const EmOptions& options)
    : impl_(std::make_unique<Impl>(graph, session, registry,
                                   std::move(hierarchy), options)) {}

EmOrchestrator::~EmOrchestrator() = default;

bool EmOrchestrator::Iterate(const std::vector<FeatureId>* scope) {
  impl_->stop = nullptr;
  impl_->is_stopped = false;
  // Parameters may have been changed without the graph's knowledge.
  impl_->is_dirty = true;
  return impl_->Iterate(scope);
}

EmReport EmOrchestrator::Run(const std::function<bool()>& stop) {
  const EmReport before = impl_->totals;
  impl_->stop = stop;
  impl_->is_stopped = false;
  impl_->is_dirty = true;
  bool has_converged = false;

  // With no structure there and none looked for, nothing moves after the first
  // solve, and its cost need not be known.
  const bool is_still = impl_->structure_count == 0 && impl_->hierarchy.empty();
  const double tight = impl_->session->options().function_tolerance;
  const bool is_coarse = impl_->options.loop_tolerance > tight && !is_still;
  impl_->is_coarse = is_coarse;
  impl_->coarse_tolerance = kFirstTolerances * impl_->options.loop_tolerance;
  impl_->coarse_radius = kFirstRadius;

  const auto start = std::chrono::steady_clock::now();
  const Impl::Scope whole;
  impl_->Optimize(whole);
  bool goes_on = impl_->EndPhase(
      impl_->structure_count == 0 ? "measurements" : "optimize", whole, start);
  impl_->coarse_tolerance = impl_->options.loop_tolerance;
  impl_->coarse_radius = impl_->options.loop_trust_region_radius;
  // What a coarse loop found last may not be solved for.
  const auto total_cost = [&] {
    if (is_still) return 0.0;
    return is_coarse ? impl_->solved_cost : impl_->session->Cost().total();
  };
  double cost = total_cost();
  // Solves that end at a change of the tolerance leave that much undone.
  const double cost_tolerance =
      impl_->options.cost_tolerance +
      (is_coarse ? 2.0 * impl_->options.loop_tolerance : 0.0);
  for (int i = 0; goes_on && i < impl_->options.max_iterations; ++i) {
    impl_->changes = 0;
    const bool has_changed = impl_->Iterate(nullptr);
    goes_on = !impl_->is_stopped;
    const bool is_settled =
        !has_changed ||
        (impl_->changes > 0 &&
         impl_->changes <= kNegligible * impl_->structure_count);
    const double last_cost = cost;
    cost = total_cost();
    if (goes_on && is_settled && impl_->is_usable &&
        std::abs(cost - last_cost) <=
            cost_tolerance * std::max(cost, last_cost)) {
      has_converged = true;
      goes_on = false;
      if (has_changed) {
        // What came last has not been judged.
        impl_->detects = false;
        impl_->Iterate(nullptr);
        impl_->detects = true;
      }
    }
  }
  if (is_coarse && !impl_->is_stopped) {
    const auto final_start = std::chrono::steady_clock::now();
    impl_->is_dirty = true;
    impl_->coarse_tolerance =
        std::max(tight, kFinalTolerances * impl_->options.loop_tolerance);
    impl_->Optimize(whole);
    impl_->EndPhase("final", whole, final_start);
  }
  impl_->is_coarse = false;
  impl_->stop = nullptr;
  impl_->totals.converged = has_converged;
  EmReport report = impl_->totals;
  report.iterations -= before.iterations;
  report.detect_seconds -= before.detect_seconds;
  report.solve_seconds -= before.solve_seconds;
  return report;
}

void EmOrchestrator::SetTrace(std::function<void(const EmPhase&)> trace) {
  impl_->trace = std::move(trace);
}

const EmReport& EmOrchestrator::totals() const { return impl_->totals; }

}  // namespace plumbline
