#ifndef PLUMBLINE_APPS_SOLVE_RUN_SUMMARY_H_
#define PLUMBLINE_APPS_SOLVE_RUN_SUMMARY_H_

#include <plumbline/core/em.h>
#include <plumbline/core/session.h>
#include <plumbline/outputs/solve_outputs.h>
#include <plumbline/outputs/summary.h>

#include <string>

namespace plumbline {

/// A summary that says what the run is asked to do.
Summary BeginSummary();

/// Puts what is to be said of costs and EM into the summary.
void Summarize(const CostReport& initial, const CostReport& last,
               const EmReport& em, Summary* summary);

/// Says how a phase of EM went, with --verbose.
void TellPhase(const EmPhase& phase);

/// Adds the covariances and ellipses that --marginals and --ellipse_sigmas ask
/// for. `session`: as ComputeMarginals has it.
void TakeMarginals(const SolverSession* session, SolveOutcome* outcome);

/// A file's name, for people: a name may have any bytes.
std::string TitleOf(const std::string& name);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_SOLVE_RUN_SUMMARY_H_
