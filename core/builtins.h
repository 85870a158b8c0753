#ifndef PLUMBLINE_CORE_BUILTINS_H_
#define PLUMBLINE_CORE_BUILTINS_H_

#include <plumbline/core/registry.h>

namespace plumbline {

/// Registers the feature types, relations and losses of plumbline::factors:
/// point, pose, segment, line, circle, orientation; the relations of method.md,
/// section 4; the names of --delta_mode. Does nothing for what is there
/// already. Explicit, because static initializers are lost in static
/// libraries.
void RegisterBuiltinRelations(Registry* registry);

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_BUILTINS_H_
