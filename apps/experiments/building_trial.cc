#include <plumbline/apps/evaluation/map_truth.h>
#include <plumbline/apps/evaluation/trajectory_alignment.h>
#include <plumbline/apps/experiments/building_trial.h>
#include <plumbline/core/error.h>
#include <plumbline/core/graph_json.h>
#include <plumbline/frontend/carmen_reader.h>
#include <plumbline/frontend/input_stream.h>
#include <plumbline/outputs/floor_plan.h>
#include <plumbline/outputs/occupancy_grid.h>

#include <algorithm>
#include <cmath>
#include <sstream>

namespace plumbline {
namespace {

// What `write` writes, to be read again.
template <typename Write>
InputStream Rewind(const std::string& name, const Write& write) {
  std::ostringstream text;
  write(text);
  return InputStream(name, text.str());
}

}  // namespace

const std::vector<std::string>& BuildingShapes() {
  static const std::vector<std::string>* const shapes =
      new std::vector<std::string>{"office", "oblique", "symmetric",
                                   "parallel"};
  return *shapes;
}

BuildingTrial RunBuildingTrial(const World& world,
                               const SimulatorOptions& simulator,
                               std::uint64_t seed, const Registry& registry,
                               const LogSolverOptions& options,
                               const std::function<bool()>& stop) {
  BuildingTrial trial;
  const Simulation simulation = Simulate(world, simulator, seed);
  InputStream log_text = Rewind("simulated log", [&](std::ostream& output) {
    WriteCarmenLog(simulation, simulator.laser, {}, output);
  });
  const Log log = ReadCarmenLog(&log_text, LaserOptions());
  InputStream truth_text = Rewind("simulated truth", [&](std::ostream& output) {
    WriteTruth(simulation, output);
  });
  const MapTruth truth = ReadMapTruth(&truth_text);

  LogSolver solver(registry, options);
  RunControl control;
  control.stop = stop;
  const LogSolverResult result = solver.Run(log, control);
  if (result.interrupted) {
    trial.is_stopped = true;
    return trial;
  }
  trial.scans = static_cast<std::int64_t>(log.scans.size());
  std::vector<TimedPose> trajectory(result.trajectory.size());
  for (std::size_t i = 0; i < trajectory.size(); ++i) {
    trajectory[i].timestamp = log.scans[i].timestamp;
    trajectory[i].pose = result.trajectory[i];
  }
  const Pose2 alignment = AlignTrajectory(trajectory, truth);
  InputStream map_text = Rewind("map", [&](std::ostream& output) {
    WriteGraphJson(solver.graph(), output);
  });
  const StraightMap map = ReadStraightMap(&map_text);
  trial.map = EvaluateMap(map, truth, alignment);
  trial.closures = EvaluateClosures(map, truth, alignment);
  FloorPlan plan = MakeFloorPlan(solver.graph(), result.trajectory);
  AddRooms(MakeOccupancyGrid(log.scans, result.trajectory, {}),
           result.trajectory, &plan);
  trial.plan = EvaluatePlan(plan.building, truth, alignment);
  // One true pose a scan, in the same order.
  const std::size_t count = std::min(trajectory.size(), truth.poses.size());
  for (std::size_t i = 0; i < count; ++i) {
    trial.mean_position_error +=
        (TransformPoint(alignment, trajectory[i].pose.head<2>()) -
         truth.poses[i].pose.head<2>())
            .norm() /
        static_cast<double>(count);
  }
  trial.consistency =
      EvaluateConsistency(solver.graph(), solver.session(), truth, trajectory);
  trial.drawing = DrawingFromGraph(solver.graph(), result.trajectory);
  return trial;
}

}  // namespace plumbline
