#ifndef PLUMBLINE_APPS_SOLVE_FLAGS_H_
#define PLUMBLINE_APPS_SOLVE_FLAGS_H_

#include <gflags/gflags_declare.h>
#include <plumbline/apps/cli/app.h>
#include <plumbline/core/graph_g2o.h>
#include <plumbline/core/initial_guess.h>
#include <plumbline/core/registry.h>
#include <plumbline/frontend/log_reader.h>
#include <plumbline/outputs/occupancy_grid.h>
#include <plumbline/pipeline/graph_solver.h>
#include <plumbline/pipeline/log_solver.h>

#include <optional>
#include <string>
#include <vector>

DECLARE_string(input);
DECLARE_string(output_dir);
DECLARE_string(log_reader);
DECLARE_string(map);
DECLARE_string(plan);
DECLARE_string(constraints);
DECLARE_bool(localize);
DECLARE_string(start_pose);
DECLARE_string(outputs);
DECLARE_string(align);
DECLARE_double(checkpoint_every);
DECLARE_string(live_dir);
DECLARE_double(live_every);
DECLARE_bool(structure);
DECLARE_double(delta_threshold);
DECLARE_string(hierarchy);
DECLARE_int32(max_solver_iterations);
DECLARE_string(marginals);
DECLARE_bool(marginals_hold_gauge);
DECLARE_double(ellipse_sigmas);
DECLARE_uint64(seed);
DECLARE_int32(num_threads);
DECLARE_string(plugins);
DECLARE_string(structure_prior);
DECLARE_bool(list_plugins);

namespace plumbline {

/// The flags of plumbline_solve in groups, for --help.
std::vector<FlagGroup> SolveFlagGroups();

/// Names of flags that say something for graphs only, and for logs only.
std::vector<std::string> GraphFlags();
std::vector<std::string> LogFlags();

/// The one place where flags become options. `registry` gives the detectors
/// that structure tolerances are handed to. Throws Error for values that do
/// not fit together or do not parse.
LogSolverOptions LogSolverOptionsFromFlags(const Registry& registry);

/// The same for a graph. Throws Error likewise.
GraphSolverOptions GraphSolverOptionsFromFlags(const Registry& registry);

/// Where a graph starts: --initial_guess.
InitialGuessOptions InitialGuessOptionsFromFlags();

/// How a graph's file is understood: --information_frame.
G2oOptions G2oOptionsFromFlags();

/// Resolution and range of occupancy.pgm.
OccupancyOptions OccupancyOptionsFromFlags();

/// Laser flags for the log reader.
LaserOptions LaserOptionsFromFlags();

/// The logs or graph of --input, one name or several separated by commas. A
/// file whose name has commas is one.
std::vector<std::string> InputsFromFlags();

/// Throws Error for a flag that says more of another one which is not given:
/// --plan_pose without --plan and the like.
void RefuseFlagsWithoutEffect();

/// Flags that say how structure is looked for and weighed: without effect where
/// there is none (--structure=false).
std::vector<std::string> StructureFlags();

/// By log: where --start_pose says that it starts, in the frame of the first
/// log, or of --map.
/// Throws Error when it does not parse or names a log that is not there.
std::vector<std::optional<Pose2>> StartPosesFromFlags(std::size_t num_logs);

/// Threads to use: --num_threads, or all cores when it is 0.
int NumThreadsFromFlags();

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_SOLVE_FLAGS_H_
