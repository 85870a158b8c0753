#ifndef PLUMBLINE_DETECTORS_BUILTINS_H_
#define PLUMBLINE_DETECTORS_BUILTINS_H_

#include <plumbline/core/registry.h>

namespace plumbline {

/// Registers the structure detectors of this folder. Detectors that are
/// registered already stay.
void RegisterBuiltinDetectors(Registry* registry);

/// RegisterBuiltinRelations and RegisterBuiltinDetectors: all that a program
/// needs before it reads a graph or looks for structure.
void RegisterBuiltins(Registry* registry);

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_BUILTINS_H_
