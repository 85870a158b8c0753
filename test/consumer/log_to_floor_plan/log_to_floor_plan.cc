// A program of one's own that turns a robot's log into a map, a floor plan and
// a grid:
//
//     log_to_floor_plan LOG
#include <plumbline/core/graph_json.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/frontend/builtins.h>
#include <plumbline/frontend/log_reader.h>
#include <plumbline/outputs/floor_plan.h>
#include <plumbline/outputs/floor_plan_dxf.h>
#include <plumbline/outputs/floor_plan_svg.h>
#include <plumbline/outputs/occupancy_grid.h>
#include <plumbline/pipeline/log_solver.h>

#include <cstdio>
#include <exception>
#include <fstream>

namespace {

void Run(const char* path) {
  //! [log to floor plan]
  plumbline::Registry registry;
  plumbline::RegisterBuiltins(&registry);
  plumbline::RegisterBuiltinLogReaders(&registry);
  const plumbline::Log log = plumbline::ReadLog(path, registry);

  plumbline::LogSolver solver(registry, {});
  const plumbline::LogSolverResult result = solver.Run(log);

  const plumbline::FloorPlan plan =
      plumbline::MakeFloorPlan(solver.graph(), result.trajectory);
  plumbline::WriteFloorPlanSvg(plan, "floorplan.svg");
  plumbline::WriteFloorPlanDxf(plan, "floorplan.dxf");
  plumbline::WriteOccupancyMap(
      plumbline::MakeOccupancyGrid(log.scans, result.trajectory, {}),
      "occupancy");
  std::ofstream map("map.json");
  plumbline::WriteGraphJson(solver.graph(), map);
  //! [log to floor plan]
  std::printf("%zu scans, %zu walls in %zu directions\n", log.scans.size(),
              plan.walls.size(), plan.directions.size());
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "log_to_floor_plan LOG\n");
    return 1;
  }
  try {
    Run(argv[1]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
  return 0;
}
