#ifndef PLUMBLINE_APPS_EXPERIMENTS_SYNTHETIC_EXPERIMENTS_H_
#define PLUMBLINE_APPS_EXPERIMENTS_SYNTHETIC_EXPERIMENTS_H_

#include <plumbline/apps/experiments/experiment.h>
#include <plumbline/core/registry.h>

namespace plumbline {

/// The experiments on worlds of points (RunExperiment says what each is).
void RunS1(const ExperimentOptions& options, const Registry& registry,
           ExperimentResult* result);
void RunS2(const ExperimentOptions& options, const Registry& registry,
           ExperimentResult* result);
void RunS3(const ExperimentOptions& options, const Registry& registry,
           ExperimentResult* result);
void RunS4(const ExperimentOptions& options, const Registry& registry,
           ExperimentResult* result);
void RunS5(const ExperimentOptions& options, const Registry& registry,
           ExperimentResult* result);
void RunS6(const ExperimentOptions& options, const Registry& registry,
           ExperimentResult* result);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_EXPERIMENTS_SYNTHETIC_EXPERIMENTS_H_
