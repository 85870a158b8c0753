#ifndef PLUMBLINE_APPS_EXPERIMENTS_BUILDING_EXPERIMENTS_H_
#define PLUMBLINE_APPS_EXPERIMENTS_BUILDING_EXPERIMENTS_H_

#include <plumbline/apps/experiments/experiment.h>
#include <plumbline/core/registry.h>

namespace plumbline {

/// The experiments on simulated buildings (RunExperiment says what they are).
void RunB1(const ExperimentOptions& options, const Registry& registry,
           ExperimentResult* result);
void RunB2(const ExperimentOptions& options, const Registry& registry,
           ExperimentResult* result);
void RunN1(const ExperimentOptions& options, const Registry& registry,
           ExperimentResult* result);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_EXPERIMENTS_BUILDING_EXPERIMENTS_H_
