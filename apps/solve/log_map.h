#ifndef PLUMBLINE_APPS_SOLVE_LOG_MAP_H_
#define PLUMBLINE_APPS_SOLVE_LOG_MAP_H_

#include <plumbline/core/registry.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/mirrors.h>
#include <plumbline/frontend/scan.h>
#include <plumbline/frontend/timed_pose.h>
#include <plumbline/outputs/solve_outputs.h>
#include <plumbline/outputs/summary.h>
#include <plumbline/pipeline/log_solver.h>

#include <string>
#include <vector>

namespace plumbline {

/// How the track hangs together, and which of the two maps stands: puts it into
/// the summary and says it.
void TellOfTrack(const std::string& name, const std::vector<Scan>& scans,
                 const LogSolverResult& result, Summary* summary);

/// Puts mirrors (map frame) into the summary, with all that was moved by
/// `moved_by`, and says where they are.
void TellOfMirrors(const std::string& name, const std::vector<Mirror>& mirrors,
                   const Pose2& moved_by, Summary* summary);

/// The pose of every scan that was solved, with its time.
std::vector<TimedPose> TimedTrajectory(const std::vector<Scan>& scans,
                                       const std::vector<Pose2>& poses);

/// Takes over what there is to say and to write of a log's map. All but `name`
/// have to stay until the outputs are written.
void TakeMap(const std::string& name, const std::vector<Scan>& scans,
             const LogSolver& solver, const Registry& registry,
             const LogSolverOptions& options, const LogSolverResult& result,
             SolveOutcome* outcome);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_SOLVE_LOG_MAP_H_
