#ifndef PLUMBLINE_CORE_BUILTINS_H_
#define PLUMBLINE_CORE_BUILTINS_H_

#include <plumbline/core/registry.h>

namespace plumbline {

/// Registers the feature types, relations and losses of plumbline::factors:
/// those of factors/blocks.h (point, pose, segment, line, end_points, circle,
/// rectangle, orientation), corridor and thickness, those of the table in
/// factors/relations.md, and the names of --delta_mode. Does nothing for what
/// is there already. Explicit, because static initializers are lost in static
/// libraries.
///
/// builtins.cc is the only file of core that knows a relation: a new one is a
/// header in factors/, a line there and a test.
void RegisterBuiltinRelations(Registry* registry);

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_BUILTINS_H_
