#include <plumbline/apps/cli/app.h>
#include <plumbline/apps/cli/progress.h>
#include <plumbline/apps/solve/log_map.h>
#include <plumbline/apps/solve/run_summary.h>
#include <plumbline/apps/solve_flags.h>
#include <plumbline/core/utf8.h>
#include <plumbline/frontend/key_scan_archive.h>
#include <plumbline/frontend/mirrors.h>
#include <plumbline/outputs/building_frame.h>
#include <plumbline/pipeline/without_structure.h>

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <memory>

namespace plumbline {
namespace {

// What the summary says of the solve of a log's map.
void SummarizeLog(const std::vector<Scan>& scans, const LogSolverResult& result,
                  Summary* summary) {
  summary->scans = static_cast<std::int64_t>(result.trajectory.size());
  summary->scans_in_log = static_cast<std::int64_t>(scans.size());
  summary->frontend_seconds =
      result.frontend_seconds + result.relocalization_seconds;
  summary->scan_seconds.assign(result.scan_seconds.begin(),
                               result.scan_seconds.end());
  summary->range_noise = result.range_sigma;
  summary->odometry_scale = result.odometry_scale;
  summary->odometry_course = result.odometry_course;
  EmReport em = result.em;
  em.detect_seconds = result.detect_seconds;
  em.solve_seconds = result.solve_seconds;
  Summarize(result.initial_cost, result.final_cost, em, summary);
}

// Moves the trajectory and the graph as --align says; returns by what.
Pose2 AlignOutputs(const std::vector<Pose2>& path, SolveOutcome* outcome) {
  if (FLAGS_align != "building") return Pose2::Zero();
  const Pose2 by = BuildingFrame(*outcome->graph, path);
  outcome->moved_graph =
      ForFlag("align", [&] { return Moved(by, *outcome->graph); });
  outcome->graph = outcome->moved_graph.get();
  for (TimedPose& timed : outcome->trajectory) {
    timed.pose = Compose(by, timed.pose);
  }
  outcome->summary.alignment = by;
  return by;
}

}  // namespace

void TellOfTrack(const std::string& name, const std::vector<Scan>& scans,
                 const LogSolverResult& result, Summary* summary) {
  for (const LooseTrack& part : result.loose) {
    const Scan& begin = scans[static_cast<std::size_t>(part.begin)];
    const Scan& end = scans[static_cast<std::size_t>(part.end)];
    summary->tracking.loose.push_back(
        {begin.timestamp, end.timestamp, part.why});
    if (!part.found) ++summary->tracking.pieces;
    Remark("%s: the map hangs by a thread, %.3f s to %.3f s: %s", name.c_str(),
           begin.timestamp, end.timestamp, part.why.c_str());
  }
  for (const std::string& note : result.notes) {
    summary->notes.push_back(note);
    Remark("%s: %s", name.c_str(), PrintableUtf8(note).c_str());
  }
  if (result.second_map_refused) {
    summary->notes.push_back(
        "the map from adjusted poses has hardly any walls: the map of the "
        "front-end stands");
    Remark("%s: %s", name.c_str(), summary->notes.back().c_str());
  }
  if (result.loose_walls) {
    summary->notes.push_back(
        "long straight walls turned the map by more than a fifth of a degree "
        "over 30 to 60 m against what the scans say: the building may bend by "
        "a little everywhere, and walls hold the poses loosely");
    Remark("%s: %s", name.c_str(), summary->notes.back().c_str());
  }
}

void TellOfMirrors(const std::string& name, const std::vector<Mirror>& mirrors,
                   const Pose2& moved_by, Summary* summary) {
  for (const Mirror& mirror : mirrors) {
    const Wall& wall = mirror.wall;
    const Eigen::Vector2d begin = TransformPoint(moved_by, wall.At(wall.begin));
    const Eigen::Vector2d end = TransformPoint(moved_by, wall.At(wall.end));
    summary->mirrors.push_back({begin, end, mirror.returns, mirror.share});
    char note[256];
    std::snprintf(note, sizeof note,
                  "a mirror, or something as smooth, %.1f m wide from (%.2f, "
                  "%.2f) to (%.2f, %.2f): what is seen behind it is the image "
                  "of what stands before it (%.0f %% of %d returns), and is "
                  "left out (--mirrors=false keeps it)",
                  wall.length(), begin.x(), begin.y(), end.x(), end.y(),
                  100.0 * mirror.share, mirror.returns);
    summary->notes.push_back(note);
    Remark("%s: %s", name.c_str(), note);
  }
}

std::vector<TimedPose> TimedTrajectory(const std::vector<Scan>& scans,
                                       const std::vector<Pose2>& poses) {
  std::vector<TimedPose> trajectory(poses.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    trajectory[i].timestamp = scans[i].timestamp;
    trajectory[i].timestamp_text = scans[i].timestamp_text;
    trajectory[i].pose = poses[i];
  }
  return trajectory;
}

void TakeMap(const std::string& name, const std::vector<Scan>& scans,
             const LogSolver& solver, const Registry& registry,
             const LogSolverOptions& options, const LogSolverResult& result,
             SolveOutcome* outcome) {
  for (const EmPhase& phase : solver.trace()) TellPhase(phase);
  TellOfTrack(name, scans, result, &outcome->summary);
  SummarizeLog(scans, result, &outcome->summary);
  outcome->trajectory = TimedTrajectory(scans, result.trajectory);
  outcome->graph = &solver.graph();
  outcome->registry = &registry;
  const Pose2 moved_by = AlignOutputs(result.trajectory, outcome);
  if (!InterruptRequested()) TakeMarginals(nullptr, outcome);
  outcome->scans = &scans;
  if (!result.mirrors.empty()) {
    TellOfMirrors(name, result.mirrors, moved_by, &outcome->summary);
    outcome->cut_scans = std::make_shared<const std::vector<Scan>>(CutAtMirrors(
        scans, result.trajectory, result.mirrors, options.mirrors));
    outcome->scans = outcome->cut_scans.get();
  }
  outcome->key_scans = [&scans, &result, moved_by] {
    std::vector<Pose2> moved;
    for (const Pose2& pose : result.trajectory) {
      moved.push_back(Compose(moved_by, pose));
    }
    return MakeKeyScanArchive(scans, result.refined, result.records, moved);
  };
  outcome->without_structure = [&scans, &registry, &options, &result,
                                moved_by] {
    return Moved(moved_by,
                 ReplayWithoutStructure(scans, registry, options, result,
                                        [] { return InterruptRequested(); }));
  };
  outcome->breaks = result.breaks;
  for (const LoopClosure& closure : result.closures) {
    const auto scan = static_cast<std::size_t>(closure.scan);
    outcome->closures.push_back(
        {Compose(outcome->trajectory[scan].pose, closure.place), closure.holds,
         closure.delta});
  }
  outcome->trace = solver.trace();
  outcome->occupancy = OccupancyOptionsFromFlags();
  outcome->title = TitleOf(name) + (FLAGS_structure ? ", with structure"
                                                    : ", without structure");
}

}  // namespace plumbline
