#ifndef PLUMBLINE_APPS_SOLVE_SOLVE_GRAPH_H_
#define PLUMBLINE_APPS_SOLVE_SOLVE_GRAPH_H_

#include <plumbline/apps/solve/run_context.h>
#include <plumbline/frontend/input_stream.h>

namespace plumbline {

/// Solves a graph and writes what came out. Returns the process's exit status;
/// throws Error.
int SolveGraph(InputStream* input, const RunContext& run);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_SOLVE_SOLVE_GRAPH_H_
