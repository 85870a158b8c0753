#ifndef PLUMBLINE_CORE_CONSTRAINT_FAULT_H_
#define PLUMBLINE_CORE_CONSTRAINT_FAULT_H_

#include <plumbline/core/constraint.h>
#include <plumbline/core/transaction.h>

#include <string>

namespace plumbline {

/// A fault for which Graph::Apply refuses a constraint: for readers, which add
/// the place in a file.
struct ConstraintFault {
  /// Empty when there is nothing wrong.
  std::string what;
  std::string expected;
};

/// Looks at a constraint between features that `transaction` adds. Its type and
/// the sizes of its numbers must be right.
ConstraintFault FindFault(const Constraint& constraint,
                          const Transaction& transaction);

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_CONSTRAINT_FAULT_H_
