#ifndef PLUMBLINE_APPS_EXPERIMENTS_LOG_EXPERIMENTS_H_
#define PLUMBLINE_APPS_EXPERIMENTS_LOG_EXPERIMENTS_H_

#include <plumbline/apps/experiments/experiment.h>
#include <plumbline/core/registry.h>

namespace plumbline {

/// The experiments on public logs (RunExperiment says what each is).
void RunR1(const ExperimentOptions& options, const Registry& registry,
           ExperimentResult* result);
void RunR2(const ExperimentOptions& options, const Registry& registry,
           ExperimentResult* result);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_EXPERIMENTS_LOG_EXPERIMENTS_H_
