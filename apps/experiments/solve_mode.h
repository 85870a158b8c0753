#ifndef PLUMBLINE_APPS_EXPERIMENTS_SOLVE_MODE_H_
#define PLUMBLINE_APPS_EXPERIMENTS_SOLVE_MODE_H_

#include <plumbline/apps/experiments/experiment.h>
#include <plumbline/pipeline/log_solver.h>

namespace plumbline {

/// How an experiment solves a log.
struct SolveMode {
  const char* name;
  bool structure;
  /// Needs structure.
  bool closures;
  Refinement refine;
};

/// The solver's defaults, with what the experiment varies.
inline LogSolverOptions SolverOptions(const ExperimentOptions& options) {
  LogSolverOptions solver;
  solver.session.delta_mode = options.delta_mode;
  solver.em.delta_threshold = options.delta_threshold;
  solver.em.seed = options.seed;
  return solver;
}

/// The same in a mode.
inline LogSolverOptions SolverOptions(const ExperimentOptions& options,
                                      const SolveMode& mode) {
  LogSolverOptions solver = SolverOptions(options);
  solver.structure = mode.structure;
  solver.global_association = mode.closures;
  solver.refine = mode.refine;
  return solver;
}

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_EXPERIMENTS_SOLVE_MODE_H_
