#ifndef PLUMBLINE_APPS_SOLVE_SOLVE_LOG_H_
#define PLUMBLINE_APPS_SOLVE_SOLVE_LOG_H_

#include <plumbline/apps/solve/log_input.h>
#include <plumbline/apps/solve/run_context.h>
#include <plumbline/core/registry.h>
#include <plumbline/pipeline/log_solver.h>

namespace plumbline {

/// Turns a log into a map and writes it, from where a run that did not end had
/// got to if there is one. Returns the process's exit status; throws Error.
int SolveLog(const LogInput& input, const RunContext& run);

/// Refuses a hierarchy that does not fit what logs are made of, before the log
/// is read. Throws Error.
void CheckHierarchy(const LogSolverOptions& options, const Registry& registry);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_SOLVE_SOLVE_LOG_H_
