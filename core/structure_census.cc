#include <plumbline/core/registry.h>
#include <plumbline/core/structure_census.h>

namespace plumbline {

void StructureCensus::OnFeatureAdded(const Feature& feature) {
  ++features_[feature.type->name];
}

void StructureCensus::OnFeatureRemoved(const Feature& feature) {
  const auto count = features_.find(feature.type->name);
  if (--count->second == 0) features_.erase(count);
}

void StructureCensus::OnConstraintAdded(const Constraint& constraint) {
  const bool is_structure = constraint.kind == ConstraintClass::kStructure;
  ++num_changes_;
  if (constraint.state == ConstraintState::kBroken) {
    broken_.insert(constraint.id);
    if (is_structure) ++broken_by_relation_[constraint.type->name];
  } else if (is_structure) {
    ++num_structure_;
    ++structure_by_relation_[constraint.type->name];
  }
}

bool StructureCensus::OnConstraintRetired(const Constraint& constraint,
                                          bool stays) {
  const bool is_structure = constraint.kind == ConstraintClass::kStructure;
  if (broken_.erase(constraint.id) > 0) {
    if (is_structure) --broken_by_relation_[constraint.type->name];
    return false;
  }
  ++num_changes_;
  if (is_structure) {
    --num_structure_;
    --structure_by_relation_[constraint.type->name];
  }
  if (stays) {
    broken_.insert(constraint.id);
    if (is_structure) ++broken_by_relation_[constraint.type->name];
  }
  return true;
}

}  // namespace plumbline
