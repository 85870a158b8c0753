#include <plumbline/core/constraint_fault.h>
#include <plumbline/core/information.h>
#include <plumbline/core/registry.h>

#include <algorithm>
#include <vector>

namespace plumbline {

ConstraintFault FindFault(const Constraint& constraint,
                          const Transaction& transaction) {
  const RelationType& type = *constraint.type;
  for (std::size_t i = 0; i < constraint.features.size(); ++i) {
    const FeatureId id = constraint.features[i];
    const Feature& feature =
        transaction.added_features()[Transaction::ProvisionalIndex(id)];
    if (!type.Accepts(i, *feature.type)) {
      return {"feature " + std::to_string(i + 1) + " of " + type.name +
                  " is of type " + feature.type->name,
              type.AcceptedNames(i)};
    }
    if (std::count(constraint.features.begin(), constraint.features.end(), id) >
        1) {
      return {type.name + " from a feature to itself", "different features"};
    }
  }
  if (!IsValidInformation(constraint.information)) {
    return {"information of " + type.name + " is not valid",
            "a symmetric positive semidefinite matrix"};
  }
  if (!(constraint.delta >= 0.0 && constraint.delta <= 1.0)) {
    return {"delta of " + type.name + " is " + std::to_string(constraint.delta),
            "a number in [0, 1]"};
  }
  return {};
}

}  // namespace plumbline
