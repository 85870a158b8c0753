#ifndef PLUMBLINE_FRONTEND_BUILTINS_H_
#define PLUMBLINE_FRONTEND_BUILTINS_H_

#include <plumbline/core/registry.h>

namespace plumbline {

/// Registers the log readers of this folder. Readers that are registered
/// already stay.
void RegisterBuiltinLogReaders(Registry* registry);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_BUILTINS_H_
