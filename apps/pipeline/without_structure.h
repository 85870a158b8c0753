#ifndef PLUMBLINE_PIPELINE_WITHOUT_STRUCTURE_H_
#define PLUMBLINE_PIPELINE_WITHOUT_STRUCTURE_H_

#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/map_without_structure.h>
#include <plumbline/frontend/scan.h>
#include <plumbline/pipeline/log_solver.h>

#include <functional>
#include <map>
#include <vector>

namespace plumbline {

/// Positions of the raw features of a graph by its measurements alone: the same
/// features and live measurements solved without any structure constraint,
/// started from the graph's present state. Empty when there is no live
/// structure to leave out, a number is not finite, or the solve fails. The
/// graph is not changed. Costs one global solve.
std::map<FeatureId, Feature> SolveWithoutStructure(const Graph& graph,
                                                   const Registry& registry);

/// Makes the map of a log again from the same refined odometry, with the same
/// front-end but no structure, neither on the way nor in the end. A feature's
/// counterpart is the one that took the same piece of wall in the same scan.
/// It begins at the pose at which that map does. `options` are those that gave
/// `result`, whose fields refined, records and trajectory are read. Empty when
/// there is nothing to compare: no scans, no structure asked for, a solve that
/// fails, or once `stop` (may be null) says so, which `interrupted` then tells.
/// Throws Error when the scans
/// cannot be found again on the map. Costs the front-end without scan matching,
/// one global solve and one relocalization.
MapWithoutStructure ReplayWithoutStructure(
    const std::vector<Scan>& scans, const Registry& registry,
    const LogSolverOptions& options, const LogSolverResult& result,
    const std::function<bool()>& stop = nullptr);

}  // namespace plumbline

#endif  // PLUMBLINE_PIPELINE_WITHOUT_STRUCTURE_H_
