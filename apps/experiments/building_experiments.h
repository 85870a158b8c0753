#ifndef PLUMBLINE_APPS_EXPERIMENTS_BUILDING_EXPERIMENTS_H_
#define PLUMBLINE_APPS_EXPERIMENTS_BUILDING_EXPERIMENTS_H_

#include <plumbline/apps/experiments/experiment.h>
#include <plumbline/core/registry.h>

namespace plumbline {

/// The experiment on simulated buildings (RunExperiment says what it is).
void RunB1(const ExperimentOptions& options, const Registry& registry,
           ExperimentResult* result);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_EXPERIMENTS_BUILDING_EXPERIMENTS_H_
