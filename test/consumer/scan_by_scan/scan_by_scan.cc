// A robot's program that hands over scans as they come and reads the map in
// between. Here the scans come from a log:
//
//     scan_by_scan LOG
#include <plumbline/detectors/builtins.h>
#include <plumbline/frontend/builtins.h>
#include <plumbline/frontend/log_reader.h>
#include <plumbline/outputs/floor_plan.h>
#include <plumbline/outputs/floor_plan_svg.h>
#include <plumbline/pipeline/log_solver.h>

#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <exception>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

void Expect(bool condition, const char* what) {
  if (!condition) throw std::runtime_error(std::string("expected ") + what);
}

void Run(const char* path) {
  plumbline::Registry registry;
  plumbline::RegisterBuiltins(&registry);
  plumbline::RegisterBuiltinLogReaders(&registry);
  const plumbline::Log log = plumbline::ReadLog(path, registry);

  //! [scan by scan]
  plumbline::LogSolver solver(registry, {});
  std::vector<plumbline::Pose2> at_once;
  std::vector<std::size_t> walls;
  for (const plumbline::Scan& scan : log.scans) {
    at_once.push_back(solver.AddScan(scan));
    if (at_once.size() % 500 == 0) {
      // The map so far.
      const plumbline::FloorPlan plan =
          plumbline::MakeFloorPlan(solver.graph(), solver.Trajectory());
      plumbline::WriteFloorPlanSvg(plan, "so_far.svg");
      walls.push_back(plan.walls.size());
    }
  }
  const plumbline::LogSolverResult result = solver.Finish();
  //! [scan by scan]
  const plumbline::FloorPlan plan =
      plumbline::MakeFloorPlan(solver.graph(), result.trajectory);

  Expect(walls.size() >= 2, "a map in between");
  Expect(walls.front() >= 3 && walls.front() < walls.back(),
         "a map that grows");
  Expect(plan.walls.size() >= walls.back() / 2, "a whole map in the end");
  Expect(result.trajectory.size() == log.scans.size(), "a pose for each scan");
  double largest = 0.0;
  for (std::size_t i = 0; i < at_once.size(); ++i) {
    largest =
        std::max(largest, (at_once[i] - result.trajectory[i]).head<2>().norm());
  }
  std::printf("%zu walls; poses said at once are at most %.2f m off\n",
              plan.walls.size(), largest);
  Expect(largest < 0.5, "poses that are right at once");
  // The same as from the whole log.
  plumbline::LogSolver whole(registry, {});
  Expect(whole.Run(log).trajectory == result.trajectory,
         "what a whole log gives");
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "scan_by_scan LOG\n");
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
