#ifndef PLUMBLINE_PIPELINE_MAP_STATE_H_
#define PLUMBLINE_PIPELINE_MAP_STATE_H_

#include <plumbline/core/break_log.h>
#include <plumbline/core/em.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/session.h>
#include <plumbline/core/state_archive.h>

#include <string>
#include <utility>
#include <vector>

// A graph, and what is kept of EM on it, for a StateWriter or StateReader
// (core/state_archive.h).

namespace plumbline {

template <typename Archive>
void Exchange(Archive& archive, CostReport& cost) {
  auto& [measurement, structure] = cost;
  ExchangeAll(archive, measurement, structure);
}

template <typename Archive>
void Exchange(Archive& archive, EmReport& report) {
  auto& [termination, iterations, detect_seconds, solve_seconds] = report;
  ExchangeAll(archive, termination, iterations, detect_seconds, solve_seconds);
}

template <typename Archive>
void Exchange(Archive& archive, EmPhase& row) {
  auto& [iteration, phase, cost, features, structure, broken, structure_by,
         broken_by, detections, seconds] = row;
  ExchangeAll(archive, iteration, phase, cost, features, structure, broken,
              structure_by, broken_by, detections, seconds);
}

template <typename Archive>
void Exchange(Archive& archive, BreakRecord& record) {
  auto& [iteration, error] = record;
  ExchangeAll(archive, iteration, error);
}

// Types go by their registered names.
template <typename Archive, typename Type, typename Find>
void ExchangeType(Archive& archive, const Type*& type, const Find& find) {
  std::string name = type == nullptr ? std::string() : type->name;
  Exchange(archive, name);
  if constexpr (Archive::kReads) type = &find(name);
}

template <typename Archive>
void ExchangeFeature(Archive& archive, const Registry& registry,
                     Feature& feature) {
  auto& [id, type, level, is_virtual, fixed, parameters, anchor, begin, end,
         observations, maker, source] = feature;
  ExchangeType(
      archive, type, [&](const std::string& name) -> const auto& {
        return registry.GetFeature(name);
      });
  // No name stands for none.
  std::string maker_name = maker == nullptr ? std::string() : maker->name;
  ExchangeAll(archive, id, level, is_virtual, fixed, parameters, anchor, begin,
              end, observations, maker_name, source);
  if constexpr (Archive::kReads) maker = registry.FindDetector(maker_name);
}

template <typename Archive>
void ExchangeConstraint(Archive& archive, const Registry& registry,
                        Constraint& constraint) {
  auto& [id, type, features, expected, information, kind, state, delta,
         break_below, source] = constraint;
  ExchangeType(
      archive, type, [&](const std::string& name) -> const auto& {
        return registry.GetRelation(name);
      });
  ExchangeAll(archive, id, features, expected, information, kind, state, delta,
              break_below, source);
}

inline void Exchange(StateWriter& archive, const Registry& registry,
                     const Graph& graph) {
  FeatureId feature_end = graph.feature_id_end();
  ConstraintId constraint_end = graph.constraint_id_end();
  ExchangeAll(archive, feature_end, constraint_end);
  const std::vector<const Feature*> features = graph.Features();
  ExchangeSize(archive, features.size());
  for (const Feature* feature : features) {
    Feature copy = *feature;
    ExchangeFeature(archive, registry, copy);
  }
  const std::vector<const Constraint*> constraints = graph.Constraints();
  ExchangeSize(archive, constraints.size());
  for (const Constraint* constraint : constraints) {
    Constraint copy = *constraint;
    ExchangeConstraint(archive, registry, copy);
  }
}

inline void Exchange(StateReader& archive, const Registry& registry,
                     Graph& graph) {
  FeatureId feature_end = 0;
  ConstraintId constraint_end = 0;
  ExchangeAll(archive, feature_end, constraint_end);
  std::vector<Feature> features(ExchangeSize(archive, 0));
  for (Feature& feature : features) ExchangeFeature(archive, registry, feature);
  std::vector<Constraint> constraints(ExchangeSize(archive, 0));
  for (Constraint& constraint : constraints) {
    ExchangeConstraint(archive, registry, constraint);
  }
  graph.Restore(std::move(features), std::move(constraints), feature_end,
                constraint_end);
}

}  // namespace plumbline

#endif  // PLUMBLINE_PIPELINE_MAP_STATE_H_
