#ifndef PLUMBLINE_APPS_EXPERIMENTS_EXPERIMENTS_H_
#define PLUMBLINE_APPS_EXPERIMENTS_EXPERIMENTS_H_

#include <plumbline/apps/experiments/concentricity.h>
#include <plumbline/apps/experiments/experiment.h>
#include <plumbline/apps/experiments/synthetic_run.h>
#include <plumbline/core/registry.h>

#include <string>
#include <vector>

namespace plumbline {

/// "S1" to "S6", "R1", "R2", "B1", "B2", "N1".
const std::vector<std::string>& ExperimentNames();

/// Runs an experiment of core/method.md, section 8.
///
///   S1  with structure, without, and with the true structure given (oracle)
///   S2  S1 from initial noise of 0.05 to 0.3 m
///   S3  S1 with distance noise of 0.01 and 0.1 m
///   S4  S1 with 20 random points
///   S5  wrong structure kept at full weight; kept but weighted by delta;
///       broken where delta is small
///   S6  four ways to say that circles are concentric, to within 0.1 m and to
///       within 0.02 m
///   R1, R2  the logs of Killian Court and of the first part of the Intel
///       Research Lab, without structure and with
///   B1  simulated buildings of several shapes (building_trial.h): right
///       and wrong loop closures, errors of walls
///   B2  two corridors that meet at 1 to 9 degrees (bent_world.h), without
///       structure and with
///   N1  errors of walls against their covariances (consistency.h) in offices
///       and long corridors: without structure, structure alone, with closures
///
/// The registry needs the built-ins. Throws Error for an unknown name and for
/// options that do not fit.
ExperimentResult RunExperiment(const std::string& id,
                               const ExperimentOptions& options,
                               Registry* registry);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_EXPERIMENTS_EXPERIMENTS_H_
